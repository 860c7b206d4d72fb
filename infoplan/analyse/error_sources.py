"""Where a mission's error comes from: its gap to BEST, split into parts that add up to it.

What each part means: docs/explain.md.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from infoplan.analyse.commands import run_command
from infoplan.analyse.configurations import Options, stored_options
from infoplan.analyse.statistics import Interval, mean_interval
from infoplan.analyse.stretches import demand_truth
from infoplan.analyse.tables import REPLAY, Selection, find_missions
from infoplan.collapse import GAIN
from infoplan.config import TreeSearchConfig
from infoplan.errors import RunError, UsageError
from infoplan.study.run_names import find_run, listed
from infoplan.study.store import (
    inspect_derived,
    list_missions,
    read_footer,
    read_table,
    table_path,
)
from infoplan.study.stored_curves import ended_collapsed, ended_moving
from infoplan.text_options import as_override
from infoplan.wording import spans

PARTS = {
    "learning": "learning",
    "spikes": "spikes let through",
    "lost": "clean samples lost",
    "places": "places",
    "best_itself": "BEST itself",
}
"""Parts of a gap, in the order in which they are told, and what people call them."""


@dataclass(frozen=True)
class ErrorSources:
    """Where the final errors of a run's missions come from.

    Attributes
    ----------
    run, best
        The run, and that of detector BEST that it is compared with.
    method, rho, scope
        What the run is.
    unit
        Of the errors: the terrain's.
    table
        One row a seed: ``seed``; ``rmse`` and ``best_rmse``, final, as stored; ``gap``, their
        difference; each of `PARTS`, whose sum is the gap; ``gain``, nats that the refit on the
        samples used gains; ``collapsed`` and ``moving``, what is known of the model at the end
        (`infoplan.collapse`), 1, 0 or NaN; ``converged``, whether all refits have.
    """

    run: str
    best: str
    method: str
    rho: float
    scope: str
    unit: str
    table: pd.DataFrame

    def interval(self, column: str) -> Interval:
        """Mean of a column over seeds with its 95 % t interval."""
        return mean_interval(self.table[column])

    @property
    def far(self) -> int:
        """How many missions gain more than 100 nats by a refit."""
        return int((self.table["gain"] > GAIN).sum())


def shapley_of_two(
    both: float, without_first: float, without_second: float, neither: float
) -> tuple[float, float]:
    """Share what two defects do together: the mean over both orders of taking them away.

    Parameters
    ----------
    both, without_first, without_second, neither
        An error with both defects, without the first, without the second, and without either.

    Returns
    -------
    first, second : float
        Shapley values (Contributions to the Theory of Games II, 1953); their sum is both - neither.
    """
    first = 0.5 * ((both - without_first) + (without_second - neither))
    second = 0.5 * ((both - without_second) + (without_first - neither))
    return first, second


def split_gap(
    rmse: float, refits: Mapping[str, float], best_rmse: float, best_refit: float
) -> dict[str, float]:
    """Split a mission's gap to BEST.

    Parameters
    ----------
    rmse
        Of the mission, as stored.
    refits
        Of its refits, by the samples that they are on (`infoplan.study.refits.DATA`).
    best_rmse, best_refit
        Of BEST with the same seed, as stored, and refit on its clean samples.

    Returns
    -------
    dict
        `PARTS`; their sum is rmse - best_rmse.
    """
    used, clean = refits["used"], refits["clean"]
    spikes, lost = shapley_of_two(
        used, refits["without_spikes"], refits["with_lost"], clean
    )  # fmt: skip
    return {
        "learning": rmse - used,
        "spikes": spikes,
        "lost": lost,
        "places": clean - best_refit,
        "best_itself": best_refit - best_rmse,
    }


def find_best(results_dir: Path, run: str, named: str | None = None) -> str:
    """Find the run of detector BEST that a run is compared with.

    Its options are the run's but for the detector, and the planner is UCT, with what options it
    shares with the run's.

    Parameters
    ----------
    results_dir
        Where the tables are.
    run
        The run's name.
    named
        Another run of detector BEST on the same map, as `find_run` finds it; None: as above.

    Raises
    ------
    UsageError
        If there is none, with the command that flies it, or several, or the one named is none.
    RunError
        If a curve of the run cannot be read.
    """
    selection = find_missions(results_dir, run=run)
    demand_truth(selection, "explanations")
    own = selection.options[run]
    if named is not None:
        return _checked_best(results_dir, own, find_run(results_dir, named))
    found = []
    for name, options in _configurations(results_dir).items():
        if options["detector.name"] == "best" and REPLAY not in options and _same(own, options):
            found.append(name)
    if run in found:
        raise UsageError(
            f"{run} is BEST itself, with which others are compared: name one of another detector, "
            "or another run of BEST with best="
        )
    if not found:
        raise UsageError(
            f"there is no run in {results_dir} with the options of {run} and the true labels as "
            f"its filter, to compare it with: fly it with {command_of_best(selection)}, or name "
            "one with best="
        )
    if len(found) > 1:
        raise UsageError(
            f"{run} can be compared with {listed(sorted(found), results_dir)}: choose with best="
        )
    return found[0]


def command_of_best(selection: Selection, seeds: Sequence[int] | None = None) -> str:
    """Write the command that flies UCT-BEST with the options of a run, and its seeds or others."""
    (run, own), = selection.options.items()  # fmt: skip
    kept = set(vars(TreeSearchConfig()))
    options = {
        name: value for name, value in own.items()
        if name != REPLAY
        and (not name.startswith("planner.") or name.removeprefix("planner.") in kept)
    }  # fmt: skip
    of_run = replace(selection, options={run: options})
    return run_command(of_run, "UCT-BEST", float(own["rho"]), seeds=seeds)


def common_seeds(results_dir: Path, run: str, best: str, seeds: Sequence[int] | None) -> list[int]:
    """List the seeds that a run and BEST both have, or of these the ones asked for.

    Raises
    ------
    UsageError
        If one that is asked for is not there, or they have none in common.
    """
    missions = list_missions(results_dir)
    common = sorted(set(missions[run]) & set(missions[best]))
    if seeds is None and common:
        return common
    wanted = sorted(set(missions[run] if seeds is None else seeds))
    not_flown, without_best = (
        [seed for seed in wanted if seed not in missions[name]] for name in (run, best)
    )
    told = []
    if not_flown:
        told.append(
            f"{_which(not_flown)} not stored of {run}: give the command that flew the others "
            f"{as_override('seeds', not_flown)}"
        )
    if without_best:
        fly = command_of_best(find_missions(results_dir, run=run), without_best)
        told.append(
            f"{_which(without_best)} not stored of {best}, to compare it with: fly it with {fly}"
        )
    if told:
        there = f"both have seeds {spans(common)}" if common else "they have no seed in common"
        raise UsageError(f"{'; '.join(told)}; {there}")
    return wanted


def _which(seeds: Sequence[int]) -> str:
    return f"seed{'s' if len(seeds) > 1 else ''} {spans(seeds)} {'are' if len(seeds) > 1 else 'is'}"


def has_refits(results_dir: Path, run: str, seed: int) -> bool:
    """Tell whether the refits of a mission are stored."""
    return inspect_derived(results_dir, "refits", run, seed).state == "done"


def explained(results_dir: Path, run: str, best: str, seeds: Sequence[int]) -> ErrorSources:
    """Read where the errors of a run's missions come from; nothing is computed.

    Parameters
    ----------
    results_dir
        Where the tables are.
    run, best
        The run, and the run of BEST.
    seeds
        Those whose refits are stored of both.

    Raises
    ------
    RunError
        If a table cannot be read.
    """
    rows = []
    for seed in seeds:
        curve = read_table(results_dir, "curves", run, seed).to_pandas()
        of_best = read_table(results_dir, "curves", best, seed).to_pandas()
        refits, best_refits = (
            read_table(results_dir, "refits", name, seed).to_pandas().set_index("data")
            for name in (run, best)
        )
        rmse, best_rmse = float(curve["rmse"].iloc[-1]), float(of_best["rmse"].iloc[-1])
        columns = {str(name): curve[name].to_numpy() for name in curve}
        collapsed = ended_collapsed(results_dir, run, seed, curve.iloc[-1].to_dict())
        moving = ended_moving(results_dir, run, seed, columns)
        clean = float(best_refits.loc["clean", "rmse"])
        rows.append(
            {"seed": seed, "rmse": rmse, "best_rmse": best_rmse, "gap": rmse - best_rmse}
            | split_gap(rmse, refits["rmse"].to_dict(), best_rmse, clean)
            | {
                "gain": float(refits.loc["used", "gain"]),
                "collapsed": np.nan if collapsed is None else float(collapsed),
                "moving": np.nan if moving is None else float(moving),
                "converged": bool(
                    refits["converged"].all() and best_refits.loc["clean", "converged"]
                ),
            }
        )
    selection = find_missions(results_dir, run=run)
    first = selection.missions.iloc[0]
    return ErrorSources(
        run, best, str(first["method"]), float(first["rho"]), str(first["scope"]),
        selection.unit, pd.DataFrame(rows),
    )  # fmt: skip


def stored_explanations(selection: Selection) -> list[ErrorSources]:
    """Read what `infoplan explain` has stored of some runs; those that it has not are left out.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_missions`; BEST is found among all stored runs.
    """
    folder, found = selection.results_dir, []
    for run in selection.options:
        done = [seed for seed in selection.seeds(run) if has_refits(folder, run, seed)]
        if not done:
            continue
        with suppress(UsageError):
            best = find_best(folder, run)
            there = set(list_missions(folder)[best])
            done = [seed for seed in done if seed in there and has_refits(folder, best, seed)]
            if done:
                found.append(explained(folder, run, best, done))
    return found


def _configurations(results_dir: Path) -> dict[str, Options]:
    """Read the configurations of the stored runs; one whose curve cannot be read is left out."""
    found = {}
    for run, seeds in list_missions(results_dir).items():
        with suppress(RunError):
            footer = read_footer(table_path(results_dir, "curves", run, seeds[0]))
            found[run] = stored_options(footer.configuration)
    return found


def _same(own: Options, best: Options) -> bool:
    """Whether a run of BEST differs from a run in detector and planner alone, and is UCT's."""
    if best["planner.name"] != "uct":
        return False
    rest = [{name: value for name, value in flat.items()
             if not name.startswith(("detector.", "planner.")) and name != REPLAY}
            for flat in (own, best)]  # fmt: skip
    planners = [{name: value for name, value in flat.items()
                 if name.startswith("planner.") and name != "planner.name"}
                for flat in (own, best)]  # fmt: skip
    shared = planners[0].keys() & planners[1].keys()
    return rest[0] == rest[1] and all(planners[0][name] == planners[1][name] for name in shared)


def _checked_best(results_dir: Path, own: Options, best: str) -> str:
    """Refuse a run that was named as BEST and cannot be compared."""
    options = find_missions(results_dir, run=best).options[best]
    if options["detector.name"] != "best":
        raise UsageError(f"best={best} has the detector {options['detector.name']}: name a run of "
                         "detector=best")  # fmt: skip
    for name in ("terrain.sha256", "terrain.extent", "grid", "budget", "rho"):
        if own[name] != options[name]:
            raise UsageError(
                f"best={best} has another {name} than the run that it is compared with "
                f"({options[name]}, not {own[name]}): name one that has the same"
            )
    return best
