"""No-go zones: the geometry against matplotlib's paths, every planner, and what is refused."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline

import infoplan
from infoplan.analyse.audit.robot import check_workspace
from infoplan.analyse.audit.stored import FaultError
from infoplan.analyse.tables import find_missions
from infoplan.cli import main
from infoplan.draw import style
from infoplan.draw.report_data import Panel, alarm_map
from infoplan.errors import RunError, UsageError
from infoplan.obstacles import NOWHERE, obstacles_of, rectangles
from infoplan.plan import PLANNERS, Situation
from infoplan.robot import steering_angles
from infoplan.study.identity import config_from_science, identify
from infoplan.terrain import load_terrain
from infoplan.walls import crosses

EXTENT = (0.0, 50.0, 0.0, 50.0)
ZONES = [
    [[8.0, 18.0], [15.0, 20.0], [12.0, 30.0], [9.0, 28.0]],
    [[30.0, 28.0], [38.0, 28.0], [38.0, 36.0], [34.0, 31.0], [30.0, 36.0]],
]
WORDS = [
    "terrain=volcano", "detector=none", "budget=200", "grid=[12,12]", "model.pilot_iterations=20",
    "n_jobs=1", "backend=sequential", "seeds=1",
]  # fmt: skip


def meets(track, polygon):
    """Whether a track touches a polygon, by matplotlib."""
    outline = Outline([*polygon, polygon[0]], closed=True)
    return outline.contains_point(track[0]) or Outline(track).intersects_path(outline, filled=False)


def random_polygon(rng):
    """A star around a random centre, of as many as nine corners."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 10)))
    reach = rng.uniform(1, 9, len(angles))
    return rng.uniform(5, 45, 2) + reach[:, None] * np.column_stack(
        [np.cos(angles), np.sin(angles)]
    )


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_a_step_touches_what_it_touches(seed):
    rng = np.random.default_rng(seed)
    polygons = [random_polygon(rng) for _ in range(4)]
    obstacles = obstacles_of([polygon.tolist() for polygon in polygons])
    for _ in range(40):
        start = rng.uniform(0, 50, 2)
        end = start + rng.normal(0, rng.choice([0.5, 8.0]), 2)
        found = crosses(*start, *end, obstacles.walls)
        outlines = [Outline([*polygon, polygon[0]]) for polygon in polygons]
        way = Outline([start, end])
        assert found == any(way.intersects_path(outline, filled=False) for outline in outlines)
    places = rng.uniform(0, 50, (200, 2))
    inside = [Outline([*polygon, polygon[0]]).contains_points(places) for polygon in polygons]
    np.testing.assert_array_equal(obstacles.contain(places), np.any(inside, axis=0))


def test_touching_is_enough():
    walls = obstacles_of([[[0, 0], [4, 0], [4, 4], [0, 4]]]).walls
    assert crosses(-1.0, 2.0, 0.0, 2.0, walls)  # up to the border
    assert crosses(-1.0, 1.0, 1.0, -1.0, walls)  # a corner alone
    assert crosses(-1.0, 0.0, 9.0, 0.0, walls)  # along an edge
    assert crosses(-5.0, 2.0, 9.0, 2.0, walls)  # right through
    assert not crosses(-1.0, 4.1, 9.0, 4.1, walls)
    assert not crosses(5.0, 0.0, 9.0, 0.0, walls)  # on an edge's line, beyond its end
    assert not crosses(0.0, 0.0, 1.0, 1.0, NOWHERE.walls)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 9), st.integers(2, 9))
def test_rectangles_cover_what_a_mask_marks(seed, rows, columns):
    rng = np.random.default_rng(seed)
    mask = rng.random((rows, columns)) < 0.4
    extent = (-3.0, 5.0, 10.0, 30.0)
    obstacles = obstacles_of(rectangles(mask, extent))
    places = rng.uniform([-3, 10], [5, 30], (300, 2))
    i = np.rint((places[:, 1] - 10) / 20 * (rows - 1)).astype(int)
    j = np.rint((places[:, 0] + 3) / 8 * (columns - 1)).astype(int)
    np.testing.assert_array_equal(obstacles.contain(places), mask[i, j])


