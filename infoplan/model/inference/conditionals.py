"""Compiled passes over the conditional distributions of blocks of data, for any kernel.

A block's data y_B given others y_C: with L the Cholesky factor of the covariance of (y_C, y_B),
the last of the residuals s = L^-1 (y_C, y_B) are independent standard normal, and the last rows V
of L^-1 whiten the block. The gradient follows from log p(y_B | y_C) = log p(y_C, y_B) - log p(y_C)
(Rasmussen & Williams, eq. 5.9, for both): with a = L^-T s and a_C = L_C^-T s_C the weights of the
derivatives are a a^T - a_C a_C^T - V^T V.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from infoplan.compiled import kernel as compiled
from infoplan.model.covariance import Sums, adder
from infoplan.model.kernel import Kernel


class Conditionals(NamedTuple):
    """The passes of one kernel.

    Attributes
    ----------
    likelihood
        (x, y, constants, variance, noise, members, starts, neighbours, scratch, with_gradient):
        whether all factorisations succeeded, the log density of all blocks given their neighbours,
        the sums over pairs of different data of the derivatives' weights times c and times the
        derivatives of c, and the sum over equal ones.
    information
        (x, y, constants, variance, noise, members, starts, neighbours, scratch, position, weights,
        first, columns, precision): adds to `weights` and `precision` those of the joint
        distribution of all data, Q y and Q, at the data whose `position` is not negative; row i of
        Q is in `precision` from `first[i]` on, in the `columns` there; tells whether all
        factorisations succeeded.

    `x` has shape (2, n), `noise` is sigma^2 + jitter, blocks are as in
    `infoplan.model.inference.neighbours.Blocks`, and `scratch` is an empty array of the dtype to
    compute in.
    """

    likelihood: Callable[..., tuple[bool, float, Sums, float]]
    information: Callable[..., bool]


@compiled(fastmath={"contract", "reassoc"})
def _factorise(factor: np.ndarray, residuals: np.ndarray, n: int) -> bool:
    """Replace a covariance's lower triangle by its Cholesky factor L, and y by L^-1 y."""
    for i in range(n):
        row = factor[i]
        for j in range(i):
            other, total = factor[j], row[j]
            for k in range(j):
                total -= row[k] * other[k]
            row[j] = total / other[j]
        pivot, residual = row[i], residuals[i]
        for k in range(i):
            pivot -= row[k] * row[k]
            residual -= row[k] * residuals[k]
        if not pivot > 0.0:
            return False
        row[i] = np.sqrt(pivot)
        residuals[i] = residual / row[i]
    return True


@compiled(fastmath={"contract", "reassoc"})
def _solve_transposed(factor: np.ndarray, vector: np.ndarray, n: int) -> None:
    """Replace a vector v by L^-T v."""
    for i in range(n - 1, -1, -1):
        row = factor[i]
        vector[i] /= row[i]
        value = vector[i]
        for k in range(i):
            vector[k] -= row[k] * value


@compiled(fastmath={"contract"})
def _whitening(factor: np.ndarray, first: int, n: int, out: np.ndarray) -> None:
    """Write the rows from `first` of L^-1."""
    for i in range(first, n):
        row = out[i - first]
        row[:n] = 0.0
        row[i] = 1.0
        _solve_transposed(factor, row, i + 1)


