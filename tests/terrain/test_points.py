"""Tables of points that are taken for grids, and maps three nodes wide that are none."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from infoplan.errors import UsageError
from infoplan.terrain import load_terrain

RNG = np.random.default_rng(0)


def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 1000 + 300 * np.sin(x / 9) * np.cos(y / 7)


def points(x: np.ndarray, y: np.ndarray, z: np.ndarray | None = None) -> np.ndarray:
    z = surface(x, y) if z is None else z
    return np.column_stack([np.ravel(x), np.ravel(y), np.ravel(z)])


def scattered(count: int, side: float = 50.0) -> np.ndarray:
    return RNG.uniform(0, side, (2, count))


LATTICE = points(*np.meshgrid(np.linspace(0, 50, 20), np.linspace(0, 50, 15)))
TIME = 0.7 * np.arange(1000)
LAWN = points(np.where(TIME // 50 % 2, 50 - TIME % 50, TIME % 50), TIME // 50 * 50 / 14)
POINTS = {
    "lattice": LATTICE,
    "lattice, the other order": LATTICE[:, [1, 0, 2]],
    "lattice, shuffled": RNG.permutation(LATTICE),
    "lattice, with gaps": LATTICE[RNG.random(300) < 0.8],
    "two by three": [(x, y, x * y + 0.1 * x) for x in range(2) for y in range(3)],
    "scattered": points(*scattered(300)),
    "scattered, few": points(*scattered(20)),
    "scattered, z of the same size": points(*(p := scattered(200)), (surface(*p) - 1000) / 10),
    "in metres east and north": np.add(points(*scattered(30, 1e4)), [5.6e5, 5.1e6, 0]),
    "in degrees": points(*scattered(20)) * [1e-4, 1e-4, 0.01] + [-67, 18, 0],
    "along tracks": LAWN,
    "three rows": np.add(points(*scattered(30)), [5.6e5, 5.1e6, 0]).T,
}


def saved(folder: Path, table: object, ending: str) -> Path:
    path = folder / f"map.{ending}"
    {"npy": np.save, "npz": np.savez, "csv": np.savetxt}[ending](path, np.asarray(table, float))
    return path


@pytest.mark.parametrize("ending", ["npy", "npz", "csv"])
@pytest.mark.parametrize("kind", POINTS)
def test_points_are_refused(kind, ending, tmp_path):
    path = saved(tmp_path, POINTS[kind], ending)
    with pytest.raises(UsageError) as caught:
        load_terrain("file", path=path)
    assert "looks like points x, y, z" in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_advice_works(tmp_path, monkeypatch):
    """What the message says to do, done as it is written."""
    path = saved(tmp_path, LATTICE, "csv")
    with pytest.raises(UsageError) as caught:
        load_terrain("file", path=path)
    code = str(caught.value).partition("x, y, z, gx")[2].partition("; or do")[0]
    monkeypatch.chdir(tmp_path)
    import scipy.interpolate

    x, y, z = LATTICE.T
    exec(f"gx{code}", {"numpy": np, "scipy": scipy, "x": x, "y": y, "z": z})
    terrain = load_terrain("file", path=tmp_path / "map.npy")
    assert terrain.elevation.shape == (100, 100)
    assert terrain.elevation[0, 0] == pytest.approx(surface(0, 0))


@pytest.mark.parametrize(
    "heading",
    ["x,y,z", "lat,lon,depth", "Longitude;Latitude;Elevation", "X1 X2 elevation", '"x","y","z"'],
)
def test_a_heading_of_points_is_told(heading, tmp_path):
    path = tmp_path / "map.csv"
    mark = next(mark for mark in ";, " if mark in heading)
    path.write_text("\n".join([heading, *(mark.join(map(str, row)) for row in LATTICE)]))
    with pytest.raises(UsageError, match=r"line 1, column 1: .* heading of points; grid points"):
        load_terrain("file", path=path)


def test_survey_logs(tmp_path):
    logs = sorted(Path(os.environ.get("INFOPLAN_DATA", tmp_path), "boat").glob("*.csv"))
    if not logs:
        pytest.skip("no survey logs on this machine")
    for log in logs:
        with log.open() as stream:
            rows = [row for row in csv.reader(stream) if row][1:]
        path = saved(tmp_path, np.array(rows, dtype=float)[:, :3], "csv")
        with pytest.raises(UsageError, match="looks like points"):
            load_terrain("file", path=path)
        with pytest.raises(UsageError, match="heading of points"):
            load_terrain("file", path=log)


Y, X = np.mgrid[0:200, 0:200].astype(float)
HONEST = {
    "volcano": load_terrain("volcano").elevation,
    "jacksboro": load_terrain("jacksboro").elevation,
    **{
        f"field {seed}": load_terrain(
            "random_field", seed=seed, shape=[150, 150], lengthscale=[6.0, 6.0]
        ).elevation
        for seed in range(4)
    },
    "noise": RNG.normal(1000, 100, (500, 100)),
    "uniform": RNG.uniform(0, 1, (500, 100)),
    "whole numbers": RNG.integers(0, 10, (200, 100)).astype(float),
    "hill": 800 * np.exp(-((X - 99.5) ** 2 + (Y - 99.5) ** 2) / 2000),
    "waves": 100 * np.sin(Y / 9 + X / 7),
    "plane": 100 * X + Y,
    "steep and even": 1000 * X + RNG.normal(size=X.shape),
    "count": np.arange(40_000.0).reshape(200, 200),
}


@pytest.mark.parametrize("kind", HONEST)
@pytest.mark.filterwarnings("ignore:an elevation of")
def test_maps_three_nodes_wide_are_read(kind, tmp_path):
    elevation = HONEST[kind]
    for step in (1, 7, 30, 49):
        for start in range(0, elevation.shape[1] - 2 * step, 23):
            for rows in (1, 4):
                table = elevation[::rows, start : start + 2 * step + 1 : step]
                for honest in (table, table.T):
                    if np.ptp(honest):
                        terrain = load_terrain("file", path=saved(tmp_path, honest, "npy"))
                        assert terrain.elevation.shape == honest.shape
