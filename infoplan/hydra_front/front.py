"""The front of Hydra: a command line becomes configurations that are acted on as one study.

Hydra runs one job after the other and answers a usage error in its own words; here a launcher of
our own sends all jobs of a multirun to one pool, and errors become one sentence.
"""

import io
import os
import shutil
import sys
from collections.abc import Container, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout
from datetime import datetime
from typing import Any

import hydra
from hydra._internal.hydra import Hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.singleton import Singleton
from hydra.plugins.launcher import Launcher
from hydra.plugins.sweeper import Sweeper
from omegaconf import DictConfig

from infoplan.caches import scratch_folder
from infoplan.config import Config
from infoplan.errors import RunError, UsageError
from infoplan.files import user_path
from infoplan.hydra_front.compose import LOCK, register, version_base
from infoplan.hydra_front.explain import explained
from infoplan.hydra_front.flags import given_flags, sort_arguments
from infoplan.hydra_front.jobs import Act, begin, task_of
from infoplan.hydra_front.launchers import WatchedLauncher, prepare_sweep, register_launcher
from infoplan.hydra_front.overrides import is_multirun, readable, values_of
from infoplan.hydra_front.trials import best_trial
from infoplan.text_options import for_hydra, typed_texts


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
    flags, overrides = sort_arguments(arguments)
    given = given_flags(flags)
    if "--shell-completion" not in given:
        overrides = readable(overrides, several=is_multirun(flags, overrides))
    entry = hydra.main(version_base="1.3", config_path="pkg://infoplan.conf", config_name="config")
    quiet = redirect_stderr(io.StringIO()) if "--package" in given else nullcontext()
    single = _composed_once() if _sets_no_mode(given, overrides) else nullcontext()
    with _own_state(), _command_line(flags, overrides), single, quiet:
        register()
        register_launcher()
        now = begin(act)
        try:
            with explained(now.statuses):
                entry(task_of(act))()
        except RunError:
            if now.trials:
                print(best_trial(now.trials))
            raise
        except SystemExit as stop:
            if stop.code and "--package" in given:
                raise UsageError(
                    f"--package {given['--package']} is no part of the configuration: name a "
                    "group, such as planner, or hydra"
                ) from stop
            # Hydra's own pages end with 0.
            return int(stop.code or 0)
    for status in now.statuses:
        if isinstance(status, Exception):
            raise status
    if now.trials:
        print(best_trial(now.trials))
    return max((status for status in now.statuses if isinstance(status, int)), default=0)


def complete_word(incomplete: str) -> list[str]:
    """Complete a word of ``infoplan run`` that is Hydra's own, like ``hydra/launcher=``."""
    line = f"infoplan {incomplete}"
    told = io.StringIO()
    os.environ |= {"COMP_LINE": line, "COMP_POINT": str(len(line))}
    with redirect_stdout(told):
        compose_and(lambda configs: (0, []), ["-sc", "query=bash"])
    return told.getvalue().split()


@contextmanager
def _own_state() -> Iterator[None]:
    """Have Hydra's state to oneself; that of an application around this one comes back."""
    kinds = (GlobalHydra, HydraConfig)
    with LOCK, version_base():
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
    if is_multirun(flags, overrides) and not values_of("hydra.sweep.dir", overrides):
        # Hydra's sweeper insists on writing multirun.yaml somewhere.
        arguments.append(f"hydra.sweep.dir={for_hydra(_sweep_folder(overrides, scratch))}")
    plugins = Plugins.instance()
    launcher_of, sweeper_of = plugins.instantiate_launcher, plugins.instantiate_sweeper

    def watched(hydra_context: Any, task_function: Any, config: DictConfig) -> Launcher:
        return WatchedLauncher(launcher_of(hydra_context, task_function, config), config)

    def prepared(*, hydra_context: Any, task_function: Any, config: DictConfig) -> Sweeper:
        prepare_sweep(config)
        return sweeper_of(hydra_context=hydra_context, task_function=task_function, config=config)

    sys.argv = ["infoplan", *arguments]
    os.environ["HYDRA_FULL_ERROR"] = "1"
    plugins.instantiate_launcher = watched  # type: ignore[method-assign]
    plugins.instantiate_sweeper = prepared  # type: ignore[method-assign]
    try:
        yield
    finally:
        plugins.instantiate_launcher = launcher_of  # type: ignore[method-assign]
        plugins.instantiate_sweeper = sweeper_of  # type: ignore[method-assign]
        sys.argv = saved_argv
        if saved_flag is None:
            del os.environ["HYDRA_FULL_ERROR"]
        else:
            os.environ["HYDRA_FULL_ERROR"] = saved_flag
        shutil.rmtree(scratch, ignore_errors=True)


def _sets_no_mode(given: Container[str], overrides: Sequence[str]) -> bool:
    """Tell that nothing says ``hydra.mode``: no configuration of the user's, no option of Hydra."""
    own = any(flag in given for flag in ("--config-path", "--config-name", "--config-dir"))
    return not own and not any(word.lstrip("+~").startswith("hydra") for word in overrides)


@contextmanager
def _composed_once() -> Iterator[None]:
    """Keep Hydra from composing everything once more to learn a mode that nothing sets."""
    get_mode = Hydra.get_mode
    Hydra.get_mode = lambda *_, **__: None  # type: ignore[method-assign]
    try:
        yield
    finally:
        Hydra.get_mode = get_mode  # type: ignore[method-assign]


def _sweep_folder(overrides: Sequence[str], scratch: str) -> str:
    """Where Hydra's files of a sweep go: to be kept if a launcher writes logs of its jobs there."""
    launcher = values_of("hydra/launcher", overrides)[-1:]
    if not launcher or launcher[0] in ("infoplan", "basic", "joblib"):
        return scratch
    given = values_of("results_dir", overrides)[-1:] or [Config().results_dir]
    results = typed_texts("results_dir", given[0])[0] or ""
    folder = user_path(results) / "hydra" / f"{datetime.now():%Y-%m-%d_%H-%M-%S}_{os.getpid()}"
    print(f"logs of the jobs and Hydra's files: {folder} (hydra.sweep.dir=)", file=sys.stderr)
    return str(folder)
