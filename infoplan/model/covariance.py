"""Compiled passes over the covariance of many positions, for any kernel.

Inputs are stored coordinate by coordinate, shape (2, n), so that the inner loops read contiguous
memory; with a kernel that has no branch and no call they compile to vector instructions. The
passes are closures over the kernel's compiled functions, which become part of them.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from infoplan.compiled import kernel as compiled
from infoplan.model.kernel import Kernel
from infoplan.model.packed import position, run_of

Sums = tuple[float, ...]


class Passes(NamedTuple):
    """The passes of one kernel.

    Attributes
    ----------
    fill
        (x, constants, variance, diagonal, out): writes the covariance of the data into `out` of
        shape (n (n + 1) / 2,), packed; `diagonal` is alpha^2 + sigma^2 + jitter.
    fill_cross
        (a, b, constants, variance, out): writes the covariances between two sets of inputs, shapes
        (2, m) and (2, n), into `out` of shape (m, n).
    fill_upper
        (x, constants, variance, diagonal, out): writes the upper triangle of the covariance of the
        data into `out` of shape (n, n), with `diagonal` on its diagonal; the rest stays as it is.
    gradient_sums
        (x, constants, weights, inverse): with W = w w^T - K_y^-1 (Rasmussen & Williams, eq. 5.9)
        of the weights w = K_y^-1 y and the packed inverse returns the sums over pairs of different
        data of W c and of W times the derivatives of c, and the trace of W.

    `constants` are the kernel's, `variance` is alpha^2, `x` has shape (2, n).
    """

    fill: Callable[[np.ndarray, Sums, float, float, np.ndarray], None]
    fill_cross: Callable[[np.ndarray, np.ndarray, Sums, float, np.ndarray], None]
    fill_upper: Callable[[np.ndarray, Sums, float, float, np.ndarray], None]
    gradient_sums: Callable[[np.ndarray, Sums, np.ndarray, np.ndarray], tuple[Sums, float]]


@cache
def passes_of(kernel: Kernel) -> Passes:
    """Return the passes of a kernel; each is compiled at its first call."""
    correlation, gradient = kernel.correlation, kernel.gradient
    nothing = (0.0,) * (1 + len(kernel.hyperparameters))
    add = adder(len(nothing))

    @compiled(fastmath={"contract"})
    def fill(
        x: np.ndarray, constants: Sums, variance: float, diagonal: float, out: np.ndarray
    ) -> None:
        x1, x2 = x[0], x[1]
        n = x1.size
        for p in range(n):
            out[position(p, p, n)] = diagonal
            first, stop, place = run_of(p, n)
            # Slices, so that the loop's index is seen to be non-negative and the loop vectorises.
            run1, run2, run = x1[first:stop], x2[first:stop], out[place : place + stop - first]
            for i in range(run.size):
                run[i] = variance * correlation(constants, run1[i], run2[i], x1[p], x2[p])

    @compiled(fastmath={"contract"})
    def fill_cross(
        a: np.ndarray, b: np.ndarray, constants: Sums, variance: float, out: np.ndarray
    ) -> None:
        b1, b2 = b[0], b[1]
        for i in range(a.shape[1]):
            for j in range(b1.size):
                out[i, j] = variance * correlation(constants, a[0, i], a[1, i], b1[j], b2[j])

    @compiled(fastmath={"contract"})
    def fill_upper(
        x: np.ndarray, constants: Sums, variance: float, diagonal: float, out: np.ndarray
    ) -> None:
        x1, x2 = x[0], x[1]
        for i in range(x1.size):
            out[i, i] = diagonal
            run1, run2, run = x1[i + 1 :], x2[i + 1 :], out[i, i + 1 :]
            for j in range(run.size):
                run[j] = variance * correlation(constants, x1[i], x2[i], run1[j], run2[j])

    @compiled(fastmath={"contract", "reassoc"})
    def gradient_sums(
        x: np.ndarray, constants: Sums, weights: np.ndarray, inverse: np.ndarray
    ) -> tuple[Sums, float]:
        x1, x2 = x[0], x[1]
        n = x1.size
        sums = nothing
        trace = 0.0
        for p in range(n):
            trace += weights[p] * weights[p] - inverse[position(p, p, n)]
            first, stop, place = run_of(p, n)
            run1, run2, run = x1[first:stop], x2[first:stop], inverse[place : place + stop - first]
            run_weights = weights[first:stop]
            for i in range(run.size):
                weight = run_weights[i] * weights[p] - run[i]
                sums = add(sums, gradient(weight, constants, run1[i], run2[i], x1[p], x2[p]))
        return sums, trace

    return Passes(fill, fill_cross, fill_upper, gradient_sums)


@cache
def adder(n: int) -> Callable[[Sums, Sums], Sums]:
    """Return a compiled sum of two tuples of n numbers; a loop over n would not vectorise."""
    if n == 1:

        @compiled(fastmath={"contract", "reassoc"})
        def add_one(a: Sums, b: Sums) -> Sums:
            return (a[0] + b[0],)

        return add_one
    add_rest = adder(n - 1)

    @compiled(fastmath={"contract", "reassoc"})
    def add(a: Sums, b: Sums) -> Sums:
        return (a[0] + b[0], *add_rest(a[1:], b[1:]))

    return add
