"""From workspace and terrain's unit to the scaled units of the model, and what cannot be scaled."""

from dataclasses import dataclass

import numpy as np

from infoplan.errors import RunError


@dataclass(frozen=True)
class Scaler:
    """Inputs go to [-1, 1] by the pilot's bounding box, its measurements to mean 0, deviation 1.

    Attributes
    ----------
    x_low, x_extent : ndarrays of shape (2,)
        Corner and size of the bounding box, workspace units.
    y_mean, y_std : float
        Mean and (population) standard deviation, terrain's unit.
    """

    x_low: np.ndarray
    x_extent: np.ndarray
    y_mean: float
    y_std: float

    @classmethod
    def of_pilot(cls, x: np.ndarray, y: np.ndarray) -> "Scaler":
        """Fit to the pilot's data.

        Parameters
        ----------
        x : ndarray of shape (n, 2)
            Positions, finite.
        y : ndarray of shape (n,)
            Measurements, finite.

        Raises
        ------
        RunError
            If they have no extent, or are equal or huge.
        """
        if not (y.size and np.ptp(x[:, 0]) > 0.0 and np.ptp(x[:, 1]) > 0.0):
            raise RunError(
                "The pilot samples span no area, and their bounding box scales the model's "
                "inputs: use a pilot path with an extent along both axes."
            )
        if not np.ptp(y) > 0.0:
            raise RunError(
                "The pilot's measurements are all equal, and their standard deviation scales the "
                "model: use a pilot path over varying terrain, or a sensor noise above zero."
            )
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            mean, std = float(y.mean()), float(y.std())
        if not (np.isfinite(mean) and 0.0 < std < np.inf):
            raise RunError(
                f"The pilot's measurements, {y.min():.3g} to {y.max():.3g}, differ by too much or "
                "too little for a standard deviation, which scales the model: use another unit."
            )
        return cls(x.min(axis=0), np.ptp(x, axis=0), mean, std)

    def inputs(self, x: np.ndarray) -> np.ndarray:
        """Scale positions of shape (n, 2); returns shape (2, n), as the compiled passes read."""
        return np.ascontiguousarray((2.0 * ((x - self.x_low) / self.x_extent) - 1.0).T)

    def outputs(self, y: np.ndarray) -> np.ndarray:
        """Scale measurements of shape (n,)."""
        return (y - self.y_mean) / self.y_std


def checked(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Copy data to float arrays of shapes (n, 2) and (n,); refuse values that are not finite."""
    x = np.array(x, dtype=float).reshape(-1, 2)
    y = np.array(y, dtype=float).reshape(-1)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise RunError("The model was given positions or measurements that are not finite numbers.")
    return x, y
