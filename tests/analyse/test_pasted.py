"""What commands suggest for a folder of any name can be pasted, and is about that folder."""

import json
import os
import shlex

import made_tables
import pytest
from command import suggested

from infoplan.analyse import find_study
from infoplan.cli import main
from infoplan.draw.figures import draw_figures
from infoplan.errors import UsageError
from infoplan.hydra_front.compose import compose

ODD_FOLDERS = ["it's 1.10, here", 'a=b "c"', "größe (1)/[x]", "2024_11_25", "~$HOME;#"]


@pytest.mark.parametrize("folder", ODD_FOLDERS)
def test_what_an_empty_folder_is_told_to_run_fills_that_folder(
    folder, tmp_path, monkeypatch, capfd
):
    monkeypatch.chdir(tmp_path)
    os.makedirs(folder)
    told = []
    for command in ("claims", "report", "figures", "show", "audit", "replay abc", "show abc"):
        assert main([*command.split(" "), f"results_dir={folder}"]) == 2
        lines = suggested(capfd.readouterr().err)
        assert lines, command
        told += [line for line in lines if line not in told]
    for command, *words in told:
        assert command == "run"
        options = [word for word in words if word != "-m"]
        assert compose([*options, "terrain=volcano"]).results_dir == folder


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
        (line,) = (found for found in suggested(told) if found[0] == "status")
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
