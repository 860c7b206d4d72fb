"""The process of nearest neighbours once more, in the plainest way: what the audit compares with.

Nothing here is shared with what missions run, but the order of a few roundings: which of two
equally near samples is taken must not depend on them.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import norm

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

Blocks = list[tuple[Integers, Integers]]
"""Samples that are given, the nearest first, and those of the block; blocks in their order."""

Neighbourhood = tuple[Blocks, Floats] | None
"""Blocks, and the units in which distances count, shape (2,); None: not known."""

GROUP = 25
"""Places that are predicted from the same samples."""

OTHER_RATIO = 1.5
"""Change of the lengthscales' ratio from which on neighbours are looked for anew."""


def follow(
    x: Floats,
    held: Iterable[Integers | None],
    lengthscales: Iterable[Floats],
    size: int,
    neighbours: int,
    ordering: str,
) -> Iterator[Neighbourhood]:
    """Go through the epochs of a mission.

    Parameters
    ----------
    x
        Positions of all samples, as the model scales them, shape (n, 2).
    held
        Numbers of the samples that the model holds after each epoch; None: not known.
    lengthscales
        Learned by then, shape (2,); NaN if the kernel has none.
    size, neighbours, ordering
        Options of the model.

    Yields
    ------
    blocks, units : list of pairs, ndarray of shape (2,)
        After each epoch; None from the first on whose samples are not known.
    """
    before, units = np.empty(0, dtype=int), np.ones(2)
    blocks: Blocks = []
    for numbers, learned in zip(held, lengthscales, strict=False):
        if numbers is None:
            break
        blocks = taught(x, before, blocks, numbers, units, size, neighbours, ordering)
        before = numbers
        change = np.log(learned[0] / learned[1]) - np.log(units[0] / units[1])
        if abs(change) > np.log(OTHER_RATIO):
            units = learned
            blocks = taught(x, before[:0], [], numbers, units, size, neighbours, ordering)
        yield blocks, units
    while True:
        yield None


def taught(
    x: Floats,
    before: Integers,
    blocks: Blocks,
    numbers: Integers,
    units: Floats,
    size: int,
    neighbours: int,
    ordering: str,
) -> Blocks:
    """Blocks after a model that holds some samples has been given others in their place."""
    old = len(before)
    if ordering != "collected" or not np.array_equal(x[numbers[:old]], x[before]):
        old, blocks = 0, []
    places = x / units
    new = [numbers[old:][part] for part in cut(places[numbers[old:]], size)]
    if ordering == "maxmin":
        new = [
            new[b] for b in _farthest_first(np.array([places[part].mean(axis=0) for part in new]))
        ]
    elif ordering == "random":
        new = [new[b] for b in np.random.default_rng(0).permutation(len(new))]
    blocks = list(blocks)
    earlier = np.concatenate([np.empty(0, dtype=int), *[part for _, part in blocks]])
    for part in new:
        blocks.append((nearest(places, places[part], earlier, neighbours), part))
        earlier = np.concatenate([earlier, part])
    return blocks


def cut(places: Floats, size: int) -> list[Integers]:
    """Halve places along their longer side until no part has more than `size`."""

    def parts(numbers: list[int]) -> list[list[int]]:
        if len(numbers) <= size:
            return [sorted(numbers)]
        sides = np.ptp(places[numbers], axis=0)
        axis = 0 if sides[0] >= sides[1] else 1
        ranked = sorted(numbers, key=lambda number: float(places[number, axis]))
        middle = size * (-(-len(numbers) // size) // 2)
        return parts(ranked[:middle]) + parts(ranked[middle:])

    found = parts(list(range(len(places)))) if len(places) else []
    return [np.array(part) for part in sorted(found)]


def nearest(places: Floats, group: Floats, among: Integers, count: int) -> Integers:
    """Find the samples nearest to any place of a group, of equally near ones the earlier."""
    squares = (group[:, None, :] - places[among]) ** 2
    distance = (squares[..., 0] + squares[..., 1]).min(axis=0)
    return among[np.argsort(distance, kind="stable")[:count]]


def log_likelihood(x: Floats, y: Floats, kernel: Any, noise: float, blocks: Blocks) -> float:
    """Sum the log densities of the blocks given their neighbours."""
    total = 0.0
    for given, part in blocks:
        residuals, factor = _whitened(x, y, kernel, noise, np.concatenate([given, part]))
        own = slice(len(given), None)
        total += float(np.sum(norm.logpdf(residuals[own]) - np.log(factor.diagonal()[own])))
    return total


def information(
    x: Floats, y: Floats, kernel: Any, noise: float, blocks: Blocks, chosen: Integers
) -> tuple[Floats, Floats]:
    """Precision of some samples in the joint distribution of all, and its product with all data."""
    place = {int(number): i for i, number in enumerate(chosen)}
    weights, precision = np.zeros(len(chosen)), np.zeros((len(chosen), len(chosen)))
    for given, part in blocks:
        numbers = np.concatenate([given, part])
        mine = [i for i, number in enumerate(numbers) if int(number) in place]
        if mine:
            residuals, factor = _whitened(x, y, kernel, noise, numbers)
            rows = solve_triangular(factor, np.eye(len(numbers)), lower=True)[len(given) :]
            there = [place[int(numbers[i])] for i in mine]
            weights[there] += rows[:, mine].T @ residuals[len(given) :]
            precision[np.ix_(there, there)] += rows[:, mine].T @ rows[:, mine]
    return weights, precision


def predict(
    x: Floats,
    y: Floats,
    kernel: Any,
    noise: float,
    numbers: Integers,
    queries: Floats,
    units: Floats,
    count: int,
) -> tuple[Floats, Floats]:
    """Predict places, each group of them from the samples nearest to it; latent mean and std."""
    mean, variance = np.zeros(len(queries)), np.zeros(len(queries))
    for group in cut(queries, GROUP):
        near = nearest(x / units, (queries / units)[group], numbers, count)
        residuals, factor = _whitened(x, y, kernel, noise, near)
        cross = solve_triangular(factor, kernel(x[near], queries[group]), lower=True)
        mean[group] = cross.T @ residuals
        variance[group] = kernel.diag(queries[group]) - np.sum(cross**2, axis=0)
    return mean, np.sqrt(np.maximum(variance, np.finfo(float).eps * kernel.diag(queries)))


def _whitened(
    x: Floats, y: Floats, kernel: Any, noise: float, numbers: Integers
) -> tuple[Floats, Floats]:
    """Residuals of some data in their order, each over its deviation given those before; factor."""
    covariance = kernel(x[numbers]) + noise * np.eye(len(numbers))
    factor = cholesky(covariance, lower=True)
    return solve_triangular(factor, y[numbers], lower=True), factor


def _farthest_first(centres: Floats) -> list[int]:
    """Order places so that each is as far as can be from all before it."""
    squares = (centres - centres.mean(axis=0)) ** 2
    order = [int(np.argmin(squares[:, 0] + squares[:, 1]))]
    while len(order) < len(centres):
        squares = (centres[:, None, :] - centres[order]) ** 2
        order.append(int(np.argmax((squares[..., 0] + squares[..., 1]).min(axis=1))))
    return order
