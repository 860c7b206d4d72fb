"""Logs are read whatever their form, and what is wrong with one is told with its place."""

import io
import re

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from infoplan.errors import UsageError
from infoplan.survey import read_log

pyproj = pytest.importorskip("pyproj")

LAT = 17.97 + 0.0001 * np.arange(12.0)
LON = -67.04 + 0.0002 * np.arange(12.0) ** 1.5
DEPTH = 6.0 + 0.25 * np.arange(12.0)


@pytest.fixture
def log(tmp_path):
    """Write a log, and read it."""

    def read(content, name="log.csv", **options):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_log(path, **options)

    return read


def table(header, rows, delimiter=","):
    return "\n".join([header, *(delimiter.join(map(str, row)) for row in rows)]) + "\n"


ROWS = list(zip(LAT.round(6), LON.round(6), DEPTH, strict=True))
PLAIN = table("lat,lon,depth", ROWS)


def on_plane(epsg=32619):
    return np.column_stack(
        pyproj.Transformer.from_crs(4326, epsg, always_xy=True).transform(
            [row[1] for row in ROWS], [row[0] for row in ROWS]
        )
    )


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("Latitude,Longitude,Depth_in_Feet", "ft"),
        ("LAT (deg),Lng [deg],Depth (m)", "m"),
        ("gps_latitude,gps_longitude,z", ""),
        ("GPSLatitude,GPSLongitude,WaterDepthFt", "ft"),
        ("lat,lon,Temperature (degC)", "degC"),
    ],
)
def test_names_and_units_are_recognised(log, header, unit):
    read = log(table(header, ROWS))
    assert read.unit == unit
    assert read.value == pytest.approx(DEPTH)
    assert read.crs == "EPSG:32619"
    assert np.abs(read.x - on_plane()).max() < 1e-6


@pytest.mark.parametrize(
    "content",
    [
        PLAIN.encode("utf-8-sig"),
        PLAIN.encode("utf-16"),
        ("# a note\n\n" + PLAIN.replace("\n", "\r\n")).encode(),
        PLAIN.replace(",", "\t").encode(),
        PLAIN.replace(",", ";").replace(".", ",").encode(),
        table("lat,lon,depth", [[f'"{cell}"' for cell in row] for row in ROWS]).encode(),
        PLAIN.replace("\n", ",\n").encode(),
    ],
    ids=["bom", "utf16", "comments", "tabs", "decimal commas", "quotes", "last comma"],
)
def test_forms_of_text(log, content):
    read = log(content)
    assert read.value == pytest.approx(DEPTH)
    assert np.abs(read.x - on_plane()).max() < 1e-6
    assert read.remarks == []


def test_columns_crs_and_unit_are_taken_from_the_user(log):
    rows = [(row[2], *place) for row, place in zip(ROWS, on_plane(32620), strict=True)]
    read = log(
        table("depth,a,b", rows), columns={"x": "a", "y": "b"}, crs="EPSG:32620", unit="feet"
    )
    assert read.unit == "ft"
    assert read.crs == "EPSG:32620"
    assert np.abs(read.x - on_plane(32620)).max() < 1e-9
    assert log(PLAIN, crs="EPSG:32620").x == pytest.approx(on_plane(32620))


def test_metres_need_no_plane_and_feet_become_metres(log):
    rows = [(i, i**2, i % 5) for i in range(12)]
    read = log(table("Easting (ft),Northing (m),value", rows))
    assert read.crs is None
    assert read.x[3] == pytest.approx([3 * 0.3048, 9.0])


def test_what_is_odd_is_counted_and_told(log):
    rows = [
        (f"2024-05-01T10:00:{second:02d}Z", *row)
        for second, row in zip([*range(10), 3, 11], ROWS, strict=True)
    ]
    rows[4] = (rows[4][0], rows[3][1], rows[3][2], "")
    text = table("time,lat,lon,depth", rows) + "2024-05-01T10:00:12Z,17.97,-67.03,six\n"
    read = log(text + "2024-05-01T10:00:13Z,,,6.5\n")
    assert read.remarks == [
        "1 line left out: line 14: depth 'six' is no number",
        "1 line without a position left out",
        "1 line is earlier than the one before: sorted by time",
        "1 sample without a value: kept, and never used",
        "1 sample where another was taken before: all kept",
    ]
    assert list(read.rows) == [0, 1, 2, 3, 10, 4, 5, 6, 7, 8, 9, 11]
    assert np.flatnonzero(np.isnan(read.value)) == [5]
    assert {row: str(reason) for row, reason in read.refused.items()} == {
        12: "depth 'six' is no number",
        13: "no position",
    }
    assert len(read.columns) == 14
    assert read.columns["depth"][12] == "six"


def test_date_and_time_of_day_are_put_together(log):
    rows = [("2024-05-01", "23:59:50", *row) for row in ROWS[:6]]
    rows += [("2024-05-02", "00:00:05", *row) for row in ROWS[6:]]
    rows[2] = ("2024-05-02", "00:00:09", *ROWS[2])
    read = log(table("Date,Time,lat,lon,depth", rows))
    assert read.time[-1] - read.time[0] == 19.0
    assert list(read.rows) == [0, 1, 3, 4, 5, 6, 7, 8, 9, 10, 11, 2]


