"""Several logs of one place, made into one: one plane, one unit, no row twice."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.survey.log import SurveyLog, read_log
from infoplan.survey.raw import Refusal
from infoplan.units import METRES, unit_name
from infoplan.wording import counted, harmless

APART = 3.0
"""Logs are of one place while each lies so many sides of the longest from another, at most."""

DATED = 1e8
"""Seconds from which on they are taken to be since 1970: a clock from 0 takes three years."""

REPEATED = 10
"""So many rows in succession that are another log's are its own, where nobody tells times."""


def read_logs(
    paths: Sequence[Path],
    columns: Mapping[str, str] | None = None,
    crs: str | None = None,
    unit: str | None = None,
) -> SurveyLog:
    """Read one log, or several of one place as one.

    Parameters
    ----------
    paths
        At least one. Several are taken one after the other, each whole: in order of their first
        times if all tell dates, else as given.
    columns
        As of `read_log`; of several logs each takes those that it has.
    crs
        As of `read_log`; left out, it is the plane of the first log.
    unit
        As of `read_log`; of several logs it is that of those that tell none, and all are converted
        to that of the first.

    Returns
    -------
    SurveyLog
        Of several logs with `SurveyLog.parts`.

    Raises
    ------
    UsageError
        If one cannot be read, or they do not go together.
    """
    if len(paths) == 1:
        return read_log(paths[0], columns, crs, unit)
    whats = [harmless(path.name) for path in paths]
    first = read_log(paths[0], columns, crs, partial=True)
    logs = [first]
    for path, what in zip(paths[1:], whats[1:], strict=True):
        log = read_log(path, columns, crs or first.crs, partial=True)
        if crs is None and ("lat" in log.roles) != ("lat" in first.roles):
            raise UsageError(
                f"one of {whats[0]} and {what} is in degrees, the other in metres on a plane of "
                "its own: say which plane that is with crs=, as in crs=EPSG:32619"
            )
        logs.append(log)
    _check_given(columns or {}, logs)
    _check_different(logs, whats)
    logs = _in_one_unit(logs, whats, unit)
    _check_one_place(logs, whats)
    order, remarks = _ordered(logs, whats)
    logs = _without_repeated([logs[i] for i in order], [whats[i] for i in order])
    return _joined(_named_apart(logs), remarks)


def _check_given(columns: Mapping[str, str], logs: Sequence[SurveyLog]) -> None:
    for role, name in columns.items():
        if all(log.roles.get(role) != name for log in logs):
            raise UsageError(
                f"columns={{{harmless(role)}: {harmless(name)}}} is a column of none of the logs"
            )


def _check_different(logs: Sequence[SurveyLog], whats: Sequence[str]) -> None:
    for i, log in enumerate(logs):
        for j in range(i):
            if log.sha256 == logs[j].sha256:
                raise UsageError(f"{whats[j]} and {whats[i]} are the same log: give it once")


def _in_one_unit(
    logs: Sequence[SurveyLog], whats: Sequence[str], unit: str | None
) -> list[SurveyLog]:
    """Convert the values of all logs to the unit of the first."""
    stated = unit_name(unit or "")
    common = logs[0].unit or stated
    found = []
    for log, what in zip(logs, whats, strict=True):
        own, remarks, value = log.unit or stated, log.remarks, log.value
        if own != common:
            if not (own in METRES and common in METRES):
                told = f"in {harmless(common)}" if common else "in no known unit"
                other = f"in {harmless(own)}" if own else "in no known unit"
                raise UsageError(
                    f"{whats[0]} is {told} and {what} {other}: {', '.join(METRES)} are converted "
                    "into each other; where a log tells none, say it with unit="
                )
            value = value * (METRES[own] / METRES[common])
            remarks = [*remarks, f"values converted from {own} to {common}"]
        found.append(replace(log, value=value, unit=common, remarks=remarks))
    return found


def _check_one_place(logs: Sequence[SurveyLog], whats: Sequence[str]) -> None:
    """Refuse logs of which one lies far from all others."""
    boxes = [(log.x.min(axis=0), log.x.max(axis=0)) for log in logs]
    longest = max(float((high - low).max()) for low, high in boxes)
    for i, (low, high) in enumerate(boxes):
        gaps = [
            float(np.hypot(*np.maximum(np.maximum(low - others[1], others[0] - high), 0.0)))
            for j, others in enumerate(boxes)
            if j != i
        ]
        if min(gaps) > APART * longest:
            raise UsageError(
                f"{whats[i]} lies {min(gaps):.3g} m from the other logs, and the longest of them "
                f"spans {longest:.3g} m: that is not one place, so survey it alone"
            )


