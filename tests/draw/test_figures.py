"""Figures against the tables they are drawn from."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
import small_study
from matplotlib.image import imread
from scipy import stats

from infoplan.analyse import find_study
from infoplan.draw.figures import NAMES, OF_STUDY, check_names, draw_figures
from infoplan.errors import UsageError


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    small_study.store(folder)
    return folder


@pytest.fixture(scope="module")
def drawn(folder):
    before = dict(mpl.rcParams)
    drawn = {figure.name: figure for figure in draw_figures(find_study(folder), single_seeds=True)}
    assert dict(mpl.rcParams) == before  # a user's own settings stay
    return drawn


def numbers(drawn, name: str) -> pd.DataFrame:
    return pd.read_csv(next(path for path in drawn[name].files if path.suffix == ".csv"))


def table(folder: Path, kind: str, run: str, seed: int = 0) -> pd.DataFrame:
    (path,) = folder.glob(f"{kind}/run={run}/seed={seed}.parquet")
    return pd.read_parquet(path, partitioning=None)


@pytest.mark.parametrize("name", OF_STUDY)
def test_every_figure_is_there_as_png_pdf_and_csv(drawn, name):
    png, pdf, csv = drawn[name].files
    assert drawn[name].problem == ""
    assert [path.name for path in (png, pdf, csv)] == [f"{name}.{k}" for k in ("png", "pdf", "csv")]
    pixels = imread(png)[..., :3]
    assert pixels.shape[1] in (1050, 2148)  # one column or two, at 300 dots an inch
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 100
    text = pdf.read_bytes()
    assert b"FontFile2" in text
    assert b"/Type3" not in text


def test_drawing_again_gives_the_same_files(folder, drawn):
    before = {path: path.read_bytes() for path in drawn["fig3"].files}
    draw_figures(find_study(folder), ["fig3"])
    assert {path: path.read_bytes() for path in before} == before


def test_fig5_shows_mean_and_band_over_seeds(folder, drawn):
    shown = numbers(drawn, "fig5")
    assert sorted(set(shown["panel"])) == list("abcd")
    assert shown.groupby("panel")["method"].nunique().to_list() == [4] * 4
    here = shown[(shown["panel"] == "d") & (shown["method"] == "PUCT-COPOD")]
    curves = [table(folder, "curves", "puct-copod-*-historical-*", seed) for seed in (0, 1)]
    single = np.array([np.interp(here["collected"], c["collected"], c["rmse"]) for c in curves])
    assert pytest.approx(single) == here[["seed_0", "seed_1"]].to_numpy().T
    assert here["mean"].to_numpy() == pytest.approx(single.mean(axis=0))
    last = stats.ttest_1samp(single[:, -1], 0.0).confidence_interval(0.95)
    assert set(shown["collapsed"]) <= {0, 1, 2}
    assert here[["low", "high"]].iloc[-1].to_list() == pytest.approx([last.low, last.high])
    assert (here["collected"].iloc[0], here["collected"].iloc[-1]) == (100, 200)


def test_fig5_has_none_and_best_under_both_scopes(drawn):
    shown = numbers(drawn, "fig5")
    for method in ("UCT-NONE", "UCT-BEST"):
        b, d = (shown[(shown["panel"] == p) & (shown["method"] == method)] for p in "bd")
        assert b["mean"].to_list() == d["mean"].to_list()


def test_fig1_and_fig6_show_the_final_means(folder, drawn):
    shown = numbers(drawn, "fig1")
    nodes, points = shown[shown["kind"] == "node"], shown[shown["kind"] != "node"]
    none = table(folder, "maps", "uct-none-*-rho0.1-*")
    assert nodes["truth"].to_numpy() == pytest.approx(none["truth"])
    assert nodes["with_outliers"].to_numpy() == pytest.approx(none["mean"])
    best = table(folder, "maps", "uct-best-*-rho0.1-*")
    assert nodes["without_outliers"].to_numpy() == pytest.approx(best["mean"])
    samples = table(folder, "samples", "uct-none-*-rho0.1-*")
    assert points["measured"].to_numpy() == pytest.approx(samples["measured"])
    assert (points["kind"] == "outlier").sum() == samples["is_outlier"].sum() > 0
    means = numbers(drawn, "fig6")
    for method in ("puct-copod", "uct-copod"):
        maps = table(folder, "maps", f"{method}-*-rho0.1-batch-*")
        assert means[method.upper()].to_numpy() == pytest.approx(maps["mean"])


def test_fig3_counts_the_flagged_samples(folder, drawn):
    shown = numbers(drawn, "fig3")
    samples = table(folder, "samples", "puct-copod-*-rho0.1-batch-*")
    maps = table(folder, "maps", "puct-copod-*-rho0.1-batch-*")
    assert shown["count"].sum() == samples["flagged"].sum() > 0
    assert shown["smoothed"].to_numpy() == pytest.approx(maps["outlier_density"])
    for x1, x2 in samples.loc[samples["flagged"], ["x1", "x2"]].to_numpy():
        nearest = np.hypot(shown["x1"] - x1, shown["x2"] - x2).idxmin()
        assert shown.loc[nearest, "count"] > 0


def test_fig4_shows_the_pilot_and_the_deviation(folder, drawn):
    shown = numbers(drawn, "fig4")
    samples = table(folder, "samples", "uct-none-*-rho0.1-*")
    pilot = samples[samples["epoch"] == 0]
    assert shown.loc[shown["panel"] == "a", "x1"].to_numpy() == pytest.approx(pilot["x1"])
    maps = table(folder, "maps", "uct-none-*-rho0.1-*")
    assert shown.loc[shown["panel"] == "b", "std"].to_numpy() == pytest.approx(maps["std"])


def test_fig7_shows_errors_and_kept_samples(folder, drawn):
    shown = numbers(drawn, "fig7")
    for method in ("puct-copod", "uct-copod"):
        here = shown[shown["method"] == method.upper()]
        maps = table(folder, "maps", f"{method}-*-rho0.1-batch-*")
        errors = here.loc[here["kind"] == "node", "abs_error"]
        assert errors.to_numpy() == pytest.approx(np.abs(maps["mean"] - maps["truth"]))
        samples = table(folder, "samples", f"{method}-*-rho0.1-batch-*")
        assert (here["kind"] == "sample kept").sum() == samples["used"].sum() < len(samples)


def test_another_seed_is_another_mission(folder, drawn):
    before = numbers(drawn, "fig3")
    (again,) = draw_figures(find_study(folder), ["fig3"], seed=1)
    assert not before.equals(pd.read_csv(again.files[2]))
    draw_figures(find_study(folder), ["fig3"])


def test_what_is_missing_is_named_with_its_command(tmp_path):
    small_study.store(tmp_path, [("uct", "copod", 0.1, "batch")], seeds=[3])
    study = find_study(tmp_path)
    fig4, fig5, fig7 = draw_figures(study, ["fig4", "fig5", "fig7"])
    assert not fig4.files
    assert fig4.problem.startswith("fig4 lacks UCT-NONE at rho 0.1: run infoplan run planner=uct ")
    assert "PUCT-COPOD at rho 0.1" in fig7.problem
    assert "experiment=fig5" in fig5.problem
    # The curves that are there are drawn, a single seed without a band.
    shown = pd.read_csv(fig5.files[2])
    assert set(shown["method"]) == {"UCT-COPOD"}
    assert shown["low"].isna().all()
    assert shown["mean"].to_list() == shown["seed_3"].to_list()


def test_a_seed_that_is_not_there_is_named(tmp_path):
    small_study.store(tmp_path, [("uct", "none", 0.1, "batch")], seeds=[3, 5])
    (fig4,) = draw_figures(find_study(tmp_path), ["fig4"])
    assert fig4.problem == (
        "fig4 cannot show seed 0, which not all its runs have: choose seed= of 3, 5"
    )


def test_runs_without_a_common_seed_are_told(tmp_path):
    small_study.store(tmp_path, [("uct", "copod", 0.1, "batch")], seeds=[0])
    small_study.store(tmp_path, [("puct", "copod", 0.1, "batch")], seeds=[1])
    (fig7,) = draw_figures(find_study(tmp_path), ["fig7"])
    assert "needs a seed that all its runs have" in fig7.problem


def test_names_of_figures_are_checked():
    assert check_names([]) == list(NAMES)
    assert check_names(["fig7", "fig1", "fig7"]) == ["fig7", "fig1"]
    with pytest.raises(UsageError, match=r"no figure 'fig55' \(did you mean 'fig5'\?\): use fig1"):
        check_names(["fig55"])
