"""What a sample at a node of the query grid is worth to a planner, by several measures.

All are of the model's prediction at the nodes: its mean, its standard deviation, or the covariance
of the latent function between them. The planners add up what they pass.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import get_lapack_funcs

Floats = NDArray[np.float64]

ROUNDING = 1e-9
"""Least variance of the noise, as a share of the largest variance: a factorisation needs some."""


def upper_confidence_bound(mean: Floats, std: Floats, kappa: float) -> Floats:
    """Mean plus kappa deviations, which looks for high ground (Srinivas et al., ICML 2010).

    Parameters
    ----------
    mean, std
        The prediction, shape (n,).
    kappa
        Weight of the deviation.

    Returns
    -------
    ndarray, shape (n,)
        Above its least value, so that no reward is negative; the unit of the mean.
    """
    bound = mean + kappa * std
    return np.asarray(bound - bound.min())


def variance_reduction(covariance: Floats, noise_variance: float) -> Floats:
    """How much a sample lowers the sum of the latent variances at all nodes (Cohn, 1996).

    Parameters
    ----------
    covariance
        Of the latent function at the nodes, given the data, shape (n, n).
    noise_variance
        Of a sample.

    Returns
    -------
    ndarray, shape (n,)
        For node v the sum over u of C_uv^2 / (C_vv + noise), the unit squared.
    """
    reduced = np.einsum("uv,uv->v", covariance, covariance)
    return np.asarray(reduced / (covariance.diagonal() + noise_variance))


def mutual_information(covariance: Floats, noise_variance: float) -> Floats:
    """Information of a sample about samples at all other nodes (Krause et al., JMLR 2008).

    Their criterion given the data: I(y_v; y_others) = log(S_vv (S^-1)_vv) / 2, S the covariance of
    samples. A node that nothing else depends on is worth nothing, however uncertain it is.

    Parameters
    ----------
    covariance
        Of the latent function at the nodes, given the data, shape (n, n).
    noise_variance
        Of a sample, taken to be at least 1e-9 of the largest variance.

    Returns
    -------
    ndarray, shape (n,)
        In nats.
    """
    potrf, trtri = get_lapack_funcs(("potrf", "trtri"), dtype=np.float64)
    nodes = np.diag_indices_from(covariance)
    noise = max(noise_variance, ROUNDING * float(covariance.diagonal().max()))
    while True:
        samples = np.array(covariance, order="F")
        samples[nodes] += noise
        variances = samples.diagonal().copy()
        factor, failed = potrf(samples, lower=1, overwrite_a=1)
        if not failed:
            break
        noise *= 10.0  # a covariance of single precision is positive only so far
    inverse, _ = trtri(factor, lower=1, overwrite_c=1)
    lower = np.tril(inverse)
    precisions = np.einsum("ij,ij->j", lower, lower)
    return np.maximum(0.5 * np.log(variances * precisions), 0.0)
