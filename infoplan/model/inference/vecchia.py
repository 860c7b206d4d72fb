"""Inference under Gaussian noise from nearest neighbours, at a cost linear in the data.

The likelihood is the product over blocks of data of p(block | its nearest earlier data) (Vecchia
1988), in blocks as Guinness (2018) has them, between noisy observations as Datta et al. (2016).
With all earlier data as neighbours it is that of the exact Gaussian process. A prediction
conditions a group of places on the data nearest to it.
"""

import copy
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.sparse import csr_array

from infoplan.errors import RunError
from infoplan.model.covariance import Sums, passes_of
from infoplan.model.inference.conditionals import conditionals_of
from infoplan.model.inference.neighbours import (
    Blocks,
    build,
    cut,
    extended,
    find_neighbours,
    pattern,
)
from infoplan.model.kernel import Kernel
from infoplan.model.theta import (
    Parameters,
    gradient_of,
    names_of,
    not_factorised,
    parameters_of,
)

Found = TypeVar("Found")

# Places that are predicted from the same data.
_GROUP = 25
# Neighbours are looked for anew when the ratio of the lengthscales has changed by this factor.
_OTHER_RATIO = 1.5
# Where a jitter of zero starts to grow.
_FIRST_JITTER = 1e-10


class VecchiaInference:
    """Log marginal likelihood of some data, its gradient and the predictive distribution.

    All are functions of theta (`infoplan.model.theta`) and of the blocks, which `set_data` and
    `settle` alone change.

    Parameters
    ----------
    kernel : Kernel
        Of the latent function.
    jitter : float
        Added to the noise variance, ten times as much whenever a factorisation fails.
    neighbours : int
        The most data that a block is conditioned on.
    block : int
        The most data in a block.
    prediction_neighbours : int
        The most data that a prediction is conditioned on.
    ordering : {"collected", "maxmin", "random"}
        Order of conditioning.
    dtype : {"float64", "float32"}
        Of covariances, factorisations and solves. Sums over data are always in double.

    Attributes
    ----------
    jitter : float
        What the last factorisation used.
    blocks : Blocks
        Of the present data.
    """

    def __init__(
        self,
        kernel: Kernel,
        jitter: float,
        *,
        neighbours: int,
        block: int,
        prediction_neighbours: int,
        ordering: str,
        dtype: str = "float64",
    ) -> None:
        self._kernel = kernel
        self._passes, self._conditionals = passes_of(kernel), conditionals_of(kernel)
        self.jitter = jitter
        self._configured_jitter = jitter
        self._neighbours, self._block, self._ordering = neighbours, block, ordering
        self._prediction_neighbours = prediction_neighbours
        self._scratch = np.empty(0, dtype=dtype)
        self._potrf, self._trtrs = get_lapack_funcs(("potrf", "trtrs"), dtype=dtype)
        self._units = np.ones((2, 1))
        self._x, self._y = np.empty((2, 0)), np.empty(0)
        self.blocks = Blocks.none(neighbours)
        self._places = np.empty((2, 0))  # of the last prediction, and their groups
        self._groups: list[np.ndarray] = []

    @property
    def n_data(self) -> int:
        """Number of data."""
        return self._y.size

    def copied(self) -> "VecchiaInference":
        """Return an inference of the same data, which may be given others."""
        return copy.copy(self)

    def set_data(self, x: np.ndarray, y: np.ndarray) -> None:
        """Take other data. Those that only follow the present ones make blocks of their own.

        Parameters
        ----------
        x : ndarray of shape (2, n)
            Scaled inputs, finite.
        y : ndarray of shape (n,)
            Scaled observations, finite.
        """
        old = self.n_data
        goes_on = self._ordering == "collected" and np.array_equal(x[:, :old], self._x)
        self._x, self._y = x, y
        if not goes_on:
            self._rebuild()
        elif x.shape[1] > old:
            scaled = x / self._units
            new = [old + numbers for numbers in cut(scaled[:, old:], self._block)]
            self.blocks = extended(self.blocks, new, scaled)

    def settle(self, theta: np.ndarray) -> None:
        """Look for neighbours anew if the lengthscales have become others.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters. Distances count in the kernel's `lengthscale_1` and `_2`; a kernel
            without these leaves them as they are.
        """
        values = dict(zip(names_of(self._kernel), np.exp(theta).tolist(), strict=True))
        if not {"lengthscale_1", "lengthscale_2"} <= set(values):
            return
        units = np.array([[values["lengthscale_1"]], [values["lengthscale_2"]]])
        change = np.log(units[0] / units[1]) - np.log(self._units[0] / self._units[1])
        if abs(float(change[0])) > np.log(_OTHER_RATIO):
            self._units = units
            self._rebuild()

    def lml(self, theta: np.ndarray) -> float:
        """Log marginal likelihood, in nats; 0 without data.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.
        """
        return self._evaluate(theta, with_gradient=False)[0] if self.n_data else 0.0

    def lml_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Log marginal likelihood and its gradient.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.

        Returns
        -------
        value : float
            The likelihood in nats.
        gradient : ndarray of shape (k,)
            Its derivatives by theta.
        """
        self.jitter = self._configured_jitter
        if self.n_data == 0:
            return 0.0, np.zeros_like(theta)
        value, sums, trace = self._evaluate(theta, with_gradient=True)
        variance, _, noise = parameters_of(self._kernel, theta)
        return value, gradient_of(variance, sums, trace, 0.5 * noise * trace)

    def predict(self, theta: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predictive mean and latent variance, each group of places from the data nearest to it.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.
        x : ndarray of shape (2, m)
            Scaled query inputs.

        Returns
        -------
        mean, variance : ndarrays of shape (m,)
            In scaled units. The variance is at least alpha^2 times the machine epsilon of the
            dtype, which is the rounding of the difference that gives it.
        """
        parameters = parameters_of(self._kernel, theta)
        variance, constants, _ = parameters
        means, variances = np.zeros(x.shape[1]), np.full(x.shape[1], variance)
        for places, near in self._grouped(x) if self.n_data and x.size else []:
            inside, around = np.ascontiguousarray(x[:, places]), self._x[:, near]
            rows = np.empty((len(places) + 1, len(near)), dtype=self._scratch.dtype)
            self._passes.fill_cross(inside, around, constants, variance, rows[:-1])
            rows[-1] = self._y[near]
            factor = self._factor(theta, parameters, around)
            solved, _ = self._trtrs(factor, rows.T, lower=1, overwrite_b=1)
            means[places] = solved[:, :-1].T @ solved[:, -1]
            variances[places] -= np.einsum("ij,ij->j", solved[:, :-1], solved[:, :-1])
        floor = variance * float(np.finfo(self._scratch.dtype).eps)
        return means, np.maximum(variances, floor)

    def weights_and_inverse(
        self, theta: np.ndarray, chosen: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Do as `weights_and_sparse_inverse`, with all zeros of the inverse."""
        weights, inverse = self.weights_and_sparse_inverse(theta, chosen)
        return weights, inverse.toarray()

    def weights_and_sparse_inverse(
        self, theta: np.ndarray, chosen: np.ndarray
    ) -> tuple[np.ndarray, csr_array]:
        """Weights of some data, and their part of the inverse covariance of all.

        Both are those of the joint distribution whose density the likelihood is.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.
        chosen : ndarray of int, shape (c,)
            Numbers of the data.

        Returns
        -------
        weights : ndarray of shape (c,)
            Of K_y^-1 y.
        inverse : sparse array of shape (c, c)
            Of K_y^-1, by rows, with sorted columns.
        """
        position = np.full(self.n_data, -1)
        position[chosen] = np.arange(len(chosen))
        first, columns = pattern(self.blocks, position, len(chosen))

        def attempt() -> tuple[np.ndarray, csr_array] | None:
            weights, values = np.zeros(len(chosen)), np.zeros(len(columns))
            done = self._conditionals.information(
                *self._data(theta), position, weights, first, columns, values
            )
            shape = (len(chosen), len(chosen))
            return (weights, csr_array((values, columns, first), shape)) if done else None

        return self._until_positive(theta, attempt)

    def _evaluate(self, theta: np.ndarray, with_gradient: bool) -> tuple[float, Sums, float]:
        """Log density, and the sums that its gradient is made of."""

        def attempt() -> tuple[float, Sums, float] | None:
            done, value, sums, trace = self._conditionals.likelihood(
                *self._data(theta), with_gradient
            )
            return (value, sums, trace) if done else None

        return self._until_positive(theta, attempt)

    def _data(self, theta: np.ndarray) -> tuple[Any, ...]:
        """Gather what both compiled passes are given first."""
        variance, constants, noise = parameters_of(self._kernel, theta)
        blocks = self.blocks
        return (
            self._x, self._y, constants, variance, noise + self.jitter,
            blocks.members, blocks.starts, blocks.neighbours, self._scratch,
        )  # fmt: skip

    def _factor(self, theta: np.ndarray, parameters: Parameters, x: np.ndarray) -> np.ndarray:
        """Lower Cholesky factor of the covariance of some data."""
        variance, constants, noise = parameters

        def attempt() -> np.ndarray | None:
            covariance = np.empty((x.shape[1], x.shape[1]), dtype=self._scratch.dtype)
            on_diagonal = variance + noise + self.jitter
            self._passes.fill_upper(x, constants, variance, on_diagonal, covariance)
            factor, info = self._potrf(covariance.T, lower=1, clean=0, overwrite_a=1)
            return factor if info == 0 and np.isfinite(factor.diagonal()).all() else None

        return self._until_positive(theta, attempt)

    def _until_positive(self, theta: np.ndarray, attempt: Callable[[], Found | None]) -> Found:
        """Repeat what fails with ten times the jitter, until it succeeds."""
        while (found := attempt()) is None:
            variance, _, noise = parameters_of(self._kernel, theta)
            largest = float(np.finfo(self._scratch.dtype).max)
            if not self.jitter <= variance + noise < largest:
                raise RunError(
                    not_factorised("Vecchia process", self._kernel, theta, self._scratch.dtype)
                )
            self.jitter = max(10.0 * self.jitter, _FIRST_JITTER)
        return found

    def _rebuild(self) -> None:
        self.blocks = build(self._x / self._units, self._ordering, self._block, self._neighbours)

    def _grouped(self, x: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """List groups of places that lie together, and the data nearest to each."""
        if not np.array_equal(x, self._places):
            self._places, self._groups = x.copy(), cut(x, _GROUP)
        starts = np.cumsum([0, *map(len, self._groups)])
        near = np.empty((len(self._groups), min(self._prediction_neighbours, self.n_data)), int)
        find_neighbours(
            self._x / self._units,
            np.ascontiguousarray(x[:, np.concatenate(self._groups)] / self._units),
            starts,
            np.full(len(self._groups), self.n_data),
            near,
        )
        return list(zip(self._groups, near, strict=True))
