"""Curves in characters."""

import numpy as np
import pytest

from infoplan.draw.terminal import curve_lines, plot_lines, small_curves, takes_braille


def test_a_rising_line_in_braille():
    drawn = curve_lines([0, 3], [0, 3], width=2, height=1, low=0, high=3)
    assert drawn == ["⡠⠊"]


def test_a_falling_line_in_asterisks():
    drawn = curve_lines([0, 2], [2, 0], width=3, height=3, low=0, high=2, braille=False)
    assert drawn == ["*  ", " * ", "  *"]


def test_jumps_are_joined():
    drawn = curve_lines([0, 1, 2], [0, 4, 4], width=3, height=5, low=0, high=4, braille=False)
    assert drawn == [" **", " * ", " * ", " * ", "*  "]


def test_values_beyond_the_ends_are_cut_and_gaps_stay():
    y = [9.0, 1.0, np.nan, -5.0]
    drawn = curve_lines(range(4), y, width=4, height=3, low=0, high=2, braille=False)
    assert drawn == ["*   ", " *  ", "   *"]


def test_a_level_curve_needs_no_range():
    drawn = curve_lines([0, 1], [5, 5], width=4, height=2, low=5, high=5, braille=False)
    assert drawn == ["    ", "****"]


@pytest.mark.parametrize(("top", "labels"), [(1430.0, ["1600", "800"]), (0.31, ["0.4", "0.2"])])
def test_axes_carry_round_numbers(top, labels):
    lines = plot_lines(
        [100, 2000], [top, 0], width=30, height=6, title="RMSE (ft)", x_label="samples"
    )
    assert lines[0] == "RMSE (ft)"
    assert [line.split()[0] for line in lines if "┤" in line] == labels
    assert lines[-2].split() == ["0", "└" + "─" * 30]
    assert lines[-1].split() == ["100", "2000", "samples"]
    # The last number stands below the right end of the axis.
    assert lines[-1].index("2000") + 4 == len(lines[-2])


def test_plain_plots_are_ascii():
    lines = plot_lines([0, 9], [1, 2], width=20, height=4, title="t", x_label="x", braille=False)
    assert "\n".join(lines).isascii()
    assert sum(line.count("*") for line in lines) >= 20


def test_encodings():
    assert takes_braille("utf-8")
    assert not takes_braille("ascii")
    assert not takes_braille("latin-1")
    assert not takes_braille(None)
    assert not takes_braille("no-such-encoding")


def test_small_curves_share_a_scale_and_average_the_seeds():
    def curve(*rmse):
        return {"collected": np.array([100, 200]), "rmse": np.array(rmse)}

    high, low, none = small_curves([[curve(8, 8), curve(10, 10)], [curve(1, 1)], []], braille=False)
    assert high.split("\n") == ["*" * 12, " " * 12, " " * 12]
    assert low.split("\n") == [" " * 12, " " * 12, "*" * 12]
    assert none == ""
