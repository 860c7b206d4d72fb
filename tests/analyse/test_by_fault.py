"""Methods against faults: cells by SciPy, what has no cell, and what the intervals promise."""

from dataclasses import asdict
from html.parser import HTMLParser
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_tables import store
from scipy import stats

from infoplan.analyse.by_fault import by_fault
from infoplan.analyse.mission_scores import read_scores
from infoplan.cli import main
from infoplan.config import METHODS as CHOICES

METHODS = ("uct-best", "uct-none", "uct-copod", "puct-copod")
LEVELS = {"uct-best": 20, "uct-none": 80, "uct-copod": 61, "puct-copod": 60}
SEEDS = range(3)


def error(method: str, fault: str, rho: float, terrain: str, seed: int) -> float:
    """RMSE of a mission, the same all along."""
    words = (method, fault, terrain, str(rho))
    noise = np.random.default_rng([seed, *"".join(words).encode()]).normal(scale=4)
    return LEVELS[method] + 100 * rho + (30 if fault == "stuck" else 0) + noise


def fly(folder: Path, method: str, fault: str, rho: float, terrain: str, seed: int, rmse) -> None:
    store(folder, method, rho, seed=seed, terrain=terrain, collected=[100, 300, 400],
          rmse=[rmse] * 3, fault=asdict(CHOICES["fault"][fault]))  # fmt: skip


def flights(terrains=("helens", "volcano"), methods=METHODS):
    conditions = [("spike", 0.0), *product(("spike", "stuck"), (0.1, 0.2))]
    for method, (fault, rho), terrain, seed in product(methods, conditions, terrains, SEEDS):
        yield method, fault, rho, terrain, seed


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("faults")
    for flight in flights():
        if flight[:2] != ("puct-copod", "stuck") or flight[2:4] != (0.2, "volcano"):
            fly(folder, *flight, error(*flight))
    return folder


def areas(results: Path, method: str, fault: str) -> list[np.ndarray]:
    """Mean area over rhos by seed on each map, from the stored tables; the deviation is 100."""
    curves = pd.read_parquet(results / "curves")
    last = curves[curves["collected"] == 400].astype({"run": str})
    planner, detector = method.split("-")
    mine = last[(last["planner"] == planner) & (last["detector"] == detector)]
    stuck = mine["run"].str.contains("stuck")
    mine = mine[stuck if fault == "stuck" else ~stuck]
    mine = mine[(mine["rho"] > 0) == (fault != "none")]
    by_seed = mine.groupby(["terrain", "seed"], observed=True)["rmse"].mean() / 100
    return [by_seed.loc[terrain].to_numpy() for terrain in ("helens", "volcano")]


def welch(first, second, confidence=0.95):
    """Mean of two maps' means with its t interval, by SciPy's test of two unlike samples."""
    found = stats.ttest_ind(first, -np.asarray(second), equal_var=False)
    interval = found.confidence_interval(confidence)
    return (np.mean(first) + np.mean(second)) / 2, interval.low / 2, interval.high / 2


def test_the_figure_shows_scipys_intervals_of_the_stored_errors(results, capfd):
    assert main(["figures", "outliers", f"results_dir={results}"]) == 0
    png, pdf, csv = map(Path, capfd.readouterr().out.split())
    assert [p.name for p in (png, pdf, csv)] == ["outliers.png", "outliers.pdf", "outliers.csv"]
    shown = pd.read_csv(csv).set_index(["method", "fault"])
    there = [cell for cell in product(METHODS, ("none", "spike", "stuck"))
             if cell != ("puct-copod", "stuck")]  # fmt: skip
    assert set(shown.index) == {(method.upper(), fault) for method, fault in there}
    for method, fault in there:
        cell = shown.loc[(method.upper(), fault)]
        found = areas(results, method, fault)
        mean, low, high = welch(*found)
        assert cell[["mean", "low", "high"]].to_list() == pytest.approx([mean, low, high])
        assert cell["n"] == 6
        assert cell["reference"] == (method == "uct-best")
        contest = {m: np.mean(areas(results, m, fault)) for m, f in there
                   if f == fault and m != "uct-best"}  # fmt: skip
        best = min(contest, key=contest.get)
        if method == best:
            assert cell["among_best"]
            assert cell["behind"] == 0
        elif method != "uct-best":
            apart = [own - other for own, other in
                     zip(found, areas(results, best, fault), strict=True)]  # fmt: skip
            mean, low, _ = welch(*apart, 1 - 2 * 0.05 / (len(contest) - 1))
            assert cell[["behind", "behind_at_least"]].to_list() == pytest.approx([mean, low])
            assert cell["among_best"] == (low <= 0)
        else:
            assert not cell["among_best"]
            assert np.isnan(cell["behind"])
    assert shown.loc[("UCT-COPOD", "spike"), "among_best"]
    assert not shown.loc[("UCT-NONE", "spike"), "among_best"]


