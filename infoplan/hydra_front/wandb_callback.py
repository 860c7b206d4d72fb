"""Hydra's callback that writes runs for Weights & Biases: ``hydra/callbacks=wandb``."""

from collections.abc import Sequence
from pathlib import Path

from infoplan.hydra_front.tracker import Tracker
from infoplan.wandb_runs import FOLDER, demand_wandb, write_runs


class WandbCallback(Tracker):
    """Writes the missions of a command as offline runs of Weights & Biases when all is stored.

    Parameters
    ----------
    project
        Name of the project to which ``wandb sync`` sends them.

    Raises
    ------
    UsageError
        If Weights & Biases is not installed.
    """

    name = "Weights & Biases"

    def __init__(self, project: str):
        demand_wandb()
        self.project = project

    def place(self, results_dir: Path) -> str:
        """Say in which folder they are written."""
        return str(results_dir / FOLDER)

    def send(self, results_dir: Path, runs: Sequence[str]) -> int:
        """Write what is new of some runs; give the number of missions."""
        return write_runs(results_dir, runs, self.project)
