"""What messages suggest can be pasted, and makes the run that was meant."""

import json
import os
import shlex
import shutil

import made_tables
import pytest
import yaml
from command import SMALL, infoplan, suggested

from infoplan.analyse import find_study
from infoplan.analyse.commands import run_command, study_command
from infoplan.cli import main
from infoplan.draw.figures import draw_figures
from infoplan.errors import UsageError

ODD = [
    *(word for word in SMALL if not word.startswith("terrain")), "rho=0.1", "seeds=[2]",
    "robot.max_steering=0.2617993877991494", "planner.exploration=0.30000000000000004",
    "results_dir=it's 1.10, here", "terrain=file", "terrain.path=größe (1), a.npy",
    "detector=copod", "terrain.extent=[0,60.5,0,60.5]",
]  # fmt: skip


def sciences(folder) -> dict[str, dict]:
    return {path.stem: yaml.safe_load(path.read_text()) for path in (folder / "runs").iterdir()}


def test_a_suggested_command_makes_the_run_that_was_meant(tmp_path, hills):
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
    for line in [*commands, *(words for cure in cures for words in suggested(cure))]:
        planned = infoplan(*line, "--dry-run", cwd=tmp_path).stdout  # the whole study takes long
        assert f" stored in {folder.name}" in planned
        # Those of the paper's runs that are there are the same runs.
        assert f" {len([run for run in found if '-none-' in run or '-copod-' in run])} are" in (
            planned
        ), line


ODD_FOLDERS = ["it's 1.10, here", 'a=b "c"', "größe (1)/[x]", "2024_11_25", "~$HOME;#"]


@pytest.mark.parametrize("folder", ODD_FOLDERS)
def test_what_an_empty_folder_is_told_to_run_fills_that_folder(
    folder, tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "500")
    os.makedirs(folder)
    for command in ("claims", "report", "figures", "show", "audit", "replay abc", "show abc"):
        words = command.split(" ")
        assert main([*words, f"results_dir={folder}"]) == 2
        told = capfd.readouterr().err
        lines = suggested(told)
        assert lines, told
        for line in lines:
            assert main([*line, "terrain=volcano", "--dry-run"]) == 0, line
            assert f"0 are stored in {folder}\n" in capfd.readouterr().out


@pytest.mark.parametrize("folder", ODD_FOLDERS)
def test_where_runs_are_listed_is_that_folder(folder, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    for method in ("uct-copod", "puct-copod", "uct-none", "puct-none"):
        for rho in (0.1, 0.2):
            made_tables.store(tmp_path / folder, method, rho)
    for words in (["show", "run=u"], ["show", "run=x"], ["audit", "run=x"], ["replay"],
                  ["claims", "run=x"], ["replay", "x"]):  # fmt: skip
        assert main([*words, f"results_dir={folder}"]) == 2
        told = capfd.readouterr().err
        if words == ["show", "run=u"]:
            assert "stands for 4 runs" in told
            continue
        (line,) = suggested(told)
        assert line[0] == "status", told
        assert main([*line, "--json"]) == 0
        assert len(json.loads(capfd.readouterr().out)["runs"]) == 8


def test_an_option_that_is_to_choose_chooses(tmp_path, capfd):
    for bounds in ([1.0, 3.0], [1.0, 4.0]):
        made_tables.store(tmp_path, "uct-none", fault__amplitude=bounds)
    with pytest.raises(UsageError, match="do not belong together") as refused:
        find_study(tmp_path)
    chosen = shlex.split(str(refused.value).partition("choose with ")[2])[0]
    assert chosen == "fault.amplitude=[1,3]"
    assert main(["claims", "--json", chosen, f"results_dir={tmp_path}"]) == 0
    assert json.loads(capfd.readouterr().out)["seeds"] == [0]


def test_runs_without_a_common_seed_get_it_by_the_command(tmp_path, capfd):
    folder = tmp_path / ODD_FOLDERS[0]
    made_tables.store(folder, "uct-copod", seed=0)
    made_tables.store(folder, "puct-copod", seed=1)
    (fig7,) = draw_figures(find_study(folder), ["fig7"])
    (line,) = suggested(fig7.problem)
    assert main([*line, "terrain=volcano", "--dry-run"]) == 0
    planned = capfd.readouterr().out
    assert f"stored in {folder}\n" in planned
    assert " 0-1 " in planned


@pytest.mark.parametrize("command", ["report", "leaderboard --html", "figures fig5"])
def test_what_is_in_the_way_is_told_from_a_full_disk(command, tmp_path, capfd):
    for method in ("uct-copod", "puct-copod"):
        for seed in (0, 1):
            made_tables.store(tmp_path, method, seed=seed)
    for place in ("report.html", "leaderboard.html"):
        (tmp_path / place).mkdir()
    (tmp_path / "figures").touch()
    assert main([*command.split(" "), f"results_dir={tmp_path}"]) == 1
    told = capfd.readouterr().err
    assert "could not be written" in told
    assert "move what is in the way elsewhere" in told
    assert "make room" not in told
