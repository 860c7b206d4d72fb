"""A mission with the authors' public Gaussian process and a tree search in plain Python.

The driver, the robot, the sensor and the detector are the same as infoplan's: only the model and
the search are exchanged, so that the two missions do equal work at equal settings.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import torch
from pypolo.kernels import RBF
from pypolo.models import GPR

import infoplan.plan.planners
from infoplan.model import MODELS

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "plan"))
import reference_search


class PyPoloModel:
    """PyPolo's torch model behind the methods that a mission calls."""

    def __init__(
        self,
        x: np.ndarray,
        y: np.ndarray,
        *,
        amplitude: float,
        lengthscale: float,
        noise_variance: float,
        jitter: float,
        learning_rate: float,
        **others: Any,
    ) -> None:
        # PyPolo's amplitude is the variance.
        kernel = RBF(amplitude**2, [lengthscale, lengthscale])
        self.gpr = GPR(x, y[:, None], kernel, noise_variance, learning_rate, jitter=jitter)
        self.jitter = jitter
        # Its likelihood would cost another factorisation.
        self.log_marginal_likelihood = float("nan")

    @property
    def n_data(self) -> int:
        """Number of data in the model."""
        return self.gpr.num_train

    @property
    def hyperparameters(self) -> SimpleNamespace:
        """The present hyperparameters, scaled units."""
        with torch.no_grad():
            variance, noise = float(self.gpr.kernel.amplitude), float(self.gpr.noise)
            first, second = self.gpr.kernel.lengthscale.tolist()
        return SimpleNamespace(
            amplitude=variance**0.5, lengthscale_1=first, lengthscale_2=second, noise_std=noise**0.5
        )

    def append(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add data."""
        self.gpr.add_data(x, y[:, None])

    def optimize(self, iterations: int) -> None:
        """Take steps of Adam."""
        self.gpr.optimize(iterations, verbose=False)

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predict mean and latent standard deviation."""
        mean, std = self.gpr(x, noise_free=True)
        return mean.ravel(), std.ravel()


def plain_search(pose: Any, maps: np.ndarray, extent: Any, *, rng: Any, **options: Any) -> Any:
    """Grow a tree by the tests' reference and return its root."""
    if options.pop("obstacles").polygons:
        raise ValueError("the plain search knows no obstacles")
    options["steering"] = options["steering"].tolist()
    settings = reference_search.Settings(maps.tolist(), extent, **options)
    return reference_search.search(settings, tuple(pose), rng)[0]


def plain_plan(root: Any, rng: Any) -> np.ndarray:
    """Read the plan off the tests' reference tree."""
    return np.array(reference_search.most_visited_actions(root, rng), dtype=np.int64)


@contextmanager
def reference_parts() -> Iterator[None]:
    """Let missions use PyPolo's model and the plain search, on one thread."""
    torch.set_num_threads(1)
    with (
        patch.dict(MODELS, gp=PyPoloModel),
        patch.multiple(
            infoplan.plan.planners, search=plain_search, most_visited_actions=plain_plan
        ),
        redirect_stdout(StringIO()),  # PyPolo prints when it adds jitter
    ):
        yield