def situation(seed, polygons):
    """A random pose, a random map, random obstacles."""
    rng = np.random.default_rng(seed)
    obstacles = obstacles_of([polygon.tolist() for polygon in polygons])
    while obstacles.contain(place := rng.uniform(0, 50, 2)).any():
        pass
    std = rng.uniform(1, 5, (15, 20))
    return Situation(
        pose=np.append(place, rng.uniform(0, 2 * np.pi)), std=std, mean=10 * std, reward_map=std,
        outlier_density=rng.uniform(0, 2, (15, 20)), extent=EXTENT, speed=0.7,
        samples_per_action=10, steering=steering_angles(0.15, 5), visited=place[None], n_pilot=1,
        epoch=1, budget=500, obstacles=obstacles,
    )  # fmt: skip


@pytest.mark.parametrize("name", PLANNERS)
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_every_planner_drives_what_the_car_can(name, seed):
    rng = np.random.default_rng(seed)
    polygons = [random_polygon(rng) for _ in range(5)]
    scene = situation(seed, polygons)
    plan = PLANNERS[name](scene, rng)
    assert (len(plan) > 0) == bool(scene.valid_actions())
    assert set(np.asarray(plan).tolist()) <= set(range(5))
    track = np.vstack([scene.pose[:2], scene.drive(plan)[:, :2]])
    assert ((track >= 0) & (track <= 50)).all()
    assert not any(meets(track, polygon) for polygon in polygons)


