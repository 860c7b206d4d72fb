"""All checks of stored missions, and how their findings read."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from infoplan.analyse.audit.detector import (
    check_confusion,
    check_density,
    check_flags,
    check_scores,
)
from infoplan.analyse.audit.model import (
    check_earlier_models,
    check_final_model,
    check_final_scores,
    check_hyperparameters,
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
from infoplan.analyse.audit.stored import FaultError, StoredMission, read_mission, stored_missions
from infoplan.analyse.audit.tables import check_configuration, check_grid, check_rows, check_values
from infoplan.errors import UsageError

CHECKS: dict[str, Callable[[StoredMission], str]] = {
    "values": check_values,
    "rows": check_rows,
    "configuration": check_configuration,
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
    "scores": check_scores,
    "flags": check_flags,
    "confusion": check_confusion,
    "outlier density": check_density,
    "hyperparameters": check_hyperparameters,
    "final scores": check_final_scores,
    "final model": check_final_model,
    "earlier models": check_earlier_models,
}
"""Checks by name, in order; one that does not apply returns an empty sentence."""


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
        samples counted from 0 in order of collection.
    """

    run: str
    seed: int
    check: str
    holds: bool
    detail: str


def audit(
    results_dir: Path,
    run: str | None = None,
    seeds: Sequence[int] | None = None,
    terrains: Mapping[str, NDArray[Any]] | None = None,
) -> Iterator[Finding]:
    """Recompute all stored missions, or some of them.

    Parameters
    ----------
    results_dir
        The folder that holds ``runs``, ``curves``, ``samples`` and ``maps``.
    run
        Name of a run; None for all.
    seeds
        Seeds to look at; None for all.
    terrains
        Elevations by the digest of the terrain, each of shape (R, C); only a run whose terrain is
        among them has its truth checked.

    Returns
    -------
    iterator of Finding
        Mission by mission, computed as it is asked for.

    Raises
    ------
    UsageError
        If nothing of what is asked for is stored.
    """
    stored = stored_missions(results_dir)
    if not stored:
        raise UsageError(
            f"results_dir={results_dir} holds no finished mission to audit: fly one with "
            "infoplan run, or name the folder that holds curves/"
        )
    runs = sorted({name for name, _ in stored})
    if run is not None:
        if run not in runs:
            raise UsageError(f"run={run} is not stored in {results_dir}: use {' or '.join(runs)}")
        stored = [(name, seed) for name, seed in stored if name == run]
    if seeds is not None:
        present = sorted({seed for _, seed in stored})
        missing = [seed for seed in seeds if seed not in present]
        if missing:
            raise UsageError(
                f"seeds={missing} of {run or 'any run'} are not stored in {results_dir}: "
                f"use some of {present}"
            )
        stored = [(name, seed) for name, seed in stored if seed in seeds]
    return (
        finding
        for name, seed in stored
        for finding in audit_mission(results_dir, name, seed, terrains=terrains)
    )


def audit_mission(
    results_dir: Path,
    run: str,
    seed: int,
    terrains: Mapping[str, NDArray[Any]] | None = None,
) -> list[Finding]:
    """Recompute one stored mission.

    Parameters
    ----------
    results_dir, run, seed
        Where, and which.
    terrains
        Elevations by the terrain's digest, as in `audit`.

    Returns
    -------
    list of Finding
        One a check. A file that is missing, truncated or of another kind is a failed finding, and
        the only one.
    """
    try:
        mission = read_mission(results_dir, run, seed, terrains or {})
    except FaultError as fault:
        return [Finding(run, seed, "files", False, str(fault))]
    columns = sum(len(table.columns) for table in (mission.curves, mission.samples, mission.maps))
    findings = [Finding(run, seed, "files", True, f"3 tables with {columns} columns and a YAML")]
    for name, check in CHECKS.items():
        try:
            detail, holds = check(mission), True
        except FaultError as fault:
            detail, holds = str(fault), False
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            # The tables are so far off that the recomputation itself breaks.
            detail, holds = f"cannot be recomputed ({type(error).__name__}: {error})", False
        if detail:
            findings.append(Finding(run, seed, name, holds, " ".join(detail.split())))
    return findings


def render(findings: Iterable[Finding]) -> str:
    """Lay findings out as a plain table, grouped by run.

    Parameters
    ----------
    findings
        Of any number of missions.

    Returns
    -------
    str
        A line a run and check: ``holds`` or ``FAILS``, how many missions do, and the detail of
        each that fails, or of the only one there is; the last line counts everything.
    """
    everything = list(findings)
    lines = []
    for run in dict.fromkeys(finding.run for finding in everything):
        of_run = [finding for finding in everything if finding.run == run]
        missions = len({finding.seed for finding in of_run})
        lines.append(f"{run}: {_missions(missions)}")
        for check in dict.fromkeys(finding.check for finding in of_run):
            lines += _render_check([finding for finding in of_run if finding.check == check])
        lines.append("")
    failed = sum(not finding.holds for finding in everything)
    missions = len({(finding.run, finding.seed) for finding in everything})
    verdict = f"{failed} FAIL" if failed else "all hold"
    lines.append(f"{_missions(missions)}, {len(everything)} checks: {verdict}")
    return "\n".join(lines)


def _missions(count: int) -> str:
    return f"{count} mission{'' if count == 1 else 's'}"


def _render_check(findings: list[Finding]) -> list[str]:
    """Lines of one check of one run."""
    failed = [finding for finding in findings if not finding.holds]
    count = f"{len(failed) or len(findings)} of {len(findings)}"
    head = f"  {findings[0].check:<17} {'FAILS' if failed else 'holds'} {count:>9}"
    if failed:
        details = [f"seed {finding.seed}: {finding.detail}" for finding in failed]
    else:
        details = [findings[0].detail] if len(findings) == 1 else [""]
    return [
        f"{head if i == 0 else ' ' * len(head)}  {detail}".rstrip()
        for i, detail in enumerate(details)
    ]
