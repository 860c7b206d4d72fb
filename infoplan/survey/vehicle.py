"""A vehicle by its turning radius, as the car that planners steer."""

import math

from infoplan.config import RobotConfig
from infoplan.robot import tightest_turn

SMALL_BOAT_RADIUS, SMALL_BOAT_SPEED = 5.0, 1.5
"""What is taken for granted of a vehicle: metres, and metres a second."""

STEPS_ACROSS = 4
"""Two samples of a track lie so small a part of the room's radius apart, unless told otherwise."""

ACTIONS_ACROSS = 4
"""An action is so large a part of the room's radius, at least, so that plans reach far."""


def steered(turning_radius: float, step: float, room: float) -> RobotConfig:
    """Choose the actions of a car that never turns tighter than a vehicle.

    An action is a quarter turn at the most; where there is much room it is longer, and its hardest
    turn is wider than the vehicle's, so that a plan of a few actions still leads somewhere.

    Parameters
    ----------
    turning_radius
        Of the vehicle, metres.
    step
        Distance of two samples, metres, at most `room`.
    room
        Radius of the largest circle that is free, metres.

    Returns
    -------
    RobotConfig
        Speed is the distance of two samples.
    """
    quarter = math.pi / 2
    action = min(max(quarter * turning_radius, room / ACTIONS_ACROSS), room)
    samples = max(1, int(action / step))
    radius = max(turning_radius, samples * step / quarter)
    return RobotConfig(
        speed=step,
        samples_per_action=samples,
        max_steering=tightest_turn(radius, step),
    )