def test_valid_actions_are_those_that_matplotlib_calls_free():
    for seed in range(30):
        polygons = [random_polygon(np.random.default_rng(seed + 1)) for _ in range(3)]
        scene = situation(seed, polygons)
        free = []
        for action in range(5):
            track = np.vstack([scene.pose[:2], scene.drive([action])[:, :2]])
            stays = ((track >= 0) & (track <= 50)).all()
            if stays and not any(meets(track, polygon) for polygon in polygons):
                free.append(action)
        assert scene.valid_actions() == free


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A short study of two planners among obstacles, one of them out of a mask."""
    folder = tmp_path_factory.mktemp("obstacles")
    mask = np.zeros((51, 51))
    mask[40:43, 20:24] = 1
    np.save(folder / "mask.npy", mask)
    words = [*WORDS, f"terrain.obstacles={ZONES}".replace(" ", ""), f"results_dir={folder}",
             f"terrain.obstacles_mask={folder / 'mask.npy'}"]  # fmt: skip
    assert main(["run", "-m", *words, "planner=uct,random"]) == 0
    return folder


def test_no_sample_of_a_mission_is_in_an_obstacle(flown):
    zones = [*ZONES, [[19.5, 39.5], [23.5, 39.5], [23.5, 42.5], [19.5, 42.5]]]
    found = list(flown.glob("samples/*/*.parquet"))
    assert len(found) == 2
    for path in found:
        track = pd.read_parquet(path, partitioning=None)[["x1", "x2"]].to_numpy()
        assert len(track) == 200
        assert not any(meets(track, zone) for zone in zones)
    stored = [path.read_text() for path in (flown / "runs").glob("*.yaml")]
    assert all("obstacles:" in text and "mask" not in text for text in stored)


def test_what_is_flown_among_obstacles_is_audited(flown, capsys):
    assert main(["audit", f"results_dir={flown}"]) == 0
    assert "off 3 obstacles" in " ".join(capsys.readouterr().out.split())


def test_a_sample_in_an_obstacle_is_found():
    track = np.column_stack([np.linspace(1, 49, 40), np.full(40, 21.0)])
    options = {"terrain.obstacles": ZONES}
    mission = SimpleNamespace(
        extent=EXTENT, x=track, samples={"heading": pd.Series(np.zeros(40))},
        length_tolerance=1e-9, option=options.get, place=lambda i: f"sample {i}",
    )  # fmt: skip
    with pytest.raises(FaultError, match="sample 6 is in an obstacle, or behind one"):
        check_workspace(mission)
    mission.x = track + np.array([0.0, 20.0])
    assert check_workspace(mission).endswith("off 2 obstacles")


def test_figures_and_report_show_where_the_robot_may_not_go(flown, monkeypatch):
    drawn = []
    monkeypatch.setattr(style, "show_obstacles", lambda axes, polygons: drawn.append(len(polygons)))
    run = next(path.stem for path in (flown / "runs").glob("uct*.yaml"))
    assert main(["animate", f"results_dir={flown}", f"run={run}", "seed=0"]) == 0
    assert drawn == [3] * 5  # the path and four maps
    selection = find_missions(flown)
    panel = Panel(0.1, "batch", {"UCT-NONE": run}, {"UCT-NONE": run})
    polygons = alarm_map(selection, [panel])["runs"][0]["obstacles"]
    assert polygons[:2] == ZONES
    assert len(polygons) == 3


def test_obstacles_are_hatched_in_their_place():
    figure = Figure()
    axes = figure.add_subplot(xlim=(0, 50), ylim=(0, 50))
    style.show_obstacles(axes, ZONES)
    (zones,) = axes.collections
    np.testing.assert_array_equal(zones.get_paths()[0].vertices[:4], ZONES[0])
    assert zones.get_hatch()
    style.show_obstacles(axes, [])


def test_a_terrain_is_shown_with_its_obstacles(tmp_path, capsys):
    square = "terrain.obstacles=[[[10,20],[15,20],[15,30],[10,30]]]"
    assert main(["terrain", "show", "terrain=volcano", square, f"results_dir={tmp_path}"]) == 0
    assert "no-go      2 % of the workspace" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["terrain.obstacles=[[[20,20],[30,20],[30,30],[20,30]]]"],
         "the pilot path meets an obstacle of terrain.obstacles near"),
        (["terrain.obstacles=[[[1,1],[2,2]]]"], "are no polygons: give the vertices of each"),
        (["terrain.obstacles=[[[1,1],[2,2],[3]]]"], "are no polygons: give the vertices of each"),
        (["terrain.obstacles=[[[1,1],[2,2],[3e9,1]]]"], "it must be at least -1e+09"),
        (["terrain.obstacles=[[1,2,3]]"], "terrain.obstacles"),
        (["terrain.obstacles_mask=nowhere.npy"], "obstacles_mask=nowhere.npy names no file"),
    ],
)  # fmt: skip
def test_what_is_no_obstacle_is_refused(words, said, tmp_path, capsys):
    assert main(["run", *WORDS, *words, f"results_dir={tmp_path}"]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_a_mask_of_too_many_pieces_is_refused(tmp_path):
    np.save(tmp_path / "mask.npy", np.indices((80, 80)).sum(axis=0) % 2)
    with pytest.raises(UsageError, match=r"3200 polygons, and at most 1000 .* a coarser mask"):
        load_terrain("volcano", obstacles_mask=tmp_path / "mask.npy")


def test_without_obstacles_nothing_is_stored_of_them():
    config = infoplan.configure("terrain=volcano", "detector=none")
    terrain = load_terrain("volcano")
    assert "obstacles" not in identify(config, terrain).science["terrain"]
    among = load_terrain("volcano", obstacles=ZONES)
    stored = identify(config, among)
    assert stored.science["terrain"]["obstacles"] == ZONES
    assert stored.name != identify(config, terrain).name
    assert config_from_science(stored.science).terrain.obstacles == ZONES


def test_a_robot_of_ones_own_keeps_off_and_must_be_out_of_them():
    field = infoplan.workspace([0, 50, 0, 50], obstacles=ZONES)
    config = infoplan.configure("planner=greedy", "detector=none", budget=300, grid=[12, 12])
    rng = np.random.default_rng(0)
    for end, free in (([25.0, 10.0], True), ([12.0, 22.0], False)):
        mission = infoplan.Mission(config, field, 0)
        x = np.vstack([rng.uniform([20, 2], [48, 20], (30, 2)), end])
        mission.start(infoplan.as_samples(mission, x, x[:, 0], heading=np.zeros(31)))
        if free:
            track = np.vstack([end, mission.plan()[:, :2]])
            assert not any(meets(track, zone) for zone in ZONES)
        else:
            with pytest.raises(RunError, match=r"the robot is at \(12, 22\), in an obstacle"):
                mission.plan()
