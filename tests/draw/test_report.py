"""The report as one page: what it says is what the tables hold, and nothing in it is markup."""

import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import made_methods
import numpy as np
import pandas as pd
import pytest
from flown import short_mission, store
from scipy import stats

from infoplan.analyse.statistics import Interval
from infoplan.analyse.tables import Selection, find_missions, find_study
from infoplan.cli import main
from infoplan.config import METHODS as BUILT_IN
from infoplan.draw import report as report_module
from infoplan.draw.report import interval_text, period_text, render, seeds_text, write_report
from infoplan.draw.report_data import MAP_POINTS, packed, panels_of, pooled_ratio
from infoplan.errors import RunError
from infoplan.terrain import Terrain

METHODS = [("uct", "none"), ("uct", "best"), ("uct", "copod"), ("puct", "copod")]


@pytest.fixture(scope="module")
def results(tmp_path_factory, volcano) -> Path:
    folder = tmp_path_factory.mktemp("reported")
    for planner, detector in METHODS:
        store(folder, short_mission(planner, detector), volcano, seeds=[0, 1, 2])
    for planner in ("uct", "puct"):
        store(folder, short_mission(planner, "copod", "historical"), volcano, seeds=[0, 1, 2])
    store(folder, short_mission("puct", "none", rho=0.2), volcano, seeds=[1])
    return folder


@pytest.fixture(scope="module")
def study(results) -> Selection:
    return find_study(results)


@pytest.fixture(scope="module")
def page(results) -> str:
    return render(find_missions(results))


@pytest.fixture(scope="module")
def data(page) -> dict:
    return embedded(page)


def embedded(page: str) -> dict:
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1]

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


class Reader(HTMLParser):
    """Reads a page strictly: every element closed in turn; keeps attributes, texts, rows."""

    VOID = ("meta", "link", "br", "img", "input")
    # In the pictures, which are XML, an element may close itself.

    def __init__(self, page: str):
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict]] = []
        self.texts: list[str] = []
        self.rows: list[list[str]] = []
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        if self.open and self.open[-1] not in ("script", "style"):
            self.texts.append(text)
            if self.rows and {"td", "th"} & set(self.open):
                self.rows[-1][-1] += text


@pytest.fixture(scope="module")
def read(page) -> Reader:
    return Reader(page)


def curves_of(results: Path, method: str, scope: str = "batch") -> dict[int, pd.DataFrame]:
    planner, detector = method.lower().split("-")
    (folder,) = results.glob(f"curves/run={planner}-{detector}-volcano-rho0.1-{scope}-*")
    paths = sorted(folder.glob("*.parquet"))
    return {int(p.stem.removeprefix("seed=")): pd.read_parquet(p, partitioning=None) for p in paths}


def samples_of(results: Path, method: str, scope: str = "batch") -> pd.DataFrame:
    planner, detector = method.lower().split("-")
    (folder,) = results.glob(f"samples/run={planner}-{detector}-volcano-rho0.1-{scope}-*")
    frames = [pd.read_parquet(p, partitioning=None) for p in sorted(folder.glob("*.parquet"))]
    return pd.concat(frames, ignore_index=True)


def test_the_page_asks_for_nothing_outside_itself(page, read):
    for tag, attributes in read.elements:
        for name in ("src", "href", "action", "data", "poster", "srcset"):
            assert attributes.get(name, "#").startswith(("#", "data:")), (tag, attributes)
    assert "@import" not in page
    assert not re.search(r"url\((?!#)", page)
    assert set(re.findall(r"https?://[^\s\"'<]+", page)) == {"http://www.w3.org/2000/svg"}
    policies = [a["content"] for tag, a in read.elements if "http-equiv" in a]
    assert len(policies) == 1
    assert "default-src 'none'" in policies[0]


