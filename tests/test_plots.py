"""What a notebook shows: facts of an object as a small table, figures that functions return."""

import copy
import re

import matplotlib
import numpy as np
import pytest
from studies import quick, study

import infoplan
from infoplan.analyse import find_missions, find_study, judge_claims
from infoplan.cli import main
from infoplan.html_table import html_table

PNG = b"\x89PNG"
OPTIONS = ["detector=none", "terrain=volcano", "grid=[12,12]", "planner.iterations=30",
           "model.pilot_iterations=20", "model.iterations=2"]  # fmt: skip


@pytest.fixture(scope="module")
def frames():
    return infoplan.fly(infoplan.configure(*OPTIONS, rho=0.1, budget=160), seed=3)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plots")
    study(quick(), folder, seeds=2)
    return find_study(folder)


def cells(page: str) -> list[str]:
    return re.findall(r"<t[dh]>(.*?)</t[dh]>", page)


def test_text_of_any_origin_is_shown_as_it_is():
    page = html_table("<b>&", [["<script>", "\x1b[31m"]], ["a<"], ["</table>"])
    assert set(re.findall(r"</?(\w+)", page)) == {"p", "table", "tr", "th", "td"}
    assert "&lt;script&gt;" in page
    assert "\x1b" not in page
    assert "style" not in page  # colours are the notebook's


def test_a_flown_mission_tells_what_its_tables_hold(frames):
    told = cells(frames._repr_html_())
    flagged, spikes = frames.samples["flagged"], frames.samples["is_outlier"]
    assert "planner puct, detector none (batch), rho 0.1, volcano, seed 3" in told
    assert f"160 collected, {160 - flagged.sum()} in the model" in told
    assert f"0 samples, 0 of them outliers; {spikes.sum()} outliers missed" in told
    assert spikes.sum() > 0


def test_a_mission_tells_how_far_it_is(volcano):
    config = infoplan.configure(*OPTIONS, rho=0.1, budget=160)
    mission = infoplan.Mission(config, volcano, seed=1)
    assert repr(mission) == "Mission(puct, none on volcano, seed 1: 0 of 160 samples, 0 epochs)"
    mission.start(mission.sample(mission.pilot_path()))
    assert f"{mission.collected} of 160" in cells(mission._repr_html_())
    assert mission.collected > 0


def test_a_terrain_tells_its_elevations(volcano):
    low, high = volcano.elevation.min(), volcano.elevation.max()
    heights = f"{low:.0f} to {high:.0f} ft"
    assert repr(volcano) == f"Terrain(volcano: 100 x 100 nodes, elevation {heights})"
    assert heights in cells(volcano._repr_html_())
    lake = infoplan.workspace([0, 10, 0, 5], name="<lake>")
    assert "unknown, in m" in cells(lake._repr_html_())
    assert "Terrain &lt;lake&gt;" in lake._repr_html_()


def test_claims_tell_comparisons_and_that_there_are_too_few_seeds(stored):
    claims = judge_claims(stored, ["C2", "C5"])
    assert [claim.name for claim in claims] == ["C2", "C5"]
    page = claims._repr_html_()
    told = cells(page)
    for claim in claims:
        assert claim.verdict.upper() in told
        for comparison in claim.comparisons:
            assert comparison.what in told
    assert "infoplan run" in page
    assert claims[0]._repr_html_().count("<tr>") == 2 + len(claims[0].comparisons)


def test_figures_are_returned_and_pyplot_is_left_alone(frames, stored, volcano):
    import matplotlib.pyplot as plt

    before = copy.deepcopy(dict(matplotlib.rcParams))
    open_before = plt.get_fignums()
    figures = {
        "terrain": infoplan.plot_terrain(volcano),
        "mission": infoplan.plot_mission(frames),
        "curves": infoplan.plot_curves(stored, single_seeds=True),
    }
    for figure in figures.values():
        assert isinstance(figure, matplotlib.figure.Figure)
        assert figure._repr_png_().startswith(PNG)
    assert plt.get_fignums() == open_before
    assert dict(matplotlib.rcParams) == before
    mean, _, error = figures["mission"].axes[:3]
    assert np.array_equal(error.lines[0].get_ydata(), frames.curves["rmse"])
    assert np.array_equal(mean.lines[0].get_xdata(), frames.samples["x1"])
    assert mean.images[0].get_array().size == len(frames.maps)


def test_a_mission_of_unknown_truth_is_drawn(frames):
    unknown = infoplan.Frames(
        frames.curves.assign(rmse=np.nan), frames.samples, frames.maps.assign(truth=np.nan)
    )
    figure = infoplan.plot_mission(unknown)
    assert [text.get_text() for text in figure.axes[2].texts] == ["truth unknown"]
    assert "unknown" in cells(unknown._repr_html_())


def test_a_survey_is_drawn_with_its_flags(tmp_path, capfd):
    (tmp_path / "log.csv").write_text(
        "x,y,depth\n"
        + "".join(f"{i % 10},{i // 10},{5 + 0.1 * (i % 7) + 9 * (i == 33)}\n" for i in range(60))
    )
    log = str(tmp_path / "log.csv")
    assert main(["survey", log, f"results_dir={tmp_path}", "grid=[8,8]", "detector=hampel"]) == 0
    survey = find_missions(tmp_path)
    figure = infoplan.plot_survey(survey)
    assert figure._repr_png_().startswith(PNG)
    assert figure.axes[0].get_title(loc="left").startswith("(a) log: ")
    with pytest.raises(infoplan.UsageError, match="need the truth"):
        infoplan.plot_curves(survey)


def test_what_cannot_be_drawn_is_told(stored):
    with pytest.raises(infoplan.UsageError, match="elevation of field is not known"):
        infoplan.plot_terrain(infoplan.workspace([0, 1, 0, 1]))
    with pytest.raises(infoplan.UsageError, match="no survey"):
        infoplan.plot_survey(stored)
