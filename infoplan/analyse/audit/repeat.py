"""Detectors and the Student-t process once more, in the plainest way: what the audit compares with.

Nothing here is shared with what missions run.
"""

import importlib
import inspect
import pkgutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from infoplan.backend import load_matplotlib

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
FIRST_STEPS = 20
LAST_STEPS = 30
CLOSE = 1e-12


def local_scores(
    x: Floats, measured: Floats, candidates: Booleans, judged: Booleans, neighbours: int
) -> Floats:
    """Compare samples with their nearest neighbours, one by one: modified z-scores.

    Parameters
    ----------
    x
        Positions, shape (n, 2).
    measured
        Measurements, shape (n,).
    candidates
        Who may be a neighbour, shape (n,).
    judged
        Who gets a score, shape (n,).
    neighbours
        How many.

    Returns
    -------
    ndarray, shape (n,)
        NaN where not judged.
    """
    scores = np.full(len(measured), np.nan)
    smallest = np.finfo(float).eps * np.abs(measured).max()
    among = np.flatnonzero(candidates)
    for i in np.flatnonzero(judged):
        others = among[among != i]
        squares = np.sum((x[others] - x[i]) ** 2, axis=1)
        near = measured[others[np.argsort(squares, kind="stable")[:neighbours]]]
        spread = 1.4826 * stats.median_abs_deviation(near)
        scores[i] = abs(measured[i] - np.median(near)) / max(spread, smallest)
    return scores


def hampel_scores(measured: Floats, judged: Booleans, reach: int) -> Floats:
    """Compare samples with the median of those before and after them; NaN where not judged."""
    scores = np.full(len(measured), np.nan)
    smallest = np.finfo(float).eps * np.abs(measured).max()
    for i in np.flatnonzero(judged):
        near = measured[max(i - reach, 0) : i + reach + 1]
        spread = 1.4826 * stats.median_abs_deviation(near)
        scores[i] = abs(measured[i] - np.median(near)) / max(spread, smallest)
    return scores


def qartod_scores(
    measured: Floats,
    judged: Booleans,
    gross_range: float | None,
    spike: float | None,
    rate: float | None,
    flat: int | None,
    tolerance: float,
) -> Floats:
    """Take the largest share of what four tests allow, sample by sample; NaN where not judged."""
    y, n = measured, len(measured)
    smallest = np.finfo(float).eps * np.abs(y).max()
    middles = [abs(y[i] - (y[i - 1] + y[i + 1]) / 2) for i in range(1, n - 1)]
    away, steps = np.abs(y - np.median(y)), np.abs(np.diff(y))
    scores = np.full(n, np.nan)
    for i in np.flatnonzero(judged):
        shares = [0.0]
        if gross_range is not None:
            shares.append(away[i] / max(gross_range * 1.4826 * np.median(away), smallest))
        if spike is not None and 0 < i < n - 1:
            shares.append(middles[i - 1] / max(spike * np.median(middles), smallest))
        if rate is not None and i:
            shares.append(steps[i - 1] / max(rate * np.median(steps), smallest))
        if flat is not None:
            same = 0
            while same <= flat and i > same and np.ptp(y[i - same - 1 : i + 1]) <= tolerance:
                same += 1
            shares.append(same / flat)
        scores[i] = max(shares)
    return scores


def given_the_rest(
    x: Floats, y: Floats, kernel: Any, noise: float, candidates: Booleans, judged: Booleans
) -> tuple[Floats, Floats]:
    """Predict the judged samples jointly from the other candidates, by a Gaussian process.

    Parameters
    ----------
    x, y
        Scaled positions and measurements, shapes (n, 2) and (n,).
    kernel
        Of the latent function, scikit-learn's.
    noise
        Variance of the observations beside it.
    candidates, judged
        What is in the process, and what may leave it, shape (n,).

    Returns
    -------
    residual, covariance : ndarrays, shapes (m,) and (m, m)
        Measurements less their predictions, and the covariance of these.
    """
    given, asked = np.flatnonzero(candidates & ~judged), np.flatnonzero(judged)
    covariance = kernel(x[asked]) + noise * np.eye(len(asked))
    residual = y[asked].copy()
    if len(given):
        cross = kernel(x[given], x[asked])
        explained = np.linalg.solve(kernel(x[given]) + noise * np.eye(len(given)), cross)
        covariance -= cross.T @ explained
        residual -= explained.T @ y[given]
    return residual, covariance


