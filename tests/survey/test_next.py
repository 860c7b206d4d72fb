"""`infoplan next`: files that other libraries read, where the log lies; what is refused."""

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from matplotlib.path import Path as Outline
from survey_logs import QUICK, write_log

from infoplan.cli import main

pyproj = pytest.importorskip("pyproj")

INSIDE = [[17.9695, -67.0404], [17.9695, -67.0396], [17.9711, -67.0396], [17.9711, -67.0404]]
"""LAT, LON: wider than the log."""

AVOID = [[17.9698, -67.0400], [17.9699, -67.0399], [17.9697, -67.0399]]

TO_PLANE = pyproj.Transformer.from_crs(4326, 32619, always_xy=True)
GEOD = pyproj.Geod(ellps="WGS84")


def run_of(folder: Path) -> str:
    return next((folder / "runs").glob("survey-*.yaml")).stem


def plan(folder: Path, *words: str) -> tuple[int, Path]:
    """Plan a track; returns the status, and the folder of its files."""
    run = run_of(folder)
    status = main(["next", run, f"results_dir={folder}", "planner.iterations=60", *words])
    return status, folder / "surveys" / run / "next"


def written(points) -> str:
    return json.dumps(points).replace(" ", "")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results with one survey in degrees."""
    place = tmp_path_factory.mktemp("next")
    log = write_log(place / "bay.csv")
    assert main(["survey", str(log), f"results_dir={place / 'results'}", *QUICK]) == 0
    return place / "results"


@pytest.fixture(scope="module")
def planned(folder):
    """The files of a track within a polygon, off a zone."""
    status, files = plan(
        folder, "budget=300", f"inside={written(INSIDE)}", f"avoid={written(AVOID)}", "altitude=12",
        "turning_radius=4", "step=1.5", "speed=2",
    )  # fmt: skip
    assert status == 0
    return files


def off(lat, lon, other_lat, other_lon):
    """Metres on the ellipsoid."""
    return np.abs(np.asarray(GEOD.inv(lon, lat, other_lon, other_lat)[2]))


def test_the_rows_are_a_track_from_where_the_log_ended(folder, planned):
    rows, log = pd.read_csv(planned / "next.csv"), pd.read_csv(folder.parent / "bay.csv")
    assert list(rows.columns) == [
        "sample", "distance_m", "time_s", "lat", "lon", "x_m", "y_m", "heading_deg", "mean",
        "deviation", "waypoint",
    ]  # fmt: skip
    assert len(rows) == 300 // 1.5 + 1
    first = rows.iloc[0]
    assert (
        off(first["lat"], first["lon"], log["Latitude"].iloc[-1], log["Longitude"].iloc[-1]) < 0.1
    )
    x, y = TO_PLANE.transform(rows["lon"], rows["lat"])
    assert np.hypot(x - rows["x_m"], y - rows["y_m"]).max() < 0.002
    steps = off(rows["lat"][:-1], rows["lon"][:-1], rows["lat"][1:], rows["lon"][1:])
    assert steps == pytest.approx(1.5, rel=1e-3)  # a UTM zone is true to scale within 0.1 %
    assert rows["distance_m"].iloc[-1] == pytest.approx(300, abs=0.01)
    assert rows["time_s"].iloc[-1] == pytest.approx(150, abs=0.01)
    assert (rows["deviation"] > 0).all()
    # The heading after a sample is the way to the next one, clockwise from the plane's north.
    ways = np.degrees(np.arctan2(np.diff(rows["x_m"]), np.diff(rows["y_m"]))) % 360
    turned = (rows["heading_deg"][:-1] - ways + 180) % 360 - 180
    assert np.abs(turned).max() < 0.1


def test_the_track_and_its_waypoints_keep_to_the_polygon_and_off_the_zone(planned):
    rows = pd.read_csv(planned / "next.csv")
    for chosen in (rows, rows[rows["waypoint"]]):
        x = chosen[["x_m", "y_m"]].to_numpy()
        between = np.linspace(x[:-1], x[1:], 50).reshape(-1, 2)
        inside, zone = (
            Outline(np.column_stack(TO_PLANE.transform(*np.array(ring)[:, ::-1].T)))
            for ring in (INSIDE, AVOID)
        )
        assert inside.contains_points(between).all()
        assert not zone.contains_points(between).any()
    x = rows[["x_m", "y_m"]].to_numpy()
    a, b, c = x[:-2], x[1:-1], x[2:]
    sides = [np.hypot(*(p - q).T) for p, q in ((a, b), (b, c), (c, a))]
    double_area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    radius = np.prod(sides, axis=0) / np.maximum(2 * double_area, 1e-300)
    assert radius.min() > 4 * 0.99  # to the CSV's millimetres


def test_gpx_is_read_by_others(planned):
    gpxpy = pytest.importorskip("gpxpy")
    rows = pd.read_csv(planned / "next.csv")
    text = (planned / "next.gpx").read_text()
    space = "{http://www.topografix.com/GPX/1/1}"
    root = ElementTree.fromstring(text)
    assert (root.tag, root.get("version")) == (f"{space}gpx", "1.1")
    assert [child.tag for child in root] == [f"{space}rte", f"{space}trk"]  # in the schema's order
    read = gpxpy.parse(text)
    (track,), (route,) = read.tracks, read.routes
    points = [(point.latitude, point.longitude) for point in track.segments[0].points]
    assert off(*np.array(points).T, rows["lat"], rows["lon"]).max() < 1e-3
    points = [(point.latitude, point.longitude) for point in route.points]
    chosen = rows[rows["waypoint"]]
    assert off(*np.array(points).T, chosen["lat"], chosen["lon"]).max() < 1e-3


def test_geojson_is_read_by_others(planned):
    geometry = pytest.importorskip("shapely.geometry")
    rows = pd.read_csv(planned / "next.csv")
    document = json.loads((planned / "next.geojson").read_text())
    assert document["type"] == "FeatureCollection"
    shapes = {}
    for feature in document["features"]:
        shapes.setdefault(feature["properties"]["kind"], []).append(
            geometry.shape(feature["geometry"])
        )
    (track,), (area,), (zone,) = shapes["track"], shapes["area"], shapes["no-go zone"]
    lon, lat = np.array(track.coords).T
    assert off(lat, lon, rows["lat"], rows["lon"]).max() < 1e-3
    assert area.is_valid
    assert area.exterior.is_ccw
    assert area.contains(track)
    assert zone.disjoint(track)
    corners = np.array(area.exterior.coords)[:-1, ::-1]
    assert sorted(map(tuple, corners.round(7))) == sorted(map(tuple, np.array(INSIDE)))
    assert len(shapes["flagged"]) == 3
    assert len(shapes["waypoints"][0].geoms) == rows["waypoint"].sum()


def test_the_mission_is_read_by_others(planned):
    rows = pd.read_csv(planned / "next.csv")
    chosen = rows[rows["waypoint"]]
    text = (planned / "next.waypoints").read_text()
    lines = [line.split("\t") for line in text.splitlines()]
    assert lines[0] == ["QGC WPL 110"]
    assert lines[1][:8] == ["0", "1", "0", "16", "0", "0", "0", "0"]
    assert len(lines) == len(chosen) + 1
    for number, line in enumerate(lines[2:], 1):
        assert line[:8] == [str(number), "0", "3", "16", "0", "0", "0", "0"]
        assert line[10:] == ["12.000", "1"]
        assert len(line[8].partition(".")[2]) >= 8
    places = np.array([line[8:10] for line in lines[1:]], dtype=float)
    assert off(*places.T, chosen["lat"], chosen["lon"]).max() < 1e-3
    mavwp = pytest.importorskip("pymavlink.mavwp")
    loader = mavwp.MAVWPLoader()
    assert loader.load(str(planned / "next.waypoints")) == len(chosen)
    read = np.array([(loader.wp(i).x, loader.wp(i).y) for i in range(loader.count())])
    assert off(*read.T, chosen["lat"], chosen["lon"]).max() < 0.1


def test_the_terminal_sums_up(folder, capsys):
    assert plan(folder, "budget=120")[0] == 0
    said = " ".join(capsys.readouterr().out.split())
    run = run_of(folder)
    rows = pd.read_csv(folder / "surveys" / run / "next" / "next.csv")
    length = rows["distance_m"].iloc[-1]
    assert 120 - 10 < length <= 120
    assert f"{run}: puct from (17.97" in said
    assert "turning radius 5 m, 1.5 m/s" in said
    assert f"{length:.0f} m 1 min {round(length / 1.5) - 60:02d} s {len(rows) - 1}" in said
    assert "of 3" in said
    assert "picture.png" in said


def test_a_plane_without_degrees_has_csv_and_geojson_in_metres(tmp_path, capsys):
    degrees = pd.read_csv(write_log(tmp_path / "bay.csv"))
    x, y = TO_PLANE.transform(degrees["Longitude"], degrees["Latitude"])
    log = pd.DataFrame({"x": x, "y": y, "depth": degrees["Depth (ft)"]})
    log.to_csv(tmp_path / "pond.csv", index=False)
    there = f"results_dir={tmp_path / 'results'}"
    assert main(["survey", str(tmp_path / "pond.csv"), there, *QUICK]) == 0
    files = tmp_path / "results" / "surveys" / run_of(tmp_path / "results") / "next"
    files.mkdir(parents=True)
    (files / "next.gpx").write_text("of another day")
    corners = np.round([[x.min(), y.min()], [x.max(), y.min()], [x.max(), y.max() + 30]]).tolist()
    corners += [[corners[0][0], corners[2][1]]]
    start = f"from={np.mean(x):.2f},{np.mean(y):.2f}"
    assert plan(tmp_path / "results", "budget=80", f"inside={written(corners)}", start)[0] == 0
    assert "no GPX and no mission: they are in degrees" in capsys.readouterr().out
    assert sorted(path.name for path in files.iterdir()) == [
        "next.csv", "next.geojson", "picture.csv", "picture.png",
    ]  # fmt: skip
    rows = pd.read_csv(files / "next.csv")
    assert "lat" not in rows
    assert rows["x_m"][0] == pytest.approx(np.mean(x), abs=0.01)
    track = json.loads((files / "next.geojson").read_text())["features"][0]["geometry"]
    assert np.array(track["coordinates"]) == pytest.approx(
        rows[["x_m", "y_m"]].to_numpy(), abs=1e-3
    )


def test_polygons_come_from_geojson_with_holes_and_other_systems(folder, tmp_path):
    ring = [[lon, lat] for lat, lon in INSIDE]
    hole = [[lon, lat] for lat, lon in AVOID]
    polygon = {"type": "Polygon", "coordinates": [[*ring, ring[0]], [*hole, hole[0]]]}
    path = tmp_path / "bay.geojson"
    path.write_text(json.dumps({"type": "Feature", "properties": {}, "geometry": polygon}))
    status, files = plan(folder, "budget=100", f"inside={path}")
    assert status == 0
    shapes = [
        f["properties"]["kind"]
        for f in json.loads((files / "next.geojson").read_text())["features"]
    ]
    assert shapes.count("no-go zone") == 1
    # The same as of before RFC 7946, in another plane; and as metres in a list.
    to_zone = pyproj.Transformer.from_crs(4326, 32620, always_xy=True)
    moved = [[[*to_zone.transform(*p)] for p in r] for r in polygon["coordinates"]]
    shape = {"type": "MultiPolygon", "coordinates": [moved]}
    old = {
        "type": "FeatureCollection",
        "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32620"}},
        "features": [{"type": "Feature", "geometry": shape}],
    }
    path.write_text(json.dumps(old))
    assert plan(folder, "budget=100", f"inside={path}")[0] == 0
    features = json.loads((files / "next.geojson").read_text())["features"]
    again = {f["properties"]["kind"]: f["geometry"]["coordinates"] for f in features}
    for kind, corners in (("area", INSIDE), ("no-go zone", AVOID)):
        found = np.array(again[kind][0])[:-1, ::-1]
        assert sorted(map(tuple, found.round(7))) == sorted(map(tuple, np.array(corners)))
    metres = [[*TO_PLANE.transform(lon, lat)] for lat, lon in INSIDE]
    around = [[*TO_PLANE.transform(lon, lat)] for lat, lon in AVOID]
    assert (
        plan(folder, "budget=100", f"inside={written(metres)}", f"avoid={written([around])}")[0]
        == 0
    )


def test_planners_and_headings_are_chosen(folder):
    tracks = {}
    for words in (["planner=lawnmower"], ["planner=greedy", "planner.actions=2"]):
        run = run_of(folder)
        assert main(["next", run, f"results_dir={folder}", "budget=60", *words]) == 0
        tracks[words[0]] = (folder / "surveys" / run / "next" / "next.csv").read_text()
    assert len(set(tracks.values())) == 2
    status, files = plan(folder, "budget=60", "from=17.9702,-67.0400", "heading=90")
    assert status == 0
    first, second = pd.read_csv(files / "next.csv").iloc[:2].to_dict("records")
    assert (first["lat"], first["lon"]) == pytest.approx((17.9702, -67.04), abs=1e-8)
    assert second["x_m"] > first["x_m"]
    assert second["y_m"] == pytest.approx(first["y_m"], abs=1e-3)


NARROW = [[17.97, -67.0400], [17.97, -67.03999], [17.9711, -67.03999], [17.9711, -67.0400]]
BOW = [INSIDE[0], INSIDE[2], INSIDE[1], INSIDE[3]]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "the length of the track in metres, like budget=500"),
        (["budget=0"], "budget=0 is not possible"),
        (["budget=3"], "budget=3 is too small: one action is"),
        (["budget=1e9"], "budget=1e+09 is too large: a track has at most 20000 samples"),
        (["budget=90", "from=18.5,-67.04"], "km outside of the hull of the survey's track"),
        (["budget=90", "from=here"], "from=here is no position: give LAT,LON"),
        (["budget=90", "inside=[[40,10],[40,11],[41,11]]"], "inside= reaches "),
        (["budget=90", "inside=[[18,-67.1],[18,-67.2],[18.1,-67.2]]"], "outside of inside="),
        (["budget=90", "inside=[[1,2],[3,4]]"], "fewer than three corners"),
        (["budget=90", "inside=[[17,-69],[18,-69],[19,-69]]"], "polygon without area"),
        (["budget=90", f"inside={written(BOW)}"], "crosses itself, between its corners 1 and 3"),
        (["budget=90", "inside=[[17,-67],[18,-67],[500000,1900000]]"], "others that are none"),
        (["budget=90", "inside=[[a,b]]"], "is no polygon: give [[LAT,LON]"),
        (["budget=90", "inside=nowhere.geojson"], "inside=nowhere.geojson cannot be read"),
        (["budget=900", "turning_radius=400"], "turning_radius=400 does not fit: the largest"),
        (["budget=90", "step=70"], "step=70 is too long"),
        (["budget=90", f"avoid={written(INSIDE)}"], "in a no-go zone: give from= off all zones"),
        (["budget=90", f"inside={written(NARROW)}"], "outside of inside="),
        (["budget=90", "detector=local"], "infoplan next has no option 'detector'"),
        (["budget=90", "planner=uct,puct"], "several values"),
        (["budget=90", "planner=swift"], "planner"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_sentence(words, sentence, folder, capsys):
    assert main(["next", run_of(folder), f"results_dir={folder}", *words]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert len(said.splitlines()) == 1
    assert "unexpected" not in said


def test_no_room_to_move_is_told(folder, capsys):
    lat, lon = 17.9702, -67.04
    corner = [[lat, lon], [lat, lon + 4e-4], [lat + 4e-4, lon + 4e-4], [lat + 4e-4, lon]]
    words = ["budget=200", f"inside={written(corner)}", f"from={lat + 4e-6},{lon + 4e-6}"]
    assert plan(folder, *words, "heading=225")[0] == 2
    assert "no room to move from the start" in capsys.readouterr().err
    assert plan(folder, *words)[0] == 0


def test_a_mission_that_was_flown_is_no_survey(tmp_path, capsys):
    words = ["terrain=volcano", "detector=none", "budget=110", "grid=[5,5]", "seeds=1",
             "backend=sequential", "planner=random", "model.pilot_iterations=1",
             "model.iterations=1", f"results_dir={tmp_path}"]  # fmt: skip
    assert main(["run", *words]) == 0
    capsys.readouterr()
    assert main(["next", "random", f"results_dir={tmp_path}", "budget=90"]) == 2
    assert "run=random is no survey but a simulated mission" in capsys.readouterr().err
    assert main(["next", "bay", f"results_dir={tmp_path}", "budget=90"]) == 2
    assert "run=bay is not stored" in capsys.readouterr().err
