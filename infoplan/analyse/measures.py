"""Numbers that the paper's claims compare: one a mission, worked out from its tables."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd

from infoplan.analyse.commands import Wanted
from infoplan.analyse.curves import collapsed_ends, missions, summarise
from infoplan.analyse.detection import detector_options, rejudge
from infoplan.analyse.judging import USUAL, Rules
from infoplan.analyse.relief import relief_at
from infoplan.analyse.tables import Selection, load_curves, load_maps, load_samples
from infoplan.collapse import counted_ends

NEARBY = 2.0
"""A sample this near to a flagged one has gone back to it, workspace units."""


@dataclass
class Measures:
    """Numbers a mission, worked out when a comparison asks for them.

    Attributes
    ----------
    selection
        Where they come from.
    rules
        By which claims are judged.
    missing
        Runs that were asked for and are not there.
    asked
        Runs that were asked for and are there, by method.
    """

    selection: Selection
    rules: Rules = USUAL
    missing: list[Wanted] = field(default_factory=list)
    asked: dict[str, str] = field(default_factory=dict)

    @cached_property
    def curves(self) -> pd.DataFrame:
        """The curves of all missions."""
        return load_curves(self.selection)

    @cached_property
    def summaries(self) -> pd.DataFrame:
        """Curves summed up, one row a mission."""
        summaries = summarise(self.curves, early=self.rules.early)
        summaries["rise"] = summaries["final"] - summaries["minimum"]
        return summaries

    @cached_property
    def ends(self) -> dict[tuple[str, int], bool | None]:
        """Whether each mission ends with a collapsed model."""
        return collapsed_ends(self.curves, self.selection.results_dir)

    @property
    def unit(self) -> str:
        """Unit of elevations and errors."""
        return self.selection.unit

    @cached_property
    def deviation(self) -> float:
        """Standard deviation of the terrain, its unit."""
        first = self.selection.missions["run"].iloc[0]
        return float(load_maps(self.selection.only([first]))["truth"].std(ddof=0))

    @property
    def margin(self) -> float:
        """Margin of elevations and errors, the terrain's unit."""
        return self.rules.margin * self.deviation

    def collapsed(self) -> dict[str, tuple[int, int]]:
        """How many missions of the runs asked for end collapsed, of how many, by method."""
        return {
            method: counted_ends([end for (name, _), end in self.ends.items() if name == run])
            for method, run in self.asked.items()
        }

    def numbers(self, name: str, method: str, rho: float, scope: str) -> "pd.Series[float] | None":
        """One number a seed; None if there is no such run, which is noted."""
        run = self.selection.run(method, rho, scope)
        if run is None:
            self.missing.append((method, rho, scope))
            return None
        self.asked[method] = run
        if name in MEASURES:
            return MEASURES[name](self.selection.only([run]))
        of_run = self.summaries.xs(run, level="run")
        return of_run[name]


def relief_gap(run: Selection) -> "pd.Series[float]":
    """Mean local relief at a mission's false alarms less that at its true negatives, by seed.

    Over the samples after the pilot, as judged at the end; NaN without a false alarm.
    """
    maps = dict(missions(load_maps(run)))
    gaps = {}
    for key, samples in missions(load_samples(run)):
        clean = samples[(samples["epoch"] > 0) & ~samples["is_outlier"].astype(bool)]
        relief, flagged = relief_at(clean, maps[key]), clean["flagged"].to_numpy(dtype=bool)
        both = flagged.any() and not flagged.all()
        gaps[key[1]] = relief[flagged].mean() - relief[~flagged].mean() if both else np.nan
    return pd.Series(gaps, dtype=float)


def spread(run: Selection) -> "pd.Series[float]":
    """Take the standard deviation of the final mean over the query grid, by seed."""
    return load_maps(run).groupby("seed")["mean"].std(ddof=0)


def mean_std(run: Selection) -> "pd.Series[float]":
    """Take the mean of the final standard deviation over the query grid, by seed."""
    return load_maps(run).groupby("seed")["std"].mean()


def recall_lost(run: Selection) -> "pd.Series[float]":
    """Recall of each epoch's own batch, pooled, less the recall over everything at the end."""
    options = detector_options(run, run.missions["run"].iloc[0])
    lost = {}
    for (_, seed), samples in missions(load_samples(run)):
        own = rejudge(samples, options)[["own_tp", "own_fn"]].sum()
        spikes = samples[samples["is_outlier"].astype(bool)]
        if len(spikes):
            lost[seed] = own["own_tp"] / own.sum() - spikes["flagged"].mean()
    return pd.Series(lost, dtype=float)


def returned(run: Selection) -> "pd.Series[float]":
    """Share of the samples after the pilot that lie near one flagged in an earlier epoch, by seed.

    Samples of the same epoch do not count: its flags were not known when it was planned.
    """
    shares = {}
    for (_, seed), samples in missions(load_samples(run)):
        planned, flagged = samples[samples["epoch"] > 0], samples[samples["flagged"].astype(bool)]
        x, places = planned[["x1", "x2"]].to_numpy(), flagged[["x1", "x2"]].to_numpy()
        near = np.hypot(*(x[:, None] - places[None]).transpose(2, 0, 1)) <= NEARBY
        earlier = flagged["epoch"].to_numpy()[None] < planned["epoch"].to_numpy()[:, None]
        shares[seed] = (near & earlier).any(axis=1).mean()
    return pd.Series(shares, dtype=float)


MEASURES: dict[str, Callable[[Selection], "pd.Series[float]"]] = {
    "relief_gap": relief_gap,
    "spread": spread,
    "std": mean_std,
    "recall_lost": recall_lost,
    "returned": returned,
}
