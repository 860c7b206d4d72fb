"""``infoplan run``: Hydra composes the configuration, this module hands it to the runner.

Hydra runs one job after the other and answers a usage error in its own words; here a launcher of
our own sends all jobs of a multirun to one pool, and errors become one sentence.
"""

import copy
import io
import itertools
import math
import os
import re
import shlex
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout
from dataclasses import fields, is_dataclass
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from types import ModuleType
from typing import Any

import yaml
from hydra import compose as hydra_compose
from hydra import version
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.utils import create_config_search_path
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, OverrideType
from hydra.core.plugins import Plugins
from hydra.core.singleton import Singleton
from hydra.core.utils import JobReturn, JobStatus
from hydra.errors import HydraException, MissingConfigException
from hydra.plugins.launcher import Launcher
from hydra.types import RunMode
from omegaconf import MISSING, DictConfig, OmegaConf, open_dict
from omegaconf.errors import (
    ConfigKeyError,
    ConfigTypeError,
    GrammarParseError,
    InterpolationResolutionError,
    MissingMandatoryValue,
    OmegaConfBaseException,
    ValidationError,
)

from infoplan.caches import scratch_folder
from infoplan.config import METHODS, TERRAIN_SCHEMAS, Config, TerrainConfig
from infoplan.errors import RunError, UsageError
from infoplan.files import user_path
from infoplan.options import describe, walk
from infoplan.output import Output
from infoplan.own import load, text_parameters
from infoplan.study.limits import check_sweep
from infoplan.text_options import (
    OWN_OPTION,
    as_override,
    decimal,
    for_hydra,
    text_options,
    typed_text,
    typed_texts,
)
from infoplan.wording import counted, figure, harmless, suggest

SCHEMAS: dict[str, dict[str, Any]] = {
    **METHODS,
    "terrain": {name: schema(name=name) for name, schema in TERRAIN_SCHEMAS.items()},
}
"""Schema of every choice of every group; each YAML file in ``infoplan.conf`` repeats one."""

GROUPS = (*SCHEMAS, "experiment")
"""What chooses a file of its own."""

CONFIG_KINDS = ("job", "hydra", "all")
INFO_CHOICES = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")
SHORT_FLAGS = {
    "-h": "--help", "-r": "--run", "-m": "--multirun", "-c": "--cfg", "-p": "--package",
    "-i": "--info", "-sc": "--shell-completion", "-cp": "--config-path", "-cn": "--config-name",
    "-cd": "--config-dir",
}  # fmt: skip
VALUED_FLAGS = {
    "--cfg": "one of job, hydra and all",
    "--package": "a part of the configuration, such as planner",
    "--config-path": "a folder",
    "--config-name": "the name of a configuration",
    "--config-dir": "a folder",
}
"""Flags that need a value, and what it is."""

NUMBER = r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*"
DECIMAL_RANGE = re.compile(rf"range\((?=[^)]*[.eE]){NUMBER},{NUMBER}(?:,{NUMBER})?\)")
"""A range of Hydra's of which a number has decimals."""

BASIC_SWEEPER = "hydra._internal.core_plugins.basic_sweeper.BasicSweeper"
"""Hydra's sweeper that runs all combinations and searches for nothing."""

FLAGS = (*SHORT_FLAGS.values(), "--hydra-help", "--version", "--resolve")

Act = Callable[[list[Config]], tuple[int, list[float]]]
"""What is done with the configurations of a study: gives exit status and one number for each."""

_statuses: list[int | Exception] = []
"""Exit status or error of each study: Hydra keeps what a job returns or raises to itself."""

_trials: list[tuple[list[str], float]] = []
"""Overrides and number of each job of a sweeper other than Hydra's basic one."""

