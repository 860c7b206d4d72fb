"""Planners, detectors, models and faults of a user's, two of each kind, for tests."""

import numpy as np

from infoplan.fault import Corrupted
from infoplan.model import GaussianProcess


def leftmost(situation, rng):
    return situation.valid_actions()[-1:]


def by_the_digits(situation, rng, *, actions: int = 3):
    """Drive by the last digits of the deviations: any change of them shows."""
    plan, pose = [], situation.pose
    while len(plan) < actions and (valid := situation.valid_actions(pose)):
        plan.append(valid[int(1e6 * situation.std.mean()) % len(valid)])
        pose = situation.drive(plan[-1:], pose)[-1]
    return plan


def high(samples, model, rng, *, share: float = 0.2):
    return samples.measured > np.quantile(samples.measured, 1 - share), samples.measured


def low(samples, model, rng):
    return samples.measured < np.quantile(samples.measured, 0.2), -samples.measured


class Smooth(GaussianProcess):
    def __init__(self, x_pilot, y_pilot, *, width: float = 0.4):
        super().__init__(x_pilot, y_pilot, lengthscale=width, noise_variance=0.1)


class Rough(GaussianProcess):
    def __init__(self, x_pilot, y_pilot):
        super().__init__(x_pilot, y_pilot, lengthscale=0.05, noise_variance=0.1)


def raised(sensed, state, rho, rng, *, size: float = 300.0):
    is_outlier = rng.random(len(sensed)) < rho
    return Corrupted(sensed.measured + size * is_outlier, is_outlier)


def lowered(sensed, state, rho, rng):
    return raised(sensed, state, rho, rng, size=-300.0)
