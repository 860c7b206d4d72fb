"""The leaderboard: areas and intervals by hand, what counts, and the command."""

import json
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from made_tables import store
from scipy import stats
from scipy.integrate import trapezoid

from infoplan.analyse.leaderboard import rank
from infoplan.cli import main
from infoplan.config import METHODS as METHODS_BY_GROUP
from infoplan.config import FaultConfig
from infoplan.errors import UsageError
from infoplan.options import option
from infoplan.study.columns import values_digest
from infoplan.study.store import sealed

COLLECTED = [100, 130, 290, 600]
METHODS = ("uct-none", "uct-copod", "puct-copod")
RHOS = (0.0, 0.2)
MAPS = ("helens", "volcano", "jacksboro")
SEEDS = range(4)


def curve(method: str, terrain: str, rho: float, seed: int) -> np.ndarray:
    """RMSE of a mission: a level of each method, map and rho, and a seed's own noise."""
    key = [METHODS.index(method), MAPS.index(terrain), round(10 * rho), seed]
    noise = np.random.default_rng(key).uniform(-8, 8, size=len(COLLECTED))
    level = {"uct-none": 80, "uct-copod": 60, "puct-copod": 50}[method]
    return level + 20 * MAPS.index(terrain) + 50 * rho + noise


def fill(folder: Path, terrains=MAPS, seeds=SEEDS, methods=METHODS) -> None:
    for method in methods:
        for terrain in terrains:
            for rho in RHOS:
                for seed in seeds:
                    store(folder, method, rho, seed=seed, collected=COLLECTED,
                          rmse=curve(method, terrain, rho, seed), terrain=terrain)  # fmt: skip


def area(method: str, terrain: str, rho: float, seed: int, deviation: float = 100.0) -> float:
    return trapezoid(curve(method, terrain, rho, seed), COLLECTED) / (600 - 100) / deviation


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    fill(folder)
    return folder


def test_scores_are_areas_over_deviations(results):
    board = rank(results)
    names = [standing.method for standing in board.standings]
    assert names == ["PUCT-COPOD", "UCT-COPOD", "UCT-NONE"]
    for standing, method in zip(board.standings, METHODS[::-1], strict=True):
        areas = np.array([[[area(method, t, r, s) for s in SEEDS] for r in RHOS] for t in MAPS])
        assert standing.score.mean == pytest.approx(areas.mean())
        for number, terrain in enumerate(MAPS):
            assert standing.by_map[terrain] == pytest.approx(areas[number].mean())
        for number, rho in enumerate(RHOS):
            assert standing.by_rho[rho] == pytest.approx(areas[:, number].mean())
        finals = [curve(method, t, r, s)[-1] / 100 for t in MAPS for r in RHOS for s in SEEDS]
        assert standing.final == pytest.approx(np.mean(finals))
        assert standing.seconds == pytest.approx(4.0)
    assert board.missions == 72
    assert board.budget == 600
    assert board.notes == ()
    behind = [standing.behind.mean for standing in board.standings]
    assert behind[0] == 0
    assert behind[2] == pytest.approx(board.standings[2].score.mean - board.standings[0].score.mean)


def test_each_map_has_its_own_deviation(tmp_path):
    fill(tmp_path, terrains=["helens", "volcano"], seeds=[0])
    for path in (tmp_path / "maps").glob("run=*volcano*/*.parquet"):
        table = pq.read_table(path, partitioning=None)
        column = table.column_names.index("truth")
        taller = (table["truth"].to_numpy() - 7) * 4
        changed = table.set_column(column, "truth", [taller])
        footer = json.loads(table.schema.metadata[b"infoplan"])
        footer["values_sha256"] = values_digest(changed)
        pq.write_table(changed.replace_schema_metadata({"infoplan": sealed(footer)}), path)
    for standing, method in zip(rank(tmp_path).standings, METHODS[::-1], strict=True):
        low = np.mean([area(method, "helens", rho, 0) for rho in RHOS])
        high = np.mean([area(method, "volcano", rho, 0, 400) for rho in RHOS])
        assert standing.score.mean == pytest.approx((low + high) / 2)


