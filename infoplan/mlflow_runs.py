"""Stored runs as runs of MLflow: parameters, learning curves by seed, scores, tags.

What is sent is read back from the tables, so that kept missions count as computed ones do, and a
run that grows by seeds stays one run of MLflow.
"""

import logging
import math
import os
import time
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.analyse.configurations import option_text, stored_options
from infoplan.errors import UsageError
from infoplan.study.store import inspect, list_missions, read_footer, read_table, table_path

RUN, SEEDS = "infoplan.run", "infoplan.seeds"
"""Tags of a run of MLflow: the run's name here, and the seeds that it has of it."""

SCORES = ("rmse", "mae", "crps", "nlpd", "smse", "msll", "coverage95")
"""Columns of the curve whose last values, meant over the seeds, are metrics."""

MOST = {"params": 100, "metrics": 1000}
"""So many of these does MLflow take at a time."""

LONGEST = 6000
"""Characters of a parameter that MLflow keeps."""


def demand_mlflow() -> None:
    """Refuse to go on without MLflow.

    Raises
    ------
    UsageError
    """
    if find_spec("mlflow") is None or find_spec("sqlalchemy") is None:
        raise UsageError(
            "hydra/callbacks=mlflow needs MLflow, which is not installed: pip install "
            "'infoplan[tracking]', or leave it out"
        )


def store_of(results_dir: Path, uri: str | None) -> str:
    """Say where runs are sent: as asked, as the environment says, or beside the tables."""
    given = uri or os.environ.get("MLFLOW_TRACKING_URI")
    return given or f"sqlite:///{(results_dir / 'mlflow.db').resolve().as_posix()}"


def send(
    results_dir: Path,
    runs: Sequence[str],
    store: str,
    experiment: str,
    *,
    artifacts: bool = False,
    verdicts: Mapping[str, str] | None = None,
) -> int:
    """Send stored runs to MLflow, as far as it does not have them.

    Parameters
    ----------
    results_dir
        Folder of the tables.
    runs
        Their names.
    store
        MLflow's tracking URI.
    experiment
        Name of MLflow's experiment, which is made if it is not there.
    artifacts
        Send the configuration and the run's figures, too.
    verdicts
        What the study says of the paper's claims, by their names; tags of all its runs.

    Returns
    -------
    int
        How many missions were sent.

    Raises
    ------
    Exception
        Whatever MLflow raises if it cannot be reached, or refuses.
    RunError
        If a table cannot be read.
    """
    client = _client(store)
    number = _experiment(client, experiment, results_dir, store)
    stored = list_missions(results_dir)
    count = 0
    for run in dict.fromkeys(runs):
        seeds = [s for s in stored.get(run, ()) if inspect(results_dir, run, s).state == "done"]
        if seeds:
            count += _send_run(client, number, results_dir, run, sorted(seeds), artifacts)
            if verdicts:
                _tag(client, _found(client, number, run), verdicts)
    return count


def _client(store: str) -> Any:
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")  # runs go where they are sent alone
    from mlflow import MlflowClient

    for name in ("alembic", "mlflow"):
        logging.getLogger(name).setLevel(logging.WARNING)
    return MlflowClient(tracking_uri=store)


def _experiment(client: Any, name: str, results_dir: Path, store: str) -> str:
    if found := client.get_experiment_by_name(name):
        return str(found.experiment_id)
    beside = store == store_of(results_dir, None) and store.startswith("sqlite:")
    place = (results_dir / "mlartifacts").resolve().as_uri() if beside else None
    return str(client.create_experiment(name, artifact_location=place))


def _found(client: Any, experiment: str, run: str) -> Any:
    """Find the run of MLflow that a stored run is; None if there is none."""
    found = client.search_runs([experiment], f"tags.`{RUN}` = '{run}'", max_results=1)
    return found[0] if found else None


def _send_run(
    client: Any, experiment: str, results_dir: Path, run: str, seeds: list[int], artifacts: bool
) -> int:
    """Send what is new of a run; give the number of its missions that are."""
    there = _found(client, experiment, run)
    if there is None:
        there = client.create_run(experiment, run_name=run, tags={RUN: run, SEEDS: ""})
    number = there.info.run_id
    sent = [int(seed) for seed in there.data.tags.get(SEEDS, "").split(",") if seed]
    new = [seed for seed in seeds if seed not in sent]
    if not new:
        return 0
    footer = read_footer(table_path(results_dir, "curves", run, seeds[0]))
    _send_parameters(client, number, stored_options(footer.configuration))
    for seed in new:
        table = read_table(results_dir, "curves", run, seed)
        _send_curve(client, number, f"rmse/seed_{seed}", table["collected"].to_numpy(),
                    table["rmse"].to_numpy())  # fmt: skip
        sent.append(seed)  # told at once: what breaks off here is not sent again
        client.set_tag(number, SEEDS, ",".join(map(str, sorted(sent))))
    _send_scores(client, number, results_dir, run, seeds)
    if artifacts:
        figures = (results_dir / "figures").glob(f"{run}*")
        for path in [results_dir / "runs" / f"{run}.yaml", *sorted(figures)]:
            client.log_artifact(number, str(path))
    client.set_terminated(number)
    return len(new)


def _send_parameters(client: Any, number: str, options: Mapping[str, Any]) -> None:
    from mlflow.entities import Param

    params = [Param(name, option_text(value)[:LONGEST]) for name, value in options.items()]
    for start in range(0, len(params), MOST["params"]):
        client.log_batch(number, params=params[start : start + MOST["params"]])


def _send_curve(
    client: Any, number: str, name: str, samples: NDArray[Any], values: NDArray[Any]
) -> None:
    from mlflow.entities import Metric

    now = int(1000 * time.time())
    metrics = [
        Metric(name, float(value), now, int(step))
        for step, value in zip(samples, values, strict=True)
        if math.isfinite(value)
    ]
    for start in range(0, len(metrics), MOST["metrics"]):
        client.log_batch(number, metrics=metrics[start : start + MOST["metrics"]])


def _send_scores(client: Any, number: str, results_dir: Path, run: str, seeds: list[int]) -> None:
    """Send the mean final scores over all seeds; their step is the number of seeds."""
    tables = [read_table(results_dir, "curves", run, seed) for seed in seeds]
    for name in SCORES:
        last = [t[name][-1].as_py() for t in tables if name in t.column_names]
        values = np.array([np.nan if value is None else value for value in last], dtype=float)
        if len(values) and np.isfinite(values).all():
            steps = np.array([len(values)])
            _send_curve(client, number, f"final_{name}", steps, np.array([values.mean()]))


def _tag(client: Any, there: Any, verdicts: Mapping[str, str]) -> None:
    """Tag a run with the verdicts that it does not have yet."""
    from mlflow.entities import RunTag

    tags = {f"claim.{claim}": verdict for claim, verdict in verdicts.items()}
    changed = [RunTag(k, tag) for k, tag in tags.items() if there.data.tags.get(k) != tag]
    if changed:
        client.log_batch(there.info.run_id, tags=changed)
