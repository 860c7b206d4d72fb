"""When samples were taken, as logs write it."""

import warnings
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Series = Any  # pandas.Series, whose parameters differ between versions of its types

DAY = 86400.0


def seconds_of(told: Series, date: Series | None = None) -> NDArray[np.float64]:
    """Read times as seconds.

    Parameters
    ----------
    told
        Dates with times, times of a day, or numbers of seconds.
    date
        Dates to times of a day.

    Returns
    -------
    ndarray, shape (n,)
        Since 1970 where dates are told, else since any moment; times of a day that fall by more
        than half a day go on the day after. NaN where there is none that can be read.
    """
    if pd.api.types.is_datetime64_any_dtype(told):
        return _since_1970(pd.to_datetime(told, utc=True))
    text = told.astype(str).str.strip()
    if date is not None:
        return _since_1970(_read(date.astype(str).str.strip() + " " + text))
    numbers = pd.to_numeric(text, errors="coerce")
    if numbers.notna().any():
        return np.asarray(numbers, dtype=np.float64)
    of_day = pd.to_timedelta(text.where(text.str.fullmatch(r"\d{1,2}:\d\d(:\d\d(\.\d*)?)?")),
                             errors="coerce")  # fmt: skip
    if of_day.notna().any():
        seconds = np.array(of_day.dt.total_seconds(), dtype=np.float64)
        there = np.flatnonzero(np.isfinite(seconds))
        midnights = np.cumsum(np.diff(seconds[there], prepend=seconds[there[0]]) < -DAY / 2)
        seconds[there] += DAY * midnights
        return seconds
    return _since_1970(_read(text))


def _read(text: Series) -> Series:
    """Read dates with times: ISO 8601, else what each looks like."""
    iso: Series = pd.to_datetime(text, errors="coerce", utc=True, format="ISO8601")
    if iso.notna().any():
        return iso
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pd.to_datetime(text, errors="coerce", utc=True, format="mixed")


def _since_1970(moments: Series) -> NDArray[np.float64]:
    seconds = (moments - pd.Timestamp("1970-01-01", tz="UTC")).dt.total_seconds()
    return np.asarray(seconds, dtype=np.float64)