_lock = threading.RLock()
"""Hydra keeps its state in the process: one thread at a time may change it."""


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
    flags, overrides = sort_arguments(arguments)
    given = check_flags(flags)
    if "--shell-completion" not in given:
        overrides = readable(overrides, several=_is_multirun(flags, overrides))
        if _is_multirun(flags, overrides):
            check_sweep(combinations(overrides))  # Hydra would begin to compose them all
    entry = hydra.main(version_base="1.3", config_path="pkg://infoplan.conf", config_name="config")
    quiet = redirect_stderr(io.StringIO()) if "--package" in given else nullcontext()
    with _own_state(), _command_line(flags, overrides), quiet:
        register()
        register_launcher()
        _act = act
        _statuses.clear()
        _trials.clear()
        try:
            with _explained(_statuses):
                entry(_task)()
        except RunError:
            if _trials:
                print(best_trial(_trials))
            raise
        except SystemExit as stop:
            if stop.code and "--package" in given:
                raise UsageError(
                    f"--package {given['--package']} is no part of the configuration: name a "
                    "group, such as planner, or hydra"
                ) from stop
            # Hydra's own pages end with 0.
            return int(stop.code or 0)
    for status in _statuses:
        if isinstance(status, Exception):
            raise status
    if _trials:
        print(best_trial(_trials))
    return max((status for status in _statuses if isinstance(status, int)), default=0)


def compose(overrides: Sequence[str]) -> Config:
    """Compose one configuration as ``infoplan run`` with these overrides does.

    Works inside of another Hydra application, and leaves its state as it is. Its bounds are not
    checked yet (`infoplan.config.validate`).

    Raises
    ------
    UsageError
        If a choice, an option or the type of a value is wrong.
    """
    words = readable(overrides, several=False)
    with _lock, _version_base():
        register()
        loader = ConfigLoaderImpl(create_config_search_path("pkg://infoplan.conf"))
        with _explained():
            composed = loader.load_configuration("config", words, RunMode.RUN, from_shell=False)
            with open_dict(composed):
                del composed["hydra"]
            _check_texts(loader, words)
            return _to_config(composed)


def compose_terrain(overrides: list[str]) -> TerrainConfig:
    """Read ``terrain=...`` and ``terrain.option=...`` as ``infoplan run`` does.

    Raises
    ------
    UsageError
        If a choice, an option or a value is wrong.
    """
    return compose(overrides).terrain


def complete(incomplete: str) -> list[str]:
    """Complete a word of ``infoplan run`` that is Hydra's own, like ``hydra/launcher=``."""
    line = f"infoplan {incomplete}"
    told = io.StringIO()
    os.environ |= {"COMP_LINE": line, "COMP_POINT": str(len(line))}
    with redirect_stdout(told):
        run(["-sc", "query=bash"])
    return told.getvalue().split()


def register() -> None:
    """Register the schemas with Hydra, in this process only; the names are infoplan's alone."""
    store = ConfigStore.instance()
    for group, choices in SCHEMAS.items():
        for name, schema in choices.items():
            store.store(group=f"infoplan_schema/{group}", name=name, node=schema)
    base = Config(planner=MISSING, detector=MISSING, terrain=MISSING, model=MISSING)
    store.store(name="infoplan_base", node=base)
    target = "hydra_plugins.infoplan.PoolLauncher"
    store.store(group="hydra/launcher", name="infoplan", node={"_target_": target})


def register_launcher() -> None:
    """Make the launcher known to Hydra.

    Hydra takes plugins from the package ``hydra_plugins`` only, and a real module there would load
    into every Hydra application of the environment: this module goes by such a name here instead.
    """
    package = sys.modules.setdefault("hydra_plugins", ModuleType("hydra_plugins"))
    package.infoplan = sys.modules[__name__]  # type: ignore[attr-defined]
    PoolLauncher.__module__ = "hydra_plugins.infoplan"
    Plugins.instance().register(PoolLauncher)