def _ordered(logs: Sequence[SurveyLog], whats: Sequence[str]) -> tuple[list[int], list[str]]:
    """Order logs by their first times, if all tell dates; returns their numbers and remarks."""
    first = [np.nan if log.time is None else float(log.time.min()) for log in logs]
    given = [*range(len(logs))]
    if not all(time >= DATED for time in first):
        return given, ["the logs are taken in the order given, as not all tell dates"]
    order = sorted(given, key=lambda i: first[i])
    if order == given:
        return given, []
    return order, [f"in order of time the logs are {', '.join(whats[i] for i in order)}"]


def _without_repeated(logs: Sequence[SurveyLog], whats: Sequence[str]) -> list[SurveyLog]:
    """Leave out of each log the rows that an earlier one has, too."""
    times = [log.time for log in logs if log.time is not None]
    timed = len(times) == len(logs)
    table = np.column_stack(
        [
            np.concatenate([log.x for log in logs]),
            np.nan_to_num(np.concatenate([log.value for log in logs]), nan=np.inf),
            np.concatenate(times) if timed else np.zeros(sum(map(len, logs))),
        ]
    )
    numbers = np.unique(table, axis=0, return_inverse=True)[1].ravel()
    ends = np.cumsum([len(log) for log in logs])
    ids = np.split(numbers, ends[:-1])
    length = 1 if timed else REPEATED
    found = [logs[0]]
    for i in range(1, len(logs)):
        log, again = logs[i], np.zeros(len(logs[i]), dtype=bool)
        refused = dict(log.refused)
        for j in range(i):
            here = _shared(ids[i], ids[j], length) & ~again
            again |= here
            refused |= dict.fromkeys(
                log.rows[here].tolist(), Refusal(f"the same as a row of {whats[j]}")
            )
        if again.all():
            raise UsageError(
                f"{whats[i]} holds no row that the other logs do not hold: leave it out"
            )
        remarks = log.remarks
        if again.any():
            told = f"{counted(int(again.sum()), 'sample')} left out: other logs hold them, too"
            remarks = [*remarks, told]
        found.append(
            replace(
                log, rows=log.rows[~again], x=log.x[~again], value=log.value[~again],
                time=None if log.time is None else log.time[~again], refused=refused,
                remarks=remarks,
            )
        )  # fmt: skip
    return found


def _shared(one: NDArray[np.int64], other: NDArray[np.int64], length: int) -> NDArray[np.bool_]:
    """Tell which of some numbers stand in a row of so many that the others hold, too."""
    shared = np.zeros(len(one), dtype=bool)
    if min(len(one), len(other)) < length:
        return shared
    windows, others = (
        np.lib.stride_tricks.sliding_window_view(numbers, length) for numbers in (one, other)
    )
    both = np.unique(np.concatenate([windows, others]), axis=0, return_inverse=True)[1].ravel()
    starts = np.flatnonzero(np.isin(both[: len(windows)], both[len(windows) :]))
    for offset in range(length):
        shared[starts + offset] = True
    return shared


def _named_apart(logs: Sequence[SurveyLog]) -> list[SurveyLog]:
    """Give logs whose files are called alike different names."""
    found: list[SurveyLog] = []
    for log in logs:
        taken = {other.name for other in found}
        name = next(
            name
            for number in range(1, len(logs) + 1)
            if (name := log.name if number == 1 else f"{log.name}-{number}") not in taken
        )
        found.append(replace(log, name=name))
    return found


def _joined(logs: Sequence[SurveyLog], remarks: list[str]) -> SurveyLog:
    """Put logs after one another."""
    starts = np.cumsum([0, *(len(log.columns) for log in logs)])
    first, others = logs[0], logs[1:]
    name = (
        f"{first.name}-{others[0].name}" if len(others) == 1 else f"{first.name}-and-{len(others)}"
    )
    timed = all(log.time is not None for log in logs)
    return SurveyLog(
        name=name,
        sha256=hashlib.sha256("".join(log.sha256 for log in logs).encode()).hexdigest(),
        columns=pd.concat([log.columns for log in logs], ignore_index=True),
        roles={f"{log.name} {role}": column for log in logs for role, column in log.roles.items()},
        rows=np.concatenate([log.rows + start for log, start in zip(logs, starts, strict=False)]),
        x=np.concatenate([log.x for log in logs]),
        value=np.concatenate([log.value for log in logs]),
        time=np.concatenate([log.time for log in logs if log.time is not None]) if timed else None,
        unit=first.unit,
        crs=first.crs,
        refused={
            row + int(start): reason
            for log, start in zip(logs, starts, strict=False)
            for row, reason in log.refused.items()
        },
        remarks=remarks,
        parts=tuple(logs),
    )
