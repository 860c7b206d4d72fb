"""A results folder that version 0.1.0 has written stays readable, audited, resumed and drawn."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from studies import study

from infoplan.analyse import find_missions, find_study, load_curves
from infoplan.analyse.audit import audit
from infoplan.analyse.status import look_at_all
from infoplan.cli import main
from infoplan.config import METHODS, Config, PilotConfig, TerrainConfig
from infoplan.draw.figures import draw_figures
from infoplan.draw.report import write_report
from infoplan.study.store import list_missions, read_footer, table_path
from infoplan.study.stored_terrains import stored_terrains

STORED = Path(__file__).parent.parent / "data" / "results-0.1.0"
REPLAY = "replay-uct-local-volcano-rho0.1-batch-e3cee0be"


@pytest.fixture
def folder(tmp_path) -> Path:
    return Path(shutil.copytree(STORED, tmp_path / "results"))


def test_all_is_there_and_whole():
    found = look_at_all(STORED)
    assert len(found.runs) == 7
    assert found.problems == []
    assert all((run.done, run.seconds > 0) == ([0], True) for run in found.runs)
    for run in list_missions(STORED):
        footer = read_footer(table_path(STORED, "curves", run, 0))
        assert footer.libraries["infoplan"] == "0.1.0"
        assert footer.footer_sha256 is None
    assert load_curves(STORED)["rmse"].notna().all()
    flown = set(find_missions(STORED).missions["planner"])
    assert flown == {"uct", "puct", "greedy"}


def test_the_audit_holds_and_says_that_footers_have_no_digest():
    maps = {terrain.sha256: terrain.elevation for terrain in stored_terrains(STORED)}
    findings = list(audit(STORED, terrains=maps))
    assert [finding for finding in findings if not finding.holds] == []
    assert len({finding.run for finding in findings}) == 7
    without = {finding.omitted for finding in findings if finding.check == "digests"}
    assert without == {"footers of curves, samples, maps, written without a digest"}
    assert {finding.omitted for finding in findings if finding.check == "truth"} == {""}


def test_nothing_is_flown_again(folder):
    config = Config(budget=90, grid=[9, 11], seeds=1, backend="sequential")
    config.terrain = TerrainConfig(name="volcano")
    points = [[0.2, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]]
    config.pilot = PilotConfig(samples=40, control_points=points)
    config.model.pilot_iterations, config.model.iterations = 20, 2
    for planner, detector, scope in (
        ("uct", "none", "batch"), ("uct", "best", "batch"), ("uct", "copod", "batch"),
        ("puct", "copod", "batch"), ("puct", "copod", "historical"),
    ):  # fmt: skip
        config.planner = replace(METHODS["planner"][planner], iterations=30)
        config.detector = replace(METHODS["detector"][detector], scope=scope)
        done, said = study(config, folder)
        assert (done.computed, done.kept) == (0, 1)
        assert "WARNING" not in said
    assert len(list_missions(folder)) == 7


def test_it_is_drawn(folder):
    paper = find_study(folder, method=["UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"])
    [drawn] = draw_figures(paper, ["fig5"], seed=0, single_seeds=False)
    assert drawn.files
    assert write_report(paper).stat().st_size > 10_000


def test_it_is_replayed(folder, capfd):
    [run] = [name for name in list_missions(folder) if name.startswith("uct-none")]
    arguments = ["replay", run, "detector=local", f"results_dir={folder}", "backend=sequential"]
    assert main(arguments) == 0
    assert "0 missions replayed, 1 kept" in capfd.readouterr().out
    assert main([*arguments, "resume=false"]) == 0
    assert all(finding.holds for finding in audit(folder, run=REPLAY))