def sort_arguments(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Split a command line into flags, with their values, and overrides, in any order."""
    flags, overrides = [], []
    rest = iter(arguments)
    for argument in rest:
        if not argument.startswith("-"):
            overrides.append(argument)
            continue
        flags.append(argument)
        if SHORT_FLAGS.get(argument, argument) in VALUED_FLAGS:
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


def check_flags(flags: Sequence[str]) -> dict[str, str]:
    """Check the flags of a command line, as `sort_arguments` gives them.

    Returns
    -------
    dict
        The long name of each flag, and its value; empty where it takes none.

    Raises
    ------
    UsageError
        If a flag is unknown, lacks its value, or does not go with another.
    """
    given: dict[str, str] = {}
    rest = iter(flags)
    for flag in rest:
        name, equals, value = flag.partition("=")
        name = SHORT_FLAGS.get(name, name)
        if name not in FLAGS:
            raise UsageError(
                f"there is no flag {flag!r}{suggest(flag, FLAGS)}: infoplan run --help lists all"
            )
        if name in VALUED_FLAGS and not equals:
            value = next(rest, "")
        elif name not in (*VALUED_FLAGS, "--info") and equals:
            raise UsageError(f"{name} takes no value: write {name} alone")
        if name in VALUED_FLAGS and (not value or (not equals and "=" in value)):
            raise UsageError(f"{name} wants {VALUED_FLAGS[name]}")
        given[name] = value
    if given.get("--cfg", "job") not in CONFIG_KINDS:
        raise UsageError(
            f"--cfg {given['--cfg']} shows nothing: use one of {_listed(CONFIG_KINDS)}"
        )
    if given.get("--info", "all") not in INFO_CHOICES:
        raise UsageError(
            f"--info={given['--info']} shows nothing: use one of {_listed(INFO_CHOICES)}"
        )
    if "--cfg" not in given and "--help" not in given:
        for name in ("--resolve", "--package"):
            if name in given:
                raise UsageError(f"{name} changes what --cfg shows: write --cfg job {name}, too")
    modes = ("--run", "--multirun", "--cfg", "--info", "--shell-completion")
    if len(chosen := [name for name in modes if name in given]) > 1:
        raise UsageError(f"{' and '.join(chosen)} do not go together: leave out all but one")
    folder = given.get("--config-dir")
    if folder is not None and not Path(folder).is_dir():
        raise UsageError(f"--config-dir {folder} is no folder: name the one that holds experiment/")
    return given


def readable(overrides: Sequence[str], several: bool) -> list[str]:
    """Write overrides so that Hydra reads what was typed.

    Parameters
    ----------
    overrides
        As typed: ``option=value``.
    several
        Whether commas separate values, as after ``-m``.

    Returns
    -------
    list of str
        Text is in quotes that Hydra takes off again. Doing it twice does no harm.

    Raises
    ------
    UsageError
        If one of them is no override.
    """
    parser = OverridesParser.create()
    own = _own_texts(overrides)
    words = [_readable(override, several, own, parser) for override in overrides]
    if several and not _values_of("hydra/sweeper", overrides):
        words = [_stepped(word) for word in words]
    for typed, word in zip(overrides, words, strict=True):
        try:
            parser.parse_override(word)
        except (HydraException, RecursionError) as error:
            metadata = _all_options().get(_key(typed))
            remedy = (
                f"{_key(typed)} must be {describe(metadata)}"
                if metadata
                else "write option=value; a value with other than letters, digits and ./-_+ goes "
                "into quotes, \"option='...'\""
            )
            shown = typed if len(typed) < 100 else f"{typed[:60]} ..."
            raise UsageError(f"the argument {harmless(shown)} cannot be read: {remedy}") from error
    return words


def _readable(
    override: str, several: bool, own: Mapping[str, set[str]], parser: OverridesParser
) -> str:
    """Write one override as `readable` says."""
    name, equals, value = override.partition("=")
    bare = name.lstrip("+")
    if name.startswith("~"):
        if not name.startswith("~hydra"):
            raise UsageError(f"{override} would take away what infoplan needs: give {name[1:]}=...")
        return override
    if not equals or not bare:
        raise UsageError(f"the argument {override!r} is no option=value, and no flag")
    if not value:
        raise UsageError(f"{name}= has no value: give one, or leave {name}= out")
    for end in re.finditer(r"\.", bare):
        owner = _all_options().get(bare[: end.start()])
        if owner and "dict" not in str(owner["type"]):
            raise UsageError(f"{bare[: end.start()]} has no parts: give {bare[: end.start()]}=...")
    if OWN_OPTION.match(name):
        # Hydra is to take options of which it has no list.
        name = f"++{name}"
    group, _, option = bare.partition(".options.")
    # What is in quotes Hydra reads as text anyhow.
    is_own = option in own.get(group, ()) and value[0] not in ("'", '"')
    if bare not in text_options() and not is_own:
        return f"{name}={value}"
    if several and re.match(r"(choice|range|interval|glob|sort|shuffle|tag)\(", value):
        try:
            parsed = parser.parse_override(f"{name}={value}")
        except HydraException:
            return f"{name}={for_hydra(typed_text(bare, value))}"
        if parsed.is_sweep_override():
            return f"{name}={_texts_in_choice(bare, value)}"
    texts = typed_texts(bare, value) if several else [typed_text(bare, value)]
    return f"{name}={','.join(map(for_hydra, texts))}"


def _stepped(word: str) -> str:
    """Write a range of decimals as its values: Hydra's steps are rounded, and may reach the stop.

    Sweepers that search take a range as a whole.
    """
    name, _, value = word.partition("=")
    match = DECIMAL_RANGE.fullmatch(value)
    if not match:
        return word
    start, stop, step = (Decimal(part or "1") for part in match.groups())
    count = math.ceil((stop - start) / step) if step else 0
    values = [start + i * step for i in range(count)]
    return f"{name}={','.join(map(str, values))}" if values else word


def _texts_in_choice(name: str, value: str) -> str:
    """Write the texts of ``choice(a,b)`` in quotes; other functions of Hydra stay as they are."""
    if match := re.fullmatch(r"choice\((.*)\)", value):
        return f"choice({','.join(map(for_hydra, typed_texts(name, match[1])))})"
    return value


def _own_texts(overrides: Sequence[str]) -> dict[str, set[str]]:
    """Options that are text of the user's functions which the overrides name, by their group."""
    functions, wanted = {}, set()
    for override in overrides:
        name, _, value = override.lstrip("+").partition("=")
        group, _, option = name.partition(".")
        if option == "function" and group in SCHEMAS and value:
            functions[group] = typed_text(name, value)
        elif option.startswith("options."):
            wanted.add(group)
    found = {}
    for group in wanted & set(functions):
        try:
            found[group] = text_parameters(load(str(functions[group])))
        except UsageError:
            continue  # whoever calls the function says what is wrong with it
    return found


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
        numbers = _study(composed, jobs, self.config.hydra.job.config_name)
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
        parsed = OverridesParser.create().parse_overrides(_task_overrides(config.hydra))
        self.given = {
            override.key_or_group: override.input_line or ""
            for override in parsed
            if not override.is_sweep_override()
        }
        self.is_search = config.hydra.sweeper["_target_"] != BASIC_SWEEPER

    def setup(self, *, hydra_context: Any, task_function: Any, config: DictConfig) -> None:
        """Do nothing: the launcher is set up already."""

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run the jobs of a sweeper, which may write null as None, and text without quotes."""
        jobs = [
            readable([self.given.get(_key(word), word) for word in overrides], several=False)
            for overrides in job_overrides
        ]
        returned = list(self.launcher.launch(jobs, initial_job_idx=initial_job_idx))
        if not self.is_search:
            return returned
        for i, (job, result) in enumerate(zip(jobs, returned, strict=True)):
            number = result._return_value
            done = result.status == JobStatus.COMPLETED and not math.isnan(number)
            _trials.append((job, number if done else math.nan))
            if not done:
                returned[i] = FailedJob(
                    overrides=result.overrides, cfg=result.cfg, status=JobStatus.FAILED
                )
        return returned


class FailedJob(JobReturn):
    """A job without a number: sweepers do not take NaN, but are told that the job has failed."""

    @property  # type: ignore[misc]
    def return_value(self) -> Any:
        """Raise."""
        raise RunError("a trial has no RMSE: its missions failed")


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
            if not isinstance(line, str):
                raise ValueError("no command line")
            overrides = parser.parse_overrides(readable(shlex.split(line), several=True))
            if any(override.key_or_group in ("sweep", "experiment") for override in overrides):
                raise ValueError("a study within a study")
            own = [override for override in overrides if override.key_or_group not in taken]
            values = [_values(override) for override in own]
        except (HydraException, ValueError, UsageError) as error:
            raise UsageError(
                f"the entry {line!r} of sweep cannot be read: it is what would follow "
                "`infoplan run -m`, like planner=uct,puct rho=0.1"
            ) from error
        jobs += [[*given, *combination] for combination in itertools.product(*values)]
    return jobs


def best_trial(trials: Sequence[tuple[Sequence[str], float]]) -> str:
    """Say which of a sweeper's trials has the least RMSE, and how to run it again.

    Parameters
    ----------
    trials
        Overrides of each, and its mean final RMSE; NaN where it failed.
    """
    finished = [trial for trial in trials if not math.isnan(trial[1])]
    if not finished:
        return f"none of {counted(len(trials), 'trial')} has an RMSE"
    overrides, number = min(finished, key=lambda trial: trial[1])
    run = f" ({number.run})" if isinstance(number, Score) and number.run else ""
    return (
        f"best of {counted(len(trials), 'trial')}: RMSE {figure(number)}{run}: "
        f"infoplan run {' '.join(map(_pasted, overrides))}"
    )


def _pasted(word: str) -> str:
    """Write an override of Hydra's as a word for a shell."""
    name, _, value = word.partition("=")
    if name in text_options():
        return as_override(name, typed_text(name, value))
    return shlex.quote(word)


class Score(float):
    """Mean final RMSE of a job, and the name of its run; empty if it stands for several."""

    run: str = ""

    def __new__(cls, value: float, run: str = "") -> "Score":
        """Make a number that knows its run."""
        score = super().__new__(cls, value)
        score.run = run
        return score

    def __reduce__(self) -> tuple[Any, ...]:
        """Let it come back from another process."""
        return Score, (float(self), self.run)


def combinations(overrides: Sequence[str]) -> int:
    """Count the jobs that Hydra's own sweeper makes of overrides; 1 if another sweeper is chosen.

    Of a single override no more than a million values are counted.
    """
    if any(override.startswith("hydra/sweeper=") for override in overrides):
        return 1
    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
        swept = [override for override in parsed if override.is_sweep_override()]
        return math.prod(
            sum(1 for _ in itertools.islice(override.sweep_string_iterator(), 1_000_000))
            for override in swept
        )
    except HydraException:
        return 1  # Hydra says what is wrong


def explain(error: BaseException) -> str:
    """Say in one sentence what is wrong with a configuration that Hydra refused."""
    chain = [error]
    while (cause := chain[-1].__cause__ or chain[-1].__context__) is not None:
        chain.append(cause)
    text = "\n".join(str(link) for link in chain)
    for link in chain:
        for kind, sentence in SENTENCES.items():
            if isinstance(link, kind) and (said := sentence(link)):
                file = re.search(r"In '(\w+)/([^']*)': \w+ raised", text)
                return f"{file[1]}={file[2]}: {said}" if file else said
    for pattern, words in REFUSALS.items():
        if match := re.search(pattern, text):
            return words(match)
    return (
        "the configuration cannot be made of these options and files: leave out one after the "
        "other (HYDRA_FULL_ERROR=1 shows where it fails)"
    )


def _missing_file(error: Any) -> str:
    """Name a choice, an experiment or a root configuration that is not there."""
    name = str(error.missing_cfg_file or "")
    group, slash, choice = name.rpartition("/")
    if not slash:
        called = f"no configuration {name!r}" if name else "no configuration in that folder"
        return f"there is {called}: leave out --config-name and --config-path"
    choices = list(error.options or SCHEMAS.get(group, {}))
    takes = f"{group}= takes {', '.join(choices)}" if choices else f"there is no group {group}"
    where = ", or put its file into the folder experiment of --config-dir"
    return (
        f"there is no {group} {choice!r}{suggest(choice, choices)}: {takes}"
        f"{where if group == 'experiment' else ''}"
    )


def _bad_yaml(error: Any) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or "it cannot be read"
    where = f"{mark.name}, line {mark.line + 1}, column {mark.column + 1}" if mark else "a file"
    return f"{where} is no YAML: {problem}; mend it"


def _wrong_type(error: Any) -> str:
    name = str(error.full_key or "").lstrip(".")
    known = _all_options()
    option = next((name[:end] for end in _ends(name) if name[:end] in known), "")
    if name.partition(".")[0] == "hydra":
        return f"{name}={error.value} is not possible: Hydra takes another kind of value there"
    if not option:
        return ""
    value = f"={'null' if error.value is None else error.value}"
    if name != option or not isinstance(error, ValidationError):
        value = ""  # it is a part's, or not told
    return f"{option}{value} is not possible: {option} must be {describe(known[option])}"


def _wrong_value(name: str, value: str) -> str:
    if metadata := _all_options().get(name):
        return f"{name}={value} is not possible: {name} must be {describe(metadata)}"
    return f"{name}={value} is not possible"


def _ends(name: str) -> Iterator[int]:
    """Where a dotted name, or one with indices, may end, the longest first."""
    yield len(name)
    yield from (match.start() for match in reversed(list(re.finditer(r"[.\[]", name))))


def _unknown_key(error: Any) -> str:
    name = str(error.full_key or "").lstrip(".")
    if name == "experiment":
        return "its first line must be `# @package _global_`, and then option: value, a line each"
    return _no_option(name) if name else ""


def _leads_nowhere(error: Any) -> str:
    name = str(error.full_key or "an option").lstrip(".")
    return (
        f"{name} refers with ${{...}} to what is not there, or to itself: write its value, or "
        "another option's name in place of the dots"
    )


SENTENCES: dict[type[BaseException], Callable[[Any], str]] = {
    MissingConfigException: _missing_file,
    yaml.YAMLError: _bad_yaml,
    UnicodeDecodeError: lambda error: (
        f"a file of the configuration is not in UTF-8: {error.reason}"
    ),
    RecursionError: lambda error: (
        "the configuration refers to itself or is nested too deep: write the values themselves"
    ),
    InterpolationResolutionError: _leads_nowhere,
    GrammarParseError: _leads_nowhere,
    MissingMandatoryValue: lambda error: f"{error.full_key} has no value: give one",
    ConfigKeyError: _unknown_key,
    ValidationError: _wrong_type,
    ConfigTypeError: _wrong_type,
    OSError: lambda error: (
        f"{error.filename} cannot be read or written ({error.strerror}): name another"
        if error.filename
        else ""
    ),
}
"""What to say of an error of Hydra or OmegaConf; empty where the text of others says more."""

REFUSALS: dict[str, Callable[[re.Match[str]], str]] = {
    r"Ambiguous value for argument '([^'=]+)": lambda match: (
        f"{match[1]} gives several values: add -m to run them all, or quote what is one value"
    ),
    r"Sweep parameters '([^'=]+)": lambda match: (
        f"{match[1]} gives several values: add -m to run them all"
    ),
    r"Could not override '([^']+)'": lambda match: _no_option(match[1]),
    r"Error merging override \+*([^\s=]+)=(.*)": lambda match: _wrong_value(match[1], match[2]),
    r"Merge error: \w+ is not a subclass of (\w+)Config": lambda match: (
        "a group is chosen by a list `defaults:` in a file, with `- override /planner: uct`, and "
        "its options are given as option: value"
    ),
    r"Config group override must be a string": lambda match: (
        "planner, detector, terrain, model and experiment are chosen by a name: leave out null, "
        "numbers and the like"
    ),
    r"Multiple values for (\S+)\.": lambda match: f"write {match[1]}=... without the +",
    r"Invalid defaults list in '([^']+)'": lambda match: (
        f"{match[1]}: `defaults:` must be a list, like [override /planner: uct]"
    ),
    r"does not support sweep type : (\w+)_SWEEP": lambda match: (
        f"{match[1].lower()}() needs a sweeper that searches, such as hydra/sweeper=optuna "
        "(pip install 'infoplan[sweep]')"
    ),
    r"range\(\) arg 3 must not be zero|Invalid range values": lambda match: (
        "range(start,stop,step) needs a step other than 0"
    ),
    r"Expecting one subcommand|No completion plugin": lambda match: (
        "--shell-completion wants install=bash, install=zsh or install=fish"
    ),
    r"(?:Could not append to config\. An item is already at|Could not append) '([^']+?)'": (
        lambda match: f"{match[1]} is an option that there is: write {match[1]}=... without the +"
    ),
}
"""What to say where only the text of the error tells; each has one name."""


def _no_option(name: str) -> str:
    known = _all_options()
    if name in known:
        group = name.split(".")[0]
        return (
            f"the chosen {group} has no option {name!r}: infoplan run --cfg job shows what it has"
        )
    return (
        f"there is no option {name!r}{suggest(name, [*known, *SCHEMAS, 'experiment'], 3)}: "
        "infoplan run --help lists all"
    )


def _all_options() -> dict[str, dict[str, Any]]:
    """Metadata of every option that some choice has."""
    known = {name: metadata for name, _, metadata in walk(Config())}
    for group, choices in SCHEMAS.items():
        for schema in choices.values():
            for name, _, metadata in walk(schema, f"{group}."):
                known.setdefault(name, metadata)
    return known


def _task(composed: DictConfig) -> float:
    """Act on one job of Hydra's own; with another launcher than ours it may be one of many."""
    hydra_config = HydraConfig.get()
    overrides = [_task_overrides(hydra_config)]
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
        with _explained():
            for job in overrides:
                _check_texts(GlobalHydra.instance().config_loader(), job)
            compose = Composer(config_name)
            expanded = [_expanded(*job, compose) for job in zip(composed, overrides, strict=True)]
            configs = [_to_config(config) for job in expanded for config in job]
        status, numbers = _act(configs)
    except (UsageError, RunError) as error:
        _statuses.append(error)
        return [float("nan")] * len(composed)
    except Exception as error:
        _statuses.append(error)
        raise
    _statuses.append(status)
    values = iter(numbers)
    return [_score([next(values) for _ in job]) for job in expanded]


def _check_texts(loader: Any, overrides: Sequence[str]) -> None:
    """Refuse text without quotes in an experiment's file that YAML has read as something else."""
    for experiment in _values_of("experiment", overrides):
        loaded = loader.repository.load_config(f"experiment/{experiment}")
        content = OmegaConf.to_container(loaded.config) if loaded else None
        for name, value in _flat(content if isinstance(content, dict) else {}):
            if name in text_options() and not isinstance(value, str | None):
                raise UsageError(
                    f"experiment={experiment}: {name} is text, but YAML reads what stands there as "
                    f"{value}: put it in quotes"
                )


def _flat(content: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in content.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _task_overrides(hydra_config: Any) -> list[str]:
    """Return the overrides of a job as they were written, ``${...}`` in them included."""
    words: Any = OmegaConf.to_container(hydra_config.overrides.task)
    return list(words)


def _score(numbers: list[float]) -> float:
    """Give the one number of a job, which keeps the name of its run if it has but one."""
    return numbers[0] if len(numbers) == 1 else Score(sum(numbers) / len(numbers))


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
    sys.stdout.flush()
    if isinstance(sys.stdout, Output):
        sys.stdout.tell_unread()  # of a study whoever listened is told why it went on
    finals = zip(final_rmse(study), study.names, strict=True)
    return int(bool(study.failed)), [Score(number, name) for number, name in finals]


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
    if not isinstance(config, Config):
        raise UsageError("this is no configuration of infoplan's: leave out --config-name")
    for name in _added_keys(config):
        raise UsageError(_no_option(name))
    for group in SCHEMAS:
        if not is_dataclass(getattr(config, group)):
            raise UsageError(f"{group} must be chosen: give {group}={'|'.join(SCHEMAS[group])}")
    return _as_meant(config)


def _as_meant(value: Any) -> Any:
    """Free all numbers of a configuration from the rounding of the steps that led to them."""
    if isinstance(value, float):
        return decimal(value)
    if isinstance(value, list):
        return [_as_meant(entry) for entry in value]
    if isinstance(value, dict):
        return {key: _as_meant(entry) for key, entry in value.items()}
    if is_dataclass(value):
        for name, entry in vars(value).items():
            setattr(value, name, _as_meant(entry))
    return value


def _added_keys(config: object, prefix: str = "") -> Iterator[str]:
    """Names that ``+name=value`` has added: Hydra lets them through, infoplan would ignore them."""
    known = {item.name for item in fields(config)}  # type: ignore[arg-type]
    for name, value in vars(config).items():
        if name not in known:
            yield prefix + name
        elif is_dataclass(value):
            yield from _added_keys(value, f"{prefix}{name}.")


def _key(word: str) -> str:
    """Name of the option, or the group, that an override is about."""
    return word.partition("=")[0].lstrip("+")


def _values_of(name: str, overrides: Sequence[str]) -> list[str]:
    return [word.partition("=")[2] for word in overrides if _key(word) == name]


def _is_multirun(flags: Sequence[str], overrides: Sequence[str]) -> bool:
    asked = any(flag in ("-m", "--multirun") for flag in flags)
    return asked or _values_of("hydra.mode", overrides)[-1:] == ["MULTIRUN"]


def _listed(words: Sequence[str]) -> str:
    return f"{', '.join(words[:-1])} and {words[-1]}"


def _make_folder(path: str) -> None:
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"hydra.sweep.dir={path} cannot be made ({error.strerror}): give another folder"
        ) from error


@contextmanager
def _explained(done: Sequence[int | Exception] = ()) -> Iterator[None]:
    """Put what goes wrong while a configuration is composed in words.

    Parameters
    ----------
    done
        How the studies ended that were acted on meanwhile. Their own errors stay what they are;
        after the first, composing is over and what remains is a sweeper's or launcher's.
    """
    try:
        yield
    except UsageError:
        raise
    except Exception as error:
        if error in done:
            raise
        if failures := [failure for failure in done if isinstance(failure, Exception)]:
            raise failures[0] from error
        if isinstance(error, RunError):
            raise
        if done:
            reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise RunError(f"the sweep ended early, Hydra says {reason}") from error
        raise UsageError(explain(error)) from error


@contextmanager
def _version_base() -> Iterator[None]:
    """Let Hydra behave as of version 1.3, whatever an application around this one has chosen."""
    chosen = version.getbase()
    version.setbase("1.3")
    try:
        yield
    finally:
        version.VersionBase.instance().version_base = chosen


@contextmanager
def _own_state() -> Iterator[None]:
    """Have Hydra's state to oneself; that of an application around this one comes back."""
    kinds = (GlobalHydra, HydraConfig)
    with _lock, _version_base():
        saved = {kind: Singleton._instances.pop(kind, None) for kind in kinds}
        try:
            yield
        finally:
            for kind, instance in saved.items():
                Singleton._instances.pop(kind, None)
                if instance is not None:
                    Singleton._instances[kind] = instance


@contextmanager
def _command_line(flags: Sequence[str], overrides: Sequence[str]) -> Iterator[None]:
    """Let Hydra see a command line, raise its errors as they are, and keep its files away."""
    saved_argv, saved_flag = sys.argv, os.environ.get("HYDRA_FULL_ERROR")
    scratch = scratch_folder()
    arguments = [*flags, *overrides]
    if _is_multirun(flags, overrides) and not _values_of("hydra.sweep.dir", overrides):
        # Hydra's sweeper insists on writing multirun.yaml somewhere.
        arguments.append(f"hydra.sweep.dir={for_hydra(_sweep_folder(overrides, scratch))}")
    plugins = Plugins.instance()
    instantiate = plugins.instantiate_launcher

    def watched(hydra_context: Any, task_function: Any, config: DictConfig) -> Launcher:
        return WatchedLauncher(instantiate(hydra_context, task_function, config), config)

    sys.argv = ["infoplan", *arguments]
    os.environ["HYDRA_FULL_ERROR"] = "1"
    plugins.instantiate_launcher = watched  # type: ignore[method-assign]
    try:
        yield
    finally:
        plugins.instantiate_launcher = instantiate  # type: ignore[method-assign]
        sys.argv = saved_argv
        if saved_flag is None:
            del os.environ["HYDRA_FULL_ERROR"]
        else:
            os.environ["HYDRA_FULL_ERROR"] = saved_flag
        shutil.rmtree(scratch, ignore_errors=True)


def _sweep_folder(overrides: Sequence[str], scratch: str) -> str:
    """Where Hydra's files of a sweep go: to be kept if a launcher writes logs of its jobs there."""
    launcher = _values_of("hydra/launcher", overrides)[-1:]
    if not launcher or launcher[0] in ("infoplan", "basic", "joblib"):
        return scratch
    given = _values_of("results_dir", overrides)[-1:] or [Config().results_dir]
    results = typed_texts("results_dir", given[0])[0] or ""
    folder = user_path(results) / "hydra" / f"{datetime.now():%Y-%m-%d_%H-%M-%S}_{os.getpid()}"
    print(f"logs of the jobs and Hydra's files: {folder} (hydra.sweep.dir=)", file=sys.stderr)
    return str(folder)
