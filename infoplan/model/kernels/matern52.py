"""The Matern kernel of smoothness 5/2: (1 + u + u^2 / 3) exp(-u) (Rasmussen & Williams, eq. 4.17).

u^2 = 5 sum_d (a_d - b_d)^2 / l_d^2; its sample paths are twice differentiable.
"""

from collections.abc import Mapping
from math import sqrt
from typing import Any

from infoplan.compiled import kernel
from infoplan.model.exponential import exponential
from infoplan.model.kernel import Kernel
from infoplan.model.stationary import LENGTHSCALES, rates


@kernel(fastmath={"contract"})
def correlation(rates: tuple[float, float], a1: float, a2: float, b1: float, b2: float) -> float:
    """Correlation of two positions."""
    d1 = a1 - b1
    d2 = a2 - b2
    u = sqrt(rates[0] * d1 * d1 + rates[1] * d2 * d2)
    return (1.0 + u + u * u / 3.0) * exponential(-u)


@kernel(fastmath={"contract", "reassoc"})
def gradient(
    weight: float, rates: tuple[float, float], a1: float, a2: float, b1: float, b2: float
) -> tuple[float, float, float]:
    """Weighted correlation, and its derivatives by the log lengthscales."""
    d1 = a1 - b1
    d2 = a2 - b2
    t1 = rates[0] * d1 * d1
    t2 = rates[1] * d2 * d2
    u = sqrt(t1 + t2)
    weighted = weight * exponential(-u)
    third = weighted * (1.0 + u) / 3.0
    return weighted * (1.0 + u + u * u / 3.0), third * t1, third * t2


def reference(hyperparameters: Mapping[str, float]) -> Any:
    """Return scikit-learn's kernel with these lengthscales."""
    from sklearn.gaussian_process.kernels import Matern

    lengthscales = [hyperparameters["lengthscale_1"], hyperparameters["lengthscale_2"]]
    return Matern(lengthscales, "fixed", nu=2.5)


KERNEL = Kernel(
    hyperparameters=LENGTHSCALES,
    constants=rates(5.0),
    correlation=correlation,
    gradient=gradient,
    reference=reference,
)
