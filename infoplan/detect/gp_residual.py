"""Outliers as measurements that the Gaussian process, given all the others, does not expect."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from infoplan.detect.evidence import Evidence, Judgement

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Conditioned(Protocol):
    """What the detector needs of a model: `infoplan.model.GaussianProcess.weights_and_inverse`."""

    def weights_and_inverse(self, x: Floats, y: Floats, chosen: Integers) -> tuple[Floats, Floats]:
        """Solve for the weights of some data, and invert their covariance, for the chosen ones."""
        ...


def gp_residual(
    samples: Evidence,
    model: Conditioned,
    rng: np.random.Generator,
    *,
    threshold: float = 3.0,
    one_by_one: bool = True,
) -> Judgement:
    """Flag samples whose leave-one-out residual is too many standard deviations.

    The Gaussian process holds all candidates, the new batch among them, under the hyperparameters
    that the model has before it sees the batch. Leaving each out in turn is a closed form
    (Rasmussen & Williams, eq. 5.12): with w = K_y^-1 y and P = K_y^-1 the residual of sample i over
    its standard deviation is w_i / sqrt(P_ii).

    A spike also spoils the prediction at its neighbours. One by one, therefore, the worst of the
    judged samples is dropped and the others are looked at without it, until none is left above the
    threshold; dropping one is a closed form again, a rank-one update of w and P.

    Parameters
    ----------
    samples
        `Evidence.candidates` are in the Gaussian process.
    model
        Has ``weights_and_inverse``, as the Gaussian processes of infoplan; for ``student_t`` it is
        that of Gaussian noise of the same variance.
    rng
        As for any detector; unused.
    threshold
        Largest absolute residual kept, in standard deviations of its prediction, noise included.
    one_by_one
        Drop the worst again and again; false: all above the threshold, at once.

    Returns
    -------
    flagged : ndarray of bool, shape (n,)
    score : ndarray, shape (n,)
        Absolute standardised residual, when it was dropped or at the end; NaN where not judged.
    """
    among = np.flatnonzero(samples.candidates)
    mine = np.flatnonzero(samples.judged[among])
    weights, inverse = model.weights_and_inverse(samples.x[among], samples.measured[among], mine)
    scores = np.abs(weights) / np.sqrt(inverse.diagonal())
    dropped = np.zeros(len(mine), dtype=bool)
    if not one_by_one:
        dropped = scores > threshold
    while one_by_one:
        worst = int(np.argmax(np.where(dropped, 0.0, scores)))
        if dropped[worst] or not scores[worst] > threshold:
            break
        dropped[worst] = True
        kept = ~dropped
        share = inverse[:, worst] / inverse[worst, worst]
        weights -= share * weights[worst]
        inverse -= np.outer(share, inverse[worst])
        scores[kept] = np.abs(weights[kept]) / np.sqrt(inverse.diagonal()[kept])
    flagged, score = np.zeros(len(samples), dtype=bool), np.full(len(samples), np.nan)
    flagged[among[mine]], score[among[mine]] = dropped, scores
    return flagged, score
