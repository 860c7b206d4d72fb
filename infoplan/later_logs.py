"""Several logs of one place: what the later ones say of what was flagged in the earlier.

A spike that nothing near it bears out is confirmed by a later log that passes there and sees the
floor; a rock that only one track has met is cleared by one that meets it, too.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from infoplan.collapse import spacing_along
from infoplan.samples import Samples

Booleans = NDArray[np.bool_]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

CONFIRMED, CLEARED, UNTESTED = "confirmed", "cleared", "untested"

REACH = 0.5
"""A sample is near to another within so many lengthscales: there they correlate by 0.88."""

STEPS = 3.0
"""Likewise distances of neighbouring samples, for a model without lengthscales."""


@dataclass(frozen=True)
class Origins:
    """Where the samples of a survey of several logs come from.

    Attributes
    ----------
    names
        Of the logs, in the order in which they were taken.
    log
        Which of them each sample is of, ascending, shape (n,).
    row
        Its row in that log, counted from 0 without the header, shape (n,).
    """

    names: tuple[str, ...]
    log: Integers
    row: Integers

    @property
    def ends(self) -> Integers:
        """Numbers of samples after which each log is complete, shape (len(names),)."""
        return np.searchsorted(self.log, np.arange(len(self.names)), side="right")


def flagged_first(origins: Origins, flags: Mapping[int, Booleans]) -> Booleans:
    """Gather the verdicts on each log as they were when it was the last.

    Parameters
    ----------
    origins
        Of all samples.
    flags
        Of the samples so far, by their number; of `Origins.ends` at least.
    """
    ends = origins.ends.tolist()
    return np.concatenate(
        [flags[end][start:end] for start, end in zip([0, *ends[:-1]], ends, strict=True)]
    )


def verdicts(
    origins: Origins, first: Booleans, samples: Samples, lengthscales: Floats
) -> list[str | None]:
    """Say what the later logs have made of each sample that was flagged before them.

    A sample is untested if no sample of a later log that is in the model lies within its reach:
    half a lengthscale of the model either way, and the distance of neighbouring samples at least.
    Else it is confirmed if it is still flagged, and cleared if not.

    Parameters
    ----------
    origins
        Of the samples.
    first
        From `flagged_first`.
    samples
        As judged at the end.
    lengthscales
        Along x1 and x2 at the end, scaled units; NaN if the model has none, whereupon the reach is
        three distances of neighbouring samples.

    Returns
    -------
    list
        One entry a sample; None where it was not flagged, or not measured, or is of the last log.
    """
    told = ~np.isnan(samples.measured)
    pilot = samples.x[(samples.epoch == 0) & told]
    spacing = spacing_along(pilot)
    reach = np.maximum(REACH * 0.5 * lengthscales * np.ptp(pilot, axis=0), spacing)
    scaled = samples.x / np.where(np.isnan(reach), STEPS * spacing, reach)
    found: list[str | None] = [None] * len(first)
    for number in range(len(origins.names) - 1):
        asked = np.flatnonzero((origins.log == number) & first & told)
        later = scaled[(origins.log > number) & ~samples.flagged]
        if not len(asked):
            continue
        distance = (
            cKDTree(later).query(scaled[asked])[0] if len(later) else np.full(len(asked), 2.0)
        )
        for sample, away in zip(asked.tolist(), distance, strict=True):
            still = CONFIRMED if samples.flagged[sample] else CLEARED
            found[sample] = still if away <= 1.0 else UNTESTED
    return found
