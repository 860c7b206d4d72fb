"""A terrain in words and as a picture."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.cbook import is_math_text
from matplotlib.image import imread
from matplotlib.text import Text

from infoplan.draw import style, terrain_map
from infoplan.draw.terrain_map import draw_terrain, terrain_summary
from infoplan.terrain import Terrain
from infoplan.terrain.relief import local_relief


def described(terrain: Terrain) -> dict[str, str]:
    return {line[:10].strip(): line[11:] for line in terrain_summary(terrain).splitlines()}


def test_description_of_a_terrain_with_known_numbers():
    elevation = np.zeros((11, 21))
    elevation[:, 15:] = 100.0
    facts = described(Terrain("step", elevation, (0.0, 20.0, 0.0, 10.0), "m", "ab" * 32))
    assert facts["terrain"] == "step"
    assert facts["nodes"] == "11 x 21, rows along y"
    assert facts["workspace"] == "x 0 to 20, y 0 to 10"
    assert facts["elevation"] == "0 to 100 m"
    assert facts["mean, std"] == f"{600 / 21:.1f}, {elevation.std():.1f} m"
    assert facts["relief"].startswith("100 m; within 2 units 0 m")
    # The step is felt by the two nodes on either side of it: 4 of 21 columns.
    assert facts["flat land"].startswith(f"{100 * 17 / 21:.0f} %")
    assert facts["sha256"] == "ab" * 32


def test_a_plain_is_flat_throughout():
    plain = Terrain("plain", np.full((5, 5), 3.0), (0.0, 9.0, 0.0, 9.0), "m", "0" * 64)
    assert described(plain)["flat land"].startswith("100 %")


@pytest.fixture
def no_large_relief(monkeypatch):
    """Local relief and shading of more than 400 x 400 nodes fail, and do not take for ever."""

    def guarded(function, place):
        def inner(*arguments):
            assert max(arguments[place].shape) <= 400
            return function(*arguments)

        return inner

    monkeypatch.setattr(terrain_map, "local_relief", guarded(terrain_map.local_relief, 0))
    monkeypatch.setattr(style, "show_relief", guarded(style.show_relief, 1))


def test_a_large_map_is_described_by_all_nodes_and_relief_by_some(no_large_relief, tmp_path):
    elevation = np.zeros((3601, 3601))
    elevation[:, 1800:] = 100.0
    elevation[7, 11] = -300.0
    large = Terrain("large", elevation, (0.0, 50.0, 0.0, 50.0), "m", "0" * 64)
    facts = described(large)
    assert facts["nodes"].startswith("3601 x 3601,")
    assert facts["elevation"] == "-300 to 100 m"
    assert facts["mean, std"] == f"{elevation.mean():.1f}, {elevation.std():.1f} m"
    assert facts["relief"].startswith("400 m; within 2 units 0 m")
    # The step is felt by the land within 2 of 50 units on either side.
    assert facts["flat land"].startswith("92 %")
    assert draw_terrain(large, tmp_path).is_file()


@pytest.mark.parametrize("shape", [(400, 400), (344, 403)])
def test_a_map_of_few_nodes_is_not_thinned(shape):
    elevation = np.random.default_rng(0).normal(0, 100, shape)
    small = Terrain("small", elevation, (0.0, 399.0, 0.0, 399.0), "m", "0" * 64)
    local = local_relief(elevation, small.extent)
    assert described(small)["relief"].endswith(f"within 2 units {np.median(local):.0f} m (median)")
    np.testing.assert_array_equal(terrain_map.coarsened(small), elevation)


def test_picture_with_the_pilot_path(volcano, tmp_path):
    path = draw_terrain(volcano, tmp_path / "figures")
    assert path == tmp_path / "figures" / "terrain-volcano.png"
    assert len(np.unique(imread(path)[..., :3].reshape(-1, 3), axis=0)) > 1000
    shown = pd.read_csv(path.with_suffix(".csv"))
    assert len(shown) == 100
    assert shown["elevation"].to_numpy() == pytest.approx(
        volcano.elevation_at(shown["x1"], shown["x2"])
    )


def test_a_place_in_the_world_is_told_and_drawn(volcano, tmp_path):
    placed = replace(volcano, world=(557820.0, 567600.0, 5107990.0, 5121980.0), crs="EPSG:26710")
    assert described(placed)["world"] == "557820 to 567600, 5107990 to 5121980 EPSG:26710"
    assert "world" not in described(volcano)
    there = draw_terrain(placed, tmp_path / "placed").read_bytes()
    assert there != draw_terrain(volcano, tmp_path / "plain").read_bytes()


Z = np.random.default_rng(0).normal(size=(30, 40))


@pytest.mark.parametrize(
    ("elevation", "told"),
    [
        (1.7 + 0.3 * np.sin(Z), "1.40 to 2.00"),
        ((Z - Z.min()) / np.ptp(Z), "0 to 1.00"),
        (np.where(Z > 0, 1000.0001, 1000.0003), "1000.000100 to 1000.000300"),
        (np.where(Z > 0, -0.01234, 0.05678), "-0.0123 to 0.0568"),
        (np.where(Z > 0, 812.4, 8365.2), "812 to 8365"),
        (np.where(Z > 0, 1e99, -1e99), "-1.00e+99 to 1.00e+99"),
    ],
)
def test_digits_fit_the_map(elevation, told):
    terrain = Terrain("t", elevation, (0.0, 50.0, 0.0, 50.0), "km", "0" * 64)
    assert described(terrain)["elevation"] == f"{told} km"


@pytest.mark.parametrize(
    "unit",
    ["<script>alert(1)</script>", "$x$", r"$\frac{", "$", "m\x1b[31m\n\x07", "\u202em", "100 $ $"]
)  # fmt: skip
def test_a_unit_is_nothing_but_a_word(unit, tmp_path):
    terrain = Terrain("t", Z, (0.0, 50.0, 0.0, 50.0), unit, "0" * 64, (0, 1, 0, 1), unit)
    lines = terrain_summary(terrain).splitlines()
    assert len(lines) == len(described(terrain)) == 9
    assert all(line.isprintable() for line in lines)
    drawn = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "save", lambda figure, *_: drawn.append(figure) or [tmp_path])
        draw_terrain(terrain, tmp_path)
    labels = [text.get_text() for text in drawn[0].findobj(Text) if "elevation" in text.get_text()]
    assert labels
    for label in labels:
        assert not is_math_text(label)
        assert label.isprintable()


@pytest.mark.parametrize(
    "extent", [(0, 1e-6, 0, 1e-6), (0, 1e9, 0, 1e9), (0, 1e-3, 0, 1e3), (0, 5, 0, 5), (9, 11, 0, 2)]
)
def test_relief_of_any_workspace(extent):
    elevation = np.random.default_rng(0).normal(size=(300, 200))
    terrain = Terrain("t", elevation, extent, "m", "0" * 64)
    assert "within 2 units" in described(terrain)["relief"]
    if np.hypot(extent[1] - extent[0], extent[3] - extent[2]) < 2:
        whole = described(terrain)["relief"].split()[0]
        assert f"within 2 units {whole} m" in described(terrain)["relief"]