def test_times_of_a_day_go_on_after_midnight(log):
    rows = [(f"{23 if i < 6 else 0}:0{i % 6}:00", *row) for i, row in enumerate(ROWS)]
    read = log(table("utc,lat,lon,depth", rows))
    assert list(read.rows) == list(range(12))
    assert read.time[-1] - read.time[0] == 3600 + 5 * 60


def test_gpx_with_extensions(log):
    points = "".join(
        f'<trkpt lat="{lat}" lon="{lon}"><ele>2</ele><time>2024-05-01T10:00:{i:02d}Z</time>'
        f'<extensions><n:sounder xmlns:n="urn:n"><n:depth>{depth}</n:depth></n:sounder>'
        "</extensions></trkpt>"
        for i, (lat, lon, depth) in enumerate(ROWS)
    )
    head = '<gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>'
    read = log(f"{head}{points}</trkseg></trk></gpx>", "track.gpx")
    assert read.value == pytest.approx(DEPTH)
    assert np.abs(read.x - on_plane()).max() < 1e-6
    assert read.time == pytest.approx(read.time[0] + np.arange(12))
    bare = log(f"{head}{points}</trkseg></trk></gpx>", "track.gpx", columns={"value": "ele"})
    assert bare.unit == "m"
    assert set(bare.value) == {2.0}


@pytest.mark.parametrize("form", ["NETCDF3_64BIT", "NETCDF4"])
def test_netcdf_trajectories(log, form):
    xarray = pytest.importorskip("xarray")
    filled = [np.append(values, np.nan).reshape(1, 13) for values in (LAT, LON, DEPTH)]
    names = ("latitude", "longitude", "sea_floor_depth_below_sea_surface")
    dataset = xarray.Dataset(
        {
            name: (("trajectory", "obs"), values, {"standard_name": standard, "units": unit})
            for name, values, standard, unit in zip(
                ("Y", "X", "depth"), filled, names, ("degrees_north", "degrees_east", "ft"),
                strict=True,
            )
        }
    )  # fmt: skip
    when = pd.to_datetime("2024-05-01") + pd.to_timedelta([*range(13)], unit="s")
    dataset["t"] = (("trajectory", "obs"), when.values.reshape(1, 13), {"standard_name": "time"})
    stream = io.BytesIO()
    engine = "scipy" if form == "NETCDF3_64BIT" else pytest.importorskip("h5netcdf").__name__
    stream.write(bytes(dataset.to_netcdf(format=form, engine=engine)))
    read = log(stream.getvalue(), "track.nc")
    assert read.unit == "ft"
    assert read.value == pytest.approx(DEPTH)
    assert read.crs == "EPSG:32619"
    assert read.time == pytest.approx(read.time[0] + np.arange(12))
    assert read.remarks == []


def test_parquet(log):
    fields = [
        pa.field("time", pa.timestamp("ms")), pa.field("lat", pa.float64()),
        pa.field("lon", pa.float64()), pa.field("depth", pa.float32(), metadata={"unit": "feet"}),
    ]  # fmt: skip
    when = pd.to_datetime("2024-05-01") + pd.to_timedelta([*range(12)], unit="s")
    columns = [pa.array(column) for column in (when, LAT, LON, DEPTH.astype(np.float32))]
    written = pa.Table.from_arrays(
        [column.cast(field.type) for column, field in zip(columns, fields, strict=True)],
        schema=pa.schema(fields),
    )
    stream = io.BytesIO()
    pq.write_table(written, stream)
    read = log(stream.getvalue(), "log.parquet")
    assert read.unit == "ft"
    assert read.value == pytest.approx(DEPTH)
    assert read.time == pytest.approx(read.time[0] + np.arange(12))


