"""``infoplan run``: Hydra composes the configuration, this module hands it to the runner.

Hydra runs one job after the other and answers a usage error in its own words; here a launcher of
our own sends all jobs of a multirun to one pool, and errors become one sentence.
"""

import copy
import itertools
import math
import os
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from types import ModuleType
from typing import Any

from hydra import compose as hydra_compose
from hydra import initialize_config_module
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, OverrideType
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus
from hydra.errors import HydraException
from hydra.plugins.launcher import Launcher
from hydra.types import RunMode
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from infoplan.config import (
    METHODS,
    TERRAIN_SCHEMAS,
    Config,
    TerrainConfig,
    describe,
    options,
)
from infoplan.errors import RunError, UsageError
from infoplan.study.limits import check_sweep
from infoplan.wording import suggest

SCHEMAS: dict[str, dict[str, Any]] = {
    **METHODS,
    "terrain": {name: schema(name=name) for name, schema in TERRAIN_SCHEMAS.items()},
}
"""Schema of every choice of every group; each YAML file in ``infoplan.conf`` repeats one."""

FLAGS_WITH_VALUE = (
    "-c", "--cfg", "-p", "--package", "-cp", "--config-path", "-cn", "--config-name",
    "-cd", "--config-dir", "--experimental-rerun",
)  # fmt: skip
INFO_CHOICES = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")

Act = Callable[[list[Config]], tuple[int, list[float]]]
"""What is done with the configurations of a study: gives exit status and one number for each."""

OWN_OPTION = re.compile(r"\w+\.(options|params)[.=]")
"""How options of a user's own function, or of one of PyOD's classes, begin."""

_statuses: list[int | Exception] = []
"""Exit status or error of each study: Hydra keeps what a job returns or raises to itself."""


def run(arguments: list[str]) -> int:
    """Run ``infoplan run`` with Hydra's command line; return the exit status."""
    if "--dry-run" in arguments:
        rest = [argument for argument in arguments if argument != "--dry-run"]
        return compose_and(_show_plan, rest)
    return compose_and(_run_and_print, arguments)


def compose_and(act: Act, arguments: list[str]) -> int:
    """Let Hydra compose the configurations of a command line, and act on them as one study.

    Parameters
    ----------
    act
        What to do with them.
    arguments
        Flags and overrides, as after ``infoplan run``.

    Returns
    -------
    int
        The exit status.

    Raises
    ------
    UsageError
        If the command line is wrong.
    """
    import hydra

    global _act
    register()
    _act = act
    _statuses.clear()
    flags, overrides = sort_arguments(arguments)
    if {"-m", "--multirun"} & set(flags):
        check_sweep(combinations(overrides))  # Hydra would begin to compose them all
    entry = hydra.main(version_base="1.3", config_path="pkg://infoplan.conf", config_name="config")
    with _command_line([*flags, *map(_admitted, overrides)]):
        try:
            entry(_task)()
        except (HydraException, OmegaConfBaseException) as error:
            raise UsageError(explain(error)) from error
        except SystemExit as stop:
            # argparse has said what is wrong; Hydra's own pages end with 0.
            return int(stop.code or 0)
    for status in _statuses:
        if isinstance(status, Exception):
            raise status
    return max((status for status in _statuses if isinstance(status, int)), default=0)


def compose(overrides: Sequence[str]) -> Config:
    """Compose one configuration as ``infoplan run`` with these overrides does.

    Its bounds are not checked yet (`infoplan.config.validate`).

    Raises
    ------
    UsageError
        If a choice, an option or the type of a value is wrong.
    """
    register()
    try:
        with initialize_config_module("infoplan.conf", version_base="1.3"):
            composed = hydra_compose("config", [_admitted(override) for override in overrides])
    except (HydraException, OmegaConfBaseException) as error:
        raise UsageError(explain(error)) from error
    return _to_config(composed)


def compose_terrain(overrides: list[str]) -> TerrainConfig:
    """Read ``terrain=...`` and ``terrain.option=...`` as ``infoplan run`` does.

    Raises
    ------
    UsageError
        If a choice, an option or a value is wrong.
    """
    return compose(overrides).terrain


