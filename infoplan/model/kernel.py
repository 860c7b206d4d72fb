"""What a kernel is: the correlation of two positions, and the hyperparameters that shape it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from infoplan.errors import UsageError
from infoplan.tables import TABLES

TAKEN = {"run", *TABLES["curves"].columns} - {"lengthscale_1", "lengthscale_2"}
"""Columns of the curves that are no hyperparameter of a kernel."""


@dataclass(frozen=True)
class Hyperparameter:
    """A positive number that the model learns on a logarithmic scale.

    Attributes
    ----------
    name
        Also of its column in the curves.
    start
        First value; None: that of the option `model.lengthscale`.
    lower, upper
        Bounds that no optimiser leaves. Those that stand here are wide enough for any sensible
        model; inside, every entry of the covariance is a normal float.
    flat
        Beyond it the likelihood is flat to rounding, and L-BFGS does not look.
    """

    name: str
    start: float | None = None
    lower: float = 1e-6
    upper: float = 1e6
    flat: float = np.inf


@dataclass(frozen=True)
class Kernel:
    """A positive definite function c(a, b) of two positions with c(a, a) = 1.

    The model's covariance is alpha^2 c(a, b). Positions are in scaled units. `correlation` and
    `gradient` are compiled (`infoplan.compiled.kernel`, or Numba outside of infoplan); what
    both need of the hyperparameters alone, `constants` computes beforehand.

    Attributes
    ----------
    hyperparameters
        In the order of their logarithms in `theta`, at least one; their names differ, and are those
        of no other column of the curves.
    constants
        Maps the logarithms, shape (k,), to a tuple of floats.
    correlation
        Maps (constants, a1, a2, b1, b2) to c(a, b).
    gradient
        Maps (weight, constants, a1, a2, b1, b2) to the tuple of weight c(a, b) and of its k
        derivatives by the logarithms.
    reference
        Maps the hyperparameters by name to a kernel as scikit-learn has it: the same written
        once more, with which the audit compares.
    """

    hyperparameters: tuple[Hyperparameter, ...]
    constants: Callable[[np.ndarray], tuple[float, ...]]
    correlation: Callable[..., float]
    gradient: Callable[..., tuple[float, ...]]
    reference: Callable[[Mapping[str, float]], Any]

    def __post_init__(self) -> None:
        names = [one.name for one in self.hyperparameters]
        if wrong := [name for name in names if name in TAKEN or names.count(name) > 1]:
            raise UsageError(
                f"a kernel's hyperparameter {wrong[0]!r} cannot have that name, which another "
                "column of the curves has: give it another"
            )
