"""Runs in MLflow: what is there is what is stored, once, whatever happens on the way."""

import sqlite3

import pandas as pd
import pytest
from studies import OPTIONS, curves

from infoplan import mlflow_runs
from infoplan.cli import main

WORDS = [*(word for word in OPTIONS if not word.startswith("detector=")), "backend=sequential"]
MLFLOW = "hydra/callbacks=mlflow"
TWO = ["planner=uct", "detector=none,best"]
NONE = ["planner=uct", "detector=none"]


def fly(folder, *words):
    return main(["run", *WORDS, f"results_dir={folder}", *words])


def metrics(folder) -> pd.DataFrame:
    """Read the database itself: every value of every metric, by run."""
    query = (
        "select runs.name as run, metrics.key as key, step, value from metrics "
        "join runs on runs.run_uuid = metrics.run_uuid join experiments using (experiment_id) "
        "where experiments.name = 'infoplan'"
    )
    with sqlite3.connect(folder / "mlflow.db") as database:
        return pd.read_sql(query, database)


def told(folder, table: str) -> dict[tuple[str, str], str]:
    """Read tags or params of all runs, by run and key."""
    query = f"select name, key, value from {table} join runs using (run_uuid)"
    with sqlite3.connect(folder / "mlflow.db") as database:
        return {(run, key): value for run, key, value in database.execute(query)}


def assert_whole(folder):
    """Everything that is stored is in MLflow, once."""
    sent = metrics(folder)
    assert not sent.duplicated(["run", "key", "step"]).any()
    for path in curves(folder):
        run, seed = path.parent.name.removeprefix("run="), path.stem.removeprefix("seed=")
        curve = pd.read_parquet(path, partitioning=None)
        of_seed = sent[(sent["run"] == run) & (sent["key"] == f"rmse/seed_{seed}")]
        of_seed = of_seed.sort_values("step")
        assert of_seed["step"].tolist() == curve["collected"].tolist()
        assert of_seed["value"].tolist() == curve["rmse"].tolist()
    assert sent["run"].nunique() == len(list(folder.glob("runs/*.yaml")))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Two runs of two seeds, of which one seed was flown before the callback was known."""
    pytest.importorskip("mlflow")
    folder = tmp_path_factory.mktemp("tracked")
    assert fly(folder, *NONE, "seeds=1") == 0
    assert fly(folder, "-m", *TWO, "seeds=2", MLFLOW) == 0
    return folder


def test_what_is_stored_is_sent_once_with_its_configuration_and_scores(study, capsys):
    assert_whole(study)
    sent = metrics(study)
    finals = pd.concat(
        pd.read_parquet(path, partitioning=None).tail(1).assign(run=path.parent.name[4:])
        for path in curves(study)
    )
    for name in ("rmse", "mae", "crps", "coverage95"):
        means = sent[sent["key"] == f"final_{name}"].set_index("run")["value"]
        expected = finals.groupby("run")[name].mean()
        assert means.to_dict() == pytest.approx(expected.to_dict())
    (run,) = {run for run in means.index if run.startswith("uct-best")}
    parameters = told(study, "params")
    assert parameters[run, "planner.name"] == "uct"
    assert parameters[run, "planner.iterations"] == "30"
    assert parameters[run, "grid"] == "[12,12]"
    tags = told(study, "tags")
    assert (tags[run, "infoplan.run"], tags[run, "infoplan.seeds"]) == (run, "0,1")

    before = len(sent)
    assert fly(study, "-m", *TWO, "seeds=2", MLFLOW) == 0
    assert "MLflow: nothing new sent to sqlite:" in capsys.readouterr().out
    assert len(metrics(study)) == before
    assert fly(study, *NONE, "seeds=3", MLFLOW) == 0
    assert "MLflow: 1 mission sent" in capsys.readouterr().out
    assert_whole(study)


def test_verdicts_are_tags_where_there_are_any(study):
    """C12 compares COPOD's methods: without them it has no verdict, and no tag."""
    tags = {key for _, key in told(study, "tags")}
    assert "claim.C2" not in tags
    (run,) = [path.stem for path in study.glob("runs/uct-none*.yaml")]
    store = mlflow_runs.store_of(study, None)
    mlflow_runs.send(study, [run], store, "infoplan", verdicts={"C2": "undecided"})
    mlflow_runs.send(study, [run], store, "infoplan", verdicts={"C2": "supported"})
    assert told(study, "tags")[run, "claim.C2"] == "supported"


def test_files_are_sent_where_they_are_wanted(study):
    (run,) = [path.stem for path in study.glob("runs/uct-best*.yaml")]
    store = mlflow_runs.store_of(study, None)
    assert mlflow_runs.send(study, [run], store, "with files", artifacts=True) == 2
    (sent,) = (study / "mlartifacts").rglob("*.yaml")
    assert sent.read_bytes() == (study / "runs" / f"{run}.yaml").read_bytes()


def test_a_tracker_that_fails_costs_nothing(study, tmp_path, capsys):
    words = [f"hydra.callbacks.mlflow.uri='sqlite:///{tmp_path}/a file/mlflow.db'", MLFLOW]
    (tmp_path / "a file").write_text("no folder")
    pytest.importorskip("mlflow")
    assert fly(tmp_path / "results", *NONE, "seeds=1", *words) == 0
    (line,) = [one for one in capsys.readouterr().err.splitlines() if "MLflow" in one]
    assert line.startswith("WARNING: MLflow at sqlite:///")
    assert "the same command sends what is missing" in line
    assert len(curves(tmp_path / "results")) == 1


def test_what_breaks_off_is_completed(study, monkeypatch, capsys):
    real, calls = mlflow_runs._send_curve, []

    def breaks(client, number, name, *curve):
        calls.append(name)
        if name == "rmse/seed_4":
            raise ConnectionError("the line is dead")
        real(client, number, name, *curve)

    monkeypatch.setattr(mlflow_runs, "_send_curve", breaks)
    words = ["planner=uct", "detector=best", "seeds=[3,4]", MLFLOW]
    assert fly(study, *words) == 0
    assert "has not taken all runs (the line is dead)" in capsys.readouterr().err
    assert {"rmse/seed_3", "rmse/seed_4"} <= set(calls)
    monkeypatch.undo()
    assert fly(study, *words) == 0
    assert "MLflow: 1 mission sent" in capsys.readouterr().out
    assert_whole(study)


def test_nothing_is_sent_of_a_dry_run(tmp_path):
    pytest.importorskip("mlflow")
    assert fly(tmp_path, *NONE, "seeds=1", MLFLOW, "--dry-run") == 0
    assert not (tmp_path / "mlflow.db").exists()


def test_a_machine_without_mlflow_is_told_before_anything_is_flown(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(mlflow_runs, "find_spec", lambda name: None)
    assert fly(tmp_path, *NONE, "seeds=1", MLFLOW) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "needs MLflow, which is not installed: pip install 'infoplan[tracking]'" in line
    assert not curves(tmp_path)


@pytest.mark.parametrize(
    ("word", "said"),
    [("hydra.callbacks.mlflow.url=x", "hydra.callbacks.mlflow.url"),
     ("hydra.callbacks.mlflow.artifacts=perhaps", "hydra.callbacks.mlflow.artifacts=perhaps"),
     ("hydra/callbacks=mlfow", "mlfow")],
)  # fmt: skip
def test_wrong_options_are_told(tmp_path, capsys, word, said):
    pytest.importorskip("mlflow")
    assert fly(tmp_path, *NONE, "seeds=1", MLFLOW, word) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