def test_every_id_is_there_once_and_every_link_leads_somewhere(read):
    ids = [attributes["id"] for _, attributes in read.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    wanted = [a[name] for _, a in read.elements for name in ("for", "aria-labelledby") if name in a]
    wanted += [a["href"][1:] for tag, a in read.elements if tag == "a"]
    assert set(wanted) <= set(ids)


def test_the_charts_hold_the_papers_panels_and_methods(data):
    titles = [panel["title"] for panel in data["panels"]]
    assert titles == ["(b) ρ = 0.1, batch scope", "(d) ρ = 0.1, historical scope",
                      "ρ = 0.2, batch scope"]  # fmt: skip
    for panel in data["panels"][:2]:
        methods = [line["method"] for line in panel["lines"]]
        assert methods == ["UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"]
    shown = {method["name"]: method["shown"] for method in data["methods"]}
    assert shown == {"UCT-NONE": True, "UCT-BEST": True, "UCT-COPOD": True, "PUCT-COPOD": True,
                     "PUCT-NONE": False}  # fmt: skip


def test_the_curves_are_those_of_the_tables(data, results):
    axis = data["axis"]
    assert axis[0] == 100
    assert axis[-1] == 200
    for panel, scope in zip(data["panels"][:2], ("batch", "historical"), strict=True):
        for line in panel["lines"]:
            where = scope if "COPOD" in line["method"] else "batch"
            stored = curves_of(results, line["method"], where)
            curves = {s: np.interp(axis, c["collected"], c["rmse"]) for s, c in stored.items()}
            for seed, values in curves.items():
                np.testing.assert_allclose(line["seeds"][str(seed)], values, rtol=1e-3)
            np.testing.assert_allclose(line["mean"], np.mean(list(curves.values()), 0), rtol=1e-3)
            low, mean, high = (np.array(line[name]) for name in ("low", "mean", "high"))
            assert np.all((low <= mean) & (mean <= high))
            known = stats.ttest_1samp(list(curves.values()), 0.0).confidence_interval(0.95)
            np.testing.assert_allclose(low, known.low, rtol=1e-3, atol=0.1)
            np.testing.assert_allclose(high, known.high, rtol=1e-3, atol=0.1)


def test_the_map_counts_what_the_samples_say(data, results):
    runs = {(run["panel"], run["method"]): run for run in data["map"]["runs"]}
    assert len(runs) == 4
    run = runs["(b) ρ = 0.1, batch scope", "PUCT-COPOD"]
    samples = samples_of(results, "PUCT-COPOD").query("epoch > 0")
    wanted = {
        "false alarms": samples["flagged"] & ~samples["is_outlier"],
        "outliers caught": samples["flagged"] & samples["is_outlier"],
        "outliers missed": ~samples["flagged"] & samples["is_outlier"],
    }
    assert [layer["name"] for layer in run["layers"]] == list(wanted)
    for layer in run["layers"]:
        chosen = samples[wanted[layer["name"]]]
        assert layer["count"] == len(chosen)
        places = [int(layer["points"][i : i + 2], 36) for i in range(0, len(layer["points"]), 2)]
        np.testing.assert_allclose(
            np.reshape(places, (-1, 2)) / 1295 * 50, chosen[["x1", "x2"]], atol=0.5 * 50 / 1295
        )
    clean = samples[~samples["is_outlier"]]
    rates = [row["rate"] for row in run["relief"]]
    assert [row["land"] for row in run["relief"]] == ["flat", "middle", "rugged"]
    assert min(rates) <= clean["flagged"].mean() <= max(rates)
    assert data["map"]["image"].startswith("data:image/png;base64,")
    assert data["map"]["extent"] == [0, 50, 0, 50]


def test_detector_quality_is_pooled_over_seeds(data, results):
    assert [panel["title"][:3] for panel in data["quality"]["panels"]] == ["(b)", "(d)"]
    charts = {chart["title"]: chart for chart in data["quality"]["panels"][0]["charts"]}
    counts = pd.concat(curves_of(results, "UCT-COPOD").values()).query("epoch > 0")
    last = counts[counts["collected"] == 200]
    assert [line["method"] for line in charts["Recall"]["lines"]] == ["UCT-COPOD", "PUCT-COPOD"]
    wanted = {
        "Precision": last["tp"].sum() / (last["tp"] + last["fp"]).sum(),
        "Recall": last["tp"].sum() / (last["tp"] + last["fn"]).sum(),
        "False-alarm rate": last["fp"].sum() / (last["fp"] + last["tn"]).sum(),
    }
    for name, value in wanted.items():
        assert charts[name]["lines"][0]["mean"][-1] == pytest.approx(value, rel=1e-3)


def test_a_pooled_ratio_has_the_interval_that_scipy_gives():
    rng = np.random.default_rng(5)
    rows = pd.DataFrame(
        {"seed": np.repeat(np.arange(8), 6), "stretch": np.tile([0, 0, 1, 1, 1, 2], 8)}
    )
    part, whole = rng.integers(0, 9, 48).astype(float), rng.integers(1, 9, 48) + 9.0
    whole[rows["stretch"] == 2] = part[rows["stretch"] == 2] = 0
    band = pooled_ratio(rows, pd.Series(part), pd.Series(whole), bins=3)
    assert np.isnan(band[:, 2]).all()
    for stretch in (0, 1):
        here = rows["stretch"] == stretch
        sums = [np.bincount(rows["seed"][here], values[here]) for values in (part, whole)]
        assert band[0, stretch] == pytest.approx(sums[0].sum() / sums[1].sum())
        # The error of the bootstrap is that of many seeds, by n instead of n - 1.
        known = stats.bootstrap(sums, lambda a, b, axis: a.sum(axis) / b.sum(axis), paired=True,
                                method="percentile", rng=np.random.default_rng(1))  # fmt: skip
        half = stats.t.ppf(0.975, 7) * known.standard_error * np.sqrt(8 / 7)
        assert band[1, stretch] == pytest.approx(band[0, stretch] - half, abs=0.01)
        assert band[2, stretch] == pytest.approx(band[0, stretch] + half, abs=0.01)


def test_the_tables_name_runs_seeds_claims_and_versions(read, results, study):
    rows = {row[0]: row[1:] for row in read.rows}
    for run in set(study.missions["run"]):
        assert rows[run][0] == ("1" if "rho0.2" in run else "0–2")
    finals = [curve["rmse"].iloc[-1] for curve in curves_of(results, "UCT-BEST").values()]
    told = read.rows[[row[0] for row in read.rows].index("UCT-BEST")][1]
    assert float(told.split(" [")[0]) == pytest.approx(np.mean(finals), rel=0.01)
    text = " ".join(read.texts)
    for claim in range(1, 13):
        assert f"C{claim}: " in text
    assert "infoplan run" in text
    assert study.options[study.missions["run"][0]]["terrain.sha256"] in text
    assert np.__version__ in text
    assert "budget=200" in text


def test_claims_that_lack_runs_name_the_command(page):
    (note,) = re.findall(r"<p>(Runs are lacking .*?)</p>", page)
    assert re.match(r"Runs are lacking for C1, C6; make them with <code>infoplan run -m", note)


def test_where_no_claim_has_numbers_no_picture_is_explained(tmp_path):
    made_methods.store(tmp_path, "lawnmower", "local")
    (told,) = re.findall(r"<p>(A claim is supported .*?)</p>", render(find_missions(tmp_path)))
    assert told.endswith("by sign flips.")


def test_the_same_tables_give_the_same_page(page, results):
    assert render(find_missions(results)) == page


def test_nothing_from_the_tables_becomes_markup(volcano, tmp_path):
    nasty = '<img src=x onerror="alert(1)">&amp;</script><b>'
    terrain = Terrain(f"file-{nasty.replace('/', '_')}", volcano.elevation, volcano.extent, nasty,
                      volcano.sha256)  # fmt: skip
    config = short_mission("uct", "copod")
    config.terrain = replace(config.terrain, name="file", path="x.npy")
    store(tmp_path, config, terrain)
    page = render(find_study(tmp_path))
    read = Reader(page)
    assert not any(tag in ("img", "b") for tag, _ in read.elements)
    assert not any("onerror" in attributes for _, attributes in read.elements)
    assert embedded(page)["unit"] == nasty
    assert any(nasty in text for text in read.texts)


def test_a_single_seed_and_a_single_run_make_a_page(volcano, tmp_path):
    store(tmp_path, short_mission("puct", "copod"), volcano, seeds=[4])
    page = render(find_study(tmp_path))
    line = embedded(page)["panels"][0]["lines"][0]
    assert set(line["low"] + line["high"]) == {None}
    assert None not in line["mean"]
    assert "nan" not in " ".join(Reader(page).texts).lower().split()


def test_without_a_detector_the_page_says_so(volcano, tmp_path):
    store(tmp_path, short_mission("uct", "none"), volcano)
    page = render(find_study(tmp_path))
    assert page.count("No run here has a detector that can err.") == 2
    data = embedded(page)
    assert data["map"]["runs"] == []
    assert data["quality"]["panels"] == []
    assert len(data["panels"]) == 1
    Reader(page)


def test_none_and_best_have_no_panel_of_their_own_beside_historical_runs(volcano, tmp_path):
    store(tmp_path, short_mission("uct", "none"), volcano)
    store(tmp_path, short_mission("uct", "copod", "historical"), volcano)
    (panel,) = panels_of(find_study(tmp_path))
    assert list(panel.runs) == ["UCT-NONE", "UCT-COPOD"]
    assert list(panel.judging) == ["UCT-COPOD"]


def test_many_points_are_thinned_evenly():
    n = 10 * MAP_POINTS
    samples = pd.DataFrame({"x1": np.linspace(-1, 3, n), "x2": np.linspace(6, 2, n)})
    text = packed(samples, (-1, 3, 2, 6))
    places = np.reshape([int(text[i : i + 2], 36) for i in range(0, len(text), 2)], (-1, 2))
    assert places.shape == (MAP_POINTS, 2)
    np.testing.assert_allclose(places[:, 0], np.linspace(0, 1295, MAP_POINTS), atol=1)
    np.testing.assert_allclose(places.sum(axis=1), 1295, atol=1)
    assert packed(samples.head(0), (-1, 3, 2, 6)) == ""


def test_the_words_for_numbers():
    assert seeds_text([7, 0, 1, 2, 9, 4]) == "0–2, 4, 7, 9"
    assert period_text("2030-01-02T03:04:05+00:00", "2030-01-02T03:09:00+00:00") == (
        "2030-01-02 03:04 to 03:09"
    )
    assert period_text("2030-01-02T23:59:05+00:00", "2030-01-03T00:09:00+00:00") == (
        "2030-01-02 23:59 to 2030-01-03 00:09"
    )
    assert period_text("2030-01-02T03:04:05", "2030-01-02T03:04:59") == "2030-01-02 03:04"
    nan = float("nan")
    assert interval_text(Interval(525.4, 409.1, 644.2, 10)) == "525 [409, 644]"
    assert interval_text(Interval(12.34, nan, nan, 1)) == "12.3"
    assert interval_text(Interval(nan, nan, nan, 0)) == "–"


def test_the_command_line_writes_the_page(results, page, capsys):
    assert main(["report", f"results_dir={results}"]) == 0
    path = results / "report.html"
    assert f"reported to {path}" in capsys.readouterr().out
    assert path.read_text(encoding="utf-8") == page
    assert not list(results.glob(".report*"))
    assert main(["report", f"results_dir={results}", "terrain=helens"]) == 2
    assert "terrain=helens" in capsys.readouterr().err


def test_a_page_that_cannot_be_written_is_one_sentence(study, tmp_path):
    results = tmp_path / "results"
    shutil.copytree(study.results_dir, results, ignore=shutil.ignore_patterns("report.html"))
    (results / "report.html").mkdir()
    with pytest.raises(RunError, match=r"report\.html could not be written"):
        write_report(replace(study, results_dir=results))


def test_every_built_in_method_has_its_sentence():
    told = {
        "planner": report_module.PLANNERS,
        "detector": report_module.DETECTORS,
        "model": report_module.MODELS,
    }
    for group, words in told.items():
        assert {*BUILT_IN[group]} - {"own", "pyod", "gp"} == {*words}
