"""What kernels of the scaled distance share: a lengthscale an axis, and what follows from both."""

from collections.abc import Callable

import numpy as np

from infoplan.model.kernel import Hyperparameter

# Ten scaled units are five times the pilot's bounding box.
LENGTHSCALES = (
    Hyperparameter("lengthscale_1", flat=10.0),
    Hyperparameter("lengthscale_2", flat=10.0),
)


def rates(factor: float) -> Callable[[np.ndarray], tuple[float, ...]]:
    """Return the function that gives factor / l_d^2 of the log lengthscales."""
    return lambda theta: tuple((factor * np.exp(-2.0 * theta)).tolist())
