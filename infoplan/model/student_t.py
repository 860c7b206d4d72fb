"""The Gaussian process with Student-t noise.

An observation is y = f + scale t, with t from Student's t distribution of `dof` degrees of freedom:
heavy tails, so that a far outlier hardly pulls the latent function.
"""

from collections.abc import Sequence

import numpy as np

from infoplan.model.inference.laplace import LaplaceInference
from infoplan.model.kernel import Kernel
from infoplan.model.kernels import as_kernel
from infoplan.model.regression import JointRegression
from infoplan.model.theta import first_theta


class StudentTProcess(JointRegression):
    """Zero-mean Gaussian process with Student-t noise, by the Laplace approximation.

    Used like `infoplan.model.GaussianProcess`, with the same scalers; the noise parameter is the
    squared scale of the t distribution in place of a variance.

    Parameters
    ----------
    x_pilot : array_like of shape (n, 2)
        Positions of the pilot samples, workspace units.
    y_pilot : array_like of shape (n,)
        Their measurements, in the terrain's unit.
    dof : float
        Degrees of freedom, above 2 so that the noise has a variance; fixed.
    kernel : str or Kernel
        One of `infoplan.config.KERNELS`, or one's own.
    amplitude : float
        First alpha.
    lengthscale : float
        First value of all the kernel's lengthscales.
    noise_variance : float
        First squared scale.
    jitter : float
        Added to the variance of the latent values. A covariance that is not positive definite is
        tried again with ten times as much, until it is.
    spacing, min_noise_variance, optimizer, learning_rate, min_lengthscale, lengthscale_prior, \
noise_prior, restarts, noise_start, optimizer_state
        As for `infoplan.model.GaussianProcess`, of the approximate log marginal likelihood and the
        squared scale.

    Raises
    ------
    RunError
        If the pilot cannot fix the scalers: no extent, equal or non-finite values.
    """

    def __init__(
        self,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        spacing: float = 1.0,
        *,
        dof: float = 4.0,
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
        min_lengthscale: float = 0.0,
        lengthscale_prior: Sequence[float] | None = None,
        noise_prior: Sequence[float] | None = None,
        restarts: int = 0,
    ) -> None:
        kernel = as_kernel(kernel)
        super().__init__(
            LaplaceInference(kernel, dof, jitter),
            kernel,
            first_theta(kernel, amplitude, lengthscale, noise_variance),
            x_pilot,
            y_pilot,
            min_noise_variance=min_noise_variance,
            optimizer=optimizer,
            learning_rate=learning_rate,
            noise_start=noise_start,
            optimizer_state=optimizer_state,
            min_lengthscale=min_lengthscale,
            spacing=spacing,
            lengthscale_prior=lengthscale_prior,
            noise_prior=noise_prior,
            restarts=restarts,
            noise_factor=dof / (dof - 2.0),
        )