def complete(arguments: list[str]) -> int:
    """Serve shell completion: the command word goes, the rest is Hydra's."""
    line = os.environ.get("COMP_LINE", "")
    words = line.split(" ")
    if len(words) > 1 and words[1] == "run":
        os.environ["COMP_LINE"] = " ".join([words[0], *words[2:]])
        if "COMP_POINT" in os.environ:
            os.environ["COMP_POINT"] = str(max(0, int(os.environ["COMP_POINT"]) - len("run ")))
        return run(arguments)
    if "query=" in " ".join(arguments) and len(words) > 1:
        from infoplan.cli import COMMANDS

        print("\n".join(name for name in COMMANDS if name.startswith(words[1])))
        return 0
    return run(arguments)


def register() -> None:
    """Register schemas and launcher with Hydra, in this process only.

    Hydra takes plugins from the package ``hydra_plugins`` only, and a real module there would load
    into every Hydra application of the environment: this module goes by such a name here instead.
    """
    plugins = Plugins.instance()
    package = sys.modules.setdefault("hydra_plugins", ModuleType("hydra_plugins"))
    package.infoplan = sys.modules[__name__]  # type: ignore[attr-defined]
    PoolLauncher.__module__ = "hydra_plugins.infoplan"
    plugins.register(PoolLauncher)
    store = ConfigStore.instance()
    for group, choices in SCHEMAS.items():
        for name, schema in choices.items():
            store.store(group=f"schema/{group}", name=name, node=schema, provider="infoplan")
    base = Config(planner=MISSING, detector=MISSING, terrain=MISSING, model=MISSING)
    store.store(name="base_config", node=base, provider="infoplan")
    target = "hydra_plugins.infoplan.PoolLauncher"
    store.store(group="hydra/launcher", name="infoplan", node={"_target_": target})


