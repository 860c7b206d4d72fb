"""The Gaussian process that trims its data: those it predicts worst are left out, step by step."""

from functools import partial

import numpy as np
from scipy.special import gammainc, gammaincinv

from infoplan.model.inference.exact import ExactInference
from infoplan.model.kernel import Kernel
from infoplan.model.kernels import as_kernel
from infoplan.model.optimizers import optimizer_of
from infoplan.model.regression import Regression
from infoplan.model.scaling import checked
from infoplan.model.theta import first_theta


class IterativeTrimmingProcess(Regression):
    """Zero-mean Gaussian process with Gaussian noise, of the data that it does not trim (ITGP).

    Li, Li and Shao (2021), "Robust Gaussian Process Regression Based on Iterative Trimming". Used
    like `infoplan.model.GaussianProcess`, with the same scalers. Each call of `optimize` goes
    through all steps: a fit to all data, `shrinking` ones to ever smaller shares of them, those
    with the smallest residuals in units of their predicted deviation, `concentrating` ones to
    `alpha1` of them, and `reweighting` ones to all that lie within the `alpha2` quantile. Each
    starts from the hyperparameters of the one before. Data that came since `optimize` are trimmed
    under the present hyperparameters. `log_marginal_likelihood` is that of the data kept.

    Parameters
    ----------
    x_pilot : array_like of shape (n, 2)
        Positions of the pilot samples, workspace units.
    y_pilot : array_like of shape (n,)
        Their measurements, in the terrain's unit.
    alpha1 : float
        Share of the data that is kept while concentrating.
    alpha2 : float
        Probability of the central interval inside which reweighting keeps data.
    shrinking, concentrating, reweighting : int
        Most steps of each kind; concentrating and reweighting end where the data kept stay.
    kernel, amplitude, lengthscale, noise_variance, jitter, min_noise_variance, optimizer, \
learning_rate, dtype
        As for `infoplan.model.GaussianProcess`.

    Raises
    ------
    RunError
        If the pilot cannot fix the scalers, or a covariance cannot be factorised.
    """

    _inference: ExactInference

    def __init__(
        self,
        x_pilot: np.ndarray,
        y_pilot: np.ndarray,
        *,
        alpha1: float = 0.5,
        alpha2: float = 0.975,
        shrinking: int = 2,
        concentrating: int = 2,
        reweighting: int = 1,
        kernel: str | Kernel = "squared_exponential",
        amplitude: float = 1.0,
        lengthscale: float = 0.5,
        noise_variance: float = 1.0,
        jitter: float = 1e-6,
        min_noise_variance: float = 1e-4,
        optimizer: str = "lbfgs",
        learning_rate: float = 0.01,
        dtype: str = "float64",
    ) -> None:
        kernel = as_kernel(kernel)
        self._shares = shares(alpha1, shrinking, concentrating)
        self._alpha2, self._shrinking, self._reweighting = alpha2, shrinking, reweighting
        self._is_trimmed = False
        self._first = first_theta(kernel, amplitude, lengthscale, noise_variance)
        self._new_optimizer = partial(optimizer_of, optimizer, learning_rate)
        super().__init__(
            ExactInference(kernel, jitter, dtype),
            kernel,
            self._first,
            x_pilot,
            y_pilot,
            min_noise_variance=min_noise_variance,
            optimizer=optimizer,
            learning_rate=learning_rate,
            noise_factor=consistency(alpha2 if reweighting else self._shares[-1]),
        )

    @property
    def log_marginal_likelihood(self) -> float:
        """Of the data kept and the present hyperparameters, in nats, scaled units."""
        self._trim_new()
        return super().log_marginal_likelihood

    def replace(self, x: np.ndarray, y: np.ndarray) -> None:
        """Take these data in place of the present ones; scalers and hyperparameters stay.

        Parameters
        ----------
        x : ndarray of shape (n, 2)
            Positions, workspace units.
        y : ndarray of shape (n,)
            Measurements; n may be 0.

        Raises
        ------
        RunError
            If a value is not finite.
        """
        self._x, self._y = checked(x, y)
        self._is_trimmed = False

    def optimize(self, iterations: int) -> None:
        """Trim, and climb the log marginal likelihood of the data kept at every step.

        Parameters
        ----------
        iterations : int
            Of the optimiser, each step; 0 leaves the hyperparameters as they are.
        """
        self._trim(iterations)

    def predict(self, x: np.ndarray, *, noisy: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and standard deviation.

        Parameters
        ----------
        x : array_like of shape (m, 2)
            Query positions, workspace units.
        noisy : bool
            Add the noise to the latent variance.

        Returns
        -------
        mean, std : ndarrays of shape (m,)
            In the unit of the measurements; the variances are those of the data kept times the
            consistency factor, as trimming makes noise look smaller.
        """
        self._trim_new()
        mean, std = super().predict(x)
        variance = self._noise_factor * std**2 + (self.observation_noise_std**2 if noisy else 0.0)
        return mean, np.sqrt(variance)

    def _trim_new(self) -> None:
        """Trim data that came since the last time."""
        if not self._is_trimmed:
            self._trim(0)

    def _trim(self, iterations: int) -> None:
        """Go through all steps (their Algorithm 1)."""
        self._is_trimmed = True
        x, y = self._scaler.inputs(self._x), self._scaler.outputs(self._y)
        kept = np.ones(y.size, dtype=bool)
        square = self._fit(x, y, kept, iterations)
        for step, share in enumerate(self._shares[1:] if y.size else (), start=1):
            rank = int(min(np.ceil(y.size * share - 0.5), y.size - 1))
            before, kept = kept, square <= np.partition(square, rank)[rank]
            if step > self._shrinking + 1 and np.array_equal(kept, before):
                break
            square = self._fit(x, y, kept, iterations)
        bound = quantile(self._alpha2)
        factor = consistency(self._shares[-1])
        for _ in range(self._reweighting if y.size else 0):
            before, kept = kept, square <= bound * factor
            if np.array_equal(kept, before):
                break
            square, factor = self._fit(x, y, kept, iterations), consistency(self._alpha2)

    def _fit(self, x: np.ndarray, y: np.ndarray, kept: np.ndarray, iterations: int) -> np.ndarray:
        """Fit to the data kept; returns all squared residuals over their predicted variances."""
        self._inference.set_data(np.ascontiguousarray(x[:, kept]), y[kept])
        if iterations:
            self._theta, self._optimizer = self._first, self._new_optimizer()
            super().optimize(iterations)
        mean, variance = self._inference.predict(self._theta, x)
        noise = float(self.hyperparameters.noise_std) ** 2
        squares: np.ndarray = (y - mean) ** 2 / (variance + noise)
        return squares


def shares(alpha1: float, shrinking: int, concentrating: int) -> list[float]:
    """Shares of the data that each step keeps, from all to `alpha1`.

    Examples
    --------
    >>> shares(0.5, 1, 2)
    [1.0, 0.75, 0.5, 0.5]
    """
    shrunk = [1.0 - (1.0 - alpha1) * step / (shrinking + 1) for step in range(shrinking + 1)]
    return shrunk + [alpha1] * concentrating


def consistency(share: float) -> float:
    """Variance of Gaussian noise over that of the central share of it (Croux and Haesbroeck 1999).

    Examples
    --------
    >>> round(consistency(0.975), 4), consistency(1.0)
    (1.1748, 1.0)
    """
    return float(share / gammainc(1.5, 0.5 * quantile(share)))


def quantile(probability: float) -> float:
    """Quantile of the chi-squared distribution with one degree of freedom."""
    return float(2.0 * gammaincinv(0.5, probability))
