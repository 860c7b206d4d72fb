"""The page on methods against faults: its file is enough to draw it, and its table says no more."""

import runpy
import shutil
from itertools import product
from pathlib import Path

import matplotlib.image
import numpy as np
import pandas as pd
import pytest
import yaml
from scipy import stats

from infoplan.config import METHODS
from infoplan.draw.style import ink_on, rgba, score_colours

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("docs")
    for name in ("outliers.csv", "outliers.md"):
        shutil.copy(ROOT / "docs" / name, folder)
    script = runpy.run_path(str(ROOT / "scripts" / "draw_outliers.py"))
    assert script["draw_outliers"](folder) == folder / "outliers.png"
    return folder


def test_the_shipped_file_gives_the_shipped_picture_and_page(drawn):
    again, shipped = (matplotlib.image.imread(f / "outliers.png") for f in (drawn, ROOT / "docs"))
    assert again.shape == shipped.shape
    # Fonts of another version of matplotlib may differ in a few pixels.
    assert np.mean(np.abs(again - shipped).max(axis=-1) > 0.1) < 0.02
    for folder in (drawn, ROOT / "docs"):
        text = (folder / "outliers.md").read_text(encoding="utf-8")
        assert text == (ROOT / "docs" / "outliers.md").read_text(encoding="utf-8")


def shipped_cells() -> dict[tuple[str, str], str]:
    text = (ROOT / "docs" / "outliers.md").read_text(encoding="utf-8").replace("\\", "")
    block = text.partition("make outliers -->")[2].partition("<!-- end -->")[0]
    rows = [line[2:-2].split(" | ") for line in block.splitlines() if line.startswith("| ")]
    faults = rows[0][1:]
    return {
        (row[0].removesuffix(" (true labels)"), fault): cell.strip()
        for row in rows[1:]
        for fault, cell in zip(faults, row[1:], strict=True)
    }


def strata(scores: pd.DataFrame, method: str, fault: str) -> list[np.ndarray]:
    """Mean area over rhos by seed on each map."""
    mine = scores[(scores["method"] == method)
                  & (scores["rho"].eq(0) if fault == "none"
                     else scores["rho"].gt(0) & scores["fault"].eq(fault))]  # fmt: skip
    by_seed = mine.groupby(["terrain", "seed"])["area"].mean()
    return [by_seed.loc[terrain].to_numpy() for terrain in sorted(set(mine["terrain"]))]


def welch(parts: list[np.ndarray], confidence: float) -> tuple[float, float]:
    """Mean over one or two maps and the lower end of its interval, by SciPy."""
    if len(parts) == 1:
        return parts[0].mean(), stats.ttest_1samp(parts[0], 0).confidence_interval(confidence).low
    first, second = parts
    found = stats.ttest_ind(first, -second, equal_var=False).confidence_interval(confidence)
    return (first.mean() + second.mean()) / 2, found.low / 2


def test_every_shipped_cell_follows_from_the_shipped_scores():
    scores = pd.read_csv(ROOT / "docs" / "outliers.csv")
    references = set(scores.loc[scores["reference"], "method"])
    shown = shipped_cells()
    methods, faults = ({key[i] for key in shown} for i in (0, 1))
    assert methods == set(scores["method"])
    assert len(shown) == len(methods) * len(faults)
    for fault in faults:
        parts = {m: found for m in methods if (found := strata(scores, m, fault))}
        contest = {m: np.mean([p.mean() for p in found]) for m, found in parts.items()
                   if m not in references}  # fmt: skip
        best = min(contest, key=contest.get)
        for method in methods:
            cell = shown[method, fault]
            if method not in parts:
                assert cell == ""
                continue
            mean, low = welch(parts[method], 0.95)
            half = f" ±{mean - low:.2f}" if min(map(len, parts[method])) > 1 else ""
            assert cell.replace("*", "") == f"{mean:.2f}{half}"
            among = method == best
            if method in contest and not among:
                apart = [a - b for a, b in zip(parts[method], parts[best], strict=True)]
                with np.errstate(divide="ignore", invalid="ignore"):
                    bound = welch(apart, 1 - 2 * 0.05 / (len(contest) - 1))[1]
                equal = all(not part.any() for part in apart)
                among = equal or not bound > 0
            assert cell.startswith("**") == among, (method, fault)


def test_the_file_is_of_missions_that_are_told_once():
    scores = pd.read_csv(ROOT / "docs" / "outliers.csv")
    keys = ["method", "fault", "rho", "terrain", "seed"]
    assert list(scores.columns) == [*keys, "reference", "area", "final"]
    assert not scores.duplicated(keys).any()
    assert np.isfinite(scores[["area", "final"]].to_numpy()).all()
    assert set(scores.loc[scores["reference"], "method"]) == {"UCT-BEST"}


def test_the_file_has_every_mission_of_the_experiment():
    text = (ROOT / "conf" / "experiment" / "outliers.yaml").read_text(encoding="utf-8")
    document = yaml.safe_load(text)
    planned = set()
    for line in document["sweep"]:
        words = {name: text.split(",") for name, text in (w.split("=") for w in line.split())}
        for detector, model in product(words["detector"], words.get("model", ["gp"])):
            parts = [words["planner"][0], detector, *([] if model == "gp" else [model])]
            method = "-".join(parts).upper()
            planned |= {
                (method, fault if float(rho) else "none", float(rho), terrain, seed)
                for fault, rho, terrain, seed in product(
                    words["fault"], words["rho"], words["terrain"], range(document["seeds"])
                )
            }
    scores = pd.read_csv(ROOT / "docs" / "outliers.csv")
    flown = scores.assign(fault=scores["fault"].where(scores["rho"] > 0, "none"))
    keys = ["method", "fault", "rho", "terrain", "seed"]
    assert set(flown[keys].itertuples(index=False, name=None)) == planned


def test_the_experiment_has_every_fault_that_needs_no_arguments():
    text = (ROOT / "conf" / "experiment" / "outliers.yaml").read_text(encoding="utf-8")
    lines = yaml.safe_load(text)["sweep"]
    known = set(METHODS["fault"]) - {"own"}
    for line in lines:
        words = dict(word.split("=") for word in line.split())
        if words["rho"] == "0":
            assert words["fault"] == "spike"
        else:
            assert set(words["fault"].split(",")) == known
            assert words["rho"] == "0.1,0.2"
    named = [dict(word.split("=") for word in line.split()) for line in lines]
    methods = [
        {*product([words["planner"]], words["detector"].split(","),
                  words.get("model", "gp").split(","))}
        for words in named
    ]  # fmt: skip
    with_faults, without = methods[::2], methods[1::2]
    assert with_faults == without
    assert len(set().union(*with_faults)) == 13


def test_few_far_cells_leave_the_others_their_shades():
    values = np.concatenate([np.linspace(0.2, 1.0, 40), [50.0, np.inf, np.nan]])
    colours = score_colours(values)
    middle, good, bad = (np.array(rgba(colours, value)) for value in (0.5, 0.2, 1.0))
    assert np.abs(middle - good).max() > 0.2
    assert np.abs(middle - bad).max() > 0.2
    assert (ink_on(rgba(colours, 0.2)), ink_on(rgba(colours, 50.0))) == ("black", "white")