@cache
def conditionals_of(kernel: Kernel) -> Conditionals:
    """Return the passes of a kernel; each is compiled at its first call."""
    correlation, gradient = kernel.correlation, kernel.gradient
    nothing = (0.0,) * (1 + len(kernel.hyperparameters))
    add = adder(len(nothing))

    @compiled(fastmath={"contract", "reassoc"})
    def weighted(
        weights: np.ndarray, constants: Sums, x1: np.ndarray, x2: np.ndarray, i: int
    ) -> Sums:
        sums = nothing
        run1, run2 = x1[:i], x2[:i]
        for j in range(run1.size):
            sums = add(sums, gradient(weights[j], constants, run1[j], run2[j], x1[i], x2[i]))
        return sums

    @compiled(fastmath={"contract"})
    def gather(
        x: np.ndarray,
        y: np.ndarray,
        constants: Sums,
        variance: float,
        noise: float,
        block: np.ndarray,
        given: np.ndarray,
        x1: np.ndarray,
        x2: np.ndarray,
        residuals: np.ndarray,
        factor: np.ndarray,
    ) -> int:
        """Write positions, data, covariance of those given and the block; return how many are."""
        count = 0
        for number in given:
            if number >= 0:
                x1[count], x2[count], residuals[count] = x[0, number], x[1, number], y[number]
                count += 1
        for i, number in enumerate(block):
            x1[count + i], x2[count + i] = x[0, number], x[1, number]
            residuals[count + i] = y[number]
        for i in range(count + block.size):
            row, run1, run2 = factor[i, :i], x1[:i], x2[:i]
            for j in range(run1.size):
                row[j] = variance * correlation(constants, run1[j], run2[j], x1[i], x2[i])
            factor[i, i] = variance + noise
        return count

    @compiled(fastmath={"contract"})
    def likelihood(
        x: np.ndarray,
        y: np.ndarray,
        constants: Sums,
        variance: float,
        noise: float,
        members: np.ndarray,
        starts: np.ndarray,
        neighbours: np.ndarray,
        scratch: np.ndarray,
        with_gradient: bool,
    ) -> tuple[bool, float, Sums, float]:
        longest = np.max(starts[1:] - starts[:-1])
        most = longest + neighbours.shape[1]
        x1, x2 = np.empty(most), np.empty(most)
        factor = np.empty((most, most), scratch.dtype)
        rows = np.empty((longest, most), scratch.dtype)
        residuals = np.empty(most, scratch.dtype)
        given, all_of_them = np.empty(most, scratch.dtype), np.empty(most, scratch.dtype)
        run = np.empty(most)
        value, sums, trace = 0.0, nothing, 0.0
        for b in range(starts.size - 1):
            block = members[starts[b] : starts[b + 1]]
            c = gather(
                x, y, constants, variance, noise, block, neighbours[b], x1, x2, residuals, factor
            )
            n = c + block.size
            if not _factorise(factor, residuals, n):
                return False, value, sums, trace
            for i in range(c, n):
                value -= 0.5 * residuals[i] ** 2 + np.log(factor[i, i]) + 0.5 * np.log(2.0 * np.pi)
            if not with_gradient:
                continue
            _whitening(factor, c, n, rows)
            given[:n] = 0.0
            given[:c] = residuals[:c]
            _solve_transposed(factor, given, c)
            all_of_them[:n] = given[:n]
            for r in range(block.size):
                all_of_them[:n] += residuals[c + r] * rows[r, :n]
            for i in range(n):
                part = run[: i + 1]
                for j in range(i + 1):
                    part[j] = all_of_them[i] * all_of_them[j] - given[i] * given[j]
                for r in range(block.size):
                    row = rows[r, : i + 1]
                    for j in range(i + 1):
                        part[j] -= row[i] * row[j]
                trace += part[i]
                sums = add(sums, weighted(part, constants, x1, x2, i))
        return True, value, sums, trace

    @compiled(fastmath={"contract"})
    def information(
        x: np.ndarray,
        y: np.ndarray,
        constants: Sums,
        variance: float,
        noise: float,
        members: np.ndarray,
        starts: np.ndarray,
        neighbours: np.ndarray,
        scratch: np.ndarray,
        position: np.ndarray,
        weights: np.ndarray,
        first: np.ndarray,
        columns: np.ndarray,
        precision: np.ndarray,
    ) -> bool:
        longest = np.max(starts[1:] - starts[:-1])
        most = longest + neighbours.shape[1]
        x1, x2 = np.empty(most), np.empty(most)
        factor = np.empty((most, most), scratch.dtype)
        rows = np.empty((longest, most), scratch.dtype)
        residuals = np.empty(most, scratch.dtype)
        places, slots = np.empty(most, np.int64), np.empty((most, most), np.int64)
        for b in range(starts.size - 1):
            block = members[starts[b] : starts[b + 1]]
            c = 0
            touched = False
            for number in neighbours[b]:
                if number >= 0:
                    places[c] = position[number]
                    touched |= places[c] >= 0
                    c += 1
            for i, number in enumerate(block):
                places[c + i] = position[number]
                touched |= places[c + i] >= 0
            if not touched:
                continue
            gather(
                x, y, constants, variance, noise, block, neighbours[b], x1, x2, residuals, factor
            )
            n = c + block.size
            if not _factorise(factor, residuals, n):
                return False
            _whitening(factor, c, n, rows)
            for i in range(n):
                for j in range(n if places[i] >= 0 else 0):
                    if places[j] >= 0:
                        begin, end = first[places[i]], first[places[i] + 1]
                        slots[i, j] = begin + np.searchsorted(columns[begin:end], places[j])
            for r in range(block.size):
                for i in range(c + r + 1):
                    if places[i] >= 0:
                        weights[places[i]] += rows[r, i] * residuals[c + r]
                        for j in range(c + r + 1):
                            if places[j] >= 0:
                                precision[slots[i, j]] += rows[r, i] * rows[r, j]
        return True

    return Conditionals(likelihood, information)
