"""A stored mission as a source: its samples go through another belief."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from infoplan.config import MissionConfig, SpikeConfig, TreeSearchConfig, is_survey
from infoplan.extent import checked_extent
from infoplan.mission import explore
from infoplan.samples import Samples
from infoplan.scoring import State
from infoplan.source import StoredSource
from infoplan.terrain.relief import local_relief, thirds


def explore_again(
    config: MissionConfig, seed: int, samples: pd.DataFrame, maps: pd.DataFrame
) -> Iterator[State]:
    """Give a belief the samples of a stored mission, epoch by epoch.

    Nothing is planned or sensed: with the detector and model that it was flown with, the numbers
    are those of the flight.

    Parameters
    ----------
    config
        Valid but for its terrain, of which only the extent counts.
    seed
        Of the detector's random streams.
    samples, maps
        Tables of the mission; the maps' truth is what predictions are scored by.

    Returns
    -------
    iterator of State
        After the pilot and after each epoch.
    """
    truth = maps["truth"].to_numpy(dtype=np.float64)
    extent, labelled = checked_extent(config.terrain.extent), not is_survey(config.terrain.name)
    third = thirds(local_relief(truth.reshape(config.grid), extent)).ravel()
    source = StoredSource(stored_samples(samples), extent, truth, third, labelled)
    # A planner or fault of the user's own need not be there any more.
    flown = replace(config, planner=stand_in(config), fault=SpikeConfig(), budget=len(samples))
    return explore(flown, source, seed)


def stored_samples(table: pd.DataFrame) -> Samples:
    """Read the table of samples; labels that nobody knows are False."""
    return Samples(
        x=table[["x1", "x2"]].to_numpy(dtype=np.float64),
        is_outlier=table["is_outlier"].to_numpy(dtype=bool, na_value=False),
        **{name: table[name].to_numpy() for name in ("epoch", "heading", "truth", "measured",
                                                     "flagged", "score")},
    )  # fmt: skip


def stand_in(config: MissionConfig) -> TreeSearchConfig:
    """Planner that keeps what a mission reads of a planner's options."""
    return TreeSearchConfig(smoothing=config.planner.smoothing)