def test_on_one_map_the_interval_is_scipys_over_seeds(tmp_path):
    seeds = range(12)
    fill(tmp_path, terrains=["helens"], seeds=seeds)
    board = rank(tmp_path)
    first, last = board.standings[0], board.standings[-1]
    means = {m: [np.mean([area(m, "helens", r, s) for r in RHOS]) for s in seeds] for m in METHODS}
    best, worst = np.array(means["puct-copod"]), np.array(means["uct-none"])
    for found, values in ((first.score, best), (last.behind, worst - best)):
        expected = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
        assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    assert last.behind.low > 0


def test_intervals_are_for_these_maps_by_welch_and_satterthwaite(results, capfd):
    board = rank(results)
    means = {
        m: np.array([[np.mean([area(m, t, r, s) for r in RHOS]) for s in SEEDS] for t in MAPS])
        for m in METHODS
    }
    best, second = means["puct-copod"], means["uct-copod"]
    cases = ((board.standings[0].score, best), (board.standings[1].behind, second - best))
    for found, values in cases:
        parts = values.var(axis=1, ddof=1) / 4
        freedom = parts.sum() ** 2 / np.sum(parts**2 / 3)
        half = stats.t.ppf(0.975, freedom) * np.sqrt(parts.sum()) / 3
        assert (found.low, found.high) == pytest.approx(
            (values.mean() - half, values.mean() + half)
        )
    # Maps differ by 0.2 in level: that is no uncertainty of a mean over these maps.
    assert board.standings[0].score.high - board.standings[0].score.low < 0.2
    assert main(["leaderboard", "--markdown", f"results_dir={results}"]) == 0
    assert "over the seeds of these maps, and for these maps alone" in capfd.readouterr().out


def test_the_probability_that_the_first_is_better_is_paired_by_map_and_seed(results):
    board = rank(results)
    first, second = (
        np.array([[np.mean([area(m, t, r, s) for r in RHOS]) for s in SEEDS] for t in MAPS])
        for m in ("puct-copod", "uct-copod")
    )
    wins = int(np.sum(first < second))
    found = board.standings[1].beaten
    expected = stats.binomtest(wins, 12).proportion_ci(0.95, method="exact")
    assert (found.mean, found.low, found.high) == pytest.approx(
        (wins / 12, expected.low, expected.high)
    )
    assert board.standings[0].beaten.mean == 0.5


def test_the_share_of_collapsed_missions_stands_beside_the_means(tmp_path, monkeypatch, capfd):
    fill(tmp_path, terrains=["helens", "volcano"], seeds=[0, 1])

    def collapsed(folder, run, seed, last):
        return run.startswith("uct-none") and seed == 0 and "helens" in run

    monkeypatch.setattr("infoplan.analyse.mission_scores.ended_collapsed", collapsed)
    shares = {one.method: one.collapsed for one in rank(tmp_path).standings}
    assert shares == {"PUCT-COPOD": 0, "UCT-COPOD": 0, "UCT-NONE": 1 / 4}
    assert main(["leaderboard", "--markdown", f"results_dir={tmp_path}"]) == 0
    assert "| 25 % | 4.0 |" in capfd.readouterr().out


def test_a_method_that_lacks_a_map_is_not_ranked_and_named(tmp_path):
    fill(tmp_path, terrains=["helens", "volcano"], seeds=[0, 1])
    store(tmp_path, "puct-none", 0.2, seed=0, collected=COLLECTED, rmse=[1, 1, 1, 1])
    store(tmp_path, "uct-none", 0.3, seed=0, collected=COLLECTED)
    store(tmp_path, "uct-best", 0.0, seed=5, collected=[100, 2000])
    board = rank(tmp_path)
    assert len(board.standings) == 3
    told = " / ".join(board.notes)
    assert "PUCT-NONE is not ranked: it lacks helens rho 0, volcano rho 0" in told
    assert "helens rho 0.3 does not count" in told
    assert "1 mission with other settings than budget=600 is left out" in told
    chosen = rank(tmp_path, {"terrain": "helens", "rho": 0.2, "seed": 0})
    assert chosen.standings[0].method == "PUCT-NONE"
    assert chosen.missions == 4


