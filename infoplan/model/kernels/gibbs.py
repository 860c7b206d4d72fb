"""Gibbs' kernel, whose lengthscales differ from place to place, l_d(x) = l_d g(x).

c(a, b) = prod_d sqrt(2 l_d(a) l_d(b) / q_d) exp(-sum_d (a_d - b_d)^2 / q_d) with
q_d = l_d(a)^2 + l_d(b)^2 (Gibbs 1997, Bayesian Gaussian Processes for Regression and
Classification; Rasmussen & Williams, eq. 4.32). Here log g is a polynomial of the place,
log g(x) = x1 log growth_1 + x2 log growth_2 + (x1^2 + x2^2) log growth_outward, with g = 1 in the
middle of the pilot's bounding box; beyond the box it is that of the nearest place on its border.
With u = log g(a) - log g(b), v = log g(a) + log g(b) the kernel is sech(u) exp(-s sech(u) exp(-v)),
s = sum_d (a_d - b_d)^2 / (2 l_d^2).
"""

from collections.abc import Mapping
from math import cosh, exp, tanh
from typing import Any

import numpy as np

from infoplan.compiled import kernel
from infoplan.model.exponential import exponential
from infoplan.model.kernel import Hyperparameter, Kernel
from infoplan.model.stationary import LENGTHSCALES, rates

_rates = rates(0.5)

Constants = tuple[float, float, float, float, float]


def constants(theta: np.ndarray) -> tuple[float, ...]:
    """Return 1 / (2 l_d^2) and the logarithms of the growths."""
    return (*_rates(theta[:2]), *theta[2:].tolist())


@kernel()
def _inside(coordinate: float) -> float:
    """Nearest coordinate in the pilot's bounding box."""
    return min(max(coordinate, -1.0), 1.0)


@kernel()
def correlation(constants: Constants, a1: float, a2: float, b1: float, b2: float) -> float:
    """Correlation of two positions."""
    d1 = a1 - b1
    d2 = a2 - b2
    a1, a2, b1, b2 = _inside(a1), _inside(a2), _inside(b1), _inside(b2)
    g1, g2, outward = constants[2], constants[3], constants[4]
    at_a = g1 * a1 + g2 * a2 + outward * (a1 * a1 + a2 * a2)
    at_b = g1 * b1 + g2 * b2 + outward * (b1 * b1 + b2 * b2)
    scale = 1.0 / cosh(at_a - at_b)
    s = constants[0] * d1 * d1 + constants[1] * d2 * d2
    return scale * exponential(-s * scale * exp(-at_a - at_b))


@kernel()
def gradient(
    weight: float, constants: Constants, a1: float, a2: float, b1: float, b2: float
) -> tuple[float, float, float, float, float, float]:
    """Weighted correlation, and its derivatives by the log hyperparameters."""
    d1 = a1 - b1
    d2 = a2 - b2
    a1, a2, b1, b2 = _inside(a1), _inside(a2), _inside(b1), _inside(b2)
    g1, g2, outward = constants[2], constants[3], constants[4]
    outer_a = a1 * a1 + a2 * a2
    outer_b = b1 * b1 + b2 * b2
    at_a = g1 * a1 + g2 * a2 + outward * outer_a
    at_b = g1 * b1 + g2 * b2 + outward * outer_b
    scale = 1.0 / cosh(at_a - at_b)
    shrunk = scale * exp(-at_a - at_b)
    t1 = constants[0] * d1 * d1 * shrunk
    t2 = constants[1] * d2 * d2 * shrunk
    weighted = weight * scale * exponential(-t1 - t2)
    by_sum = weighted * (t1 + t2)  # by v, and the next by u
    by_difference = tanh(at_a - at_b) * (by_sum - weighted)
    return (
        weighted,
        2.0 * weighted * t1,
        2.0 * weighted * t2,
        by_difference * (a1 - b1) + by_sum * (a1 + b1),
        by_difference * (a2 - b2) + by_sum * (a2 + b2),
        by_difference * (outer_a - outer_b) + by_sum * (outer_a + outer_b),
    )


def reference(hyperparameters: Mapping[str, float]) -> Any:
    """Return the kernel for scikit-learn, from its first formula, axis by axis."""
    from infoplan.model.reference import Written

    def lengthscales(x: np.ndarray) -> np.ndarray:
        x = np.clip(x, -1.0, 1.0)
        growth = hyperparameters["growth_1"] ** x[:, 0] * hyperparameters["growth_2"] ** x[:, 1]
        growth = growth * hyperparameters["growth_outward"] ** np.sum(x**2, axis=1)
        own = [hyperparameters["lengthscale_1"], hyperparameters["lengthscale_2"]]
        return np.asarray(growth[:, np.newaxis] * own)

    def correlations(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        la, lb = lengthscales(a)[:, np.newaxis], lengthscales(b)[np.newaxis]
        q = la**2 + lb**2
        squares = (a[:, np.newaxis] - b[np.newaxis]) ** 2
        prefactor = np.sqrt(np.prod(2.0 * la * lb / q, axis=2))
        return np.asarray(prefactor * np.exp(-np.sum(squares / q, axis=2)))

    return Written(correlations)


# From the middle to a corner the lengthscales differ by a factor of 10,000 at most.
_GROWTHS = tuple(
    Hyperparameter(f"growth_{name}", start=1.0, lower=0.1, upper=10.0)
    for name in ("1", "2", "outward")
)

KERNEL = Kernel(
    hyperparameters=(*LENGTHSCALES, *_GROWTHS),
    constants=constants,
    correlation=correlation,
    gradient=gradient,
    reference=reference,
)
