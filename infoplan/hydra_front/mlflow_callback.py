"""Hydra's callback that sends what a command has run to MLflow: ``hydra/callbacks=mlflow``."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback

from infoplan.analyse.claims import judge_claims
from infoplan.analyse.tables import find_study
from infoplan.errors import RunError, UsageError
from infoplan.files import user_path
from infoplan.hydra_front.jobs import session
from infoplan.output import complain
from infoplan.tracking import demand_mlflow, send, store_of
from infoplan.wording import counted, harmless


class MlflowCallback(Callback):
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

    def __init__(self, uri: str | None, experiment: str, artifacts: bool, claims: bool):
        demand_mlflow()
        self.uri, self.experiment = uri, experiment
        self.artifacts, self.claims = artifacts, claims

    def on_run_end(self, config: Any, **kwargs: Any) -> None:
        """Send what a command without ``-m`` has run."""
        runs = getattr(kwargs["job_return"]._return_value, "runs", ())
        self._send({str(config.results_dir): runs})

    def on_multirun_end(self, config: Any, **kwargs: Any) -> None:
        """Send what all jobs of a sweep have run, wherever they did."""
        self._send(session().runs)

    def _send(self, runs: Mapping[str, Sequence[str]]) -> None:
        """Send runs by results folder; a tracker that fails costs nothing that is stored."""
        for folder, names in runs.items():
            if not names:
                continue
            results_dir = user_path(folder)
            store = store_of(results_dir, self.uri)
            try:
                verdicts = _verdicts(results_dir, names) if self.claims else {}
                sent = send(results_dir, names, store, self.experiment,
                            artifacts=self.artifacts, verdicts=verdicts)  # fmt: skip
            except Exception as error:  # MLflow's are of many kinds
                reason = harmless(" ".join(str(error).split()) or type(error).__name__)
                complain(
                    f"WARNING: MLflow at {harmless(store)} has not taken all runs ({reason}); "
                    f"nothing is lost in {results_dir}: the same command sends what is missing"
                )
            else:
                told = counted(sent, "mission") if sent else "nothing new"
                print(f"MLflow: {told} sent to {harmless(store)}")


def _verdicts(results_dir: Path, runs: Sequence[str]) -> dict[str, str]:
    """Judge the claims by these runs alone; what they lack has no verdict."""
    if len(set(runs)) < 2:
        return {}
    try:
        judged = judge_claims(find_study(results_dir, run=list(dict.fromkeys(runs))))
    except (UsageError, RunError):
        return {}  # they are no study of the paper's
    return {claim.name: claim.verdict for claim in judged if claim.verdict != "missing"}