def sort_arguments(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Split a command line into flags, with their values, and overrides, in any order."""
    flags, overrides = [], []
    rest = iter(arguments)
    for argument in rest:
        if not argument.startswith("-"):
            overrides.append(argument)
            continue
        flags.append(argument)
        if argument in FLAGS_WITH_VALUE:
            flags.extend(value for value in [next(rest, None)] if value is not None)
        elif argument in ("-i", "--info"):
            # Its value is optional: without one, the next override would be taken for it.
            flags[-1] = "--info=all"
            following = next(rest, None)
            if following in INFO_CHOICES:
                flags[-1] = f"--info={following}"
            elif following is not None:
                more_flags, more_overrides = sort_arguments([following, *rest])
                return flags + more_flags, overrides + more_overrides
    return flags, overrides


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
        compose = Composer(self.config.hydra.job.config_name)
        composed = [compose(overrides) for overrides in jobs]
        numbers = _study(composed, jobs, self.config.hydra.job.config_name)
        return [
            JobReturn(overrides=overrides, cfg=config, status=JobStatus.COMPLETED,
                      _return_value=number)
            for overrides, config, number in zip(job_overrides, composed, numbers, strict=True)
        ]  # fmt: skip


class Composer:
    """Composes configurations with Hydra, many of them in little time.

    Hydra reads and merges all files anew for every job. Here that is done once for every choice of
    groups; plain options are set in a copy, as Hydra itself does it at the end.

    Parameters
    ----------
    config_name
        Name of the root configuration.
    """

    def __init__(self, config_name: str):
        self.config_name = config_name
        self.parser = OverridesParser.create()
        self.composed: dict[tuple[str, ...], DictConfig] = {}

    def __call__(self, overrides: Sequence[str]) -> DictConfig:
        """Compose the configuration of a job's overrides."""
        parsed = self.parser.parse_overrides(list(overrides))
        plain = [override for override in parsed if self._is_plain(override)]
        groups = tuple(override.input_line or "" for override in parsed if override not in plain)
        if groups not in self.composed:
            self.composed[groups] = hydra_compose(self.config_name, overrides=list(groups))
        config = copy.deepcopy(self.composed[groups])
        try:
            for override in plain:
                OmegaConf.update(config, override.key_or_group, override.value(), merge=True)
        except OmegaConfBaseException:
            return hydra_compose(self.config_name, overrides=list(overrides))  # for its message
        return config

    def _is_plain(self, override: Override) -> bool:
        """Whether an override sets an option of a group or of the root, and does nothing else."""
        name = override.key_or_group
        changes = override.type == OverrideType.CHANGE and override.package is None
        return changes and name not in (*SCHEMAS, "experiment") and "/" not in name


def expand(lines: Sequence[str], given: Sequence[str]) -> list[list[str]]:
    """Expand the command lines of ``sweep`` to the overrides of single jobs.

    Parameters
    ----------
    lines
        Overrides, also of several values, as after ``infoplan run -m``.
    given
        Overrides of the command line proper; they take the place of the lines' own.

    Returns
    -------
    list of list of str
        All combinations of each line, in order.

    Raises
    ------
    UsageError
        If a line is no command line.
    """
    parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
    taken = {override.key_or_group for override in parser.parse_overrides(list(given))}
    jobs = []
    for line in lines:
        try:
            overrides = parser.parse_overrides([_admitted(word) for word in shlex.split(line)])
            own = [override for override in overrides if override.key_or_group not in taken]
            values = [_values(override) for override in own]
        except (HydraException, ValueError) as error:
            raise UsageError(
                f"the entry {line!r} of sweep cannot be read: it is what would follow "
                "`infoplan run -m`, like planner=uct,puct rho=0.1"
            ) from error
        jobs += [[*given, *combination] for combination in itertools.product(*values)]
    return jobs


def combinations(overrides: Sequence[str]) -> int:
    """Count the jobs that Hydra's own sweeper makes of overrides; 1 if another sweeper is chosen.

    Of a single override no more than a million values are counted.
    """
    if any(override.startswith("hydra/sweeper=") for override in overrides):
        return 1
    try:
        parsed = OverridesParser.create().parse_overrides([_admitted(word) for word in overrides])
        swept = [override for override in parsed if override.is_sweep_override()]
        return math.prod(
            sum(1 for _ in itertools.islice(override.sweep_string_iterator(), 1_000_000))
            for override in swept
        )
    except HydraException:
        return 1  # Hydra says what is wrong


def explain(error: BaseException) -> str:
    """Say in one sentence what is wrong with a command line that Hydra refused."""
    chain = [error]
    while (cause := chain[-1].__cause__ or chain[-1].__context__) is not None:
        chain.append(cause)
    text = "\n".join(str(link) for link in chain)
    if match := re.search(r"Could not find '([^'/]+)/([^']*)'", text):
        group, choice = match[1], match[2]
        available = re.search(r"Available options in [^\n]*\n((?:\s+\S+\n?)+)", text)
        choices = available[1].split() if available else list(SCHEMAS.get(group, {}))
        return (
            f"there is no {group} {choice!r}{suggest(choice, choices)}: "
            f"{group}= takes {', '.join(choices)}"
        )
    if match := re.search(r"Ambiguous value for argument '([^']+)'", text):
        return (
            f"{match[1]} gives several values: add -m to run them all, or quote what is one value"
        )
    if match := re.search(r"Could not override '([^']+)'", text):
        return _no_option(match[1])
    if match := re.search(r"Error merging override ([^=\s]+)=(\S*)", text):
        name, value = match[1].lstrip("+~"), match[2]
        if metadata := _all_options().get(name):
            return f"{name}={value} is not possible: {name} must be {describe(metadata)}"
    first = next(line for line in text.splitlines() if line.strip())
    return f"the command line cannot be read: {first}"


def _no_option(name: str) -> str:
    known = _all_options()
    if name in known:
        group = name.split(".")[0]
        return (
            f"the chosen {group} has no option {name!r}: infoplan run --cfg job shows what it has"
        )
    return (
        f"there is no option {name!r}{suggest(name, [*known, *SCHEMAS, 'experiment'])}: "
        "infoplan run --help lists all"
    )


def _all_options() -> dict[str, dict[str, Any]]:
    """Metadata of every option that some choice has."""
    known = {name: metadata for name, _, metadata in options(Config())}
    for group, choices in SCHEMAS.items():
        for schema in choices.values():
            for name, _, metadata in options(schema, f"{group}."):
                known.setdefault(name, metadata)
    return known


def _admitted(override: str) -> str:
    """Let Hydra take options of which it has no list: of own functions and PyOD's classes."""
    return f"++{override}" if OWN_OPTION.match(override) else override


def _task(composed: DictConfig) -> float:
    """Act on one job of Hydra's own; with another launcher than ours it may be one of many."""
    hydra_config = HydraConfig.get()
    overrides = [list(hydra_config.overrides.task)]
    number = _study([composed], overrides, str(hydra_config.job.config_name))[0]
    last = _statuses[-1]
    if hydra_config.mode == RunMode.MULTIRUN and last:
        # Perhaps in another process: only an error finds its way back.
        raise last if isinstance(last, Exception) else RunError("missions failed")
    return number


def _study(
    composed: Sequence[DictConfig], overrides: Sequence[list[str]], config_name: str
) -> list[float]:
    """Act on the configurations of jobs as one study; return a number for each, for sweepers."""
    try:
        compose = Composer(config_name)
        expanded = [_expanded(*job, compose) for job in zip(composed, overrides, strict=True)]
        status, numbers = _act([_to_config(config) for job in expanded for config in job])
    except (UsageError, RunError) as error:
        _statuses.append(error)
        return [float("nan")] * len(composed)
    except (HydraException, OmegaConfBaseException) as error:
        _statuses.append(UsageError(explain(error)))
        return [float("nan")] * len(composed)
    _statuses.append(status)
    values = iter(numbers)
    return [sum(next(values) for _ in job) / len(job) for job in expanded]


def _expanded(composed: DictConfig, overrides: list[str], compose: Composer) -> list[DictConfig]:
    """Give the configurations that a job stands for: itself, or those of its ``sweep``."""
    if not composed.sweep:
        return [composed]
    return [compose(job) for job in expand(composed.sweep, overrides)]


def _values(override: Override) -> list[str]:
    """Write an override of one or several values as overrides of one each."""
    if not override.is_sweep_override():
        return [override.input_line or ""]
    return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]


