"""Missions as files of Weights & Biases, read back record by record."""

import json
import struct
from collections.abc import Iterator

import pandas as pd
import pytest
from studies import OPTIONS, curves

from infoplan import wandb_runs
from infoplan.cli import main

WORDS = [*(word for word in OPTIONS if not word.startswith("detector=")), "backend=sequential"]
WANDB = "hydra/callbacks=wandb"
NONE = ["planner=uct", "detector=none"]


def fly(folder, *words):
    return main(["run", *WORDS, f"results_dir={folder}", *words])


BLOCK = 32 * 1024


def records(data: bytes) -> Iterator[bytes]:
    """Parse a log of LevelDB's format, after the head of 7 bytes that tells whose it is."""
    assert data.startswith(b":W&B")
    place, whole = 7, b""
    while place < len(data):
        if BLOCK - place % BLOCK < 7:  # no record begins so late in a block
            place += BLOCK - place % BLOCK
            continue
        _, length, kind = struct.unpack_from("<IHB", data, place)
        whole += data[place + 7 : place + 7 + length]
        place += 7 + length
        if kind in (1, 4):  # a whole record, or the last part of one
            yield whole
            whole = b""


def read(path) -> tuple[dict, dict, pd.DataFrame]:
    """Read a file: what the run is, its configuration, and its history."""
    from wandb.proto.wandb_internal_pb2 import Record

    run, rows = None, []
    for data in records(path.read_bytes()):
        record = Record()
        record.ParseFromString(data)
        if record.HasField("run"):
            run = record.run
        if record.HasField("history"):
            rows.append({"/".join(item.nested_key) or item.key: json.loads(item.value_json)
                         for item in record.history.item})  # fmt: skip
    config = {item.key: json.loads(item.value_json) for item in run.config.update}
    about = {"id": run.run_id, "group": run.run_group, "name": run.display_name,
             "project": run.project}  # fmt: skip
    return about, config, pd.DataFrame(rows)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Two runs of two seeds, of which one seed was flown before the callback was known."""
    pytest.importorskip("wandb")
    folder = tmp_path_factory.mktemp("tracked")
    assert fly(folder, *NONE, "seeds=1") == 0
    assert fly(folder, "-m", "planner=uct", "detector=none,best", "seeds=2", WANDB) == 0
    return folder


def test_every_mission_is_a_run_with_its_curves(study, capsys):
    files = list(study.glob("wandb/offline-run-*/*.wandb"))
    assert len(files) == len(curves(study)) == 4
    found = {about["name"]: (about, config, history) for about, config, history in map(read, files)}
    for path in curves(study):
        run, seed = path.parent.name.removeprefix("run="), int(path.stem.removeprefix("seed="))
        about, config, history = found[f"{run} seed {seed}"]
        assert (about["group"], about["project"]) == (run, "infoplan")
        assert (config["seed"], config["planner.name"], config["grid"]) == (seed, "uct", [12, 12])
        stored = pd.read_parquet(path, partitioning=None)
        assert history["_step"].tolist() == stored["collected"].tolist()
        for name in ("rmse", "crps", "coverage95"):
            assert history[name].tolist() == pytest.approx(stored[name].tolist())
    assert len({about["id"] for about, _, _ in found.values()}) == 4

    assert fly(study, *NONE, "seeds=3", WANDB, "hydra.callbacks.wandb.project=other") == 0
    assert f"Weights & Biases: 1 mission sent to {study / 'wandb'}" in capsys.readouterr().out
    assert fly(study, *NONE, "seeds=3", WANDB) == 0
    assert "Weights & Biases: nothing new sent" in capsys.readouterr().out
    assert len(list(study.glob("wandb/offline-run-*/*.wandb"))) == 5
    assert len(list((study / "wandb").iterdir())) == 5, "nothing else is left there"


def test_what_breaks_off_costs_nothing_and_is_completed(tmp_path, monkeypatch, capsys):
    wandb = pytest.importorskip("wandb")

    class Breaks:
        def log(self, *_, **__):
            raise OSError("the disk is full")

    monkeypatch.setattr(wandb, "init", lambda **_: Breaks())
    assert fly(tmp_path, *NONE, "seeds=1", WANDB) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("WARNING: Weights & Biases at ")
    assert "has not taken all runs (the disk is full)" in line
    assert list((tmp_path / "wandb").iterdir()) == []
    monkeypatch.undo()
    assert fly(tmp_path, *NONE, "seeds=1", WANDB) == 0
    assert "Weights & Biases: 1 mission sent" in capsys.readouterr().out


def test_a_machine_without_it_is_told_before_anything_is_flown(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(wandb_runs, "find_spec", lambda name: None)
    assert fly(tmp_path, *NONE, "seeds=1", WANDB) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "which is not installed: pip install 'infoplan[wandb]'" in line
    assert not curves(tmp_path)


def test_a_wrong_option_is_told(tmp_path, capsys):
    pytest.importorskip("wandb")
    assert fly(tmp_path, *NONE, "seeds=1", WANDB, "hydra.callbacks.wandb.projekt=x") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "hydra.callbacks.wandb.projekt" in line
