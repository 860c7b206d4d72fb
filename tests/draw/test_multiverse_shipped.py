"""The page on the multiverse: its file is enough to draw it, and its tables say no more."""

import runpy
import shutil
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd
import pytest
from scipy import stats

from infoplan.analyse.multiverse import claim_curves, compare_models
from infoplan.analyse.universe_numbers import read
from infoplan.analyse.universe_parts import whole
from infoplan.study.universes import DEFAULT

ROOT = Path(__file__).parents[2]
PICTURES = ("multiverse.png", "multiverse_choices.png", "multiverse_c4.png")


@pytest.fixture(scope="module")
def shipped():
    return read(ROOT / "docs" / "multiverse.parquet")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("docs")
    for name in ("multiverse.parquet", "multiverse_exact.parquet", "multiverse.md"):
        shutil.copy(ROOT / "docs" / name, folder)
    script = runpy.run_path(str(ROOT / "scripts" / "draw_multiverse.py"))
    assert script["draw_multiverse"](folder) == [folder / name for name in PICTURES]
    return folder


def test_the_shipped_file_gives_the_shipped_page_and_pictures(drawn):
    text = (drawn / "multiverse.md").read_text(encoding="utf-8")
    assert text == (ROOT / "docs" / "multiverse.md").read_text(encoding="utf-8")
    for name in PICTURES:
        again, shipped = (matplotlib.image.imread(f / name) for f in (drawn, ROOT / "docs"))
        assert again.shape == shipped.shape
        # Fonts of another version of matplotlib may differ in a few pixels.
        assert np.mean(np.abs(again - shipped).max(axis=-1) > 0.1) < 0.02


def test_all_that_is_shipped_is_whole(shipped):
    assert whole(shipped).missions.equals(shipped.missions)
    names = [one.name for one in shipped.universes]
    assert names[0] == DEFAULT
    missions = shipped.missions
    assert (shipped.terrain, shipped.budget) == ("helens", 2000)
    assert np.isfinite(missions[["final", "early", "late"]]).all(axis=None)


def test_the_control_is_of_the_same_missions(shipped):
    """How often and by how much the two models differ, as the page says it."""
    exact = read(ROOT / "docs" / "multiverse_exact.parquet")
    assert (exact.model, shipped.model) == ("gp", "vecchia")
    assert (exact.terrain, exact.budget) == (shipped.terrain, shipped.budget)
    names = [one.name for one in exact.universes]
    joint = [one.name for one in exact.universes if one.is_joint]
    assert joint == [f"joint {number}" for number in range(1, 73, 24)]
    assert names[0] == DEFAULT
    assert len(names) == 7
    found = compare_models(shipped, exact)
    assert len(found) == 4 * len(names)
    # The paper's score makes no difference to two methods.
    found = found.drop_duplicates(["method", "end", "mean"])
    page = prose("docs/multiverse.md")
    beyond = int(((found["low"] > 0) | (found["high"] < 0)).sum())
    most = found["mean"].abs().max()
    assert f"by up to {most:.0f} ft, in {beyond} of {len(found)} cases beyond chance" in page
    assert f"`vecchia` is the lower one in {(found['mean'] < 0).sum()}," in page
    ours, theirs = ({c.name: c for c in claim_curves(made)} for made in (shipped, exact))
    pairs = [(ours[name].verdict_in(one), theirs[name].verdict_in(one))
             for name in theirs for one in theirs[name].universes]  # fmt: skip
    same = sum(one == other for one, other in pairs)
    assert len(theirs) == 8
    assert f"of {len(pairs)} verdicts on the eight claims" in page
    assert f"{same} are the same" in page


def prose(name: str) -> str:
    """A document in one line."""
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())


def ends_of(shipped, rho, scope="batch"):
    """Final RMSE, a row a universe and seed."""
    missions = shipped.missions
    missions = missions[(missions["rho"] == rho) & (missions["scope"] == scope)]
    return missions.pivot(index=["universe", "seed"], columns="method", values="final")


def with_intervals(differences):
    """Mean and 95 % t interval of each universe."""
    wide = differences.unstack()
    found = stats.ttest_1samp(wide.to_numpy(), 0, axis=1).confidence_interval()
    return pd.DataFrame({"mean": wide.mean(axis=1), "low": found.low, "high": found.high})


