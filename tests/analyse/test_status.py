"""``infoplan status`` and ``infoplan run --dry-run``."""

import json
import re
from datetime import date

import pytest
from studies import OPTIONS, quick, study

from infoplan.analyse import load_curves
from infoplan.cli import main
from infoplan.study import locks
from infoplan.study.store import list_missions, save_failure, table_path


@pytest.fixture
def stored(tmp_path):
    """Two runs, seeds 0 to 2 and 1 to 3: done, failed, running, broken, missing."""
    folder = tmp_path / "results"
    study(quick(), folder, seeds=[0, 1, 2], backend="sequential", rho=0.1)
    study(quick(), folder, seeds=[1, 2, 3], backend="sequential", rho=0.2)
    runs = sorted(list_missions(folder))
    for seed in (2, 3):
        table_path(folder, "curves", runs[1], seed).unlink()
    save_failure(folder, runs[1], 2, "Traceback")
    table_path(folder, "maps", runs[0], 2).write_bytes(b"")
    held = locks.acquire(folder, runs[1], 3)
    yield folder, runs
    held.release()


def status(capfd, *arguments: str) -> dict:
    assert main(["status", "--json", *arguments]) == 0
    return json.loads(capfd.readouterr().out)


def seeds(run: dict) -> dict:
    return {
        name: run[name] for name in ("done", "failed", "running", "broken", "missing") if run[name]
    }


def test_status_of_all_runs(stored, capfd):
    folder, runs = stored
    capfd.readouterr()
    found = status(capfd, f"results_dir={folder}")
    assert [run["run"] for run in found["runs"]] == runs
    first, second = found["runs"]
    assert seeds(first) == {"done": [0, 1], "broken": [2], "missing": [3]}
    assert seeds(second) == {"done": [1], "failed": [2], "running": [3], "missing": [0]}
    assert first["first"] < first["last"]
    assert first["seconds"] > second["seconds"] > 0
    (problem,) = found["problems"]
    assert "maps" in problem
    assert "seed=2" in problem


def test_status_of_a_study(stored, capfd):
    folder, runs = stored
    capfd.readouterr()
    found = status(capfd, *OPTIONS, "rho=0.1,0.3", "seeds=2", f"results_dir={folder}")
    known, unknown = found["runs"]
    assert known["run"] == runs[0]
    assert seeds(known) == {"done": [0, 1]}
    assert "rho0.3" in unknown["run"]
    assert seeds(unknown) == {"missing": [0, 1]}
    assert (unknown["last"], unknown["seconds"]) == (None, 0.0)


def test_status_as_a_table(stored, capfd):
    folder, runs = stored
    (folder / "curves" / "mine.parquet").write_bytes(b"x")
    capfd.readouterr()
    assert main(["status", f"results_dir={folder}"]) == 0
    said = capfd.readouterr().out
    header, *_, first, second = [line for line in said.splitlines() if "missing" in line or any(
        run in line for run in runs)][:3]  # fmt: skip
    assert header.split()[:6] == ["run", "done", "failed", "running", "broken", "missing"]
    assert first.split()[:4] == [runs[0], "0-1", "2", "3"]
    assert second.split()[:5] == [runs[1], "1", "2", "3", "0"]
    assert f"{date.today():%Y-%m}" in first
    assert "mine.parquet is no mission's" in said


def test_status_of_nothing(tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["status"]) == 2
    assert "results_dir=results is no folder" in capfd.readouterr().err
    (tmp_path / "results").mkdir()
    assert main(["status"]) == 0
    assert "there is no run in results yet" in capfd.readouterr().out
    assert main(["status", "seedss=3"]) == 2
    assert "did you mean 'seeds'" in capfd.readouterr().err
    assert list(tmp_path.rglob("*")) == [tmp_path / "results"]


def test_dry_run_lists_and_writes_nothing(stored, capfd, tmp_path):
    folder, _ = stored
    before = sorted(path for path in tmp_path.rglob("*"))
    capfd.readouterr()
    line = ["run", "--dry-run", "-m", *OPTIONS, "rho=0.1,0.2,0.3", "seeds=4", "n_jobs=2"]
    assert main([*line, f"results_dir={folder}"]) == 0
    said = capfd.readouterr().out
    rows = [
        line.split() for line in said.splitlines() if line.strip().startswith("puct none batch")
    ]
    assert [row[3:6] for row in rows] == [
        ["2", "2", "2-3,"[:3]],
        ["1", "3", "0,"],
        ["0", "4", "0-3"],
    ]
    assert "9 missions would run, 3 are stored" in said
    assert "with 2 workers, by the missions stored" in said
    assert "broken:" in said
    assert sorted(path for path in tmp_path.rglob("*")) == before


def test_many_runs_are_told_by_method_map_and_rho(tmp_path, capfd, monkeypatch):
    monkeypatch.setattr("infoplan.draw.study_tables.MANY", 3)
    line = ["run", "-m", *OPTIONS, "rho=0.1,0.2", "planner.exploration=0.3,0.7", "seeds=2",
            "backend=sequential", f"results_dir={tmp_path}"]  # fmt: skip
    assert main([*line[:-2], line[-1], "--dry-run"]) == 0
    said = capfd.readouterr().out
    rows = [line.split() for line in said.splitlines() if "puct none batch" in line]
    assert "4 runs, those of a method, map and rho together" in said
    assert [row[-4:] for row in rows] == [["0.1", "2", "0", "4"], ["0.2", "2", "0", "4"]]
    assert "8 missions would run" in said
    assert main(line) == 0
    said = capfd.readouterr().out
    (row,) = (line.split() for line in said.splitlines() if "rho 0.2 " in line)
    ends = load_curves(tmp_path, rho=0.2).groupby(["run", "seed"])["rmse"].last()
    means = ends.groupby("run").mean()
    shown = [float(cell.strip("[],")) for cell in row[-7:-4]]
    assert row[-9:-7] == ["2", "4"]
    assert shown == pytest.approx([means.median(), means.min(), means.max()], rel=0.01)


def test_dry_run_without_earlier_missions(tmp_path, capfd):
    folder = tmp_path / "results"
    assert main(["run", *OPTIONS, "seeds=2", f"results_dir={folder}", "--dry-run"]) == 0
    said = capfd.readouterr().out
    assert "2 missions would run, 0 are stored" in said
    assert "by their operations" in " ".join(said.split())
    assert re.search(r"a worker takes about 2\d\d MB of memory", said)
    assert not folder.exists()


def test_dry_run_when_all_is_done(tmp_path, capfd):
    study(quick(), tmp_path, seeds=2, backend="sequential")
    capfd.readouterr()
    line = ["run", *OPTIONS, "seeds=2", f"results_dir={tmp_path}", "--dry-run"]
    assert main(line) == 0
    said = capfd.readouterr().out
    assert "0 missions would run, 2 are stored" in said
    assert "about" not in said.splitlines()[-1]
    assert main([*line, "resume=false"]) == 0
    assert "2 missions would run, 0 are stored" in capfd.readouterr().out
