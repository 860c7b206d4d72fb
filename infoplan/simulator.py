"""The simulator: a robot with a sensor on a known terrain."""

import numpy as np
from numpy.typing import NDArray

from infoplan.config import MissionConfig
from infoplan.extent import query_grid
from infoplan.randomness import generator
from infoplan.robot import bezier_path
from infoplan.samples import Batch
from infoplan.sensing import add_spikes
from infoplan.terrain import Terrain

Floats = NDArray[np.float64]


class Simulator:
    """A robot that drives where it is told, and whose sensor is noisy and sometimes wrong.

    A `Source`.

    Parameters
    ----------
    config
        The mission's options, valid (`infoplan.config.validate`).
    terrain
        The ground truth.
    seed
        Of all random streams.
    """

    is_steered = True

    def __init__(self, config: MissionConfig, terrain: Terrain, seed: int):
        self.config = config
        self.terrain = terrain
        self.seed = seed
        self.extent = terrain.extent
        rows, columns = config.grid
        x, y = query_grid(terrain.extent, (rows, columns)).T
        self.grid_truth = terrain.elevation_at(x, y)
        self._sensor_rng = generator(seed, "sensor")

    def pilot_path(self) -> Floats:
        """Poses along the Bezier curve that circles the workspace, shape (n, 3)."""
        pilot = self.config.pilot
        return bezier_path(np.array(pilot.control_points), self.extent, pilot.samples)

    def pilot(self) -> Batch:
        """Drive the pilot's path."""
        return self.sample(0, self.pilot_path())

    def sample(self, epoch: int, trajectory: Floats | None) -> Batch:
        """Sense the terrain along a trajectory; the sensor's fault is part of it."""
        assert trajectory is not None
        x, n = trajectory[:, :2], len(trajectory)
        truth = self.terrain.elevation_at(x[:, 0], x[:, 1])
        rng = self._sensor_rng if epoch else generator(self.seed, "pilot")
        measured = measure(truth, self.config.sensor.noise_std, rng)
        is_outlier = np.zeros(n, dtype=bool)
        if epoch or self.config.pilot.outliers:
            outliers = self.config.outliers
            measured, is_outlier = add_spikes(
                measured,
                self.config.rho,
                generator(self.seed, "spikes", epoch),
                count=outliers.count,
                amplitude=outliers.amplitude,
                quantiles=outliers.quantiles,
            )
        return Batch(x, trajectory[:, 2], measured, is_outlier, truth)


def measure(truth: Floats, noise_std: float, rng: np.random.Generator) -> Floats:
    """Add the sensor's Gaussian noise to the true elevations, shape (n,), terrain's unit."""
    with np.errstate(over="ignore"):  # told by the belief, which knows the options
        return truth + noise_std * rng.standard_normal(truth.shape)
