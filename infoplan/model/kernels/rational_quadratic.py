"""The rational quadratic kernel, (1 + s / shape)^-shape with s = sum_d (a_d - b_d)^2 / (2 l_d^2).

A mixture of Gaussian kernels of many lengthscales (Rasmussen & Williams, eq. 4.19, whose alpha is
`shape` here): the smaller the shape, the more of them; a large one gives the Gaussian kernel.
"""

from collections.abc import Mapping
from math import exp, log1p
from typing import Any

import numpy as np

from infoplan.compiled import kernel
from infoplan.model.exponential import exponential
from infoplan.model.kernel import Hyperparameter, Kernel
from infoplan.model.stationary import LENGTHSCALES, rates

_rates = rates(0.5)


def constants(theta: np.ndarray) -> tuple[float, ...]:
    """Return 1 / (2 l_d^2) and the shape."""
    return (*_rates(theta[:2]), exp(theta[2]))


@kernel(fastmath={"contract"})
def correlation(
    constants: tuple[float, float, float], a1: float, a2: float, b1: float, b2: float
) -> float:
    """Correlation of two positions."""
    d1 = a1 - b1
    d2 = a2 - b2
    shape = constants[2]
    return exponential(-shape * log1p((constants[0] * d1 * d1 + constants[1] * d2 * d2) / shape))


@kernel(fastmath={"contract"})
def gradient(
    weight: float, constants: tuple[float, float, float], a1: float, a2: float, b1: float, b2: float
) -> tuple[float, float, float, float]:
    """Weighted correlation, and its derivatives by the log lengthscales and the log shape."""
    d1 = a1 - b1
    d2 = a2 - b2
    t1 = constants[0] * d1 * d1
    t2 = constants[1] * d2 * d2
    shape = constants[2]
    beyond = (t1 + t2) / shape
    log_base = log1p(beyond)
    weighted = weight * exponential(-shape * log_base)
    twice = 2.0 * weighted / (1.0 + beyond)
    by_shape = weighted * shape * (beyond / (1.0 + beyond) - log_base)
    return weighted, twice * t1, twice * t2, by_shape


def reference(hyperparameters: Mapping[str, float]) -> Any:
    """Return scikit-learn's kernel of distances in these lengthscales, with this shape."""
    from sklearn.gaussian_process.kernels import RationalQuadratic

    from infoplan.model.reference import Written

    units = np.array([hyperparameters["lengthscale_1"], hyperparameters["lengthscale_2"]])
    of_units = RationalQuadratic(1.0, hyperparameters["shape"], "fixed", "fixed")
    return Written(lambda a, b: of_units(a / units, b / units))


# Beyond a shape of 1000 it is the Gaussian kernel but for the tails.
KERNEL = Kernel(
    hyperparameters=(*LENGTHSCALES, Hyperparameter("shape", start=1.0, flat=1e3)),
    constants=constants,
    correlation=correlation,
    gradient=gradient,
    reference=reference,
)
