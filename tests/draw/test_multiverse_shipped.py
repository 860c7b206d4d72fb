"""The page on the multiverse: its file is enough to draw it, and its tables say no more."""

import re
import runpy
import shutil
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from scipy import stats

from infoplan.analyse.multiverse import claim_curves, compare_models, orders_by_collapse
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
    page = " ".join((ROOT / "docs" / "multiverse.md").read_text(encoding="utf-8").split())
    beyond = int(((found["low"] > 0) | (found["high"] < 0)).sum())
    most = found["mean"].abs().max()
    assert f"by up to {most:.0f} ft, in {beyond} of {len(found)} cases beyond chance" in page
    ours, theirs = ({c.name: c for c in claim_curves(made)} for made in (shipped, exact))
    pairs = [(ours[name].verdict_in(one), theirs[name].verdict_in(one))
             for name in theirs for one in theirs[name].universes]  # fmt: skip
    same = sum(one == other for one, other in pairs)
    assert len(theirs) == 8
    assert f"of {len(pairs)} verdicts on the eight claims" in page
    assert f"{same} are the same" in page


def test_counts_in_the_prose_are_those_of_the_file(shipped):
    """Where the main sentence of page and README comes from."""
    found = orders_by_collapse(shipped)
    page = " ".join((ROOT / "docs" / "multiverse.md").read_text(encoding="utf-8").split())
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    collapsed, others = found.loc[True], found.loc[False]
    assert set(shipped.missions.groupby("universe")["rho"].nunique()) == {3}
    assert f"All {len(shipped.universes)} universes are flown at rho 0.05, 0.10 and 0.15" in page
    assert f"In {collapsed['universes']:.0f} universes most missions of UCT-NONE end" in page
    below, above = (others[f"UCT-COPOD {sign} UCT-NONE"] for sign in "<>")
    assert re.search(
        f"In the {others['universes']:.0f} others UCT-NONE ends at {others['UCT-NONE']:.0f} ft "
        rf"instead of {collapsed['UCT-NONE']:.0f} \(medians\), UCT-COPOD below it in {below:.0f} "
        f"and above it in {above:.0f}", page
    )  # fmt: skip
    few, many = (orders_by_collapse(shipped, rho) for rho in (0.05, 0.15))
    told = [f"{found.loc[False, name]:.0f}" for found in (few, many)
            for name in ("UCT-COPOD < UCT-NONE", "universes", "UCT-COPOD > UCT-NONE")]  # fmt: skip
    assert (
        f"at 0.05 {few.loc[True, 'universes']:.0f} universes collapse, and UCT-COPOD ends below "
        f"UCT-NONE in {told[0]} of the {told[1]} others and above it in {told[2]}; at 0.15 it is "
        f"below in {told[3]} of {told[4]}, above in {told[5]}."
    ) in page
    judged = {curve.name: curve.verdicts for curve in claim_curves(shipped, ["C1", "C6"])}
    supported, contradicted = (judged["C1"].count(one) for one in ("supported", "contradicted"))
    assert f"holds in {supported}, all joint, and is contradicted in {contradicted}" in page
    assert "supported" not in judged["C6"]
    pays = f"{collapsed['UCT-COPOD < UCT-NONE']:.0f} of {collapsed['universes']:.0f}"
    rarely = f"{below:.0f} of {others['universes']:.0f}"
    assert (
        f"in {pays} readings of the paper, and in {rarely} others, above it in {above:.0f}"
    ) in readme


def test_where_a_perfect_filter_hurts_beyond_chance_is_told(shipped):
    missions = shipped.missions[shipped.missions["rho"] == 0.1]
    ends = missions.pivot_table("final", ["universe", "seed"], "method")
    above = (ends["UCT-BEST"] - ends["UCT-NONE"]).unstack().filter(like="joint", axis=0)
    more = above[above.mean(axis=1) > 0.05 * shipped.deviation]
    assert len(more) == 10
    found = stats.ttest_1samp(more.to_numpy(), 0, axis=1).confidence_interval()
    sure = [int(name.split()[1]) for name in more.index[found.low > 0]]
    *first, last = map(str, sorted(sure))
    page = " ".join((ROOT / "docs" / "multiverse.md").read_text(encoding="utf-8").split())
    assert "In ten of these, at rho 0.10, UCT-BEST even ends more than 60 ft above UCT-NONE" in page
    assert f"in four beyond chance (joint {', '.join(first)} and {last})" in page
    intervals = dict(zip(more.index, zip(found.low, found.high, strict=True), strict=True))
    for name in ("joint 46", "joint 70"):
        low, high = intervals[name]
        mean = more.loc[name].mean()
        assert f"{mean:.0f} ft [{low:.0f}, {high:.0f}]" in page
