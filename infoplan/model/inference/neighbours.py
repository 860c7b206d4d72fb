"""Blocks of data that lie together, and the nearest data among those that come before.

What the likelihood of nearest neighbours (`infoplan.model.inference.vecchia`) is made of: data in
blocks, the blocks in an order, and for each block the data of earlier blocks that lie nearest.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoplan.compiled import kernel

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Blocks:
    """Data in blocks, and the neighbours of each block.

    Attributes
    ----------
    members : ndarray of int, shape (n,)
        Numbers of the data, block by block, in the order of conditioning.
    starts : ndarray of int, shape (b + 1,)
        Where in `members` each block starts, and the end.
    neighbours : ndarray of int, shape (b, m)
        Numbers of the data that each block is conditioned on, the nearest first; -1: none.
    """

    members: Integers
    starts: Integers
    neighbours: Integers

    @classmethod
    def none(cls, neighbours: int) -> "Blocks":
        """Blocks of no data."""
        return cls(np.empty(0, int), np.zeros(1, int), np.empty((0, neighbours), int))

    def __len__(self) -> int:
        """Count the blocks."""
        return len(self.starts) - 1


def cut(x: np.ndarray, size: int) -> list[Integers]:
    """Cut data into compact blocks: halved along their longer side again and again.

    Parameters
    ----------
    x : ndarray of shape (2, n)
        Positions.
    size : int
        The most data in a block; all but few blocks have as many.

    Returns
    -------
    list of ndarrays of int
        Numbers of the data of each block, ascending. The blocks are in the order of their first
        data.
    """
    found: list[Integers] = []
    open_ones = [np.arange(x.shape[1])] if x.shape[1] else []
    while open_ones:
        numbers = open_ones.pop()
        if len(numbers) <= size:
            found.append(np.sort(numbers))
            continue
        places = x[:, numbers]
        axis = int(np.argmax(np.ptp(places, axis=1)))
        full = -(-len(numbers) // size)  # blocks to come
        middle = size * (full // 2)
        # Stable, so that data at one place stay in their order.
        ranked = numbers[np.argsort(places[axis], kind="stable")]
        open_ones += [ranked[:middle], ranked[middle:]]
    return sorted(found, key=lambda numbers: int(numbers[0]))


def maxmin(centres: np.ndarray) -> Integers:
    """Order places so that each is as far as can be from all before it (Guinness 2018).

    Parameters
    ----------
    centres : ndarray of shape (2, b)
        Places.

    Returns
    -------
    ndarray of int, shape (b,)
        The first is the nearest to the middle of all.
    """
    order = np.empty(centres.shape[1], dtype=int)
    middle = centres.mean(axis=1, keepdims=True)
    distance = -((centres - middle) ** 2).sum(axis=0)
    for rank in range(len(order)):
        order[rank] = farthest = int(np.argmax(distance))
        away = ((centres - centres[:, farthest : farthest + 1]) ** 2).sum(axis=0)
        distance = away if rank == 0 else np.minimum(distance, away)
    return order


def build(x: np.ndarray, ordering: str, size: int, neighbours: int) -> Blocks:
    """Cut data into blocks, order them, and find the neighbours of all.

    Parameters
    ----------
    x : ndarray of shape (2, n)
        Positions, in units in which distances count.
    ordering : {"collected", "maxmin", "random"}
        Order of conditioning: that of the data, `maxmin`, or a permutation from a fixed seed.
    size : int
        The most data in a block.
    neighbours : int
        The most data that a block is conditioned on.
    """
    blocks = cut(x, size)
    if ordering == "maxmin" and blocks:
        order = maxmin(np.array([x[:, numbers].mean(axis=1) for numbers in blocks]).T)
    elif ordering == "random":
        order = np.random.default_rng(0).permutation(len(blocks))
    else:
        order = np.arange(len(blocks))
    return extended(Blocks.none(neighbours), [blocks[b] for b in order], x)


def extended(before: Blocks, new: list[Integers], x: np.ndarray) -> Blocks:
    """Append blocks to the end of the order; those before keep their neighbours.

    Parameters
    ----------
    before
        Blocks that are there.
    new : list of ndarrays of int
        Numbers of the data of each block to come.
    x : ndarray of shape (2, n)
        Positions of all data.
    """
    most = before.neighbours.shape[1]
    members = np.concatenate([before.members, *new])
    sizes = [len(numbers) for numbers in new]
    starts = np.concatenate([before.starts, before.starts[-1] + np.cumsum(sizes, dtype=int)])
    found = np.full((len(new), most), -1)
    ordered = np.ascontiguousarray(x[:, members])
    begin = starts[len(before) :]
    find_neighbours(ordered, ordered, begin, begin[:-1], found)
    found = np.where(found < 0, -1, members[found])
    return Blocks(members, starts, np.concatenate([before.neighbours, found]))


@kernel()  # without fast mathematics: which of two is nearer must not depend on the processor
def find_neighbours(
    x: np.ndarray, places: np.ndarray, starts: np.ndarray, available: np.ndarray, out: np.ndarray
) -> None:
    """Find the data nearest to groups of places, by the least distance to any of the group.

    Parameters
    ----------
    x : ndarray of shape (2, n)
        Positions of the data.
    places : ndarray of shape (2, q)
        Places, group by group.
    starts : ndarray of int, shape (g + 1,)
        Where in `places` each group starts, and the end.
    available : ndarray of int, shape (g,)
        How many of the first data each group may have.
    out : ndarray of int, shape (g, m)
        Overwritten with numbers of data, the nearest first, of equally near ones the earlier; what
        lies beyond those that are available stays as it is.
    """
    most = out.shape[1]
    distances = np.empty(most)
    for group in range(available.size):
        row = out[group]
        count = 0
        for j in range(available[group]):
            nearest = np.inf
            for i in range(starts[group], starts[group + 1]):
                d1, d2 = places[0, i] - x[0, j], places[1, i] - x[1, j]
                nearest = min(nearest, d1 * d1 + d2 * d2)
            if count == most and not (most and nearest < distances[most - 1]):
                continue
            place = min(count, most - 1)
            count = min(count + 1, most)
            while place > 0 and distances[place - 1] > nearest:
                distances[place], row[place] = distances[place - 1], row[place - 1]
                place -= 1
            distances[place], row[place] = nearest, j
