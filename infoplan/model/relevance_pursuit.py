"""The Gaussian process that gives noise of their own to data that need it."""

from collections.abc import Sequence

import numpy as np

from infoplan.model.inference.relevance import RelevanceInference
from infoplan.model.kernel import Kernel
from infoplan.model.kernels import as_kernel
from infoplan.model.regression import Regression
from infoplan.model.theta import first_theta


class RelevancePursuitProcess(Regression):
    """Zero-mean Gaussian process whose data may each have a noise variance of their own.

    Ament et al. (2024). Used like `infoplan.model.GaussianProcess`, with the same scalers. Which
    data have how much of it is found anew by forward relevance pursuit under all hyperparameters
    that are looked at, so that the optimiser climbs the likelihood at its maximum over both.

    Parameters
    ----------
    x_pilot : array_like of shape (n, 2)
        Positions of the pilot samples, workspace units.
    y_pilot : array_like of shape (n,)
        Their measurements, in the terrain's unit.
    outlier_fraction : float
        Mean of the exponential prior on the number of data with a variance of their own, as a
        share of all.
    fractions : list of float
        The shares that are compared, besides none.
    kernel, amplitude, lengthscale, noise_variance, jitter, min_noise_variance, optimizer, \
learning_rate, noise_start, optimizer_state
        As for `infoplan.model.GaussianProcess`.

    Raises
    ------
    RunError
        If the pilot cannot fix the scalers, or a covariance cannot be factorised.
    """

    def __init__(
        self,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        *,
        outlier_fraction: float = 0.2,
        fractions: Sequence[float] = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5),
        kernel: str | Kernel = "squared_exponential",
        amplitude: float = 1.0,
        lengthscale: float = 0.5,
        noise_variance: float = 1.0,
        jitter: float = 1e-6,
        min_noise_variance: float = 1e-4,
        optimizer: str = "adam",
        learning_rate: float = 0.01,
        noise_start: str = "carried",
        optimizer_state: str = "carried",
    ) -> None:
        kernel = as_kernel(kernel)
        inference = RelevanceInference(
            kernel, jitter, fractions=fractions, outlier_fraction=outlier_fraction
        )
        super().__init__(
            inference,
            kernel,
            first_theta(kernel, amplitude, lengthscale, noise_variance),
            x_pilot,
            y_pilot,
            min_noise_variance=min_noise_variance,
            optimizer=optimizer,
            learning_rate=learning_rate,
            noise_start=noise_start,
            optimizer_state=optimizer_state,
        )
