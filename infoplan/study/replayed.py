"""A mission that gets the samples of a stored one instead of flying."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from infoplan.config import MissionConfig, TreeSearchConfig
from infoplan.culprit import culprit_named
from infoplan.mission import CurveRow, Mission, Samples
from infoplan.terrain import Terrain


def replayed_mission(
    config: MissionConfig, terrain: Terrain, seed: int, samples: pd.DataFrame, maps: pd.DataFrame
) -> tuple[Mission, Iterator[CurveRow]]:
    """Prepare a mission that gets the stored samples, epoch by epoch, and is evaluated after each.

    Parameters
    ----------
    config, terrain, seed
        As of `Mission`; of the terrain only the extent counts.
    samples, maps
        Tables of the mission that was flown; the map's truth is what predictions are scored by.

    Returns
    -------
    mission : Mission
    rows : iterator of CurveRow
        After the pilot and after each epoch.
    """
    # Nobody plans: a planner of the user's own need not be there any more.
    config = replace(config, planner=stand_in(config))
    mission = Mission(config, terrain, seed)
    mission.grid_truth = maps["truth"].to_numpy(dtype=np.float64)
    n = len(samples)
    stored = Samples(
        epoch=samples["epoch"].to_numpy(dtype=np.int64),
        x=samples[["x1", "x2"]].to_numpy(dtype=np.float64),
        flagged=np.zeros(n, dtype=bool),
        score=np.full(n, np.nan),
        **{name: samples[name].to_numpy() for name in ("heading", "truth", "measured",
                                                       "is_outlier")},
    )  # fmt: skip
    return mission, _replayed_rows(mission, config, stored)


def _replayed_rows(mission: Mission, config: MissionConfig, stored: Samples) -> Iterator[CurveRow]:
    for mission.epoch in range(int(stored.epoch[-1]) + 1):
        batch = stored[stored.epoch == mission.epoch]
        with culprit_named(config, f"in epoch {mission.epoch}"):
            if mission.epoch:
                mission.observe(batch)
            else:
                mission.start(batch)
            row = mission.evaluate()
        yield row


def stand_in(config: MissionConfig) -> TreeSearchConfig:
    """Planner that keeps what a mission reads of a planner's options."""
    return TreeSearchConfig(smoothing=config.planner.smoothing)
