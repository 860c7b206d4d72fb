"""Log-normal priors of the lengthscales and the noise variance, for a maximum a posteriori."""

from collections.abc import Sequence

import numpy as np

from infoplan.model.kernel import Kernel
from infoplan.model.theta import names_of


class Prior:
    """Independent normal distributions of some log hyperparameters.

    Parameters
    ----------
    kernel : Kernel
        Whose names tell which of its hyperparameters are lengthscales: those that begin so.
    lengthscale, noise_variance : (float, float) or None
        Median of the hyperparameter, and standard deviation of its logarithm; None: no prior.
    """

    def __init__(
        self,
        kernel: Kernel,
        lengthscale: Sequence[float] | None,
        noise_variance: Sequence[float] | None,
    ) -> None:
        of_lengthscales, of_noise = lengthscale or (1.0, np.inf), noise_variance or (1.0, np.inf)
        *names, _ = names_of(kernel)
        chosen = [of_lengthscales if name.startswith("lengthscale") else (1.0, np.inf)
                  for name in names]  # fmt: skip
        medians, self._deviations = np.array([*chosen, of_noise], dtype=float).T
        self._centres = np.log(medians)

    def log_density(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Log density of theta, up to a constant, and its gradient.

        Of the logarithms, so that the mode does not depend on the hyperparameters' unit.

        Parameters
        ----------
        theta : ndarray of shape (k,)
            Log hyperparameters.
        """
        standardised = (theta - self._centres) / self._deviations
        return -0.5 * float(standardised @ standardised), -standardised / self._deviations
