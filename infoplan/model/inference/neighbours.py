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


def pattern(blocks: Blocks, position: Integers, count: int) -> tuple[Integers, Integers]:
    """Say where the precision of the data is not zero: between those that share a block.

    Parameters
    ----------
    blocks
        Of all data; a block's neighbours belong to it.
    position : ndarray of int, shape (n,)
        Row of the precision that each datum has; -1: none.
    count
        Number of rows.

    Returns
    -------
    first : ndarray of int, shape (count + 1,)
        Where in `columns` each row starts, and the end.
    columns : ndarray of int
        Ascending in each row.
    """
    sizes = np.diff(blocks.starts)
    of_block = np.concatenate(
        [
            np.repeat(np.arange(len(blocks)), sizes),
            np.repeat(np.arange(len(blocks)), blocks.neighbours.shape[1]),
        ]
    )
    places = np.concatenate([blocks.members, blocks.neighbours.ravel()])
    places = np.where(places < 0, -1, position[places])
    of_block, places = of_block[places >= 0], places[places >= 0]
    by_block, by_place = np.argsort(of_block, kind="stable"), np.argsort(places, kind="stable")
    return _pattern(
        places[by_block], np.searchsorted(of_block[by_block], np.arange(len(blocks) + 1)),
        of_block[by_place], np.searchsorted(places[by_place], np.arange(count + 1)),
    )  # fmt: skip


@kernel()
def _pattern(
    places: np.ndarray, starts: np.ndarray, blocks: np.ndarray, begins: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gather the places of each block, and the blocks of each place, to a row for each place."""
    count = begins.size - 1
    seen, row = np.full(count, -1), np.empty(count, np.int64)
    first = np.zeros(count + 1, np.int64)
    columns = np.empty(64, np.int64)
    for i in range(count):
        length = 0
        for block in blocks[begins[i] : begins[i + 1]]:
            for place in places[starts[block] : starts[block + 1]]:
                if seen[place] != i:
                    seen[place] = i
                    row[length] = place
                    length += 1
        first[i + 1] = first[i] + length
        if first[i + 1] > columns.size:
            longer = np.empty(2 * first[i + 1], np.int64)
            longer[: first[i]] = columns[: first[i]]
            columns = longer
        columns[first[i] : first[i + 1]] = np.sort(row[:length])
    return first, columns[: first[count]].copy()


_CHUNK = 64
"""Data that are passed over together where all of them are too far."""


@kernel()
def _box(x: np.ndarray, first: int, last: int) -> tuple[float, float, float, float]:
    """Bounds of some places: least and greatest of each coordinate."""
    low1, high1, low2, high2 = np.inf, -np.inf, np.inf, -np.inf
    for j in range(first, last):
        low1, high1 = min(low1, x[0, j]), max(high1, x[0, j])
        low2, high2 = min(low2, x[1, j]), max(high2, x[1, j])
    return low1, high1, low2, high2


@kernel()
def _gap(one: tuple[float, float, float, float], other: np.ndarray) -> float:
    """Squared distance of two boxes: rounded, too, no more than that of any two of their places."""
    d1 = max(max(one[0] - other[1], other[0] - one[1]), 0.0)
    d2 = max(max(one[2] - other[3], other[2] - one[3]), 0.0)
    return d1 * d1 + d2 * d2


@kernel()
def _sort_in(
    x: np.ndarray,
    places: np.ndarray,
    first: int,
    last: int,
    count: int,
    distances: np.ndarray,
    row: np.ndarray,
) -> int:
    """Sort data into the nearest found so far, `count` of them; returns how many there are then."""
    most = distances.size
    for j in range(first, last):
        nearest = np.inf
        for i in range(places.shape[1]):
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
    return count


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
    boxes = np.empty((-(-x.shape[1] // _CHUNK), 4))
    for chunk in range(len(boxes)):
        boxes[chunk] = _box(x, chunk * _CHUNK, min((chunk + 1) * _CHUNK, x.shape[1]))
    enough = -(-most // _CHUNK)
    for group in range(available.size):
        there, mine = available[group], places[:, starts[group] : starts[group + 1]]
        around = _box(mine, 0, mine.shape[1])
        # The chunks about the nearest one have enough: what is farther than all of those is not
        # among the nearest, and a chunk whose box is farther need not be looked at.
        farthest, whole = np.inf, there // _CHUNK
        if 0 < enough <= whole:
            best, least = 0, np.inf
            for chunk in range(whole):
                gap = _gap(around, boxes[chunk])
                if gap < least:
                    best, least = chunk, gap
            lowest = min(max(best - enough // 2, 0), whole - enough)
            first, last = lowest * _CHUNK, (lowest + enough) * _CHUNK
            _sort_in(x, mine, first, last, 0, distances, out[group])
            farthest = distances[most - 1]
        count = 0
        for chunk in range(-(-there // _CHUNK)):
            if count == most and most:
                farthest = min(farthest, distances[most - 1])
            if _gap(around, boxes[chunk]) <= farthest:
                first, last = chunk * _CHUNK, min((chunk + 1) * _CHUNK, there)
                count = _sort_in(x, mine, first, last, count, distances, out[group])
