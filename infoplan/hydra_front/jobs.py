"""The jobs of a command line: all of a sweep are acted on as one study."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from infoplan.config import Config
from infoplan.errors import RunError, UsageError
from infoplan.hydra_front.compose import Composer, check_texts, to_config
from infoplan.hydra_front.explain import explained
from infoplan.hydra_front.overrides import sweep_jobs
from infoplan.hydra_front.trials import Score
from infoplan.study.limits import check_sweep

Act = Callable[[list[Config]], tuple[int, list[float]]]
"""What is done with the configurations of a study: gives exit status and one number for each."""


@dataclass
class Session:
    """What is done in one call of the front, which Hydra cannot hand on to its jobs.

    Attributes
    ----------
    act
        What to do with the configurations.
    statuses
        Exit status or error of each study: Hydra keeps what a job returns or raises to itself.
    trials
        Overrides and number of each job of a sweeper other than Hydra's basic one.
    runs
        Names of the runs of all jobs of a sweep, by results folder.
    """

    act: Act
    statuses: list[int | Exception] = field(default_factory=list)
    trials: list[tuple[list[str], float]] = field(default_factory=list)
    runs: dict[str, list[str]] = field(default_factory=dict)


_session: list[Session] = []
"""The session under way."""


def begin(act: Act) -> Session:
    """Begin a session in this process."""
    _session[:] = [Session(act)]
    return _session[0]


def session() -> Session:
    """Give the session that was begun last in this process."""
    return _session[0]


def task_of(act: Act) -> Callable[[DictConfig], float]:
    """Make what Hydra calls for a job; with another launcher than ours in a process of its own."""

    def task(composed: DictConfig) -> float:
        return act_on_job(composed, act)

    return task


def act_on_job(composed: DictConfig, act: Act) -> float:
    """Act on one job of Hydra's own; with another launcher than ours it may be one of many."""
    if not _session:
        begin(act)
    hydra_config = HydraConfig.get()
    overrides = [task_overrides(hydra_config)]
    number = act_on_jobs([composed], overrides, str(hydra_config.job.config_name))[0]
    last = session().statuses[-1]
    if hydra_config.mode == RunMode.MULTIRUN and last:
        # Perhaps in another process: only an error finds its way back.
        raise last if isinstance(last, Exception) else RunError("missions failed")
    return number


def act_on_jobs(
    composed: Sequence[DictConfig], overrides: Sequence[list[str]], config_name: str
) -> list[float]:
    """Act on the configurations of jobs as one study; return a number for each, for sweepers."""
    statuses = session().statuses
    try:
        with explained():
            for job in overrides:
                check_texts(GlobalHydra.instance().config_loader(), job)
            compose = Composer(config_name, of_sweep=True)
            expanded = _expanded(composed, overrides, compose)
            configs = [to_config(config) for job in expanded for config in job]
        status, numbers = session().act(configs)
    except (UsageError, RunError) as error:
        statuses.append(error)
        return [float("nan")] * len(composed)
    except Exception as error:
        statuses.append(error)
        raise
    statuses.append(status)
    values = iter(numbers)
    return [_score([next(values) for _ in job]) for job in expanded]


def task_overrides(hydra_config: Any) -> list[str]:
    """Return the overrides of a job as they were written, ``${...}`` in them included."""
    words: Any = OmegaConf.to_container(hydra_config.overrides.task)
    return list(words)


def _score(numbers: list[float]) -> float:
    """Give the one number of a job, which knows its runs."""
    if len(numbers) == 1:
        return numbers[0]
    runs = (run for number in numbers for run in getattr(number, "runs", ()))
    return Score(sum(numbers) / len(numbers), *runs)


def _expanded(
    composed: Sequence[DictConfig], overrides: Sequence[list[str]], compose: Composer
) -> list[list[DictConfig]]:
    """Give the configurations that each job stands for: itself, or those of its ``sweep``."""
    lines = [
        sweep_jobs(config.sweep, job) if config.sweep else []
        for config, job in zip(composed, overrides, strict=True)
    ]
    check_sweep(sum(map(len, lines)))
    return [
        [compose(line) for line in of_job] if config.sweep else [config]
        for config, of_job in zip(composed, lines, strict=True)
    ]
