"""Where samples come from: a source gives them on request, and alone knows the truth."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from infoplan.extent import Extent
from infoplan.obstacles import NOWHERE, Obstacles
from infoplan.samples import Batch, Samples

Floats = NDArray[np.float64]


class Source(Protocol):
    """What gives samples, batch by batch.

    Attributes
    ----------
    extent
        xmin, xmax, ymin, ymax of the workspace.
    obstacles
        Where the robot must not go.
    grid_truth
        Elevation at the nodes of the query grid, row-major, terrain's unit; NaN where unknown.
    grid_third
        Third of the grid by relief that each of them is in (`infoplan.terrain.relief.thirds`).
    is_steered
        Whether it goes where it is told; else it gives the next batch that there is.
    """

    extent: Extent
    obstacles: Obstacles
    grid_truth: Floats
    grid_third: NDArray[np.intp]
    is_steered: bool

    def pilot(self) -> Batch:
        """Give the samples from before any planning."""
        ...

    def sample(self, epoch: int, trajectory: Floats | None) -> Batch:
        """Give the samples of an epoch, from 1, along a trajectory where it is steered.

        Parameters
        ----------
        epoch
            Which.
        trajectory
            Poses x1, x2, heading at the samples, shape (n, 3).
        """
        ...


class StoredSource:
    """A mission that was flown: its samples once more, whatever is planned.

    Parameters
    ----------
    samples
        All of them.
    extent, grid_truth, grid_third
        As of `Source`.
    labelled
        Whether anybody knows which samples are outliers.
    """

    is_steered = False
    obstacles = NOWHERE  # nothing is planned

    def __init__(
        self,
        samples: Samples,
        extent: Extent,
        grid_truth: Floats,
        grid_third: NDArray[np.intp],
        labelled: bool = True,
    ):
        self.samples, self.labelled = samples, labelled
        self.extent = extent
        self.grid_truth = grid_truth
        self.grid_third = grid_third

    def pilot(self) -> Batch:
        """Give the samples of the pilot."""
        return self.sample(0, None)

    def sample(self, epoch: int, trajectory: Floats | None) -> Batch:
        """Give the samples of an epoch."""
        part = self.samples[self.samples.epoch == epoch]
        labels = part.is_outlier if self.labelled else None
        return Batch(part.x, part.heading, part.measured, labels, part.truth)