def test_only_seeds_that_all_have_count(tmp_path):
    fill(tmp_path, terrains=["helens"], seeds=[0, 1, 2])
    fill(tmp_path, terrains=["helens"], seeds=[7], methods=METHODS[:2])
    board = rank(tmp_path)
    assert board.maps == {"helens": [0, 1, 2]}
    assert board.missions == 18


def test_methods_of_one_name_are_told_apart_by_their_options(tmp_path):
    fill(tmp_path, terrains=["helens"], seeds=[0])
    for rho in RHOS:
        store(tmp_path, "uct-copod", rho, collected=COLLECTED, detector__contamination=0.2)
    names = {standing.method for standing in rank(tmp_path).standings}
    assert "UCT-COPOD detector.contamination=0.2" in names
    assert "UCT-COPOD detector.contamination=0.1" in names
    assert "UCT-NONE" in names


def test_a_scope_is_told_by_the_label_where_it_is_not_batch(tmp_path):
    fill(tmp_path, terrains=["helens"], seeds=[0])
    for rho in RHOS:
        store(tmp_path, "uct-copod", rho, "historical", collected=COLLECTED)
    names = {standing.method for standing in rank(tmp_path).standings}
    assert names == {"UCT-NONE", "UCT-COPOD", "UCT-COPOD historical", "PUCT-COPOD"}


@dataclass
class StuckConfig(FaultConfig):
    name: str = option("stuck", "fault", choices=("stuck",))
    length: int = option(5, "samples that it holds", at_least=1)


def test_a_fault_is_a_condition_and_not_averaged_into_another(tmp_path, monkeypatch):
    monkeypatch.setitem(METHODS_BY_GROUP["fault"], "stuck", StuckConfig())
    stuck = {"name": "stuck", "length": 5}
    methods = ("uct-none", "uct-copod")
    for seed in (0, 1):
        for method, level in zip(methods, (80, 60), strict=True):
            store(tmp_path, method, seed=seed, collected=COLLECTED, rmse=[level] * 4)
            store(tmp_path, method, seed=seed, collected=COLLECTED, rmse=[3 * level] * 4,
                  fault=stuck)  # fmt: skip
    store(tmp_path, "uct-copod", collected=COLLECTED, fault=stuck | {"length": 7})
    store(tmp_path, "puct-copod", collected=COLLECTED)
    board = rank(tmp_path)
    assert [standing.method for standing in board.standings] == ["UCT-COPOD", "UCT-NONE"]
    assert board.faults == ("spike", "stuck fault.length=5")
    means = board.by_fault.grid("mean").loc["UCT-COPOD"].to_dict()
    alone = {"stuck fault.length=7": 5.0}  # flown by this method only
    assert means == pytest.approx({"spike": 0.6, "stuck fault.length=5": 1.8} | alone)
    assert board.standings[1].score.mean == pytest.approx(1.6)
    assert board.missions == 8
    assert main(["leaderboard", "--markdown", "fault=spike", f"results_dir={tmp_path}"]) == 0


def test_settings_of_a_fault_are_conditions_of_their_own(tmp_path):
    for method in ("uct-none", "uct-copod", "puct-copod"):
        store(tmp_path, method, collected=COLLECTED)
    store(tmp_path, "uct-copod", collected=COLLECTED, fault__count="floor")
    board = rank(tmp_path)
    assert board.missions == 3
    assert board.notes == (
        "helens spike fault.count=floor rho 0.1 does not count: most methods lack it",
    )