def test_a_folder_of_several_faults_gets_the_figure_unasked(results, capfd):
    main(["figures", "terrain=volcano", "rho=0.1", "method=uct-none", f"results_dir={results}"])
    assert "outliers.png" in capfd.readouterr().out


def test_filters_choose_what_the_figure_shows(results, capfd):
    line = ["figures", "outliers", f"results_dir={results}"]
    assert main([*line, "rho=0.1", "terrain=helens", "method=[uct-none,uct-copod]"]) == 0
    shown = pd.read_csv(capfd.readouterr().out.split()[2])
    assert set(shown["method"]) == {"UCT-NONE", "UCT-COPOD"}
    assert set(shown["fault"]) == {"spike", "stuck"}
    expected = [error("uct-none", "stuck", 0.1, "helens", seed) / 100 for seed in SEEDS]
    cell = shown[(shown["method"] == "UCT-NONE") & (shown["fault"] == "stuck")].iloc[0]
    interval = stats.ttest_1samp(expected, 0).confidence_interval()
    assert cell[["mean", "low", "high"]].to_list() == pytest.approx(
        [np.mean(expected), interval.low, interval.high]
    )
    assert main([*line, "replay=true"]) == 2
    assert "a replay is nobody's" in capfd.readouterr().err
    assert main([*line, "scope=historical", "method=uct-none"]) == 2
    assert "no finished mission with" in capfd.readouterr().err


class Cells(HTMLParser):
    """Texts of the cells of a page's table of faults, row by row."""

    def __init__(self):
        super().__init__()
        self.rows: list[list[str]] = []
        self.inside = False

    def handle_starttag(self, tag, attributes):
        if tag == "table":
            self.inside = ("class", "faults") in attributes
        if self.inside and tag == "tr":
            self.rows.append([])
        if self.inside and tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        self.inside = self.inside and tag != "table"

    def handle_data(self, text):
        if self.inside and self.rows and self.rows[-1]:
            self.rows[-1][-1] += text


def test_the_leaderboard_tells_the_cells_in_three_shapes(results, capfd, monkeypatch):
    table = by_fault(read_scores(results).table)
    cells = table.cells.set_index(["method", "fault"])
    for method, fault in product(["UCT-BEST", "UCT-NONE", "PUCT-COPOD"], table.faults):
        assert ((method, fault) in cells.index) == ((method, fault) != ("PUCT-COPOD", "stuck"))
    line = ["leaderboard", f"results_dir={results}"]
    assert main([*line, "--markdown"]) == 0
    said = capfd.readouterr().out.partition("| method | none |")[2]
    rows = [row[2:-2].split(" | ") for row in said.splitlines() if row.startswith("| ")]
    assert rows[0][0] == "UCT-BEST (true labels)"
    written = {row[0]: [cell.strip() for cell in row[1:]] for row in rows}
    assert list(written)[1:] == list(table.methods)[1:]
    assert written["PUCT-COPOD"][2] == ""
    cell = cells.loc[("UCT-NONE", "stuck")]
    half = (cell["high"] - cell["low"]) / 2
    assert written["UCT-NONE"][2] == f"{cell['mean']:.2f} ±{half:.2f}"
    assert written["UCT-COPOD"][2].startswith(f"**{cells.loc[('UCT-COPOD', 'stuck'), 'mean']:.2f}*")

    assert main([*line, "--html"]) == 0
    page = Cells()
    page.feed((results / "leaderboard.html").read_text(encoding="utf-8"))
    capfd.readouterr()
    assert page.rows[0] == ["method", *table.faults]
    shown = {row[0]: row[1:] for row in page.rows[1:]}
    assert shown["UCT-NONE"][2] == f"{cell['mean']:.2f}±{half:.2f}"

    monkeypatch.setenv("COLUMNS", "60")
    assert main(line) == 0
    said = capfd.readouterr().out.partition("By fault")[2]
    assert max(map(len, said.splitlines())) <= 60
    assert f"±{half:.2f}" in said
    assert "an empty cell" in said
    assert "UCT-BEST: the filter is given the true labels; no contestant" in " ".join(said.split())


def test_one_fault_needs_no_table(results, capfd):
    assert main(["leaderboard", "fault=stuck", "terrain=helens", f"results_dir={results}"]) == 0
    assert "By fault" not in capfd.readouterr().out


