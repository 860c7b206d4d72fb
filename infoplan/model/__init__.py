"""Gaussian process regression with the anisotropic Gaussian kernel.

A model is a class with the public interface of `GaussianProcess`; its constructor takes the pilot's
positions and measurements, and its options as keywords.
"""

from collections.abc import Callable
from typing import Any

from infoplan.model.gp import GaussianProcess, Hyperparameters
from infoplan.model.likelihood import log_marginal_likelihood
from infoplan.model.student_t import StudentTProcess

MODELS: dict[str, Callable[..., Any]] = {"gp": GaussianProcess, "student_t": StudentTProcess}

__all__ = [
    "MODELS",
    "GaussianProcess",
    "Hyperparameters",
    "StudentTProcess",
    "log_marginal_likelihood",
]
