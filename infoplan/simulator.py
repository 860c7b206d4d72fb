"""The simulator: a robot with a sensor on a known terrain."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.answers import checked_corruption
from infoplan.config import MissionConfig
from infoplan.extent import query_grid
from infoplan.fault import Corrupted, Sensed
from infoplan.methods import find, method_label
from infoplan.randomness import generator
from infoplan.robot import bezier_path
from infoplan.samples import Batch
from infoplan.terrain import Terrain
from infoplan.terrain.relief import local_relief, thirds

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
        relief = local_relief(self.grid_truth.reshape(rows, columns), terrain.extent)
        self.grid_third = thirds(relief).ravel()
        self._sensor_rng = generator(seed, "sensor")
        self._fault = find("fault", config.fault)
        self._fault_state: Any = None
        self._time = 0

    def pilot_path(self) -> Floats:
        """Poses along the Bezier curve that circles the workspace, shape (n, 3)."""
        pilot = self.config.pilot
        return bezier_path(np.array(pilot.control_points), self.extent, pilot.samples)

    def pilot(self) -> Batch:
        """Drive the pilot's path."""
        return self.sample(0, self.pilot_path())

    def sample(self, epoch: int, trajectory: Floats | None) -> Batch:
        """Sense the terrain along a trajectory, noise and fault of the sensor included."""
        assert trajectory is not None
        x, heading = trajectory[:, :2], trajectory[:, 2]
        truth = self.terrain.elevation_at(x[:, 0], x[:, 1])
        rng = self._sensor_rng if epoch else generator(self.seed, "pilot")
        measured = measure(truth, self.config.sensor.noise_std, rng)
        time = np.arange(self._time, self._time + len(trajectory), dtype=np.float64)
        self._time += len(trajectory)
        lowest, highest = float(self.grid_truth.min()), float(self.grid_truth.max())
        said = self._corrupt(Sensed(x, heading, truth, measured, time, epoch, lowest, highest))
        return Batch(x, heading, said.measured, said.is_outlier, truth)

    def _corrupt(self, sensed: Sensed) -> Corrupted:
        """Let the fault spoil a batch; the pilot's only if that is wanted."""
        if not (sensed.epoch or self.config.pilot.outliers):
            return Corrupted(sensed.measured, np.zeros(len(sensed), dtype=bool))
        rng = generator(self.seed, "fault", sensed.epoch)
        with np.errstate(over="ignore", invalid="ignore"):  # told by the belief
            said = self._fault(sensed, self._fault_state, self.config.rho, rng)
        corrupted = checked_corruption(said, sensed, method_label(self.config.fault))
        self._fault_state = corrupted.state
        return corrupted


def measure(truth: Floats, noise_std: float, rng: np.random.Generator) -> Floats:
    """Add the sensor's Gaussian noise to the true elevations, shape (n,), terrain's unit."""
    with np.errstate(over="ignore"):  # told by the belief, which knows the options
        return truth + noise_std * rng.standard_normal(truth.shape)
