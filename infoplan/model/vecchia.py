"""The Gaussian process with Gaussian noise, conditioned on nearest neighbours alone."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array

from infoplan.model.inference.vecchia import VecchiaInference
from infoplan.model.kernel import Kernel
from infoplan.model.kernels import as_kernel
from infoplan.model.regression import Regression
from infoplan.model.scaling import checked
from infoplan.model.theta import first_theta


class VecchiaProcess(Regression):
    """Zero-mean Gaussian process with Gaussian noise, at a cost that is linear in the data.

    Used like `infoplan.model.GaussianProcess`, which it equals to rounding while the data are no
    more than `neighbours` and `prediction_neighbours`. Data that are appended become blocks of
    their own; neighbours are looked for anew when, after `optimize`, the ratio of the lengthscales
    has changed by half or more.

    Parameters
    ----------
    x_pilot : array_like of shape (n, 2)
        Positions of the pilot samples, workspace units.
    y_pilot : array_like of shape (n,)
        Their measurements, in the terrain's unit.
    neighbours : int
        The most data that a block is conditioned on in the likelihood.
    block : int
        The most data that are conditioned together.
    prediction_neighbours : int
        The most data that a prediction is conditioned on.
    ordering : {"collected", "maxmin", "random"}
        Order of conditioning: as the data come, each block as far as can be from all before, or a
        permutation. The last two look for all neighbours anew whenever data come.
    kernel, amplitude, lengthscale, noise_variance, jitter, dtype, spacing, min_noise_variance, \
optimizer, learning_rate, min_lengthscale, lengthscale_prior, noise_prior, restarts, noise_start, \
optimizer_state
        As for `infoplan.model.GaussianProcess`.

    Raises
    ------
    RunError
        If the pilot cannot fix the scalers, or a covariance cannot be factorised.
    """

    _inference: VecchiaInference

    def __init__(
        self,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        spacing: float = 1.0,
        *,
        neighbours: int = 30,
        block: int = 7,
        prediction_neighbours: int = 160,
        ordering: str = "collected",
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
        inference = VecchiaInference(
            kernel, jitter, neighbours=neighbours, block=block, ordering=ordering, dtype=dtype,
            prediction_neighbours=prediction_neighbours,
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
            min_lengthscale=min_lengthscale,
            spacing=spacing,
            lengthscale_prior=lengthscale_prior,
            noise_prior=noise_prior,
            restarts=restarts,
        )

    def optimize(self, iterations: int) -> None:
        """Climb the log marginal likelihood, then let the neighbours follow the lengthscales."""
        super().optimize(iterations)
        self._inference.settle(self._theta)

    def adopt(self, other: Regression) -> None:
        """Take the hyperparameters of another one, then let the neighbours follow."""
        super().adopt(other)
        self._inference.settle(self._theta)

    def recall(self, hyperparameters: Mapping[str, float]) -> None:
        """Take hyperparameters that were told before, then let the neighbours follow."""
        super().recall(hyperparameters)
        self._inference.settle(self._theta)

    def weights_and_inverse(
        self, x: np.ndarray, y: np.ndarray, chosen: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Do as `Regression.weights_and_inverse`, of the distribution that the likelihood has."""
        return self._taught(x, y).weights_and_inverse(self._theta, chosen)

    def weights_and_sparse_inverse(
        self, x: np.ndarray, y: np.ndarray, chosen: np.ndarray
    ) -> tuple[np.ndarray, csr_array]:
        """Do as `weights_and_inverse`; the inverse has the blocks and their neighbours alone."""
        return self._taught(x, y).weights_and_sparse_inverse(self._theta, chosen)

    def _taught(self, x: np.ndarray, y: np.ndarray) -> VecchiaInference:
        """Return an inference of other data; the model stays as it is."""
        x, y = checked(x, y)
        inference = self._inference.copied()
        inference.set_data(self._scaler.inputs(x), self._scaler.outputs(y))
        return inference