def test_a_rho_is_written_to_its_last_digit(tmp_path, capfd):
    for method in ("uct-none", "uct-copod"):
        for rho in (0.1234567, 0.3, 0.1 + 0.2):
            store(tmp_path, method, rho, collected=COLLECTED)
    assert main(["leaderboard", "--markdown", f"results_dir={tmp_path}"]) == 0
    said = capfd.readouterr().out
    assert "rho 0.1234567, 0.3, 0.30000000000000004;" in said
    assert "| rho 0.1234567 | rho 0.3 | rho 0.30000000000000004 |" in said


def test_replays_are_nobodys_method(tmp_path):
    fill(tmp_path, terrains=["helens"], seeds=[0])
    for rho in RHOS:
        store(tmp_path, "greedy-copod", rho, collected=COLLECTED, replay="uct-copod-...-01234567")
    assert len(rank(tmp_path).standings) == 3


def test_replays_alone_are_nothing_to_rank(tmp_path):
    for method in ("uct-none", "uct-copod"):
        store(tmp_path, method, collected=COLLECTED, replay="uct-best-helens-rho0-batch-01234567")
    with pytest.raises(UsageError, match="holds no finished mission"):
        rank(tmp_path)


@pytest.mark.parametrize(
    ("filters", "words"),
    [
        ({"rho": 0.7}, r"no finished mission with rho=0\.7: there is rho=0\.0 or 0\.2$"),
        (
            {"terrain": ["volcano"], "rho": [0.7, 1]},
            r"with terrain=\[volcano\] rho=\[0\.7,1\]: there is terrain=helens or jacks.*; rho",
        ),
        ({"planner": "puct"}, "no two methods"),
    ],
)
def test_nothing_to_rank_is_one_sentence(results, filters, words):
    with pytest.raises(UsageError, match=words):
        rank(results, filters)


class Rows(HTMLParser):
    """The texts of a page's table cells, row by row."""

    def __init__(self):
        super().__init__()
        self.rows: list[list[str]] = []

    def handle_starttag(self, tag, attributes):
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data):
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data


def test_the_command_in_three_shapes(results, capfd):
    expected = rank(results).standings
    assert main(["leaderboard", f"results_dir={results}"]) == 0
    said = capfd.readouterr().out
    positions = [said.index(standing.method) for standing in expected]
    assert positions == sorted(positions)

    assert main(["leaderboard", "--markdown", f"results_dir={results}"]) == 0
    lines = capfd.readouterr().out.splitlines()
    rows = [line.strip("| ").split(" | ") for line in lines if line.startswith("| ")]
    assert [row[1] for row in rows[1:]] == [standing.method for standing in expected]
    assert [row[2].split()[0] for row in rows[1:]] == [f"{s.score.mean:.3f}" for s in expected]
    assert len({len(row) for row in rows[1:]}) == 1

    assert main(["leaderboard", "--html", f"results_dir={results}"]) == 0
    page = results / "leaderboard.html"
    assert str(page) in capfd.readouterr().out
    parser = Rows()
    parser.feed(page.read_text(encoding="utf-8"))
    assert [row[1] for row in parser.rows[1:]] == [standing.method for standing in expected]
    assert len({len(row) for row in parser.rows}) == 1
    assert "http" not in page.read_text(encoding="utf-8")


def test_the_command_filters_and_refuses(results, tmp_path, capfd):
    assert main(["leaderboard", "terrain=[helens]", "rho=0.2", f"results_dir={results}"]) == 0
    said = capfd.readouterr().out
    assert "12 missions" in said
    empty = tmp_path / "nothing here"
    empty.mkdir()
    assert main(["leaderboard", f"results_dir={empty}", "rho=0.2"]) == 2
    line = f"infoplan run -m experiment=benchmark 'results_dir={empty}'"
    assert capfd.readouterr().err.rstrip().endswith(line)
    assert main(["leaderboard", "--html", "--markdown", f"results_dir={results}"]) == 2
    assert "--markdown, --html or --latex: choose one" in capfd.readouterr().err
    assert main(["leaderboard", "rhoo=1", f"results_dir={results}"]) == 2
    assert "did you mean 'rho'" in capfd.readouterr().err
    frame = pd.read_parquet(results / "curves")
    assert len(frame) == 72 * len(COLLECTED)
