"""The Matern kernel of smoothness 1/2: exp(-u) (Rasmussen & Williams, eq. 4.18).

u^2 = 1 sum_d (a_d - b_d)^2 / l_d^2; its sample paths are continuous and nowhere smooth.
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
    return exponential(-u)


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
    over = weighted / max(u, 1e-300)  # of equal positions 0 / 1e-300 = 0, the limit
    return weighted, over * t1, over * t2


def reference(hyperparameters: Mapping[str, float]) -> Any:
    """Return scikit-learn's kernel with these lengthscales."""
    from sklearn.gaussian_process.kernels import Matern

    lengthscales = [hyperparameters["lengthscale_1"], hyperparameters["lengthscale_2"]]
    return Matern(lengthscales, "fixed", nu=0.5)


KERNEL = Kernel(
    hyperparameters=LENGTHSCALES,
    constants=rates(1.0),
    correlation=correlation,
    gradient=gradient,
    reference=reference,
)
