"""Scores of a Gaussian prediction against the truth, and the length of a path."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from infoplan.terrain.relief import CLASSES

Floats = NDArray[np.float64]


def continuous_ranked_probability(mean: Floats, std: Floats, truth: Floats) -> Floats:
    """Continuous ranked probability score of each normal prediction; small is good.

    Parameters
    ----------
    mean, std, truth
        Shape (n,), of one unit.

    Returns
    -------
    ndarray, shape (n,)
        Of that unit.

    References
    ----------
    Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", Journal of
    the American Statistical Association, 2007, Section 4.2.
    """
    z = (truth - mean) / std
    density = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi)
    return np.asarray(std * (z * (2.0 * ndtr(z) - 1.0) + 2.0 * density - 1.0 / np.sqrt(np.pi)))


def standardised_square(error: Floats, truth: Floats) -> float:
    """Mean square error over the variance of the truth, SMSE; NaN where the truth is flat.

    The mean of the truth, predicted everywhere, scores 1 (Rasmussen and Williams, "Gaussian
    Processes for Machine Learning", 2006, Section 2.5).
    """
    variance = np.var(truth)
    return float(np.mean(error**2) / variance) if variance > 0 or np.isnan(variance) else np.nan


def standardised_log_loss(nlpd: float, truth: Floats, measured: Floats) -> float:
    """Mean standardised log loss, MSLL: that of a prediction less that of a trivial one.

    The trivial one predicts mean and variance of the measurements everywhere (Rasmussen and
    Williams, 2006, Section 2.5); below 0 is better than that.

    Parameters
    ----------
    nlpd
        Mean negative log density of the truth under the prediction.
    truth
        Shape (n,).
    measured
        Samples that the model holds, shape (m,).

    Returns
    -------
    float
        NaN where all measurements are equal.
    """
    variance = np.var(measured)
    if not variance > 0:
        return np.nan
    trivial = 0.5 * np.mean((truth - np.mean(measured)) ** 2) / variance
    return float(nlpd - trivial - 0.5 * np.log(2.0 * np.pi * variance))


def by_third(error: Floats, third: NDArray[np.intp]) -> dict[str, float]:
    """Root mean square error within each third of the grid, by name.

    Parameters
    ----------
    error
        At the nodes, shape (n,).
    third
        From `infoplan.terrain.relief.thirds`, shape (n,).
    """
    return {
        f"rmse_{name}": float(np.sqrt(np.mean(error[third == index] ** 2)))
        for index, name in enumerate(CLASSES)
    }


def path_length(x: Floats) -> float:
    """Sum of the distances between successive places, shape (n, 2); in their unit."""
    return float(np.sum(np.hypot(*np.diff(x, axis=0).T)))
