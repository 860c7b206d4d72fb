"""Checks of a survey of several logs: where samples come from, what later logs say of flags."""

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist

from infoplan.analyse.audit.model import pilot_box, spacing_of_samples
from infoplan.analyse.audit.stored import (
    Booleans,
    FaultError,
    Integers,
    Partial,
    StoredMission,
    demand,
)


def check_later_logs(mission: StoredMission) -> str | Partial:
    """Check the table ``origins``: its logs, the flags of each when it was the last, verdicts."""
    table, samples = mission.tables["origins"], mission.samples
    if len(table) != len(samples):
        raise FaultError(f"the origins of {len(table)} samples are told, of {len(samples)}")
    names = list(dict.fromkeys(table["log"]))
    log = table["log"].map(names.index).to_numpy()
    first = table["flagged_first"].to_numpy(dtype=bool)
    demand(np.diff(log, prepend=0) >= 0, lambda i: f"sample {i} is of a log that had ended")
    if table.duplicated(["log", "row"]).any():
        raise FaultError(f"sample {int(table.duplicated(['log', 'row']).argmax())} is told twice")
    unknown = []
    for number, name in enumerate(names):
        mine = np.flatnonzero(log == number)
        judged = mission.judgements[int(mission.epoch[mine[-1]])]
        if judged is None:
            unknown.append(name)
            continue
        again = judged[1][mine] & mission.told[mine]
        if len(wrong := mine[first[mine] != again]):
            raise FaultError(
                f"sample {wrong[0]} has flagged_first {first[wrong[0]]}, judged again "
                f"{not first[wrong[0]]}"
            )
    expected = _verdicts(mission, log, first, len(names))
    found = [None if pd.isna(verdict) else str(verdict) for verdict in table["verdict"]]
    for i, (one, other) in enumerate(zip(found, expected, strict=True)):
        if one != other:
            raise FaultError(f"sample {i} is called {one}, its neighbours make it {other}")
    told = f"{len(names)} logs, {sum(one is not None for one in found)} verdicts"
    if unknown:
        return Partial(told, f"flags of {', '.join(unknown)} when they were the last")
    return told


def _verdicts(
    mission: StoredMission, log: Integers, first: Booleans, count: int
) -> list[str | None]:
    """Say what later logs make of each flag, pair by pair."""
    found: list[str | None] = [None] * len(log)
    if mission.option("detector.scope") != "historical":
        return found
    last, (low, high) = mission.curves.iloc[-1], pilot_box(mission)
    scaled = np.array([last["lengthscale_1"], last["lengthscale_2"]], dtype=float)
    spacing = spacing_of_samples(mission)
    radius = np.maximum(scaled * (high - low) / 4, spacing)
    x = mission.x / np.where(np.isnan(radius), 3 * spacing, radius)
    flagged = mission.samples["flagged"].to_numpy(dtype=bool)
    for i in np.flatnonzero(first & (log < count - 1)):
        later = x[(log > log[i]) & ~flagged]
        near = len(later) > 0 and cdist(x[i : i + 1], later).min() <= 1
        found[i] = ("confirmed" if flagged[i] else "cleared") if near else "untested"
    return found
