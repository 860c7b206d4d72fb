"""A model of your own: a class that predicts elevations.

In the folder of this file:
    infoplan run model=own model.function=own_model.Matern model.options.nu=2.5

The keyword-only parameters of its constructor, annotated, are its options. A mission also reads
`hyperparameters`, `jitter`, `log_marginal_likelihood` of a model that has them.
"""

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor, kernels


class Matern:
    """Gaussian process with a rough kernel, whose parameters are learned from the pilot alone."""

    def __init__(self, x_pilot, y_pilot, *, nu: float = 1.5, noise: float = 0.05):
        self.centre, self.scale = y_pilot.mean(), y_pilot.std()
        kernel = kernels.Matern([10.0, 10.0], nu=nu)
        self.process = GaussianProcessRegressor(kernel, alpha=noise**2)
        self.replace(x_pilot, y_pilot)
        self.process.set_params(kernel=self.process.kernel_, optimizer=None)

    def append(self, x, y):
        """Add samples: positions of shape (n, 2), measurements of shape (n,)."""
        self.replace(np.vstack([self.x, x]), np.append(self.y, y))

    def replace(self, x, y):
        """Take these samples in place of those before."""
        self.x, self.y = x, y
        self.process.fit(x, (y - self.centre) / self.scale)

    def optimize(self, iterations):
        """Learn; called after the pilot and after each epoch. Here all is learned by then."""

    def predict(self, x):
        """Mean and standard deviation at positions of shape (m, 2), both of shape (m,)."""
        mean, std = self.process.predict(x, return_std=True)
        return self.centre + self.scale * mean, self.scale * std
