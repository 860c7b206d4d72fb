"""Stored missions as runs of Weights & Biases, written to files offline; ``wandb sync`` sends them.

What is written is read back from the tables, so that kept missions count as computed ones do.
"""

import math
import os
import shutil
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from infoplan.analyse.configurations import stored_options
from infoplan.errors import UsageError
from infoplan.mlflow_runs import SCORES
from infoplan.study.store import inspect, list_missions, read_footer, read_table, table_path

FOLDER = "wandb"
"""Within the results folder; what Weights & Biases calls it, too."""


def demand_wandb() -> None:
    """Refuse to go on without Weights & Biases.

    Raises
    ------
    UsageError
    """
    if find_spec("wandb") is None:
        raise UsageError(
            "hydra/callbacks=wandb needs Weights & Biases, which is not installed: pip install "
            "'infoplan[wandb]', or leave it out"
        )


def write_runs(results_dir: Path, runs: Sequence[str], project: str) -> int:
    """Write the missions of stored runs, as far as they are not there.

    Each mission is a run of Weights & Biases, grouped by infoplan's run; it is there when its
    folder is, which is put into place when it is whole.

    Parameters
    ----------
    results_dir
        Folder of the tables.
    runs
        Their names.
    project
        Name of the project to which ``wandb sync`` sends them.

    Returns
    -------
    int
        How many missions were written.

    Raises
    ------
    Exception
        Whatever the package raises if it cannot write.
    RunError
        If a table cannot be read.
    """
    stored, count = list_missions(results_dir), 0
    for run in dict.fromkeys(runs):
        for seed in sorted(stored.get(run, ())):
            there = any((results_dir / FOLDER).glob(f"offline-run-*-{name_of(run, seed)}"))
            if not there and inspect(results_dir, run, seed).state == "done":
                _write(results_dir, run, seed, project)
                count += 1
    return count


def name_of(run: str, seed: int) -> str:
    """Name a mission as Weights & Biases knows it: by the hash that tells runs apart."""
    return f"{run.rpartition('-')[2]}-seed{seed}"


def _write(results_dir: Path, run: str, seed: int, project: str) -> None:
    # Nothing of the machine is anybody's business.
    os.environ.setdefault("WANDB_ERROR_REPORTING", "false")
    import wandb

    footer = read_footer(table_path(results_dir, "curves", run, seed))
    table = read_table(results_dir, "curves", run, seed)
    known = [name for name in SCORES if name in table.column_names]
    config = {**stored_options(footer.configuration), "seed": seed}
    folder = results_dir / FOLDER
    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(
        prefix=".unfinished-", dir=folder, ignore_cleanup_errors=True
    ) as scratch:
        sent = wandb.init(
            mode="offline", dir=scratch, project=project, group=run, id=name_of(run, seed),
            name=f"{run} seed {seed}", config=config,
            settings=wandb.Settings(silent=True, console="off", disable_git=True, disable_code=True,
                                    x_disable_stats=True, x_disable_meta=True),
        )  # fmt: skip
        for row in table.select(["collected", *known]).to_pylist():
            step = row.pop("collected")
            sent.log({k: v for k, v in row.items() if _is_finite(v)}, step=step)
        sent.finish()
        (whole,) = (Path(scratch) / FOLDER).glob("offline-run-*")
        shutil.move(whole, folder)


def _is_finite(value: Any) -> bool:
    return value is not None and math.isfinite(value)
