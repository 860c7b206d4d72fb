"""What the commands about studies do: run, show what would run, replay, explain, look at them.

A study that is stored already is shown without what missions need: imports of SciPy and Numba wait.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from infoplan.analyse.configurations import stored_options
from infoplan.analyse.status import Status, look, look_at_all
from infoplan.config import Config, is_survey, validate
from infoplan.draw.console import say, wide_console
from infoplan.draw.progress import listener
from infoplan.draw.status_table import print_status
from infoplan.draw.study_tables import print_plan, print_summary
from infoplan.errors import UsageError
from infoplan.hydra_front.compose import compose
from infoplan.hydra_front.front import compose_and
from infoplan.hydra_front.jobs import Act
from infoplan.hydra_front.trials import Score
from infoplan.output import Output
from infoplan.palette import TERMINAL
from infoplan.study.run_names import choose_run
from infoplan.study.runner import check_study, identify_study, plan_study, run_study
from infoplan.study.stored_curves import final_rmse

if TYPE_CHECKING:
    from infoplan.analyse.error_sources import ErrorSources


def run(arguments: list[str]) -> int:
    """Run ``infoplan run`` with Hydra's command line; return the exit status."""
    if "--dry-run" in arguments:
        rest = [argument for argument in arguments if argument != "--dry-run"]
        return compose_and(show_plan, rest)
    return compose_and(run_and_print, arguments)


def run_and_print(configs: list[Config]) -> tuple[int, list[float]]:
    """Run a study; give the exit status and the mean final RMSE of each configuration."""
    console = wide_console()
    study = run_study(configs, listener(console))
    print_summary(study, console)
    sys.stdout.flush()
    if isinstance(sys.stdout, Output):
        sys.stdout.tell_unread()  # of a study whoever listened is told why it went on
    finals = zip(final_rmse(study), study.names, strict=True)
    return int(bool(study.failed)), [Score(number, name) for number, name in finals]


def show_plan(configs: list[Config]) -> tuple[int, list[float]]:
    """Print what a study would fly; give the exit status and the numbers that are stored."""
    console = wide_console()
    check_study(configs)
    study = plan_study(configs, listener(console).say)
    print_plan(study, configs[0], console)
    return 0, final_rmse(study)


def replay(
    results_dir: Path, run: str, seeds: Sequence[int] | None, trust: bool, overrides: list[str]
) -> int:
    """Run ``infoplan replay``.

    Parameters
    ----------
    results_dir
        The folder of the tables.
    run
        The stored run, as `infoplan.study.run_names` finds it.
    seeds
        Which of its missions; None: all that are done.
    trust
        Whether a detector's or model's function that the stored run names may be imported; one
        that an override names may.
    overrides
        As of `reconfigure`.

    Returns
    -------
    int
        1 if a replay has failed, else 0.
    """
    from infoplan.draw.replay_table import print_replay
    from infoplan.hydra_front.reconfigure import how_to_replay, named_functions, reconfigure
    from infoplan.study.replay import find_flown, replay_study
    from infoplan.study.surveys import check_judging
    from infoplan.trust import admit

    console = wide_console()
    listening = listener(console)
    compose(how_to_replay(overrides))  # what is wrong there is told whatever the run
    source = find_flown(results_dir, run)
    config = reconfigure(source.config, overrides)
    if is_survey(config.terrain.name):
        check_judging(config)
    admit(config, source.science, named_functions(overrides), trust,
          lambda text: listening.say(text, "note"))  # fmt: skip
    study = replay_study(results_dir, source, config, seeds, listening)
    print_replay(study, console)
    return int(bool(study.failed))


def explain(
    results_dir: Path,
    runs: Sequence[str],
    best: str | None,
    seeds: Sequence[int] | None,
    overrides: list[str],
    console: Console,
) -> "tuple[list[ErrorSources], int]":
    """Compute where the errors of stored runs come from, as far as it is not stored.

    Parameters
    ----------
    results_dir
        The folder of the tables.
    runs
        As `infoplan.study.run_names` finds them.
    best
        The run of BEST that all are compared with; None: found for each.
    seeds
        Which missions; None: all that a run and BEST both have.
    overrides
        How it is run.
    console
        Where progress is told.

    Returns
    -------
    sources : list of ErrorSources
        Of the runs with a mission that could be computed.
    failed : int
        How many missions could not.
    """
    from infoplan.analyse.error_sources import common_seeds, explained, find_best
    from infoplan.study.refit import demand_refittable, refit_study
    from infoplan.study.replay import find_flown

    config = compose(overrides)
    validate(config)
    flown = {source.name: source for source in (find_flown(results_dir, run) for run in runs)}
    for source in flown.values():
        demand_refittable(source)
    compared = {name: find_best(results_dir, name, best) for name in flown}
    chosen = {name: common_seeds(results_dir, name, of, seeds) for name, of in compared.items()}
    wanted: dict[str, dict[int, None]] = {}
    for name, of in compared.items():
        for run in (of, name):
            wanted.setdefault(run, {}).update(dict.fromkeys(chosen[name]))
    sources = {name: flown.get(name) or find_flown(results_dir, name) for name in wanted}
    study = refit_study(
        results_dir, [(sources[name], list(of_run)) for name, of_run in wanted.items()], config,
        listener(console),
    )  # fmt: skip
    for label, reason, path in study.failed:
        say(console, f"FAILED {label}: {reason} ({path})", style=TERMINAL["failure"])
    told = []
    for name, of in compared.items():
        done = [seed for seed in chosen[name] if {(name, seed), (of, seed)} <= study.done]
        if done:
            told.append(explained(results_dir, name, of, done))
    return told, len(study.failed)


def status(results_dir: Path, overrides: Sequence[str], run: str | None, as_json: bool) -> int:
    """Run ``infoplan status``.

    Parameters
    ----------
    results_dir
        The folder of the tables.
    overrides
        As of ``infoplan run -m``: the study that is looked at. Without any, all stored runs are,
        with the seeds of all of them as those wanted of each.
    run
        One stored run, as `infoplan.study.run_names` finds it.
    as_json
        Write it for scripts.

    Returns
    -------
    int
        0, whatever is done or missing.

    Raises
    ------
    UsageError
        If there is no such folder, no such run, or the overrides are wrong.
    """
    if overrides and run is not None:
        raise UsageError(
            f"run={run} and {overrides[0]} ask for two things: name a stored run, or describe a "
            "study"
        )
    if overrides:
        return compose_and(_status_of_study(as_json), ["-m", *overrides])
    found = look_at_all(results_dir)
    if run is not None:
        name = choose_run(run, [one.run for one in found.runs], results_dir)
        found.runs = [one for one in found.runs if one.run == name]
        found.problems = [problem for problem in found.problems if name in problem]
    _print_status(found, as_json)
    return 0


def _status_of_study(as_json: bool) -> Act:
    def act(configs: list[Config]) -> tuple[int, list[float]]:
        check_study(configs)
        # A warning about the map would not be JSON.
        console = Console(stderr=True) if as_json else wide_console()
        study = identify_study(configs, listener(console).say)
        wanted = {run.name: seeds for run, seeds in study.runs}
        options = {run.name: stored_options(run.science) for run, _ in study.runs}
        _print_status(look(study.results_dir, wanted, options), as_json)
        return 0, [float("nan")] * len(configs)

    return act


def _print_status(found: Status, as_json: bool) -> None:
    if as_json:
        print(json.dumps(asdict(found), indent=2))
    else:
        print_status(found, wide_console())
