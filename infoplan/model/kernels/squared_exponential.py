"""The anisotropic Gaussian kernel, exp(-sum_d (a_d - b_d)^2 / (2 l_d^2)) (the paper's `kernel`)."""

from collections.abc import Mapping
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
    return exponential(-(rates[0] * d1 * d1 + rates[1] * d2 * d2))


@kernel(fastmath={"contract", "reassoc"})
def gradient(
    weight: float, rates: tuple[float, float], a1: float, a2: float, b1: float, b2: float
) -> tuple[float, float, float]:
    """Weighted correlation, and its derivatives by the log lengthscales."""
    d1 = a1 - b1
    d2 = a2 - b2
    t1 = rates[0] * d1 * d1
    t2 = rates[1] * d2 * d2
    weighted = weight * exponential(-(t1 + t2))
    twice = 2.0 * weighted
    return weighted, twice * t1, twice * t2


def reference(hyperparameters: Mapping[str, float]) -> Any:
    """Return scikit-learn's kernel with these lengthscales."""
    from sklearn.gaussian_process.kernels import RBF

    return RBF([hyperparameters["lengthscale_1"], hyperparameters["lengthscale_2"]], "fixed")


KERNEL = Kernel(
    hyperparameters=LENGTHSCALES,
    constants=rates(0.5),
    correlation=correlation,
    gradient=gradient,
    reference=reference,
)