MALFORMED = {
    "empty": ("", "log.csv is empty: give a line of column names, then a line a sample"),
    "no header": (table("17.9,-67.0,6.1", ROWS), "line 1 holds numbers and no column names"),
    "no position": (PLAIN.replace("lon", "speed"), "no columns of positions that are recognised "
                    "among lat, speed, depth"),
    "two values": (table("lat,lon,bottom depth,probe depth", [(*row, 1) for row in ROWS]),
                   "several columns that could be value, bottom depth, probe depth"),
    "no samples": ("# a note\nlat,lon,depth\n", "log.csv has a header and no samples"),
    "words": (PLAIN.replace(".", "°"), "line 2, column 1 (lat): '17°97' is no number, and 12 of "
              "12 lines are wrong"),
    "swapped": (table("lat,lon,depth", [(row[1] * 2, row[0], row[2]) for row in ROWS]),
                "line 2, column 1 (lat): -134.08 is beyond 90"),
    "open quote": (PLAIN.replace("17.9702", '"17.9702'), "line 4: a double quote is not closed"),
    "two of a name": (PLAIN.replace("lon", "lat"), "line 1, column 2 is the second of the name"),
    "one column": (PLAIN.replace(",", " "), "line 1: there is one column"),
    "ragged": (PLAIN.replace(",6", ",6,1,2").replace(",7", ",7,1,2"),
               "line 2: 5 fields where the header has 3, and 8 of 12 lines are wrong"),
    "binary": (b"\x89HDF\r\n\x1a\n" + bytes(64), "log.csv is no text"),
    "junk": (bytes(range(256)) * 8, "log.csv is no text"),
    "a page": (b"<!DOCTYPE html>\n<html><body>Please, sign in</body></html>\n",
               "log.csv is a page of a website"),
    "all missing": (table("lat,lon,depth", [(*row[:2], "") for row in ROWS]),
                    "12 samples with a position, 0 of them with a value: it takes 10"),
    "two delimiters": (PLAIN.replace(",", ";").replace(";", ",", 2),
                       "line 2: semicolons part its columns, commas those of the header"),
    "utf16 without mark": (PLAIN.encode("utf-16-le"), "log.csv is a text in UTF-16 without its "
                           "mark: save it as UTF-8"),
    "two rows": (table("lat,lon,depth", ROWS[:2]), "2 samples with a position"),
    "few": (table("lat,lon,depth", ROWS[:4]), "4 samples with a position, 4 of them with a value"),
    "no times": (table("time,lat,lon,depth", [("noon", *row) for row in ROWS]),
                 "line 2, column 1 (time): 'noon' is no time"),
    "a point": (table("x,y,z", [(1, 2, row[2]) for row in ROWS]), "lies on a line, or in a point"),
    "pole": (table("lat,lon,depth", [(row[0] + 70, *row[1:]) for row in ROWS]),
             "latitude 87.97, where there is no UTM zone"),
}  # fmt: skip


@pytest.mark.parametrize("case", MALFORMED)
def test_a_malformed_log_gets_one_sentence(log, case):
    content, sentence = MALFORMED[case]
    with pytest.raises(UsageError) as refused:
        log(content)
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("content", "name", "sentence"),
    [
        ("<gpx><trk>\n<trkseg></trk></gpx>", "track.gpx", "line 2, column 11: it is no whole XML"),
        ('<!DOCTYPE g [<!ENTITY a "b">]><gpx/>', "track.gpx", "declares entities"),
        ("<gpx/>", "track.gpx", "no track, route or waypoints"),
        ("<gpx><trk><trkseg/></trk></gpx>", "track.gpx", "no track, route or waypoints"),
        (bytes(range(256)), "track.gpx", "line 1, column 1: it is no whole XML"),
        ("<!doctype HTML><html/>", "track.gpx", "track.gpx is a page of a website"),
        (b"PAR1 and no more", "log.parquet", "log.parquet is no whole Parquet file"),
        (b"CDF\x01 and no more", "log.nc", "log.nc is no whole NetCDF file"),
        ("", "log.xlsx", "no log that is read: give one of .cdf, .csv"),
    ],
)
def test_other_malformed_files_too(log, content, name, sentence):
    with pytest.raises(UsageError, match=re.escape(sentence)):
        log(content, name)


@pytest.mark.parametrize("form", ["scipy", "h5netcdf", "parquet"])
@pytest.mark.parametrize("share", [0.5, 0.9])
def test_a_file_that_ends_too_early_is_told(log, form, share):
    if form == "parquet":
        stream = io.BytesIO()
        pq.write_table(pa.table({"lat": LAT, "lon": LON, "depth": DEPTH}), stream)
        content, name, kind = stream.getvalue(), "log.parquet", "Parquet"
    else:
        xarray = pytest.importorskip("xarray")
        pytest.importorskip(form)
        columns = {"lat": LAT, "lon": LON, "depth": DEPTH}
        dataset = xarray.Dataset({name: (("obs",), values) for name, values in columns.items()})
        content, name, kind = bytes(dataset.to_netcdf(engine=form)), "log.nc", "NetCDF"
    with pytest.raises(UsageError, match=f"{name} is no whole {kind} file: copy it once more"):
        log(content[: int(share * len(content))], name)


def test_a_folder_is_no_log(tmp_path):
    (tmp_path / "log.csv").mkdir()
    with pytest.raises(UsageError, match="is a folder: name a file"):
        read_log(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"columns": {"value": "dept"}}, "no column of log.csv (did you mean 'depth'?)"),
        ({"columns": {"vale": "depth"}}, "did you mean 'value'?"),
        ({"crs": "EPSG:4326"}, "crs=EPSG:4326 is WGS 84, no plane in metres"),
        ({"crs": "here"}, "crs=here is not known"),
    ],
)
def test_options_that_do_not_fit(log, options, sentence):
    with pytest.raises(UsageError) as refused:
        log(PLAIN, **options)
    assert sentence in str(refused.value)


def test_the_plainer_name_is_taken(log):
    rows = [(*row, 99.0) for row in ROWS]
    assert log(table("lat,lon,Depth_in_Feet,probe depth", rows)).value == pytest.approx(DEPTH)
    rows = [(*row[:2], 99.0, row[2]) for row in ROWS]
    assert log(table("lat,lon,probe depth,depth (ft)", rows)).value == pytest.approx(DEPTH)
