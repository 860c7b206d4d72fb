"""All checks of stored missions, and what they find."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.analyse.audit.detector import (
    check_confusion,
    check_density,
    check_flags,
    check_scores,
    replay_detector,
)
from infoplan.analyse.audit.fault import check_errors, check_share
from infoplan.analyse.audit.logs import check_later_logs
from infoplan.analyse.audit.model import (
    check_earlier_models,
    check_final_model,
    check_final_scores,
    check_hyperparameters,
    check_stretches,
)
from infoplan.analyse.audit.robot import (
    check_actions,
    check_pilot,
    check_spot_turns,
    check_steps,
    check_workspace,
)
from infoplan.analyse.audit.sensing import (
    check_sensor,
    check_spike_count,
    check_spike_draws,
    check_spike_size,
    check_truth,
)
from infoplan.analyse.audit.stored import (
    Epochs,
    FaultError,
    Partial,
    StoredMission,
    read_mission,
)
from infoplan.analyse.audit.tables import (
    check_bounds,
    check_configuration,
    check_digests,
    check_grid,
    check_rows,
    check_times,
    check_values,
)
from infoplan.config import is_survey
from infoplan.errors import UsageError
from infoplan.study.run_names import choose_run
from infoplan.study.store import list_missions
from infoplan.text_options import as_command
from infoplan.threads import one_thread
from infoplan.wording import harmless

CHECKS: dict[str, Callable[[StoredMission], str | Partial]] = {
    "digests": check_digests,
    "values": check_values,
    "rows": check_rows,
    "configuration": check_configuration,
    "times": check_times,
    "bounds": check_bounds,
    "grid": check_grid,
    "pilot": check_pilot,
    "steps": check_steps,
    "actions": check_actions,
    "spot turns": check_spot_turns,
    "workspace": check_workspace,
    "truth": check_truth,
    "sensor": check_sensor,
    "spike count": check_spike_count,
    "spike size": check_spike_size,
    "spike draws": check_spike_draws,
    "outlier share": check_share,
    "outlier errors": check_errors,
    "scores": check_scores,
    "flags": check_flags,
    "confusion": check_confusion,
    "outlier density": check_density,
    "hyperparameters": check_hyperparameters,
    "final scores": check_final_scores,
    "final model": check_final_model,
    "earlier models": check_earlier_models,
    "stretches": check_stretches,
    "later logs": check_later_logs,
}
"""Checks by name, in order."""

OF_TRUTH = (
    "bounds", "truth", "sensor", "spike count", "spike size", "spike draws", "outlier share",
    "outlier errors", "confusion", "final scores",
)  # fmt: skip
OF_ROBOT = ("pilot", "steps", "actions", "spot turns")
"""Checks that no survey can be put to: nobody knows its truth, and somebody else drove."""

SPIKE = "spike"
SPIKES_ONLY = ("spike count", "spike size", "spike draws")
NEVER_SPIKES = ("outlier share", "outlier errors")
"""Checks that not every fault is put to."""


@dataclass(frozen=True)
class Finding:
    """What one check found in one mission.

    Attributes
    ----------
    run, seed
        The mission.
    check
        Name of the check.
    holds
        Whether the tables agree with what was recomputed.
    detail
        One short sentence with numbers; on failure it names the first offending sample or epoch,
        samples counted from 0 in order of collection. Empty where nothing could be recomputed.
    omitted
        What was not recomputed, and why; empty if nothing was left out.
    """

    run: str
    seed: int
    check: str
    holds: bool
    detail: str
    omitted: str = ""


def audit(
    results_dir: Path,
    run: str | None = None,
    seeds: Sequence[int] | None = None,
    terrains: Mapping[str, NDArray[Any]] | None = None,
    epochs: Any = None,
) -> Iterator[Finding]:
    """Recompute all stored missions, or some of them.

    Parameters
    ----------
    results_dir
        The folder that holds ``runs``, ``curves``, ``samples`` and ``maps``.
    run
        Name of a run, its hash, or the beginning of either; None for all.
    seeds
        Seeds to look at; None for all.
    terrains
        Elevations by the digest of the terrain, each of shape (R, C); only a run whose terrain is
        among them has its truth checked.
    epochs
        Whose models are fitted again, besides the last: ``all`` (or None), a number of them, evenly
        spread, or a list.

    Returns
    -------
    iterator of Finding
        Mission by mission, computed as it is asked for.

    Raises
    ------
    UsageError
        If nothing of what is asked for is stored, or `epochs` is none of these.
    """
    chosen = _epochs(epochs)
    listed = list_missions(results_dir)
    stored = sorted((name, seed) for name, found in listed.items() for seed in found)
    if not stored:
        raise UsageError(
            f"results_dir={results_dir} holds no finished mission to audit: fly one with "
            f"{as_command('infoplan run', results_dir)}, or name the folder that holds curves/"
        )
    runs = sorted({name for name, _ in stored})
    if run is not None:
        run = choose_run(run, runs, results_dir)
        stored = [(name, seed) for name, seed in stored if name == run]
    if seeds is not None:
        present = {seed for _, seed in stored}
        # The first will do: a count may stand for a thousand million of them.
        missing = next((seed for seed in seeds if seed not in present), None)
        if missing is not None:
            raise UsageError(
                f"seed {missing} of {run or 'any run'} is not stored in {results_dir}: "
                f"use some of {sorted(present)}"
            )
        stored = [(name, seed) for name, seed in stored if seed in seeds]
    return (
        finding
        for name, seed in stored
        for finding in audit_mission(results_dir, name, seed, terrains, chosen)
    )


def audit_mission(
    results_dir: Path,
    run: str,
    seed: int,
    terrains: Mapping[str, NDArray[Any]] | None = None,
    epochs: Epochs = None,
) -> list[Finding]:
    """Recompute one stored mission.

    Parameters
    ----------
    results_dir, run, seed
        Where, and which.
    terrains
        Elevations by the terrain's digest, as in `audit`.
    epochs
        A number, a list, or None for all, as in `audit`.

    Returns
    -------
    list of Finding
        One a check. A file that is missing, truncated or of another kind is a failed finding, and
        the only one.
    """
    try:
        mission = read_mission(results_dir, run, seed, terrains or {}, epochs, replay_detector)
    except FaultError as fault:
        return [Finding(run, seed, "files", False, _line(str(fault)))]
    columns = sum(len(table.columns) for table in mission.tables.values())
    files = f"{len(mission.tables)} tables with {columns} columns and a YAML"
    findings = [Finding(run, seed, "files", True, files)]
    for name, check in CHECKS.items():
        holds, omitted = True, ""
        try:
            if name in SPIKES_ONLY and mission.option("fault.name") != SPIKE:
                continue
            if name == "stretches" and not is_survey(mission.option("terrain.name")):
                continue
            if name == "later logs" and "origins" not in mission.tables:
                continue
            if name in NEVER_SPIKES and mission.option("fault.name") == SPIKE:
                continue
            with one_thread(), np.errstate(all="ignore"):  # a check that fails says so itself
                told = _without_truth(mission, name) or check(mission)
            detail, omitted = (told, "") if isinstance(told, str) else (told.detail, told.omitted)
        except FaultError as fault:
            detail, holds = str(fault), False
        except (ArithmeticError, LookupError, MemoryError, TypeError, ValueError) as error:
            # The tables are so far off that the recomputation itself breaks.
            detail, holds = f"cannot be recomputed ({type(error).__name__}: {error})", False
        findings.append(Finding(run, seed, name, holds, _line(detail), _line(omitted)))
    return findings


def _without_truth(mission: StoredMission, check: str) -> Partial | None:
    """Say what a survey cannot be asked; None if it can."""
    if not is_survey(mission.option("terrain.name")):
        return None
    if check in OF_TRUTH:
        return Partial("", "nobody knows the truth of a survey")
    if check in OF_ROBOT:
        return Partial("", "whoever made the survey drove")
    return None


def _line(text: str) -> str:
    return harmless(" ".join(text.split()))


def _epochs(chosen: Any) -> Epochs:
    """Read which epochs are to be recomputed."""
    if chosen is None or chosen == "all":
        return None
    whole = [chosen] if isinstance(chosen, int) else chosen
    if (
        not isinstance(whole, list)
        or any(
            isinstance(epoch, bool) or not isinstance(epoch, int) or epoch < 0 for epoch in whole
        )
        or chosen == 0
    ):
        raise UsageError(
            f"epochs={chosen} chooses nothing: use all, a number of epochs of at least 1, or a list"
            " of them such as [0,5,9]"
        )
    found: Epochs = chosen
    return found
