"""Checks of what a fault other than spikes has made of the measurements: how often, and how far."""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import stats

from infoplan.analyse.audit.stored import (
    CHANCE,
    SIGMAS,
    Booleans,
    FaultError,
    Floats,
    Integers,
    Partial,
    StoredMission,
    demand,
    demand_close,
)

SCATTERED = ("max_range", "uniform", "heavy_tail")
"""Faults that hit each sample with probability rho, whatever befalls the others."""

LASTING = ("burst", "stuck", "bias", "drift", "dropout")
"""Faults that come in stretches."""


def check_share(mission: StoredMission) -> str | Partial:
    """Check that the number of outliers may come of rho and of the fault's way to choose them."""
    name, rho = mission.option("fault.name"), float(mission.option("rho"))
    outlier, chosen = mission.samples["is_outlier"].to_numpy(), spoilt(mission)
    demand(~outlier | chosen, lambda i: f"{mission.place(i)} is an outlier, but the pilot has none")
    found, n = int(np.sum(outlier)), int(np.sum(chosen))
    if name in SCATTERED:
        stay, begin = np.full(n, rho), np.full(n, rho)
    elif name in LASTING:
        length = float(mission.option("fault.length"))
        stay, begin = np.full(n, 1 - 1 / length), np.full(n, rho / (length * (1 - rho)))
    elif name == "local":
        stay = begin = _local_chances(mission, chosen, rho)
    else:
        return Partial(f"{found} outliers in {n} samples", f"the share: {_unknown(mission)}")
    chances = count_chances(rho, stay, begin)
    # Both tails; of a stuck sensor the first value of all is its own.
    slack = int(name == "stuck")
    tail = min(chances[: found + 1 + slack].sum(), chances[max(found - slack, 0) :].sum())
    if tail < CHANCE / 2:
        raise FaultError(f"{found} outliers in {n} samples at rho {rho:g}, {name}")
    return f"{found} outliers in {n} samples, {name}"


def check_errors(mission: StoredMission) -> str | Partial:
    """Check that what outliers say is what the fault may say."""
    name = mission.option("fault.name")
    if name not in ERRORS:
        return Partial("", f"the errors: {_unknown(mission)}")
    outliers = np.flatnonzero(mission.samples["is_outlier"].to_numpy())
    said = mission.samples["measured"].to_numpy()[outliers]
    demand(
        np.isnan(said) if name == "dropout" else np.isfinite(said),
        lambda i: f"{mission.place(outliers[i])} says {said[i]}, which {name} does not",
    )
    if not len(outliers):
        return "no outliers"
    ERRORS[name](mission, outliers)
    return f"{len(outliers)} outliers as of {name}"


def _unknown(mission: StoredMission) -> str:
    """Say why nothing is known of a fault."""
    if mission.is_own("fault"):
        return "the fault is the user's own"
    if mission.option("fault.name") == "mixed":
        return "which of the mixed faults has hit a sample is not stored"
    return f"nothing is known of fault={mission.option('fault.name')}"


def spoilt(mission: StoredMission) -> Booleans:
    """Tell which samples the fault was given, shape (n,)."""
    return (mission.epoch > 0) | bool(mission.option("pilot.outliers"))


def count_chances(first: float, stay: Floats, begin: Floats) -> Floats:
    """Give the distribution of the number of outliers in a Markov chain of two states.

    Parameters
    ----------
    first
        Probability that the first sample is one; where stay and begin are the same, theirs is.
    stay, begin
        Probability that a sample is one after one that is, and after one that is not, shape (n,).

    Returns
    -------
    ndarray, shape (n + 1,)
    """
    n = len(stay)
    chance = float(stay[0]) if n and stay[0] == begin[0] else first
    sound, spoilt = np.zeros(n + 1), np.zeros(n + 1)
    sound[0] = 1.0
    for i in range(n):
        after_sound = chance if i == 0 else begin[i]
        arrive = sound * after_sound + spoilt * stay[i]
        sound = sound * (1 - after_sound) + spoilt * (1 - stay[i])
        spoilt = np.roll(arrive, 1)
    return sound + spoilt


def _local_chances(mission: StoredMission, chosen: Booleans, rho: float) -> Floats:
    """Give the probability that each sample is an outlier by its ground, batch after batch."""
    x, truth = mission.x[chosen], mission.samples["truth"].to_numpy()[chosen]
    bounds = [float(bound) for bound in mission.option("fault.regions")]
    regions = [bounds[i : i + 4] for i in range(0, len(bounds), 4)]
    if regions:
        inside = [any(a <= p <= b and c <= q <= d for a, b, c, d in regions) for p, q in x]
        bad = np.array(inside, dtype=float)
    else:
        step = np.linalg.norm(np.diff(x, axis=0), axis=1)
        slope = np.abs(np.diff(truth)) / np.where(step > 0, step, math.inf)
        bad = np.concatenate([slope[:1] if len(slope) else [0.0], slope])
    chances, epochs = np.zeros(len(bad)), mission.epoch[chosen]
    for e in np.unique(epochs):
        so_far = bad[epochs <= e]
        worst = so_far.max()
        weight = 1 + (float(mission.option("fault.factor")) - 1) * so_far / (worst or 1.0)
        # The mean of min(1, c w) grows with c: halve the interval in which it is rho.
        low, high = 0.0, 1.0 / weight.min()
        for _ in range(200):
            middle = (low + high) / 2
            below = np.minimum(1.0, middle * weight).mean() < rho
            low, high = (middle, high) if below else (low, middle)
        chances[epochs == e] = np.minimum(1.0, high * weight)[epochs[epochs <= e] == e]
    return chances


