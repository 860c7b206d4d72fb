"""What Hydra's callbacks that pass on stored runs have in common."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.experimental.callback import Callback

from infoplan.files import user_path
from infoplan.hydra_front.jobs import session
from infoplan.output import complain
from infoplan.wording import counted, harmless


class Tracker(Callback, ABC):
    """Passes on the runs of a command when all is stored."""

    name = ""
    """Of the tracker."""

    @abstractmethod
    def place(self, results_dir: Path) -> str:
        """Say where runs are passed to."""

    @abstractmethod
    def send(self, results_dir: Path, runs: Sequence[str]) -> int:
        """Pass on what is new of some runs; give the number of missions."""

    def on_run_end(self, config: Any, **kwargs: Any) -> None:
        """Pass on what a command without ``-m`` has run."""
        runs = getattr(kwargs["job_return"]._return_value, "runs", ())
        self._send_all({str(config.results_dir): runs})

    def on_multirun_end(self, config: Any, **kwargs: Any) -> None:
        """Pass on what all jobs of a sweep have run, wherever they did."""
        self._send_all(session().runs)

    def _send_all(self, runs: Mapping[str, Sequence[str]]) -> None:
        """Pass on runs by results folder; a tracker that fails costs nothing that is stored."""
        for folder, names in runs.items():
            if not names:
                continue
            results_dir = user_path(folder)
            place = harmless(self.place(results_dir))
            try:
                sent = self.send(results_dir, names)
            except Exception as error:  # those of trackers are of many kinds
                reason = harmless(" ".join(str(error).split()) or type(error).__name__)
                complain(
                    f"WARNING: {self.name} at {place} has not taken all runs ({reason}); "
                    f"nothing is lost in {results_dir}: the same command sends what is missing"
                )
            else:
                told = counted(sent, "mission") if sent else "nothing new"
                print(f"{self.name}: {told} sent to {place}")