def leave_one_out(
    residual: Floats, covariance: Floats, threshold: float, one_by_one: bool
) -> tuple[Floats, Booleans]:
    """Standardised residuals of each sample given all others, and those too large.

    Parameters
    ----------
    residual, covariance
        From `given_the_rest`.
    threshold
        Largest residual kept, standard deviations.
    one_by_one
        Take out the worst, look at the rest without it, and so on; else all at once.

    Returns
    -------
    scores, flags : ndarrays, shape (m,)
    """
    left = np.arange(len(residual))
    precision = np.linalg.inv(covariance)
    found = np.abs(precision @ residual) / np.sqrt(np.diag(precision))
    flagged = found > threshold
    if one_by_one:
        flagged[:] = False
        current = found
        while len(left) and current.max() > threshold:
            worst = int(np.argmax(current))
            flagged[left[worst]] = True
            rest = np.delete(np.arange(len(left)), worst)
            # The inverse without a row and a column, by blocks.
            column = precision[rest, worst]
            precision = (
                precision[np.ix_(rest, rest)] - np.outer(column, column) / (precision[worst, worst])
            )
            left = left[rest]
            current = np.abs(precision @ residual[left]) / np.sqrt(np.diag(precision))
            found[left] = current
    return found, flagged


def pyod_judgement(
    features: Floats,
    name: str,
    contamination: float,
    params: Mapping[str, Any],
    sequence: np.random.SeedSequence,
) -> tuple[Floats, Booleans]:
    """Judge samples by a detector of PyOD.

    Parameters
    ----------
    features
        Not scaled yet, shape (n, k).
    name, contamination, params
        Class and parameters.
    sequence
        Seeds it.

    Returns
    -------
    scores, flags : ndarrays, shape (n,)

    Raises
    ------
    ValueError
        If PyOD has no such class.
    """
    kind = _pyod_class(name)
    scaled = np.zeros_like(features)
    for column, values in enumerate(features.T):
        if values.std() > np.finfo(float).eps * np.abs(values).max():
            scaled[:, column] = (values - values.mean()) / values.std()
    seed = int(np.random.default_rng(sequence).integers(2**31 - 1))
    parameters = {**params, "contamination": contamination}
    if "random_state" in inspect.signature(kind).parameters:
        parameters["random_state"] = seed
    state = np.random.get_state()  # noqa: NPY002 - what some of PyOD's classes draw from
    np.random.seed(seed)  # noqa: NPY002
    try:
        detector = kind(**parameters).fit(scaled)
    finally:
        np.random.set_state(state)  # noqa: NPY002
    return detector.decision_scores_, detector.labels_ == 1


def _pyod_class(name: str) -> Any:
    load_matplotlib()  # as PyOD does
    import pyod.models

    for module in pkgutil.iter_modules(pyod.models.__path__):
        text = Path(pyod.models.__path__[0], f"{module.name}.py").read_text("utf-8")
        if f"class {name}(" in text:
            return getattr(importlib.import_module(f"pyod.models.{module.name}"), name)
    raise ValueError(f"PyOD has no class {name}")