def _range(mission: StoredMission) -> tuple[float, float]:
    """Lowest elevation of the terrain at the nodes of the query grid, and their range."""
    truth = mission.maps["truth"]
    return float(truth.min()), float(truth.max() - truth.min())


def _reach(mission: StoredMission) -> float:
    """How far noise may move a measurement, terrain's unit."""
    return SIGMAS * float(mission.option("sensor.noise_std")) + mission.elevation_tolerance


def _errors(mission: StoredMission) -> Floats:
    """Measured minus true elevation of each sample, shape (n,)."""
    return (mission.samples["measured"] - mission.samples["truth"]).to_numpy()


def _constant(mission: StoredMission, outliers: Integers) -> None:
    lowest, span = _range(mission)
    level = lowest + float(mission.option("fault.level")) * span
    said = mission.samples["measured"].to_numpy()[outliers]
    # A multiple of the range is rounded to a share of itself.
    allowed = mission.elevation_tolerance * max(1.0, abs(float(mission.option("fault.level"))))
    demand_close("the return of outlier", said, level, allowed)


def _anywhere(mission: StoredMission, outliers: Integers) -> None:
    lowest, span = _range(mission)
    low, high = (lowest + float(bound) * span for bound in mission.option("fault.bounds"))
    allowed = mission.elevation_tolerance * max(1.0, abs(low), abs(high))
    said = mission.samples["measured"].to_numpy()[outliers]
    demand(
        (said >= low - allowed) & (said <= high + allowed),
        lambda i: f"{mission.place(outliers[i])} says {said[i]:.6g}, not {low:.6g} to {high:.6g}",
    )
    _demand_distribution(said, stats.uniform(low, high - low), 0.0)


def _student(mission: StoredMission, outliers: Integers) -> None:
    _, span = _range(mission)
    scale = float(mission.option("fault.scale")) * span
    # The density is below 0.4: noise moves the distribution by no more than that times its reach.
    blur = 0.4 * _reach(mission) / scale if scale > 0 else math.inf
    _demand_distribution(
        _errors(mission)[outliers] / (scale or 1.0),
        stats.t(float(mission.option("fault.dof"))),
        blur,
    )


def _demand_distribution(values: Floats, expected: Any, blur: float) -> None:
    distance = stats.kstest(values, expected.cdf).statistic - blur
    if distance > 0 and stats.kstwo.sf(distance, len(values)) < CHANCE:
        raise FaultError(
            f"{len(values)} outliers, median {np.median(values):.4g}, are not as drawn"
        )


def _sizes(mission: StoredMission, outliers: Integers) -> None:
    _, span = _range(mission)
    low, high = (float(bound) * span for bound in mission.option("fault.amplitude"))
    size, reach = np.abs(_errors(mission)[outliers]), _reach(mission)
    demand(
        (size >= low - reach) & (size <= high + reach),
        lambda i: (
            f"{mission.place(outliers[i])} is {size[i]:.4g} off the truth, not {low:.4g} to "
            f"{high:.4g}"
        ),
    )


def _held(mission: StoredMission, outliers: Integers) -> None:
    measured = mission.samples["measured"].to_numpy()
    demand(
        measured[outliers] == measured[outliers - 1],
        lambda i: f"{mission.place(outliers[i])} does not say what the one before it said",
    )


def _steps(mission: StoredMission, outliers: Integers) -> None:
    _sizes(mission, outliers)
    errors, reach = _errors(mission), 2 * _reach(mission)
    for one, other in pairwise(outliers):
        if other == one + 1 and not abs(errors[other] - errors[one]) <= reach:
            raise FaultError(f"{mission.place(other)} has another error than the one before it")


def _growth(mission: StoredMission, outliers: Integers) -> None:
    _, span = _range(mission)
    rate, reach = float(mission.option("fault.rate")) * span, _reach(mission)
    errors, age = _errors(mission), 0
    for before, i in pairwise([-2, *outliers]):
        age = age + 1 if i == before + 1 else 1
        if not abs(abs(errors[i]) - age * rate) <= reach:
            raise FaultError(
                f"{mission.place(i)} is {errors[i]:.4g} off the truth, {age} samples into a drift "
                f"of {rate:.4g} a sample"
            )


ERRORS: dict[str, Callable[[StoredMission, Integers], None]] = {
    "max_range": _constant,
    "uniform": _anywhere,
    "heavy_tail": _student,
    "burst": _sizes,
    "local": _sizes,
    "stuck": _held,
    "bias": _steps,
    "drift": _growth,
    "dropout": lambda mission, outliers: None,
}
"""What is demanded of the outliers of a fault, by its name; their numbers are given."""
