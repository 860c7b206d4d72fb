"""A survey's log as infoplan takes it: samples in order of time, on a plane in metres."""

import hashlib
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.errors import UsageError
from infoplan.files import read_regular
from infoplan.survey.delimited import read_delimited
from infoplan.survey.gpx import read_gpx
from infoplan.survey.names import ROLES, roles_of, split_name
from infoplan.survey.netcdf import read_netcdf
from infoplan.survey.parquet import read_parquet
from infoplan.survey.projection import checked_crs, to_metres, utm_zone
from infoplan.survey.raw import FEWEST, RawLog, Refusal
from infoplan.survey.times import seconds_of
from infoplan.units import METRES, unit_name
from infoplan.wording import counted, harmless

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

READERS: dict[str, Callable[[bytes, str], RawLog]] = {
    **dict.fromkeys((".csv", ".tsv", ".txt"), read_delimited),
    ".gpx": read_gpx,
    **dict.fromkeys((".nc", ".nc4", ".cdf"), read_netcdf),
    **dict.fromkeys((".parquet", ".pq"), read_parquet),
}
"""What reads a log, by the end of its name."""

MAX_LOG = 1 << 28
"""Size of a log, in bytes, at most."""

MOST_REFUSED = 0.1
"""Share of rows that may be refused; with more the log is not what it is taken for."""

ABSENT = frozenset({"", "nan", "na", "n/a", "null", "none", "-", "nat"})
"""Words for a value that is missing, small letters."""

LARGEST = 1e100
"""Largest value in size that is read."""


