"""Hydra's callback that sends what a command has run to MLflow: ``hydra/callbacks=mlflow``."""

from collections.abc import Sequence
from pathlib import Path

from infoplan.analyse.claims import judge_claims
from infoplan.analyse.tables import find_study
from infoplan.errors import RunError, UsageError
from infoplan.hydra_front.tracker import Tracker
from infoplan.mlflow_runs import demand_mlflow, send, store_of


class MlflowCallback(Tracker):
    """Sends the runs of a command to MLflow when all is stored.

    Parameters
    ----------
    uri
        MLflow's tracking URI; None: that of the environment, else an SQLite file in results_dir.
    experiment
        Name of MLflow's experiment.
    artifacts
        Send each run's configuration and figures, too.
    claims
        Tag the runs of a study with its verdicts on the paper's claims.

    Raises
    ------
    UsageError
        If MLflow is not installed.
    """

    name = "MLflow"

    def __init__(self, uri: str | None, experiment: str, artifacts: bool, claims: bool):
        demand_mlflow()
        self.uri, self.experiment = uri, experiment
        self.artifacts, self.claims = artifacts, claims

    def place(self, results_dir: Path) -> str:
        """Say which MLflow it is."""
        return store_of(results_dir, self.uri)

    def send(self, results_dir: Path, runs: Sequence[str]) -> int:
        """Send what is new of some runs; give the number of missions."""
        verdicts = _verdicts(results_dir, runs) if self.claims else {}
        return send(results_dir, runs, self.place(results_dir), self.experiment,
                    artifacts=self.artifacts, verdicts=verdicts)  # fmt: skip


def _verdicts(results_dir: Path, runs: Sequence[str]) -> dict[str, str]:
    """Judge the claims by these runs alone; what they lack has no verdict."""
    if len(set(runs)) < 2:
        return {}
    try:
        judged = judge_claims(find_study(results_dir, run=list(dict.fromkeys(runs))))
    except (UsageError, RunError):
        return {}  # they are no study of the paper's
    return {claim.name: claim.verdict for claim in judged if claim.verdict != "missing"}
