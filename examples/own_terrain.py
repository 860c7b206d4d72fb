"""A terrain of your own: a function that returns elevations.

In the folder of this file:

    infoplan terrain show terrain=own terrain.function=own_terrain.ridges terrain.options.height=250
    infoplan run terrain=own terrain.function=own_terrain.ridges terrain.options.count=3

The function's keyword-only parameters, annotated, are its options. It returns a two-dimensional
array, rows along y from the bottom up, columns along x, or a pair of it and the elevations' unit.
"""

import numpy as np


def ridges(*, height: float = 300.0, count: int = 4, nodes: int = 80, angle: float = 30.0):
    """Parallel ridges on a plain that rises eastwards.

    Parameters
    ----------
    height
        From valley to crest, metres.
    count
        Number of ridges along a diagonal.
    nodes
        Rows and columns of the map.
    angle
        Direction across the ridges, degrees counter-clockwise from east.
    """
    y, x = np.mgrid[0 : 1 : nodes * 1j, 0 : 1 : nodes * 1j]
    across = x * np.cos(np.radians(angle)) + y * np.sin(np.radians(angle))
    elevation = 500 + 200 * x + height / 2 * np.cos(2 * np.pi * count * across)
    return elevation, "m"