def student_t(
    x: Floats,
    y: Floats,
    query: Floats,
    kernel: Any,
    scale: float,
    dof: float,
    jitter: float,
    start: Floats,
) -> tuple[Floats, Floats, float]:
    """Laplace approximation of a Gaussian process with Student-t noise, by general solves.

    Parameters
    ----------
    x, y
        Scaled data, shapes (n, 2) and (n,).
    query
        Where to predict, shape (m, 2).
    kernel
        Of the latent function, scikit-learn's.
    scale, dof
        Of the noise.
    jitter
        Added to the latent variance at the data.
    start
        Latent values near the mode, shape (n,).

    Returns
    -------
    mean, std : ndarrays, shape (m,)
        Latent prediction.
    lml : float
        Approximate log marginal likelihood.
    """
    n, v = len(y), dof * scale**2
    covariance = kernel(x) + jitter * np.eye(n)
    latent = start
    # Expectation and maximisation, which cannot diverge, then Newton's method, which is exact.
    for _ in range(FIRST_STEPS):
        variance = (v + (y - latent) ** 2) / (dof + 1.0)
        latent = covariance @ np.linalg.solve(covariance + np.diag(variance), y)
    for _ in range(LAST_STEPS):
        slope, curvature = _derivatives(y - latent, v, dof)
        # (K^-1 + W) step = slope - K^-1 latent, times K.
        step = np.linalg.solve(np.eye(n) + covariance * curvature, covariance @ slope - latent)
        latent = latent + step
        if np.abs(step).max() <= CLOSE * (1.0 + np.abs(latent).max()):
            break
    slope, curvature = _derivatives(y - latent, v, dof)
    system = np.eye(n) + covariance * curvature
    cross = kernel(query, x)
    explained = np.linalg.solve(system.T, np.diag(curvature) @ cross.T)
    variance = kernel.diag(query) - np.sum(cross.T * explained, axis=0)
    lml = (
        np.sum(stats.t.logpdf(y, dof, latent, scale))
        - 0.5 * slope @ latent
        - 0.5 * np.linalg.slogdet(system)[1]
    )
    return cross @ slope, np.sqrt(variance), float(lml)


def _derivatives(residual: Floats, v: float, dof: float) -> tuple[Floats, Floats]:
    """First and minus second derivative of the log density by the latent value."""
    d = v + residual**2
    return (dof + 1.0) * residual / d, (dof + 1.0) * (v - residual**2) / d**2


def robust_conjugate(
    x: Floats,
    y: Floats,
    query: Floats,
    kernel: Any,
    noise: float,
    jitter: float,
    outlier_fraction: float,
    neighbours: int | None,
    weighted: bool,
) -> tuple[Floats, Floats, float]:
    """Robust and conjugate Gaussian process by the formulas of its paper, with general solves.

    Parameters
    ----------
    x, y
        Scaled data, shapes (n, 2) and (n,).
    query
        Where to predict, shape (m, 2).
    kernel
        Of the latent function, scikit-learn's.
    noise
        sigma^2.
    jitter
        Added to the variances of the data.
    outlier_fraction, neighbours, weighted
        As the options `outlier_fraction`, `centre_neighbours` and `criterion` of the model.

    Returns
    -------
    mean, std : ndarrays, shape (m,)
        Latent prediction.
    density : float
        Leave-one-out log predictive density, weighted or not.
    """
    centre = np.zeros(len(y))
    for i in range(len(y) if neighbours and len(y) > 1 else 0):
        squares = (x[i, 0] - x[:, 0]) ** 2 + (x[i, 1] - x[:, 1]) ** 2
        others = np.delete(np.arange(len(y)), i)
        reach = np.sort(squares[others])[: int(neighbours or 0)][-1]
        centre[i] = np.median(y[others][squares[others] <= reach])
    distance = y - centre
    c = np.quantile(np.abs(distance), 1.0 - outlier_fraction)
    weight = np.sqrt(noise / 2.0) / np.sqrt(1.0 + (distance / c) ** 2)
    diagonal = noise * (noise / 2.0) / weight**2  # sigma^2 J_w
    target = y + noise * 2.0 * distance / (c**2 + distance**2)  # y - sigma^2 d log(w^2) / dy
    inverse = np.linalg.inv(kernel(x) + np.diag(diagonal + jitter))
    cross = kernel(query, x)
    variance = kernel.diag(query) - np.sum((cross @ inverse) * cross, axis=1)
    left_out = target - inverse @ target / np.diag(inverse)
    spread = 1.0 / np.diag(inverse) - diagonal + noise
    share = 2.0 * weight**2 / noise if weighted else np.ones(len(y))
    density = share @ stats.norm.logpdf(y, left_out, np.sqrt(spread))
    return cross @ inverse @ target, np.sqrt(variance), float(density)
