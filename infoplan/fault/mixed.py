"""Several faults at once."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from infoplan.config import MixedConfig
from infoplan.fault.sensed import Corrupted, Sensed, corrupted


def mixed(
    sensed: Sensed,
    state: list[Any] | None,
    rho: float,
    rng: np.random.Generator,
    *,
    known: dict[str, Callable[..., Corrupted]],
    faults: Sequence[str] = ("burst", "max_range", "stuck"),
    weights: Sequence[float] = (),
    options: dict[str, Any] | None = None,
) -> Corrupted:
    """Let several faults spoil a batch, none of which knows of the others.

    Where several have changed a sample, it says what the last of them says.

    Parameters
    ----------
    sensed, rho
        As of any fault.
    state
        Of each fault.
    rng
        Each fault gets a child of it.
    known
        The faults by name.
    faults, weights, options
        As of `infoplan.config.MixedConfig`.
    """
    config = MixedConfig(faults=list(faults), weights=list(weights), options=options or {})
    parts, shares = config.parts(), config.shares(rho)
    before = state or [None] * len(parts)
    said, after = sensed.measured, []
    for part, share, own, stream in zip(parts, shares, before, rng.spawn(len(parts)), strict=True):
        arguments = {name: value for name, value in vars(part).items() if name != "name"}
        done = known[part.name](sensed, own, share, stream, **arguments)
        said = np.where(done.is_outlier, done.measured, said)
        after.append(done.state)
    return corrupted(sensed, said, after)
