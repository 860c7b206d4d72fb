"""The look that all figures share."""

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

import infoplan
from infoplan.analyse import METHODS
from infoplan.draw import style
from infoplan.draw.mission_picture import mission_figure
from infoplan.method_identity import PAPERS
from infoplan.palette import MARKS, RIM

EXTENT = (0.0, 40.0, 0.0, 30.0)


@pytest.fixture(scope="module")
def frames():
    small = ["grid=[12,12]", "planner.iterations=30", "model.pilot_iterations=20"]
    return infoplan.fly(infoplan.configure("terrain=volcano", *small, rho=0.1, budget=160), seed=3)


def cone() -> np.ndarray:
    """A hill in the middle of 31 x 41 nodes."""
    y, x = np.mgrid[0:31, 0:41]
    return 500.0 - 10.0 * np.hypot(x - 20, y - 15)


def test_light_comes_from_the_north_west():
    brightness = style.shaded(cone(), EXTENT, cone())[..., :3].mean(axis=-1)
    north_west, south_east = brightness[20:25, 10:15].mean(), brightness[5:10, 25:30].mean()
    # Row 0 is the south: the lit flank lies in the high rows and the low columns.
    assert north_west > 1.2 * south_east


def test_shading_is_taken_from_the_other_map():
    steep, gentle = 10 * cone(), cone()
    alone, beside = style.shaded(gentle, EXTENT, gentle), style.shaded(gentle, EXTENT, steep)
    assert np.ptp(alone[..., :3].mean(axis=-1)) > 2 * np.ptp(beside[..., :3].mean(axis=-1))


def test_flat_land_can_be_drawn():
    flat = np.full((5, 6), 7.0)
    assert np.isfinite(style.shaded(flat, EXTENT, flat)).all()


def test_nodes_of_a_map_lie_on_the_borders():
    with style.journal():
        axes = style.new_figure(style.COLUMN, 2.0).add_subplot()
        image = style.show_map(axes, np.zeros((31, 41)), EXTENT, cmap="viridis")
    assert image.get_extent() == pytest.approx((-0.5, 40.5, -0.5, 30.5))
    assert (axes.get_xlim(), axes.get_ylim()) == ((0.0, 40.0), (0.0, 30.0))


def test_marks_stand_out_from_every_colour_of_a_map(frames):
    marked = [
        line
        for axes in mission_figure(frames.curves, frames.samples, frames.maps).axes
        for line in axes.lines
        if line.get_marker() == MARKS["flagged"].marker
    ]
    assert len(marked) == 2
    for line in marked:
        assert line.get_color() == MARKS["flagged"].colour
        assert line.get_markeredgecolor() == RIM
        assert len(line.get_xdata()) == frames.samples["flagged"].sum() > 0


def test_the_paper_methods_differ_in_colour_and_in_dashes():
    for a, b in combinations(METHODS, 2):
        distance = np.abs(np.subtract(to_rgb(PAPERS[a].colour), to_rgb(PAPERS[b].colour))).sum()
        assert distance > 0.4
        assert PAPERS[a].dashes != PAPERS[b].dashes


def test_text_is_readable_at_column_width():
    sizes = [style.SETTINGS[f"{what}.labelsize"] for what in ("axes", "xtick", "ytick")]
    assert min(*sizes, style.SETTINGS["font.size"], style.SETTINGS["legend.fontsize"]) >= 6.0
