"""A multiverse in parts: what of it is whole, and two parts as one."""

from collections import Counter
from dataclasses import replace

import pandas as pd

from infoplan.analyse.universe_numbers import LABELS, Multiverse, in_order
from infoplan.errors import UsageError

COMMON = ("terrain", "unit", "budget", "model", "axis")
"""What parts of one multiverse have in common."""


def whole(multiverse: Multiverse) -> Multiverse:
    """Leave out what is still being flown.

    That is seeds that most runs lack, runs that lack others, and of each universe the shares of
    outliers at which it lacks a run that others have there.
    """
    missions, of_run = multiverse.missions, list(LABELS[:-1])
    flown = Counter(missions.groupby(of_run)["seed"].agg(frozenset))
    seeds = max(flown, key=lambda some: (flown[some], len(some)))
    missions = missions[missions["seed"].isin(seeds)]
    missions = missions[missions.groupby(of_run)["seed"].transform("nunique") == len(seeds)]
    runs = missions["method"] + " " + missions["scope"]
    there = runs.groupby([missions["universe"], missions["rho"]]).transform("nunique")
    most = there.groupby(missions["rho"]).transform("max")
    return replace(multiverse, missions=missions[there == most].reset_index(drop=True))


def joined(first: Multiverse, second: Multiverse) -> Multiverse:
    """Make one multiverse of two: what the second has of a universe and rho is taken from it.

    Raises
    ------
    UsageError
        If they differ in more than universes, shares of outliers and seeds.
    """
    for name in COMMON:
        one, other = getattr(first, name), getattr(second, name)
        if one != other:
            raise UsageError(f"parts of a multiverse have the same {name}, not {one} and {other}")
    keys = ["universe", "rho"]
    newer = pd.MultiIndex.from_frame(second.missions[keys])
    older = pd.MultiIndex.from_frame(first.missions[keys])
    missions = pd.concat([first.missions[~older.isin(newer)], second.missions])
    return replace(first, missions=in_order(missions))
