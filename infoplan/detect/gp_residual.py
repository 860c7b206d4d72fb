"""Outliers as measurements that the Gaussian process, given all the others, does not expect."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

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
    conditioned = getattr(model, "weights_and_sparse_inverse", model.weights_and_inverse)
    weights, inverse = conditioned(samples.x[among], samples.measured[among], mine)
    scores = np.abs(weights) / np.sqrt(inverse.diagonal())
    dropped = _drop(weights, inverse, scores, threshold) if one_by_one else scores > threshold
    flagged, score = np.zeros(len(samples), dtype=bool), np.full(len(samples), np.nan)
    flagged[among[mine]], score[among[mine]] = dropped, scores
    return flagged, score


@dataclass(frozen=True)
class _Dropped:
    """A sample that was dropped: its part of the inverse before that.

    Attributes
    ----------
    places
        Numbers of the samples that it has to do with, ascending.
    share
        Its column there, over its entry on the diagonal.
    row
        Its row there.
    """

    places: Integers
    share: Floats
    row: Floats


def _drop(
    weights: Floats, inverse: Floats | csr_array, scores: Floats, threshold: float
) -> NDArray[np.bool_]:
    """Drop the worst again and again; `weights` and `scores` become those of the others.

    The inverse stays as it is: a row of it without those that were dropped is made when it is
    needed, from those of them that it has to do with. So a sparse one stays sparse.
    """
    n = len(weights)
    diagonal = inverse.diagonal().copy()
    dropped = np.zeros(n, dtype=bool)
    before: list[_Dropped] = []
    touched_by: list[list[int]] = [[] for _ in range(n)]
    column, row = np.zeros(n), np.zeros(n)
    standing = scores.copy()  # 0 where dropped
    while n:
        worst = int(np.argmax(standing))
        if dropped[worst] or not scores[worst] > threshold:
            break
        dropped[worst], standing[worst] = True, 0.0
        there, values = _row(inverse, worst)
        column[there] = row[there] = values
        reached = [there]
        for one in (before[number] for number in touched_by[worst]):
            # Entries (i, worst) and (worst, i) lose what went with the sample that was dropped.
            place = np.searchsorted(one.places, worst)
            column[one.places] -= one.share * one.row[place]
            row[one.places] -= one.share[place] * one.row
            reached.append(one.places)
        there = np.unique(np.concatenate(reached))
        there = there[(column[there] != 0) | (row[there] != 0)]
        share = column[there] / row[worst]
        weights[there] -= share * weights[worst]
        diagonal[there] -= share * row[there]
        kept = there[~dropped[there]]
        scores[kept] = np.abs(weights[kept]) / np.sqrt(diagonal[kept])
        standing[kept] = scores[kept]
        for sample in kept.tolist():
            touched_by[sample].append(len(before))
        before.append(_Dropped(there, share, row[there].copy()))
        for numbers in reached:
            column[numbers] = row[numbers] = 0.0
    return dropped


def _row(inverse: Floats | csr_array, number: int) -> tuple[Integers, Floats]:
    """Return the columns of a row, which is that column, too, and its entries there."""
    if isinstance(inverse, np.ndarray):
        return np.arange(len(inverse)), inverse[number]
    part = slice(inverse.indptr[number], inverse.indptr[number + 1])
    return inverse.indices[part], inverse.data[part]
