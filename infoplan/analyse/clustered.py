"""Least squares over units that share their repetitions, with errors clustered both ways.

Units here are universes, repetitions are seeds. How often the intervals cover: docs/statistics.md.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ALONE = 1e-9
"""A unit is fitted by nothing but itself if less than this is left of it."""


@dataclass(frozen=True)
class Estimates:
    """Linear combinations of coefficients: their means, standard errors, degrees of freedom."""

    mean: Floats
    error: Floats
    freedom: Floats

    def intervals(self) -> tuple[Floats, Floats]:
        """Give the ends of the 95 % t intervals."""
        from scipy import special

        half = special.stdtrit(self.freedom, 0.975) * self.error
        return self.mean - half, self.mean + half

    def p(self) -> float:
        """Give the least p of t tests that each is zero, times their number."""
        from scipy import special

        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.abs(self.mean) / self.error
        each = 2.0 * special.stdtr(self.freedom, -t)
        return float(min(len(each) * each.min(), 1.0))


@dataclass(frozen=True)
class ClusteredFit:
    """A least-squares fit of the mean over repetitions.

    Attributes
    ----------
    weights
        Each coefficient is a row of these times the units' means: shape (coefficients, units).
    values
        What is fitted: shape (units, repetitions).
    left
        What the fit leaves of a vector is this matrix times it: shape (units, units).
    """

    weights: Floats
    values: Floats
    left: Floats

    @property
    def squares(self) -> float:
        """Sum of squares that is left of the units' means."""
        return float(np.sum((self.left @ self.values.mean(axis=1)) ** 2))

    def estimates(self, rows: Floats) -> Estimates:
        """Estimate linear combinations of the coefficients.

        The variance is that of independent units, who may differ in theirs, and what single
        repetitions vary beyond the noise that is in both (two-way clusters: Cameron, Gelbach and
        Miller, Journal of Business & Economic Statistics 29, 2011). That of units is Bell and
        McCaffrey's (Survey Methodology 28, 2002), without bias if theirs are equal, with their
        degrees of freedom; those of the sum are Satterthwaite's.

        Parameters
        ----------
        rows
            One a combination: shape (combinations, coefficients).

        Returns
        -------
        Estimates
            The errors are NaN with a single repetition, and where a unit that none resembles
            decides.
        """
        weights = rows @ self.weights
        repetitions = self.values.shape[1]
        by_repetition = weights @ self.values
        residuals = self.left @ self.values
        share = np.diag(self.left)
        unsure_of = np.where(weights**2 > ALONE**2, np.nan, 0.0)
        squared = np.where(share > ALONE, weights**2 / np.maximum(share, ALONE), unsure_of)
        free = (weights**2).sum(axis=1) ** 2 / np.einsum(
            "ij,jk,ik->i", squared, self.left**2, squared
        )
        of_units = squared @ residuals.mean(axis=1) ** 2
        if repetitions < 2:
            unknown = np.full(len(rows), np.nan)
            return Estimates(by_repetition.mean(axis=1), unknown, unknown)
        of_repetitions = by_repetition.var(axis=1, ddof=1) / repetitions
        noise = squared @ residuals.var(axis=1, ddof=1) / repetitions
        variance = of_units + np.maximum(of_repetitions - noise, 0.0)
        unsure = of_repetitions**2 / (repetitions - 1) + noise**2 / free / (repetitions - 1)
        bottom = of_units**2 / free + np.where(of_repetitions > noise, unsure, 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            freedom = np.where(variance > 0, variance**2 / bottom, free)
        return Estimates(by_repetition.mean(axis=1), np.sqrt(variance), freedom)


def fit(design: Floats, values: Floats) -> ClusteredFit:
    """Fit the mean over repetitions of values to a design.

    Parameters
    ----------
    design
        Shape (units, coefficients).
    values
        Shape (units, repetitions); one that is missing, NaN, counts as the mean of its unit.
    """
    filled = np.where(np.isnan(values), np.nanmean(values, axis=1, keepdims=True), values)
    weights = np.asarray(np.linalg.pinv(design), dtype=np.float64)
    return ClusteredFit(weights, filled, np.eye(len(design)) - design @ weights)


def differences(columns: list[int], count: int) -> Floats:
    """Combine coefficients, each alone and each less each other: shape (combinations, count)."""
    alone = np.eye(count)[columns]
    pairs = [one - other for k, one in enumerate(alone) for other in alone[:k]]
    return np.vstack([alone, *pairs])
