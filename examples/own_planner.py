"""A planner of your own: a function that chooses the robot's actions.

In the folder of this file:

    infoplan run planner=own planner.function=own_planner.farthest planner.options.actions=3

The function's keyword-only parameters, annotated, are its options; `infoplan.plan.Situation` says
what `situation` holds. It returns actions, indices into `situation.steering`, that stay in the
workspace; none only where none does: then the robot turns on the spot, and it is asked again.
"""

import numpy as np


def farthest(situation, rng, *, actions: int = 4):
    """Drive, action by action, to where the nearest sample so far is farthest.

    Parameters
    ----------
    situation, rng
        Given to every planner: pose, maps, what the robot can do; and the epoch's own generator.
    actions
        Length of the plan.
    """
    plan, pose, visited = [], situation.pose, situation.visited
    while len(plan) < actions and (valid := situation.valid_actions(pose)):
        drives = [situation.drive([action], pose) for action in valid]
        distance = [np.hypot(*(visited - poses[-1, :2]).T).min() for poses in drives]
        best = int(np.argmax(distance))
        plan.append(valid[best])
        pose = drives[best][-1]
        visited = np.vstack([visited, drives[best][:, :2]])
    return plan
