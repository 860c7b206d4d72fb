"""The vector of log hyperparameters: theta = (log alpha, the kernel's ..., log sigma^2).

All are in scaled units; alpha^2 is the variance of the latent function, sigma^2 that of the noise
(for Student-t noise the squared scale). Nothing else knows where in theta which of them stands.
"""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from infoplan.errors import UsageError
from infoplan.model.kernel import Hyperparameter, Kernel

_AMPLITUDE = Hyperparameter("amplitude")
_SMALLEST_NOISE, _LARGEST_NOISE = 1e-20, 1e12


class Parameters(NamedTuple):
    """What the covariance is computed from: alpha^2, the kernel's constants, sigma^2."""

    variance: float
    constants: tuple[float, ...]
    noise: float


class Bounds(NamedTuple):
    """Bounds of theta, shape (k,) each; beyond `flat` the likelihood is flat to rounding."""

    lower: np.ndarray
    upper: np.ndarray
    flat: np.ndarray


def names_of(kernel: Kernel) -> list[str]:
    """Names of the learned hyperparameters, in the order of theta."""
    return [_AMPLITUDE.name, *(one.name for one in kernel.hyperparameters), "noise_std"]


def first_theta(
    kernel: Kernel, amplitude: float, lengthscale: float, noise_variance: float
) -> np.ndarray:
    """Return theta of the start values; those below 1e-20 count as 1e-20."""
    own = [lengthscale if one.start is None else one.start for one in kernel.hyperparameters]
    theta: np.ndarray = np.log(np.maximum([amplitude, *own, noise_variance], 1e-20))
    return theta


def theta_of(kernel: Kernel, hyperparameters: Mapping[str, float]) -> np.ndarray:
    """Return theta of hyperparameters by their names, the reverse of `hyperparameters_of`."""
    theta: np.ndarray = np.log([hyperparameters[name] for name in names_of(kernel)])
    theta[-1] *= 2.0  # sigma^2
    return theta


def lengthscale_floors(kernel: Kernel, shortest: np.ndarray) -> np.ndarray:
    """Return logarithms below which no lengthscale is to be, minus infinity for all else.

    Parameters
    ----------
    kernel : Kernel
        Its `lengthscale_1` and `lengthscale_2` are meant.
    shortest : ndarray of shape (2,)
        Floors along both axes, scaled units; 0: none.

    Raises
    ------
    UsageError
        If there is a floor, and the kernel has no such lengthscales.
    """
    names = names_of(kernel)
    floors = np.full(len(names), -np.inf)
    for name, floor in zip(("lengthscale_1", "lengthscale_2"), shortest, strict=True):
        if floor > 0.0:
            if name not in names:
                raise UsageError(
                    f"model.min_lengthscale needs a kernel with a {name}, and this one learns "
                    f"{', '.join(names)}: leave the option at 0"
                )
            floors[names.index(name)] = np.log(floor)
    return floors


def bounds_of(
    kernel: Kernel, min_noise_variance: float, floors: np.ndarray | float = -np.inf
) -> Bounds:
    """Return the bounds of theta.

    Parameters
    ----------
    kernel : Kernel
        Knows those of its hyperparameters.
    min_noise_variance : float
        Floor of sigma^2, scaled units. Below 1e-20 it counts as 1e-20, whose logarithm is finite.
    floors : ndarray of shape (k,)
        From `lengthscale_floors`; without them there are none.

    Returns
    -------
    Bounds
        Upper ones are never below a floor; sigma^2 ends at 1e12 or at a floor above it.
    """
    floor = max(min_noise_variance, _SMALLEST_NOISE)
    noise = Hyperparameter("", lower=floor, upper=max(floor, _LARGEST_NOISE))
    all_of_them = [_AMPLITUDE, *kernel.hyperparameters, noise]
    return Bounds(
        np.maximum(np.log([one.lower for one in all_of_them]), floors),
        np.maximum(np.log([one.upper for one in all_of_them]), floors),
        np.maximum(np.log([one.flat for one in all_of_them]), floors),
    )


def parameters_of(kernel: Kernel, theta: np.ndarray) -> Parameters:
    """Compute what the covariance needs."""
    with np.errstate(over="ignore"):  # infinite ones are told by the factorisation
        variance, constants = float(np.exp(2.0 * theta[0])), kernel.constants(theta[1:-1])
    return Parameters(variance, constants, noise_variance_of(theta))


def noise_variance_of(theta: np.ndarray) -> float:
    """Return sigma^2."""
    with np.errstate(over="ignore"):
        return float(np.exp(theta[-1]))


def with_noise_variance(theta: np.ndarray, noise_variance: float) -> np.ndarray:
    """Return a copy of theta with another sigma^2."""
    return np.append(theta[:-1], np.log(noise_variance))


def gradient_of(
    variance: float, sums: tuple[float, ...], trace: float, by_noise: float
) -> np.ndarray:
    """Put the derivatives by theta together (Rasmussen & Williams, eq. 5.9).

    Parameters
    ----------
    variance : float
        alpha^2.
    sums, trace
        From `infoplan.model.covariance.Passes.gradient_sums`.
    by_noise : float
        Derivative by log sigma^2.
    """
    by_kernel = [variance * total for total in sums[1:]]
    return np.array([variance * (2.0 * sums[0] + trace), *by_kernel, by_noise])


def hyperparameters_of(kernel: Kernel, theta: np.ndarray) -> SimpleNamespace:
    """Return the hyperparameters by name: `amplitude`, the kernel's, and `noise_std`."""
    *values, noise_variance = np.exp(theta).tolist()
    return SimpleNamespace(
        **dict(zip(names_of(kernel), [*values, noise_variance**0.5], strict=True))
    )


def not_factorised(model: str, kernel: Kernel, theta: np.ndarray, dtype: Any = float) -> str:
    """Say that no jitter makes a covariance positive definite, and what may."""
    *values, noise = np.exp(theta).tolist()
    listed = ", ".join(
        f"{name} {value:.3g}" for name, value in zip(names_of(kernel), values, strict=False)
    )
    wider = ", or use model.dtype=float64" if np.dtype(dtype).itemsize < 8 else ""
    return (
        f"the {model} cannot factorise the covariance of its data, with {listed} and noise "
        f"variance {noise:.3g} (scaled units): start model.amplitude, model.lengthscale and "
        "model.noise_variance nearer to 1, look for "
        f"measurements beyond all others{wider}"
    )