def test_errors_that_are_not_finite_are_told_and_win_nothing(tmp_path, capfd):
    for flight in flights(terrains=["volcano"]):
        lost = flight == ("uct-copod", "stuck", 0.1, "volcano", 2)
        fly(tmp_path, *flight, np.nan if lost else error(*flight))
    assert main(["figures", "outliers", f"results_dir={tmp_path}"]) == 0
    shown = pd.read_csv(capfd.readouterr().out.split()[2]).set_index(["method", "fault"])
    cell = shown.loc[("UCT-COPOD", "stuck")]
    assert (cell["lost"], cell["n"]) == (1, 3)
    assert np.isnan(cell[["mean", "low", "high", "behind"]].to_list()).all()
    assert not cell["among_best"]
    assert shown.loc[("PUCT-COPOD", "stuck"), "behind"] == 0
    assert main(["leaderboard", "--markdown", f"results_dir={tmp_path}"]) == 0
    assert "| not finite |" in capfd.readouterr().out


def test_a_single_seed_has_no_interval_and_tells_nothing_apart(tmp_path, capfd):
    for flight in flights(terrains=["volcano"], methods=["uct-none", "uct-copod"]):
        if flight[4] == 0:
            fly(tmp_path, *flight, error(*flight))
    assert main(["figures", "outliers", f"results_dir={tmp_path}"]) == 0
    shown = pd.read_csv(capfd.readouterr().out.split()[2])
    assert shown["low"].isna().all()
    assert shown["among_best"].all()

    assert main(["report", f"results_dir={tmp_path}"]) == 0
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert 'href="#faults"' in text
    assert "a cell with a single seed on a map has no interval" in text
    page = Cells()
    page.feed(text)
    assert page.rows[0] == ["method", "none", "spike", "stuck"]
    stuck = [error("uct-none", "stuck", rho, "volcano", 0) / 100 for rho in (0.1, 0.2)]
    assert {row[0]: row[3] for row in page.rows[1:]}["UCT-NONE"] == f"{np.mean(stuck):.2f}*"


def scores(values: dict[str, np.ndarray]) -> pd.DataFrame:
    """Missions of methods, an array faults x maps x seeds each."""
    frames = []
    for method, array in values.items():
        fault, terrain, seed = (axis.ravel() for axis in np.indices(array.shape))
        frames.append(
            pd.DataFrame({"method": method, "fault": [f"f{k}" for k in fault], "rho": 0.1,
                          "terrain": [f"map{k}" for k in terrain], "seed": seed,
                          "reference": False, "area": array.ravel()})
        )  # fmt: skip
    return pd.concat(frames)


@pytest.mark.long
def test_intervals_and_the_set_of_the_best_hold_what_they_promise():
    # Each fault is a study of its own: 240 of two unlike maps and five seeds.
    rng = np.random.default_rng(5)
    spread = np.array([0.05, 0.2])[:, None]
    truth = 1.0
    drawn = {f"m{k}": truth + rng.normal(size=(240, 2, 5)) * spread for k in range(6)}
    drawn["worse"] = 3 * truth + rng.normal(size=(240, 2, 5)) * spread
    cells = by_fault(scores(drawn)).cells.set_index(["method", "fault"])
    fair = cells.drop("worse", level="method")
    covered = ((fair["low"] <= truth) & (truth <= fair["high"])).mean()
    assert covered == pytest.approx(0.95, abs=0.018)  # of 1440
    # All six are the best: any of them may be called so, and is with 95 % or more.
    kept = fair["among_best"].groupby("method").mean()
    assert kept.min() >= 0.95 - 2.5 * np.sqrt(0.95 * 0.05 / 240)
    assert kept.max() < 1
    assert not cells.loc["worse", "among_best"].any()


def test_a_pair_on_common_noise_is_told_apart_where_its_means_are_not():
    rng = np.random.default_rng(6)
    common = rng.normal(size=(100, 2, 5))
    drawn = {"one": 5 + common, "two": 5.2 + common + 0.05 * rng.normal(size=common.shape)}
    cells = by_fault(scores(drawn)).cells.set_index(["method", "fault"])
    overlap = cells.loc["one", "high"] > cells.loc["two", "low"]
    assert overlap.mean() > 0.95
    assert cells.loc["two", "among_best"].mean() < 0.05
    behind = cells.loc["two", "behind_at_least"]
    assert (behind < 0.2).mean() == pytest.approx(0.95, abs=0.06)


def test_a_condition_that_most_methods_lack_does_not_count():
    table = scores({"a": np.ones((1, 2, 3)), "b": np.ones((1, 2, 3)), "c": np.ones((1, 1, 3))})
    extra = table[table["method"] == "a"].assign(rho=0.3)
    found = by_fault(pd.concat([table, extra]))
    assert set(found.cells["method"]) == {"a", "b"}
    assert found.notes == (
        "map0 f0 rho 0.3 does not count: most methods lack it",
        "map1 f0 rho 0.3 does not count: most methods lack it",
    )
    other = scores({"a": np.ones((1, 1, 3)), "b": np.ones((1, 1, 3))}).assign(fault="g")
    assert "g: map0 rho 0.1 alone" in by_fault(pd.concat([table, other])).notes
