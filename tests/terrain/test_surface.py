"""Elevation between nodes, borders, orientation and the query grid."""

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.interpolate import RegularGridInterpolator

from infoplan.errors import UsageError
from infoplan.extent import query_grid
from infoplan.terrain import Terrain, load_terrain

RAMP = np.add.outer(100.0 * np.arange(3), np.arange(5))  # rises by 100 a row, by 1 a column


def terrain(elevation=RAMP, extent=(0.0, 8.0, 10.0, 14.0)) -> Terrain:
    return Terrain("test", elevation, extent, "m", "")


@settings(max_examples=60, deadline=None)
@given(
    elevation=hnp.arrays(
        np.float64,
        st.tuples(st.integers(2, 6), st.integers(2, 6)),
        elements=st.floats(-1e4, 1e4, allow_nan=False),
    ),
    corner=st.tuples(st.floats(-100, 100), st.floats(-100, 100)),
    size=st.tuples(st.floats(0.1, 100), st.floats(0.1, 100)),
    fractions=hnp.arrays(np.float64, (7, 2), elements=st.floats(0, 1)),
)
def test_bilinear_agrees_with_scipy(elevation, corner, size, fractions):
    extent = (corner[0], corner[0] + size[0], corner[1], corner[1] + size[1])
    y = np.linspace(extent[2], extent[3], elevation.shape[0])
    x = np.linspace(extent[0], extent[1], elevation.shape[1])
    points = np.clip(np.array(corner) + fractions * np.array(size), [x[0], y[0]], [x[-1], y[-1]])
    expected = RegularGridInterpolator((y, x), elevation)(points[:, ::-1])
    found = terrain(elevation, extent).elevation_at(points[:, 0], points[:, 1])
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_the_first_row_is_the_lower_border_and_the_first_column_the_left_one():
    surface = terrain()
    corners = surface.elevation_at([0.0, 8.0, 0.0, 8.0], [10.0, 10.0, 14.0, 14.0])
    assert corners.tolist() == [0.0, 4.0, 200.0, 204.0]


def test_nodes_lie_on_the_borders_and_even_between_them():
    assert terrain().elevation_at(2.0, 12.0) == 101.0
    assert terrain().elevation_at(3.0, 11.0) == 51.5


def test_locations_broadcast():
    found = terrain().elevation_at(np.linspace(0, 8, 5), np.linspace(10, 14, 3)[:, None])
    np.testing.assert_allclose(found, RAMP)


def test_rounding_beyond_the_border_counts_as_the_border():
    assert terrain().elevation_at(np.nextafter(8.0, 9.0), np.nextafter(10.0, 9.0)) == 4.0


@pytest.mark.parametrize(
    ("x1", "x2"), [(-0.001, 12), (8.001, 12), (4, 9.999), (4, 14.001), (np.nan, 12), (4, np.nan)]
)
def test_locations_outside_are_refused(x1, x2):
    with pytest.raises(ValueError, match="outside the terrain"):
        terrain().elevation_at([4.0, x1], [12.0, x2])


def test_query_grid_runs_along_x_first_and_includes_the_borders():
    grid = query_grid(terrain().extent, (3, 2))
    assert grid.tolist() == [[0, 10], [8, 10], [0, 12], [8, 12], [0, 14], [8, 14]]


def test_query_grid_of_the_map_s_own_shape_gives_the_map_back():
    surface = terrain(np.random.default_rng(0).normal(size=(7, 11)))
    grid = query_grid(surface.extent, (7, 11))
    found = surface.elevation_at(grid[:, 0], grid[:, 1]).reshape(7, 11)
    np.testing.assert_allclose(found, surface.elevation, atol=1e-12)


def test_elevation_is_a_contiguous_read_only_copy():
    given_array = np.asfortranarray(RAMP.astype(np.float32))
    surface = terrain(given_array)
    given_array[0, 0] = 7.0
    assert surface.elevation[0, 0] == 0.0
    assert surface.elevation.dtype == np.float64
    assert surface.elevation.flags.c_contiguous
    with pytest.raises(ValueError, match="read-only"):
        surface.elevation[0, 0] = 1.0


@pytest.mark.parametrize(
    "extent",
    [
        (0, 50, 0),
        (0, 50, 0, 50, 1),
        (50, 0, 0, 50),
        (0, 50, 5, 5),
        (0, np.inf, 0, 50),
        (0, 50, np.nan, 50),
        ("west", 50, 0, 50),
        7,
    ],
)
def test_an_extent_that_is_no_workspace_is_refused(extent):
    with pytest.raises(UsageError, match=r"terrain\.extent=.* xmin < xmax and ymin < ymax"):
        load_terrain("volcano", extent=extent)


def test_extent_becomes_a_tuple_of_floats():
    assert load_terrain("volcano", extent=[-1, 1, 0, 3]).extent == (-1.0, 1.0, 0.0, 3.0)


def test_digest_of_a_built_in_surface_is_that_of_its_doubles(volcano):
    content = volcano.elevation.astype("<f8").tobytes(order="C")
    assert volcano.sha256 == hashlib.sha256(content).hexdigest()


@pytest.mark.parametrize(
    "extent",
    [[0, 1e-9, 0, 1e-9], [0, 1e308, 0, 1e308], [-1e308, 1e308, 0, 1], [1e9, 1e9 + 1e-3, 0, 1],
     [0, 1e-5, 0, 1e5], [0, 5e-324, 0, 1]],
)  # fmt: skip
def test_a_workspace_too_small_large_or_long_for_its_digits_is_refused(extent):
    with pytest.raises(UsageError, match=r"terrain\.extent=.* is no workspace: "):
        load_terrain("volcano", extent=extent)
    assert load_terrain("volcano", extent=[0, 1e-6, -1e-6, 1e-6]).extent[1] == 1e-6
    assert load_terrain("volcano", extent=[5e5, 6e5, 5.1e6, 5.2e6]).extent[3] == 5.2e6
    assert load_terrain("volcano", extent=[-1e9, 1e9, 0, 1e9]).extent[1] == 1e9
