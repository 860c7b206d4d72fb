"""Filling, resampling, cropping and turning, against SciPy and geometry."""

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import KDTree

from infoplan.errors import UsageError
from infoplan.terrain import grids, load_terrain
from infoplan.terrain.grids import Grid, cropped, filled, resampled, turned

EDGES = (100.0, 130.0, 40.0, 80.0)


def bumpy(shape: tuple[int, int], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(1000, 200, shape)


class TestFilling:
    @settings(max_examples=30, deadline=None)
    @given(seed=st.integers(0, 10_000), share=st.floats(0.01, 0.95))
    def test_a_missing_node_gets_the_elevation_of_a_nearest_one(self, seed, share):
        rng = np.random.default_rng(seed)
        elevation = bumpy((9, 13), seed)
        missing = rng.random(elevation.shape) < share
        missing[4, 6] = False
        broken = np.where(
            missing, rng.choice([np.nan, np.inf, -np.inf], elevation.shape), elevation
        )
        result = filled(Grid(broken)).elevation
        np.testing.assert_array_equal(result[~missing], elevation[~missing])
        places = np.argwhere(~missing)
        for node in np.argwhere(missing):
            distance, _ = KDTree(places).query(node)
            nearest = places[np.linalg.norm(places - node, axis=1) <= distance + 1e-9]
            assert result[tuple(node)] in elevation[tuple(nearest.T)]

    def test_a_whole_map_stays_as_it_is(self):
        grid = Grid(bumpy((4, 5)))
        assert filled(grid) is grid


class TestResampling:
    @settings(max_examples=40, deadline=None)
    @given(
        old=st.tuples(st.integers(2, 40), st.integers(2, 40)),
        new=st.tuples(st.integers(2, 30), st.integers(2, 30)),
    )
    def test_agrees_with_scipy_s_filter_and_interpolation(self, old, new):
        elevation = bumpy(old)
        spread = [
            max(0.0, (before / after - 1) / 2) for before, after in zip(old, new, strict=True)
        ]
        smooth = gaussian_filter(elevation, spread, mode="mirror")
        axes = [(np.arange(n) + 0.5) * m / n - 0.5 for m, n in zip(old, new, strict=True)]
        places = np.meshgrid(*axes, indexing="ij")
        expected = map_coordinates(smooth, places, order=1, mode="mirror")
        np.testing.assert_allclose(resampled(Grid(elevation), new).elevation, expected, rtol=1e-11)

    def test_the_same_shape_is_the_same_map(self):
        elevation = bumpy((7, 9))
        np.testing.assert_allclose(
            resampled(Grid(elevation), (7, 9)).elevation, elevation, rtol=1e-13
        )

    def test_fine_ripples_vanish_instead_of_becoming_coarse_ones(self):
        ripples = np.tile([0.0, 1.0], (120, 60))
        coarse = resampled(Grid(ripples), (12, 13)).elevation
        assert np.abs(coarse - 0.5).max() < 0.01

    def test_a_slope_stays_a_slope_at_its_place(self):
        rows, columns = np.mgrid[0:60, 0:80] + 0.5
        slope = 3 * rows + 5 * columns
        coarse = resampled(Grid(slope), (20, 16)).elevation
        inner = coarse[4:-4, 4:-4]
        rows, columns = np.mgrid[0:20, 0:16] + 0.5
        np.testing.assert_allclose(inner, (9 * rows + 25 * columns)[4:-4, 4:-4], rtol=1e-12)

    def test_the_edges_stay_and_the_nodes_are_the_middles(self):
        grid = resampled(Grid(bumpy((8, 6)), edges=EDGES), (4, 3))
        assert grid.edges == EDGES
        assert grid.node_bounds() == (105.0, 125.0, 45.0, 75.0)

    def test_too_many_nodes(self):
        with pytest.raises(UsageError, match=r"terrain\.shape=\[100000, 100000\] has more than"):
            resampled(Grid(bumpy((3, 3))), [100_000, 100_000])


class TestCropping:
    def test_rows_and_columns_of_the_map_and_its_place(self):
        elevation = bumpy((8, 6))
        grid = cropped(Grid(elevation, edges=EDGES), [1, -2, -4, 6])
        np.testing.assert_array_equal(grid.elevation, elevation[1:6, 2:6])
        assert grid.edges == (110.0, 130.0, 45.0, 70.0)

    def test_nothing_is_cut_from_the_whole(self):
        grid = Grid(bumpy((8, 6)), edges=EDGES)
        np.testing.assert_array_equal(cropped(grid, [0, 8, 0, 6]).elevation, grid.elevation)
        assert cropped(grid, [-8, 8, 0, 6]).edges == EDGES

    @pytest.mark.parametrize(
        "crop",
        [[0, 9, 0, 6], [-9, 8, 0, 6], [0, 8, 0, 7], [3, 4, 0, 6], [5, 2, 0, 6], [0, 0, 0, 6],
         [0, 8, -1, 6], [8, 10, 0, 6], [0, 8, 4, -3]],
    )  # fmt: skip
    def test_what_does_not_fit(self, crop):
        with pytest.raises(UsageError, match=r"terrain\.crop=.* does not fit 8 rows and 6 columns"):
            cropped(Grid(bumpy((8, 6))), crop)


def rotated(x: float, y: float, orientation: int) -> tuple[float, float]:
    """Where a place of the unturned map, measured from the middle, comes to lie."""
    if orientation >= 4:
        x = -x
    for _ in range(orientation % 4):
        x, y = -y, x
    return x, y


class TestTurning:
    @pytest.mark.parametrize("orientation", range(8))
    def test_places_move_as_on_paper(self, orientation):
        before = load_terrain("volcano", extent=[-5, 5, -5, 5])
        after = load_terrain("volcano", extent=[-5, 5, -5, 5], orientation=orientation)
        for x, y in np.random.default_rng(0).uniform(-5, 5, (20, 2)):
            moved = rotated(x, y, orientation)
            assert after.elevation_at(*moved) == pytest.approx(before.elevation_at(x, y), rel=1e-12)

    def test_all_eight_are_different_and_have_names_and_digests_of_their_own(self):
        maps = [load_terrain("volcano", orientation=k) for k in range(8)]
        assert len({terrain.elevation.tobytes() for terrain in maps}) == 8
        assert len({terrain.sha256 for terrain in maps}) == 8
        assert [terrain.name for terrain in maps[:2]] == ["volcano", "volcano-turned1"]

    def test_a_quarter_turn_swaps_the_sides(self):
        elevation = bumpy((3, 5))
        assert turned(elevation, 1).shape == (5, 3)
        # Counter-clockwise: the right end of the bottom row becomes the right end of the top row.
        assert turned(elevation, 1)[-1, -1] == elevation[0, -1]

    @pytest.mark.parametrize("orientation", range(8))
    def test_only_right_angles_need_a_square(self, orientation):
        extent = [0, 60, 0, 40]
        if orientation % 2:
            with pytest.raises(UsageError, match=r"stretch the map over terrain\.extent"):
                load_terrain("volcano", extent=extent, orientation=orientation)
        else:
            assert load_terrain("volcano", extent=extent, orientation=orientation).extent[1] == 60

    @pytest.mark.parametrize("orientation", [-1, 8])
    def test_there_are_eight(self, orientation):
        with pytest.raises(UsageError, match=r"terrain\.orientation=.* at most 7"):
            load_terrain("volcano", orientation=orientation)


class TestUnits:
    def test_known_units_are_converted(self):
        feet, metres = load_terrain("volcano"), load_terrain("volcano", unit="m")
        assert (metres.name, metres.unit) == ("volcano-m", "m")
        np.testing.assert_allclose(metres.elevation, feet.elevation * 0.3048, rtol=1e-15)
        assert metres.sha256 != feet.sha256
        survey = load_terrain("volcano", unit="us-ft")
        np.testing.assert_allclose(survey.elevation, feet.elevation * 0.999998, rtol=1e-12)

    @pytest.mark.parametrize("unit", ["ft", "feet", "Foot"])
    def test_the_map_s_own_unit_changes_nothing(self, unit):
        plain, named = load_terrain("volcano"), load_terrain("volcano", unit=unit)
        assert (named.name, named.unit, named.sha256) == ("volcano", "ft", plain.sha256)

    def test_other_units_are_refused(self):
        with pytest.raises(UsageError, match=r"terrain\.unit=dBm .* which is in ft: .* m, ft"):
            load_terrain("volcano", unit="dBm")

    def test_a_map_without_a_unit_is_labelled(self, tmp_path):
        path = tmp_path / "map.npy"
        np.save(path, bumpy((3, 4)))
        plain, feet = load_terrain("file", path=path), load_terrain("file", path=path, unit="feet")
        assert (plain.unit, feet.unit) == ("m", "ft")
        assert plain.sha256 == feet.sha256
        np.testing.assert_array_equal(plain.elevation, feet.elevation)


class TestTogether:
    def test_fill_then_resample_then_crop_then_turn(self, tmp_path):
        path = tmp_path / "map.npy"
        elevation = bumpy((40, 30))
        elevation[3:9, 5:8] = np.nan
        np.save(path, elevation)
        terrain = load_terrain(
            "file", path=path, nodata="fill", shape=[20, 15], crop=[2, 12, 3, 13], orientation=5
        )
        grid = resampled(filled(Grid(elevation)), [20, 15])
        np.testing.assert_array_equal(terrain.elevation, turned(grid.elevation[2:12, 3:13], 5))

    def test_each_change_gives_another_digest(self, tmp_path):
        path = tmp_path / "map.npy"
        elevation = bumpy((8, 9))
        np.save(path, elevation)
        changes = [{}, {"shape": [8, 8]}, {"shape": [9, 8]}, {"crop": [0, 8, 0, 8]},
                   {"crop": [0, 7, 0, 8]}, {"orientation": 2}]  # fmt: skip
        digests = [load_terrain("file", path=path, **change).sha256 for change in changes]
        assert len(set(digests)) == len(changes)
        assert digests[0] == hashlib.sha256(path.read_bytes()).hexdigest()
        assert load_terrain("file", path=path, nodata="fill").sha256 == digests[0]

    def test_missing_elevations_are_refused_before_they_spread(self, tmp_path):
        path = tmp_path / "map.npy"
        elevation = bumpy((8, 9))
        elevation[2, 3] = np.nan
        np.save(path, elevation)
        with pytest.raises(UsageError, match="has 1 nodes that are missing"):
            load_terrain("file", path=path, shape=[4, 4])
        cut = load_terrain("file", path=path, crop=[3, 8, 0, 9])
        np.testing.assert_array_equal(cut.elevation, elevation[3:])

    def test_an_option_of_another_map_is_refused(self):
        with pytest.raises(UsageError, match=r"terrain=volcano has no option terrain\.crop: it"):
            load_terrain("volcano", crop=[0, 9, 0, 9])
        with pytest.raises(UsageError, match=r"no option terrain\.orientatoin \(did you mean"):
            load_terrain("volcano", orientatoin=3)

    def test_bounds_hold_outside_the_command_line_too(self, tmp_path):
        with pytest.raises(UsageError, match=r"terrain\.shape=\[1, 5\] is out of bounds"):
            load_terrain("file", path=tmp_path, shape=[1, 5])
        with pytest.raises(UsageError, match=r"terrain\.nodata=keep is not a choice"):
            load_terrain("file", path=tmp_path, nodata="keep")

    def test_the_limit_is_a_quarter_of_a_gigabyte(self):
        assert grids.MAX_NODES * 8 == 2**28


@pytest.mark.long
def test_the_paper_s_grid_comes_from_the_survey_s_elevation_model():
    data = os.environ.get("INFOPLAN_DATA")
    assert data, "set INFOPLAN_DATA to a folder with helens.npy and mtsthelens_after.zip"
    derived = load_terrain(
        "file",
        path=Path(data) / "mtsthelens_after.zip",
        nodata="fill",
        shape=[129, 129],
        crop=[14, -15, 15, -14],
        orientation=6,
    )
    published = load_terrain("helens", path=data)
    assert derived.unit == published.unit == "ft"
    np.testing.assert_allclose(derived.elevation, published.elevation, rtol=0, atol=1e-8)
