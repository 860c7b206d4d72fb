"""A situation that planners are tested in, and how it goes on by plain arithmetic."""

import numpy as np

from infoplan.plan import Situation
from infoplan.robot import steering_angles

EXTENT = (0.0, 50.0, -10.0, 30.0)


def situation(pose=(20.0, 5.0, 0.3), seed=0, **changes):
    rng = np.random.default_rng(seed)
    fields = {
        "pose": np.array(pose),
        "std": rng.uniform(1, 5, (15, 20)),
        "mean": 100 * np.ones((15, 20)),
        "outlier_density": rng.uniform(0, 2, (15, 20)),
        "extent": EXTENT,
        "speed": 0.7,
        "samples_per_action": 10,
        "steering": steering_angles(0.15, 5),
        "visited": np.array([[25.0, 10.0], pose[:2]]),
        "n_pilot": 2,
        "epoch": 1,
        "budget": 500,
    }
    fields |= changes
    return Situation(**({"reward_map": fields["std"]} | fields))


def poses_of(scene, actions):
    """Drive with plain arithmetic, in a list of (x, y)."""
    x, y, heading = scene.pose
    poses = []
    for action in actions:
        for _ in range(scene.samples_per_action):
            x, y = x + scene.speed * np.cos(heading), y + scene.speed * np.sin(heading)
            heading += scene.steering[action]
            poses.append((x, y))
    return np.array(poses)