@dataclass(frozen=True)
class SurveyLog:
    """A log that was read.

    Attributes
    ----------
    name
        The stem of its file, fit for the name of a folder.
    sha256
        Digest of its bytes.
    columns
        Its columns as they were, a row a sample, in the order of the file.
    roles
        Names of the columns that were read, by role (`ROLES`).
    rows
        Rows of `columns` that are samples, in order of time, shape (n,).
    x
        Their easting and northing, metres, shape (n, 2).
    value
        What was measured, NaN where it is missing, shape (n,).
    time
        Seconds since any moment, shape (n,); None: the log tells no times.
    unit
        Of the values; empty where nobody has told it.
    crs
        Coordinate reference system of `x`, as ``EPSG:32619``; None: a plane of the log's own.
    refused
        Rows that are no samples, and why.
    remarks
        What the reader has met: sentences with counts.
    parts
        Of several logs made into one (`infoplan.survey.several`), each of them, in order; else
        none.
    """

    name: str
    sha256: str
    columns: pd.DataFrame
    roles: dict[str, str]
    rows: Integers
    x: Floats
    value: Floats
    time: Floats | None
    unit: str
    crs: str | None
    refused: dict[int, Refusal]
    remarks: list[str]
    parts: tuple["SurveyLog", ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def log_of(self) -> Integers:
        """Which of `parts` each sample is of, shape (n,); 0 of a log that has none."""
        return np.repeat(np.arange(len(self.parts) or 1), [*map(len, self.parts or (self,))])


def read_log(
    path: Path,
    columns: Mapping[str, str] | None = None,
    crs: str | None = None,
    unit: str | None = None,
    *,
    partial: bool = False,
) -> SurveyLog:
    """Read the log of a survey.

    Parameters
    ----------
    path
        CSV or TSV with a header, GPX, NetCDF or Parquet, by the end of its name (`READERS`).
    columns
        Names of columns by role, where they are not to be recognised.
    crs
        The plane: degrees are projected to it, metres are taken to be its; None: the local UTM
        zone, and metres are on a plane of their own.
    unit
        Of the values, where the log does not tell it or tells a wrong one.
    partial
        Whether `columns` may name some that this log has not.

    Raises
    ------
    UsageError
        If the log cannot be read: names the file, and the line and column where there are any.
    """
    what = harmless(path.name)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise UsageError(
            f"{harmless(path)} is no log that is read: give one of {', '.join(sorted(READERS))}"
        )
    try:
        content = read_regular(path, MAX_LOG)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise UsageError(f"{harmless(path)} cannot be read ({reason}): name a log") from error
    if content.lstrip()[:20].lower().startswith((b"<!doctype html", b"<html")):
        raise UsageError(
            f"{what} is a page of a website, perhaps one that asks to sign in, and no log: "
            "download the log once more"
        )
    raw = reader(content, what)
    names = [str(name) for name in raw.columns]
    given = {role: name for role, name in (columns or {}).items()
             if not (partial and role in ROLES and name not in names)}  # fmt: skip
    roles = roles_of(names, given, what)
    refused = dict(raw.refused)
    numbers: dict[str, Floats] = {
        role: _numbers(raw, roles[role], role, refused)
        for role in ("lat", "lon", "x", "y", "value")
        if role in roles
    }
    time = _times(raw, roles, refused)
    _check_refused(raw, refused, what)
    remarks = []
    if refused:
        row = min(refused)
        others = f" (and {counted(len(refused) - 1, 'other')})" if len(refused) > 1 else ""
        remarks.append(
            f"{counted(len(refused), raw.place)} left out: {raw.where(row)}{others}: {refused[row]}"
        )
    here, there = ("lat", "lon") if "lat" in roles else ("x", "y")
    placed = np.isfinite(numbers[here]) & np.isfinite(numbers[there])
    unplaced = [row for row in np.flatnonzero(~placed).tolist() if row not in refused]
    refused |= dict.fromkeys(unplaced, Refusal("no position"))
    if lost := len(unplaced):
        remarks.append(f"{counted(lost, raw.place)} without a position left out")
    rows = np.array([row for row in range(len(raw.columns)) if row not in refused], dtype=np.int64)
    if np.isfinite(numbers["value"][rows]).sum() < FEWEST:
        raise UsageError(
            f"{what} has {counted(len(rows), 'sample')} with a position, "
            f"{np.isfinite(numbers['value'][rows]).sum()} of them with a value: it takes {FEWEST}"
        )
    if time is not None:
        rows = rows[_order(time[rows], remarks, raw.place)]
    x, plane = _plane({role: entry[rows] for role, entry in numbers.items()}, raw, roles, crs, what)
    if np.any(np.ptp(x, axis=0) == 0):
        raise UsageError(
            f"{what} lies on a line, or in a point: its positions must differ both ways"
        )
    value = numbers["value"][rows]
    if missing := int(np.isnan(value).sum()):
        remarks.append(f"{counted(missing, 'sample')} without a value: kept, and never used")
    _, first = np.unique(x, axis=0, return_index=True)
    if repeated := len(x) - len(first):
        remarks.append(f"{counted(repeated, 'sample')} where another was taken before: all kept")
    told = raw.units.get(roles["value"]) or split_name(roles["value"])[1]
    return SurveyLog(
        name=re.sub(r"[^A-Za-z0-9_-]+", "-", path.stem).strip("-") or "log",
        sha256=hashlib.sha256(content).hexdigest(),
        columns=raw.columns, roles=roles, rows=rows, x=x, value=value,
        time=None if time is None else time[rows],
        unit=unit_name(unit if unit is not None else told), crs=plane, refused=refused,
        remarks=remarks,
    )  # fmt: skip


def _numbers(raw: RawLog, column: str, role: str, refused: dict[int, Refusal]) -> Floats:
    """Read a column of numbers; NaN where one is missing, or no number and the row refused."""
    cells = raw.columns[column]
    if pd.api.types.is_numeric_dtype(cells):
        numbers = cells.to_numpy(dtype=np.float64, na_value=np.nan).copy()
        wrong = np.isinf(numbers)
    else:
        text = cells.map(lambda cell: "" if cell is None else str(cell).strip())
        point = text.str.replace(r"^([+-]?\d*),(\d+([eE][+-]?\d+)?)$", r"\1.\2", regex=True)
        numbers = pd.to_numeric(point, errors="coerce").to_numpy(dtype=np.float64).copy()
        wrong = ~np.isfinite(numbers) & ~text.str.lower().isin(ABSENT).to_numpy()
    for row in np.flatnonzero(wrong):
        shown = harmless(str(cells.iloc[row]))[:30]
        refused.setdefault(int(row), Refusal(f"{shown!r} is no number", column))
    most = {"lat": 90.0, "lon": 360.0}.get(role, LARGEST)
    for row in np.flatnonzero(np.abs(numbers) > most):
        if np.isfinite(numbers[row]):
            refused.setdefault(int(row), Refusal(f"{numbers[row]:g} is beyond {most:g}", column))
    numbers[[*refused]] = np.nan
    return numbers


def _times(raw: RawLog, roles: Mapping[str, str], refused: dict[int, Refusal]) -> Floats | None:
    """Read the times; None without such a column."""
    column = roles.get("time", roles.get("date"))
    if column is None:
        return None
    date = raw.columns[roles["date"]] if {"time", "date"} <= roles.keys() else None
    seconds = seconds_of(raw.columns[column], date)
    for row in np.flatnonzero(~np.isfinite(seconds)):
        shown = harmless(str(raw.columns[column].iloc[row]))[:30]
        refused.setdefault(int(row), Refusal(f"{shown!r} is no time", column))
    return seconds


def _check_refused(raw: RawLog, refused: Mapping[int, Refusal], what: str) -> None:
    """Refuse a log of which too much is refused, naming the first place."""
    if not len(raw.columns):
        raise UsageError(f"{what} has a header and no samples")
    if len(refused) > max(1, MOST_REFUSED * len(raw.columns)):
        row = min(refused)
        raise UsageError(
            f"{what}, {raw.where(row, refused[row].column)}: {refused[row].reason}, and "
            f"{len(refused)} of {counted(len(raw.columns), raw.place)} are wrong: say which "
            "columns to read with columns={x: ..., y: ..., value: ..., time: ...}, or mend the log"
        )


def _order(time: Floats, remarks: list[str], place: str) -> Integers:
    """Order samples by time; those of one time stay as they were."""
    if early := int(np.sum(np.diff(time) < 0)):
        verb = "is" if early == 1 else "are"
        remarks.append(
            f"{counted(early, place)} {verb} earlier than the one before: sorted by time"
        )
    return np.argsort(time, kind="stable")


def _plane(
    numbers: dict[str, Floats], raw: RawLog, roles: Mapping[str, str], crs: str | None, what: str
) -> tuple[Floats, str | None]:
    """Put positions on a plane in metres; returns them and the plane's name."""
    plane = None if crs is None else checked_crs(crs)
    if "lat" in roles:
        lat, lon = numbers["lat"], numbers["lon"]
        plane = plane or utm_zone(lat, lon, what)
        return to_metres(lat, lon, plane, what), plane
    sides = []
    for role in ("x", "y"):
        unit = raw.units.get(roles[role]) or split_name(roles[role])[1] or "m"
        if unit_name(unit) not in METRES:
            raise UsageError(
                f"{what}, column {harmless(roles[role])} is in {harmless(unit)}: positions are in "
                f"degrees, as lat and lon, or in {', '.join(METRES)}"
            )
        sides.append(numbers[role] * METRES[unit_name(unit)])
    return np.column_stack(sides), plane
