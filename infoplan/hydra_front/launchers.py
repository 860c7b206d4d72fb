"""Launchers of Hydra's: our own pool for all jobs of a sweep, and an eye on those of others."""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from omegaconf import DictConfig, open_dict, read_write

from infoplan.errors import RunError, UsageError
from infoplan.hydra_front.compose import Composer
from infoplan.hydra_front.jobs import act_on_jobs, session, task_overrides
from infoplan.hydra_front.overrides import combinations, key, readable
from infoplan.study.limits import check_sweep

BASIC_SWEEPER = "hydra._internal.core_plugins.basic_sweeper.BasicSweeper"
"""Hydra's sweeper that runs all combinations and searches for nothing."""


def register_launcher() -> None:
    """Make the launcher known to Hydra.

    Hydra takes plugins from the package ``hydra_plugins`` only, and a real module there would load
    into every Hydra application of the environment: this module goes by such a name here instead.
    """
    package = sys.modules.setdefault("hydra_plugins", ModuleType("hydra_plugins"))
    package.infoplan = sys.modules[__name__]  # type: ignore[attr-defined]
    PoolLauncher.__module__ = "hydra_plugins.infoplan"
    Plugins.instance().register(PoolLauncher)


class PoolLauncher(Launcher):
    """Hydra launcher that sends all jobs of a multirun to one pool of workers."""

    def setup(self, *, hydra_context: Any, task_function: Any, config: DictConfig) -> None:
        """Keep what is needed to compose each job's configuration."""
        self.config = config

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Compose the configurations of all jobs and run them as one study."""
        jobs = [list(overrides) for overrides in job_overrides]
        _make_folder(str(self.config.hydra.sweep.dir))  # some sweepers write to it
        compose = Composer(self.config.hydra.job.config_name)
        composed = [compose(overrides) for overrides in jobs]
        numbers = act_on_jobs(composed, jobs, self.config.hydra.job.config_name)
        return [
            JobReturn(overrides=overrides, cfg=config, status=JobStatus.COMPLETED,
                      _return_value=number)
            for overrides, config, number in zip(job_overrides, composed, numbers, strict=True)
        ]  # fmt: skip


class WatchedLauncher(Launcher):
    """Launcher, of whatever kind, whose jobs get what was typed, and whose results are noted.

    Parameters
    ----------
    launcher
        Does the work.
    config
        Hydra's configuration of the sweep.
    """

    def __init__(self, launcher: Launcher, config: DictConfig):
        self.launcher = launcher
        parsed = OverridesParser.create().parse_overrides(task_overrides(config.hydra))
        self.given = {
            override.key_or_group: override.input_line or ""
            for override in parsed
            if not override.is_sweep_override()
        }
        self.is_search = is_search(config)

    def setup(self, *, hydra_context: Any, task_function: Any, config: DictConfig) -> None:
        """Do nothing: the launcher is set up already."""

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run the jobs of a sweeper, which may write null as None, and text without quotes."""
        jobs = [
            readable([self.given.get(key(word), word) for word in overrides], several=False)
            for overrides in job_overrides
        ]
        returned = list(self.launcher.launch(jobs, initial_job_idx=initial_job_idx))
        for result in returned:
            runs = getattr(result._return_value, "runs", ())  # a failed job has an error there
            if runs and result.cfg is not None:
                session().runs.setdefault(str(result.cfg.results_dir), []).extend(runs)
        if not self.is_search:
            return returned
        for i, (job, result) in enumerate(zip(jobs, returned, strict=True)):
            number = result._return_value
            done = result.status == JobStatus.COMPLETED and not math.isnan(number)
            session().trials.append((job, number if done else math.nan))
            if not done:
                returned[i] = FailedJob(
                    overrides=result.overrides, cfg=result.cfg, status=JobStatus.FAILED
                )
        return returned


def is_search(config: DictConfig) -> bool:
    """Whether a sweeper chooses the values that it tries, unlike Hydra's own, which tries all."""
    return bool(config.hydra.sweeper["_target_"] != BASIC_SWEEPER)


def prepare_sweep(config: DictConfig) -> None:
    """Write what files say of a sweep as its command line is written, and refuse too large a one.

    Parameters
    ----------
    config
        Of Hydra, before its sweeper is made, which would write all combinations out.

    Raises
    ------
    UsageError
        If the sweep has no configuration, or more than can be held.
    """
    if is_search(config):
        return
    params = config.hydra.sweeper.params or {}
    words = readable([f"{name}={value}" for name, value in params.items()], several=True)
    with read_write(config), open_dict(config):
        config.hydra.sweeper.params = dict(word.split("=", 1) for word in words)
    parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
    check_sweep(combinations(parser.parse_overrides([*words, *task_overrides(config.hydra)])))


class FailedJob(JobReturn):
    """A job without a number: sweepers do not take NaN, but are told that the job has failed."""

    @property  # type: ignore[misc]
    def return_value(self) -> Any:
        """Raise."""
        raise RunError("a trial has no RMSE: its missions failed")


def _make_folder(path: str) -> None:
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"hydra.sweep.dir={path} cannot be made ({error.strerror}): give another folder"
        ) from error
