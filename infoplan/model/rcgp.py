"""The robust and conjugate Gaussian process: data far from a centre count less."""

import numpy as np

from infoplan.model.inference.robust_conjugate import RobustConjugateInference
from infoplan.model.kernel import Kernel
from infoplan.model.kernels import as_kernel
from infoplan.model.regression import Regression
from infoplan.model.theta import first_theta


class RobustConjugateProcess(Regression):
    """Zero-mean Gaussian process with a generalised posterior that weighs the data (RCGP).

    Altamirano, Briol and Knoblauch (2024). Used like `infoplan.model.GaussianProcess`, with the
    same scalers. Its hyperparameters maximise a leave-one-out log predictive density, which is
    what `log_marginal_likelihood` tells.

    Parameters
    ----------
    x_pilot : array_like of shape (n, 2)
        Positions of the pilot samples, workspace units.
    y_pilot : array_like of shape (n,)
        Their measurements, in the terrain's unit.
    outlier_fraction : float
        Share of the data that is expected to lie far from the centre: the soft threshold c is the
        quantile of the distances that so many exceed.
    centre_neighbours : int or None
        A datum's centre is the median of so many nearest others. None: the prior mean, the mean
        of the pilot's measurements, as in the paper.
    criterion : {"weighted", "plain"}
        Data count in the criterion by the squares of their weights (Laplante et al. 2025,
        "Robust and Conjugate Spatio-Temporal Gaussian Processes"), or alike, as in the paper.
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
        centre_neighbours: int | None = 10,
        criterion: str = "weighted",
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
        inference = RobustConjugateInference(
            kernel, jitter, outlier_fraction=outlier_fraction, neighbours=centre_neighbours,
            weighted=criterion == "weighted",
        )  # fmt: skip
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
