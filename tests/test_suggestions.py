"""What messages suggest can be pasted, and makes the run that was meant."""

import json
import shutil

import yaml
from command import SMALL, infoplan, suggested

from infoplan.analyse import find_study
from infoplan.analyse.commands import run_command, study_command
from infoplan.cli import main

ODD = [
    *(word for word in SMALL if not word.startswith("terrain")), "rho=0.1", "seeds=[2]",
    "backend=sequential",
    "robot.max_steering=0.2617993877991494", "planner.exploration=0.30000000000000004",
    "results_dir=it's 1.10, here", "terrain=file", "terrain.path=größe (1), a.npy",
    "detector=copod", "terrain.extent=[0,60.5,0,60.5]",
]  # fmt: skip


def sciences(folder) -> dict[str, dict]:
    return {path.stem: yaml.safe_load(path.read_text()) for path in (folder / "runs").iterdir()}


def test_a_suggested_command_makes_the_run_that_was_meant(tmp_path, hills, monkeypatch, capsys):
    shutil.copy(hills, tmp_path / "größe (1), a.npy")
    infoplan("run", *ODD, cwd=tmp_path)
    folder = tmp_path / "it's 1.10, here"
    ((name, flown),) = sciences(folder).items()
    # What a command in that folder says of itself is relative to it.
    told = infoplan(
        "figures", "fig4", "fig6", f"results_dir={folder.name}", cwd=tmp_path, check=False
    )
    commands = suggested(told.stdout + told.stderr)
    assert commands, told.stdout + told.stderr
    selection = find_study(folder)
    same = suggested(run_command(selection, "PUCT-COPOD", 0.1))
    assert suggested(study_command(selection))[0][:3] == ["run", "-m", "experiment=fig5"]
    again = infoplan(*same[0], cwd=tmp_path)
    assert "0 missions computed, 1 kept" in again.stdout
    other = infoplan(*suggested(run_command(selection, "UCT-NONE", 0.1))[0], cwd=tmp_path)
    assert "1 mission computed" in other.stdout
    found = sciences(folder)
    (new,) = set(found) - {name}
    for key, value in flown.items():
        if key not in ("planner", "detector"):
            assert found[new][key] == value, key
    judged = infoplan("claims", "--json", f"results_dir={folder.name}", cwd=tmp_path).stdout
    cures = {cure for claim in json.loads(judged)["claims"] for cure in claim["commands"]}
    assert cures
    monkeypatch.chdir(tmp_path)
    for line in [*commands, *(words for cure in cures for words in suggested(cure))]:
        assert main([*line, "--dry-run"]) == 0  # the whole study takes long
        planned = capsys.readouterr().out
        assert f" stored in {folder.name}" in planned
        if "-m" in line:  # those of the study that are there are the same runs
            assert "2 are stored" in planned
