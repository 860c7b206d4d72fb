"""Relevance pursuit: which data need noise of their own, and how much (Ament et al. 2024)."""

import numpy as np

from infoplan.compiled import kernel as compiled

# Sweeps over the support end where no rho moves by more than this share of sigma^2 + rho.
_TOLERANCE = 1e-6
_MOST_SWEEPS = 200


def pursue(inverse: np.ndarray, y: np.ndarray, sizes: list[int], prior_mean: float) -> np.ndarray:
    """Find the further noise variances of some data (their Algorithm 1, forward).

    Parameters
    ----------
    inverse : ndarray of shape (n, n)
        P = A^-1 without any; overwritten.
    y : ndarray of shape (n,)
        Observations.
    sizes : list of int
        Sizes of the support to go through, ascending, until the posterior falls.
    prior_mean : float
        Mean of the exponential prior on the size.

    Returns
    -------
    ndarray of shape (n,)
        rho at the size of the highest likelihood times prior; of equal ones the least.
    """
    rho, weights = np.zeros(y.size), inverse @ y
    support = np.empty(0, dtype=int)
    best, found, gain = 0.0, rho.copy(), 0.0
    for size in sizes:
        # What each rho alone would be: the squared leave-one-out error less its variance.
        lone = (weights / inverse.diagonal()) ** 2 - 1.0 / inverse.diagonal()
        lone[support] = -np.inf
        largest = np.argsort(-lone, kind="stable")[: size - len(support)]
        support = np.concatenate([support, largest[lone[largest] > 0.0]])
        gain += climb(inverse, weights, rho, support)
        posterior = gain - len(support) / prior_mean
        if posterior > best:
            best, found = posterior, rho.copy()
        if posterior < best or len(support) < size:
            break
    return found


def climb(inverse: np.ndarray, weights: np.ndarray, rho: np.ndarray, support: np.ndarray) -> float:
    """Maximise the likelihood over the rho of a support, one after the other until they stay.

    Parameters
    ----------
    inverse, weights, rho : ndarrays of shapes (n, n), (n,), (n,)
        P = A^-1, P y, and rho; all are brought up to date.
    support : ndarray of int, shape (k,)
        Whose rho may change.

    Returns
    -------
    float
        By how much the log likelihood rose.
    """
    own = np.ix_(support, support)
    precision, theirs = inverse[own].copy(), weights[support].copy()
    start = rho[support]
    values = start.copy()
    gain = _sweep(precision, theirs, values)
    changes = values - start
    if len(support) and changes.any():
        # Woodbury for all at once: A + E D E^T.
        left = inverse[:, support]
        inner = np.linalg.solve(
            np.eye(len(support)) + changes[:, None] * inverse[own], changes[:, None] * left.T
        )
        weights -= inner.T @ weights[support]
        inverse -= left @ inner
        rho[support] = values
    return float(gain)


# Without contraction or another order of sums: every rho is what the formulas give step by step.
@compiled(error_model="numpy")
def _sweep(precision: np.ndarray, theirs: np.ndarray, values: np.ndarray) -> float:
    """Climb within P and P y of the support alone; these and its rho are overwritten."""
    n, gain = len(values), 0.0
    column = np.empty(n)
    for _ in range(_MOST_SWEEPS):
        moved = 0.0
        for i in range(n):
            p, w = precision[i, i], theirs[i]
            # The maximum by this rho, in closed form.
            change = max((w / p) ** 2 - 1.0 / p, -values[i])
            share = 1.0 + change * p
            if change == 0.0 or not share > 0.0:
                continue
            gain += 0.5 * (change * w**2 / share - np.log(share))
            column[:] = precision[:, i]
            for j in range(n):
                theirs[j] -= (change * w / share) * column[j]
                scaled = (change / share) * column[j]
                row = precision[j]
                for k in range(n):
                    row[k] -= scaled * column[k]
            values[i] += change
            moved = max(moved, abs(change) / (values[i] + 1.0 / p))
        if moved <= _TOLERANCE:
            break
    return gain
