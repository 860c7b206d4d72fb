"""Gaussian process regression: with any kernel, some of which expect outliers.

A model is a class with the public interface of `infoplan.model.regression.Regression`; its
constructor takes the pilot's positions and measurements, and its options as keywords.
"""

from collections.abc import Callable
from typing import Any

from infoplan.model.gp import GaussianProcess
from infoplan.model.inference.exact import log_marginal_likelihood
from infoplan.model.itgp import IterativeTrimmingProcess
from infoplan.model.kernel import Hyperparameter, Kernel
from infoplan.model.rcgp import RobustConjugateProcess
from infoplan.model.relevance_pursuit import RelevancePursuitProcess
from infoplan.model.student_t import StudentTProcess
from infoplan.model.vecchia import VecchiaProcess

MODELS: dict[str, Callable[..., Any]] = {
    "gp": GaussianProcess,
    "student_t": StudentTProcess,
    "vecchia": VecchiaProcess,
    "rcgp": RobustConjugateProcess,
    "itgp": IterativeTrimmingProcess,
    "relevance_pursuit": RelevancePursuitProcess,
}

__all__ = [
    "MODELS",
    "GaussianProcess",
    "Hyperparameter",
    "IterativeTrimmingProcess",
    "Kernel",
    "RelevancePursuitProcess",
    "RobustConjugateProcess",
    "StudentTProcess",
    "VecchiaProcess",
    "log_marginal_likelihood",
]