def _run_and_print(configs: list[Config]) -> tuple[int, list[float]]:
    from infoplan.study.runner import run_study
    from infoplan.study.summary import final_rmse, print_summary, wide_console

    console = wide_console()
    study = run_study(configs, console)
    print_summary(study, console)
    return int(bool(study.failed)), final_rmse(study)


_act: Act = _run_and_print
"""What to do in this call: Hydra cannot hand it on. A launcher's other processes run missions."""


def _show_plan(configs: list[Config]) -> tuple[int, list[float]]:
    from infoplan.study.runner import check_study, plan_study
    from infoplan.study.summary import final_rmse, print_plan, wide_console

    console = wide_console()
    check_study(configs)
    study = plan_study(configs, console)
    print_plan(study, configs[0], console)
    return 0, final_rmse(study)


def _to_config(composed: DictConfig) -> Config:
    config = OmegaConf.to_object(composed)
    assert isinstance(config, Config)
    for name in _added_keys(config):
        raise UsageError(_no_option(name))
    return config


def _added_keys(config: object, prefix: str = "") -> Iterator[str]:
    """Names that ``+name=value`` has added: Hydra lets them through, infoplan would ignore them."""
    known = {item.name for item in fields(config)}  # type: ignore[arg-type]
    for name, value in vars(config).items():
        if name not in known:
            yield prefix + name
        elif is_dataclass(value):
            yield from _added_keys(value, f"{prefix}{name}.")


@contextmanager
def _command_line(arguments: list[str]) -> Iterator[None]:
    """Let Hydra see these arguments, raise its errors as they are, and keep its files away."""
    saved_argv, saved_flag = sys.argv, os.environ.get("HYDRA_FULL_ERROR")
    try:
        scratch = tempfile.mkdtemp(prefix="infoplan-")
    except OSError as error:
        raise RunError(
            "there is no temporary folder to write to: set TMPDIR to a folder where files can be "
            "written"
        ) from error
    multirun = any(argument in ("-m", "--multirun") for argument in arguments)
    if multirun and not any(argument.startswith("hydra.sweep.dir=") for argument in arguments):
        # Hydra's sweeper insists on writing multirun.yaml somewhere.
        arguments = [*arguments, f"hydra.sweep.dir={scratch}"]
    sys.argv = ["infoplan", *arguments]
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        yield
    finally:
        sys.argv = saved_argv
        if saved_flag is None:
            del os.environ["HYDRA_FULL_ERROR"]
        else:
            os.environ["HYDRA_FULL_ERROR"] = saved_flag
        shutil.rmtree(scratch, ignore_errors=True)
