"""What a planner is given to gather: the deviation, and what a sample is worth, of a prediction."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.answers import checked_covariance, number_of
from infoplan.config import MissionConfig
from infoplan.errors import RunError
from infoplan.methods import method_label
from infoplan.plan.rewards import (
    mutual_information,
    upper_confidence_bound,
    variance_reduction,
)

Floats = NDArray[np.float64]


def deviation_and_reward(
    config: MissionConfig, model: Any, nodes: Floats, mean: Floats, std: Floats
) -> tuple[Floats, Floats]:
    """Give what rewards the planner at some nodes, as its options say.

    Parameters
    ----------
    config
        Its planner's options, and the model's for messages.
    model
        What has predicted.
    nodes
        Shape (n, 2), workspace units.
    mean, std
        The model's latent prediction there, shape (n,), terrain's unit.

    Returns
    -------
    std : ndarray, shape (n,)
        With the learned noise where ``noisy_std`` asks for it.
    reward : ndarray, shape (n,)
        Of a sample, by the option ``reward``; the deviation for planners without it.

    Raises
    ------
    RunError
        If the model does not tell the noise or covariance that an option needs.
    """
    planner = config.planner
    if getattr(planner, "noisy_std", False):
        std = np.hypot(std, _noise_std(config, model, "planner.noisy_std=true"))
    reward = getattr(planner, "reward", "std")
    if reward == "std":
        return std, std
    if reward == "ucb":
        return std, upper_confidence_bound(mean, std, planner.kappa)
    noise_variance = _noise_std(config, model, f"planner.reward={reward}") ** 2
    covariance = checked_covariance(model.covariance(nodes), len(nodes), method_label(config.model))
    measure = mutual_information if reward == "mutual_information" else variance_reduction
    return std, measure(covariance, noise_variance)


def _noise_std(config: MissionConfig, model: Any, needed_by: str) -> float:
    """Give the deviation of the noise that the model has learned."""
    noise = number_of(model, "observation_noise_std")
    if np.isnan(noise):
        name = needed_by.partition("=")[0]
        remedy = "planner.noisy_std=false" if name == "planner.noisy_std" else f"{name}=std"
        raise RunError(
            f"{needed_by} needs a model with observation_noise_std, which "
            f"{method_label(config.model)} has not: use {remedy}"
        )
    return noise