def test_counts_in_the_prose_are_those_of_the_file(shipped):
    """Where the main sentence of page and README comes from."""
    page, margin = prose("docs/multiverse.md"), 0.05 * shipped.deviation
    missions = shipped.missions
    assert set(missions.groupby("universe")["rho"].nunique()) == {3}
    assert f"All {len(shipped.universes)} universes are flown at rho 0.05, 0.10 and 0.15" in page
    none = missions[(missions["method"] == "UCT-NONE") & (missions["rho"] == 0.1)]
    collapses = none.groupby("universe")["collapsed"].mean() > 0.5
    ends = ends_of(shipped, 0.1).groupby("universe").mean()
    collapsed, others = ends[collapses], ends[~collapses]
    assert f"In {len(collapsed)} universes most missions of UCT-NONE end with a" in page
    assert f"In all {len(collapsed)} UCT-COPOD ends below it, and PUCT-COPOD, too" in page
    for method in ("UCT-COPOD", "PUCT-COPOD"):
        assert (collapsed[method] < collapsed["UCT-NONE"] - margin).all()
    lower = (collapsed["PUCT-COPOD"] < collapsed["UCT-COPOD"] - margin).sum()
    assert f"which ends below UCT-COPOD in {lower}" in page
    less = others["UCT-COPOD"] - others["UCT-NONE"]
    below, above = (less < -margin).sum(), (less > margin).sum()
    medians = (one["UCT-NONE"].median() for one in (others, collapsed))
    told = "In the {} others UCT-NONE ends at {:.0f} ft instead of {:.0f} (medians), ".format(
        len(others), *medians
    )
    assert f"{told}UCT-COPOD below it in {below} and above it in {above}." in page
    judged = {curve.name: curve.verdicts for curve in claim_curves(shipped, ["C1", "C6"])}
    supported, contradicted = (judged["C1"].count(one) for one in ("supported", "contradicted"))
    assert f"holds in {supported}, all joint, and is contradicted in {contradicted}" in page
    assert "supported" not in judged["C6"]
    assert (
        f"COPOD ends below no filter in {len(collapsed)} of {len(collapsed)} readings of the "
        f"paper, and in {below} of {len(others)} others, above it in {above}"
    ) in prose("README.md")


CURES = (
    "pilot: spiky", "pilot: spiky, judged", "noise: restarted", "noise: floor 1",
    "learning: adam per sample", "learning: lbfgs 5", "learning: lbfgs 20", "learning: frozen",
    "actions driven: 2", "actions driven: 1", "learning rate: 0.003",
)  # fmt: skip


def test_half_of_the_figure_is_left_where_one_choice_ends_the_collapse(shipped):
    page, none = prose("docs/multiverse.md"), "UCT-NONE"
    ends = ends_of(shipped, 0.1).loc[list(CURES)]
    best, copod, regained, against = (
        with_intervals(ends[one] - ends[other])
        for one, other in (("UCT-BEST", none), ("UCT-COPOD", none), ("PUCT-COPOD", "UCT-COPOD"),
                           ("PUCT-COPOD", none))
    )  # fmt: skip
    words = {9: "nine", 10: "ten", 7: "seven", 6: "six"}
    sure = words[(best["high"] < 0).sum()]
    assert f"ends {-best['mean'].max():.0f} to {-best['mean'].min():.0f} ft below UCT-NONE" in page
    means = ends.groupby("universe").mean()
    halved = words[(means["UCT-BEST"] < means[none] / 2).sum()]
    assert f"({sure} intervals are below zero), in {halved} at less than half its error" in page
    low, high = -regained["mean"].max(), -regained["mean"].min()
    sure = words[(regained["high"] < 0).sum()]
    assert f"PUCT-COPOD ends {low:.0f} to {high:.0f} ft below UCT-COPOD ({sure})" in page
    low, high, sure = copod["mean"].min(), copod["mean"].max(), words[(copod["low"] > 0).sum()]
    assert (
        f"UCT-COPOD ends {low:.0f} to {high:.0f} ft *above* UCT-NONE ({sure} intervals are above"
    ) in page
    low, high = -against["mean"].min(), against["mean"].max()
    assert f"between {low:.0f} ft below and {high:.0f} ft above it" in page
    counts = []
    for rho in (0.05, 0.15):
        other = ends_of(shipped, rho).loc[list(CURES)]
        moved = with_intervals(other["PUCT-COPOD"] - other["UCT-COPOD"])
        counts.append(words[(moved["high"] < 0).sum()])
    assert "({} and {} of PUCT-COPOD's intervals below UCT-COPOD".format(*counts) in page
    gained, lost = 1 - means["UCT-BEST"] / means[none], means["UCT-COPOD"] / means[none] - 1
    assert (
        f"perfect ones take {100 * gained.min():.0f} to {100 * gained.max():.0f} % off UCT-NONE's "
        f"error, COPOD's add {100 * lost.min():.0f} to {100 * lost.max():.0f} %"
    ) in page


def test_where_a_perfect_filter_hurts_beyond_chance_is_told(shipped):
    page, ends = prose("docs/multiverse.md"), ends_of(shipped, 0.1)
    above = with_intervals(ends["UCT-BEST"] - ends["UCT-NONE"]).filter(like="joint", axis=0)
    more = above[above["mean"] > 0.05 * shipped.deviation]
    assert len(more) == 10
    sure = sorted(int(name.split()[1]) for name in more.index[more["low"] > 0])
    *first, last = map(str, sure)
    assert "In ten joint universes, at rho 0.10, UCT-BEST even ends more than 60 ft above" in page
    assert f"in four beyond chance (joint {', '.join(first)} and {last})" in page
