"""Exact Gaussian process regression with the anisotropic Gaussian kernel."""

from infoplan.model.gp import GaussianProcess, Hyperparameters
from infoplan.model.likelihood import log_marginal_likelihood

__all__ = ["GaussianProcess", "Hyperparameters", "log_marginal_likelihood"]
