"""What a planner is given."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoplan.obstacles import NOWHERE, Obstacles
from infoplan.plan.reward_maps import nearest_index
from infoplan.robot import drive
from infoplan.walls import is_free

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Situation:
    """Where the robot is, what it may do, and what is known of the terrain.

    Attributes
    ----------
    pose
        x1, x2, heading, shape (3,).
    std
        The model's standard deviation at the nodes of the query grid, shape (rows, cols), terrain's
        unit; row 0 at ymin, column 0 at xmin, the outer nodes on the borders.
    mean
        The model's mean there, shape (rows, cols), terrain's unit.
    reward_map
        What a sample there is worth, none negative, shape (rows, cols): what the planner's option
        ``reward`` says; the deviation for planners without it.
    outlier_density
        Smoothed count of the flagged samples there, shape (rows, cols).
    extent
        xmin, xmax, ymin, ymax of the workspace.
    speed
        Distance a sample, workspace units.
    samples_per_action
        Samples along an action.
    steering
        Turn a sample of each action, radians, shape (A,); an action is an index into it.
    visited
        Where samples were taken so far, in order, shape (n, 2).
    n_pilot
        How many of them, the first ones, are the pilot's.
    epoch
        Number of this decision, from 1.
    budget
        Samples of the whole mission.
    obstacles
        Where the robot must not go.
    """

    pose: Floats
    std: Floats
    mean: Floats
    reward_map: Floats
    outlier_density: Floats
    extent: tuple[float, float, float, float]
    speed: float
    samples_per_action: int
    steering: Floats
    visited: Floats
    n_pilot: int
    epoch: int
    budget: int
    obstacles: Obstacles = NOWHERE

    def drive(
        self, actions: Sequence[int] | NDArray[np.integer], pose: Floats | None = None
    ) -> Floats:
        """Poses at the samples of some actions, shape (samples, 3), from this pose or another."""
        start = self.pose if pose is None else pose
        return drive(start, actions, self.steering, self.speed, self.samples_per_action)

    def stays_inside(self, poses: Floats, pose: Floats | None = None) -> bool:
        """Tell whether some poses, driven to from this pose or another, may all be reached.

        They lie in the workspace or on its border, and no step between them touches an obstacle.
        """
        x, y = (self.pose if pose is None else pose)[:2]
        track = np.ascontiguousarray(poses, dtype=np.float64)
        xmin, xmax, ymin, ymax = map(float, self.extent)
        return bool(is_free(track, x, y, (xmin, xmax, ymin, ymax), self.obstacles.walls))

    def valid_actions(self, pose: Floats | None = None) -> list[int]:
        """Actions that stay in the workspace and off obstacles, from this pose or another."""
        return [
            action
            for action in range(len(self.steering))
            if self.stays_inside(self.drive([action], pose), pose)
        ]

    def reward(self, reward_map: Floats, poses: Floats) -> float:
        """Sum of a map's values at the nodes nearest to some poses."""
        rows, cols = reward_map.shape
        xmin, xmax, ymin, ymax = self.extent
        return float(
            sum(
                reward_map[nearest_index(y, ymin, ymax, rows), nearest_index(x, xmin, xmax, cols)]
                for x, y, _ in poses
            )
        )
