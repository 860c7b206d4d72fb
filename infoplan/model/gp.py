"""The Gaussian process with Gaussian noise."""

from collections.abc import Sequence

import numpy as np

from infoplan.model.inference.exact import ExactInference
from infoplan.model.kernel import Kernel
from infoplan.model.kernels import as_kernel
from infoplan.model.regression import JointRegression
from infoplan.model.theta import first_theta


class GaussianProcess(JointRegression):
    """Zero-mean Gaussian process with Gaussian noise.

    The pilot data are the first data of the model and fix the scalers: inputs go to [-1, 1] by
    the pilot's bounding box, observations to zero mean and unit (population) standard deviation.

    Parameters
    ----------
    x_pilot : array_like of shape (n, 2)
        Positions of the pilot samples, workspace units.
    y_pilot : array_like of shape (n,)
        Their measurements, in the terrain's unit.
    kernel : str or Kernel
        One of `infoplan.config.KERNELS`, or one's own.
    amplitude : float
        First alpha.
    lengthscale : float
        First value of all the kernel's lengthscales.
    noise_variance : float
        First sigma^2.
    jitter : float
        Added to sigma^2 in every factorisation. One that fails is repeated with ten times the
        jitter until it succeeds, or the jitter exceeds all variances; the next starts from this
        value again.
    dtype : {"float64", "float32"}
        Precision of kernel matrices, factorisations and solves.
    spacing, min_noise_variance, optimizer, learning_rate, min_lengthscale, lengthscale_prior, \
noise_prior, restarts, noise_start, optimizer_state
        How the hyperparameters are learned: as for `infoplan.model.regression.Regression`.

    Raises
    ------
    RunError
        If the pilot cannot fix the scalers: no extent, equal, non-finite or huge values. All that
        computes with the covariance raises it, too, if that cannot be factorised.
    """

    def __init__(
        self,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        spacing: float = 1.0,
        *,
        kernel: str | Kernel = "squared_exponential",
        amplitude: float = 1.0,
        lengthscale: float = 0.5,
        noise_variance: float = 1.0,
        jitter: float = 1e-6,
        dtype: str = "float64",
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
            ExactInference(kernel, jitter, dtype),
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
        )
