"""The maps that need no file: do they show what they are named after?"""

import matplotlib.cbook
import numpy as np
import pytest

from infoplan.errors import UsageError
from infoplan.terrain import TERRAINS, Terrain, load_terrain

METRES = 0.3048


@pytest.fixture(scope="module")
def mountain() -> Terrain:
    """The volcano over kilometres east and north of its crater's middle."""
    return load_terrain("volcano", extent=(-3.78, 3.78, -6.8, 4.0))


def rays(mountain: Terrain, azimuths: list[float], start: float, end: float) -> np.ndarray:
    """Metres along rays from the crater's middle: a row an azimuth, degrees clockwise of north."""
    radius = np.linspace(start, end, 80)
    angle = np.radians(azimuths)[:, None]
    return METRES * mountain.elevation_at(radius * np.sin(angle), radius * np.cos(angle))


ROUND_BUT_NORTH = list(np.arange(60.0, 300.0, 5.0))


def test_volcano_is_a_grid_of_feet_like_helens(volcano):
    assert (volcano.name, volcano.unit, volcano.elevation.shape) == ("volcano", "ft", (100, 100))
    assert np.std(volcano.elevation) == pytest.approx(1209, rel=0.05)
    assert 2500 < volcano.elevation.min() < 3000


def test_volcano_rises_to_the_published_2549_metres(volcano):
    assert METRES * volcano.elevation.max() == pytest.approx(2549, abs=5)


def test_volcano_has_a_crater_of_two_kilometres_far_below_its_rim(mountain):
    across = rays(mountain, ROUND_BUT_NORTH, 0.4, 2.5)
    rim = across.max(axis=1)
    at = np.linspace(0.4, 2.5, 80)[across.argmax(axis=1)]
    assert np.all((at > 0.8) & (at < 1.3))
    floor = rays(mountain, ROUND_BUT_NORTH, 0.45, 0.46).mean()
    assert 1800 < floor < 2000
    assert rim.min() > floor + 250
    assert np.median(rim) > floor + 450


def test_volcano_is_breached_to_the_north(mountain):
    breach = rays(mountain, [-15, 0, 15], 0.5, 2.5).max(axis=1)
    rim = rays(mountain, ROUND_BUT_NORTH, 0.5, 2.5).max(axis=1)
    assert breach.max() < rim.min() - 250
    outwards = rays(mountain, [0], 0.5, 3.9)[0]
    assert outwards[-1] < outwards[0] - 400


def test_volcano_has_a_dome_in_its_crater(mountain):
    top = METRES * mountain.elevation_at(0.0, 0.05)
    around = rays(mountain, list(np.arange(0, 360, 10.0)), 0.45, 0.46)
    assert top > around.max() + 80


def test_volcano_has_flat_land_steep_walls_and_no_cliff(mountain):
    north, east = 10_800 / 99, 7_560 / 99
    slope = np.degrees(np.arctan(np.hypot(*np.gradient(METRES * mountain.elevation, north, east))))
    assert 0.2 < np.mean(slope < 10) < 0.4
    assert 0.1 < np.mean(slope > 25) < 0.25
    assert slope.max() < 65


def test_volcano_has_the_same_bytes_everywhere(volcano):
    assert volcano.sha256 == "19d674ecbf8301f47393e8c903dc9fb391ce9d0350cad260ee2373b3e469fac1"


def test_jacksboro_has_all_nodes_that_matplotlib_ships(volcano):
    surface = load_terrain("jacksboro")
    with matplotlib.cbook.get_sample_data("jacksboro_fault_dem.npz") as shipped:
        northmost, southmost = shipped["elevation"][[0, -1]]
    assert surface.unit == "m"
    assert surface.elevation.shape == (344, 403)
    np.testing.assert_array_equal(surface.elevation[-1], northmost)
    np.testing.assert_array_equal(surface.elevation[0], southmost)


def test_jacksboro_s_highest_mountain_stands_in_the_south():
    # Cross Mountain, 1077 m, at 36.2 N; the map ends near 36.45 N.
    elevation = load_terrain("jacksboro").elevation
    row, _ = np.unravel_index(elevation.argmax(), elevation.shape)
    assert elevation.max() == pytest.approx(1077, abs=2)
    assert row < 344 / 3


@pytest.mark.parametrize("name", ["volcano", "jacksboro"])
def test_built_in_maps_take_no_file(name, tmp_path):
    with pytest.raises(UsageError, match=rf"terrain={name} has no option terrain\.path"):
        load_terrain(name, path=tmp_path)


def test_an_unknown_map_is_refused_with_the_known_ones():
    with pytest.raises(UsageError, match="terrain=everest is not a map") as caught:
        load_terrain("everest")
    assert all(name in str(caught.value) for name in TERRAINS)
