"""Geographers' formats, written by rasterio: elevations, place, unit; large and bad files."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rasterio.transform import Affine
from usgs_dem import write_dem

from infoplan.errors import UsageError
from infoplan.terrain import grids, load_terrain, rasters

MAP = np.random.default_rng(1).integers(500, 2500, (13, 17)).astype(np.int16)
"""As in a file: the first row is the north."""

NORTH_UP = Affine(30.0, 0.0, 559_995.0, 0.0, -30.0, 5_120_025.0)
"""The nodes lie at multiples of their distance, as the USGS has them."""
UTM = "EPSG:32610"


def write(path: Path, elevation: np.ndarray, driver: str = "GTiff", **profile) -> Path:
    """Write a map, in formats that cannot be created by way of a GeoTIFF."""
    if driver == "USGSDEM":
        place = profile.get("transform", NORTH_UP)
        return write_dem(path, elevation, place.c + place.a / 2, place.f + place.e / 2, place.a)
    profile = {"crs": UTM, "transform": NORTH_UP, "nodata": None, "unit": None} | profile
    unit, scale = profile.pop("unit"), profile.pop("scale", (1.0, 0.0))
    tif = path if driver == "GTiff" else path.with_name("source.tif")
    rows, columns = elevation.shape[-2:]
    with rasterio.open(
        tif, "w", driver="GTiff", height=rows, width=columns, dtype=elevation.dtype,
        count=1 if elevation.ndim == 2 else len(elevation), **profile,
    ) as out:  # fmt: skip
        out.write(elevation if elevation.ndim == 3 else elevation[None])
        if unit:
            out.units = (unit,)
        if scale != (1.0, 0.0):
            out.scales, out.offsets = (scale[0],), (scale[1],)
    if tif != path:
        with rasterio.Env(GDAL_PAM_ENABLED="NO"):
            rasterio.shutil.copy(tif, path, driver=driver)
        tif.unlink()
    return path


def srtm(folder: Path) -> tuple[Path, np.ndarray]:
    """Write an SRTM file of its smallest size."""
    rows, columns = np.mgrid[0:1201, 0:1201]
    elevation = (1000 + rows - columns // 3).astype(np.int16)
    place = Affine(1 / 1200, 0, -123 - 1 / 2400, 0, -1 / 1200, 47 + 1 / 2400)
    path = write(folder / "N46W123.hgt", elevation, "SRTMHGT", crs="EPSG:4326", transform=place)
    return path, elevation


def refusal(path: Path, **options) -> str:
    with pytest.raises(UsageError) as caught:
        load_terrain("file", path=path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


FORMATS = [("map.tif", "GTiff"), ("map.TIFF", "GTiff"), ("map.asc", "AAIGrid"),
           ("map.dem", "USGSDEM")]  # fmt: skip


class TestFormats:
    @pytest.mark.parametrize(("name", "driver"), FORMATS)
    @settings(
        max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
    )
    @given(
        seed=st.integers(0, 1000),
        shape=st.tuples(st.integers(2, 30), st.integers(2, 30)),
        west=st.integers(40_000, 60_000),
        north=st.integers(400_000, 600_000),
    )
    def test_elevations_and_place_come_back_the_south_first(
        self, name, driver, seed, shape, west, north, tmp_path
    ):
        elevation = np.random.default_rng(seed).integers(-400, 8000, shape).astype(np.int16)
        place = Affine(10.0, 0, west * 10.0 - 5, 0, -10.0, north * 10.0 + 5)
        path = write(tmp_path / name, elevation, driver, transform=place)
        terrain = load_terrain("file", path=path)
        np.testing.assert_array_equal(terrain.elevation, elevation[::-1])
        rows, columns = shape
        expected = (west, west + columns - 1, north - rows + 1, north)
        np.testing.assert_allclose(np.array(terrain.world) / 10, expected)
        assert terrain.name == "file-map"

    def test_srtm(self, tmp_path):
        path, elevation = srtm(tmp_path)
        terrain = load_terrain("file", path=path)
        np.testing.assert_array_equal(terrain.elevation, elevation[::-1])
        np.testing.assert_allclose(terrain.world, (-123, -122, 46, 47))
        assert (terrain.unit, terrain.crs) == ("m", "EPSG:4326")

    @pytest.mark.parametrize("turned", [False, True])
    @pytest.mark.parametrize("mirrored", [False, True])
    def test_north_is_up_and_east_is_right_whatever_the_file_s_order(
        self, turned, mirrored, tmp_path
    ):
        rows, columns = MAP.shape
        dx, west, dy, north = NORTH_UP.a, NORTH_UP.c, NORTH_UP.e, NORTH_UP.f
        stored = MAP
        if turned:
            dy, north, stored = -dy, north + rows * dy, stored[::-1]
        if mirrored:
            dx, west, stored = -dx, west + columns * dx, stored[:, ::-1]
        place = Affine(dx, 0, west, 0, dy, north)
        terrain = load_terrain("file", path=write(tmp_path / "map.tif", stored, transform=place))
        np.testing.assert_array_equal(terrain.elevation, MAP[::-1])
        np.testing.assert_allclose(terrain.world, (560_010, 560_490, 5_119_650, 5_120_010))

    def test_a_picture_without_a_place_has_its_first_row_on_top(self, tmp_path):
        with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
            path = write(tmp_path / "map.tif", MAP, crs=None, transform=Affine.identity())
        terrain = load_terrain("file", path=path)
        np.testing.assert_array_equal(terrain.elevation, MAP[::-1])
        assert (terrain.world, terrain.crs) == (None, "")

    def test_a_map_that_is_not_along_its_coordinates_is_refused(self, tmp_path):
        path = write(tmp_path / "map.tif", MAP, transform=Affine(30, 5, 0, 5, -30, 0))
        assert "do not run from west to east" in refusal(path)

    def test_every_real_type_scale_and_offset(self, tmp_path):
        for dtype in ("uint8", "int16", "uint16", "int32", "float32", "float64"):
            path = write(tmp_path / "map.tif", (MAP % 200).astype(dtype))
            np.testing.assert_array_equal(
                load_terrain("file", path=path).elevation, (MAP % 200)[::-1]
            )
        path = write(tmp_path / "map.tif", MAP, scale=(0.1, 50.0))
        np.testing.assert_allclose(load_terrain("file", path=path).elevation, MAP[::-1] * 0.1 + 50)

    def test_the_coordinate_system_is_named(self, tmp_path):
        assert load_terrain("file", path=write(tmp_path / "map.tif", MAP)).crs == UTM
        own = "+proj=tmerc +lon_0=-121.7 +ellps=clrk66 +units=m"
        path = write(tmp_path / "own.tif", MAP, crs=own)
        assert load_terrain("file", path=path).crs.startswith("+proj=tmerc")

    def test_place_follows_the_nodes_that_are_kept_and_goes_when_the_map_is_turned(self, tmp_path):
        path = write(tmp_path / "map.tif", MAP)
        cut = load_terrain("file", path=path, crop=[2, 10, 3, -4])
        np.testing.assert_allclose(cut.world, (560_100, 560_370, 5_119_710, 5_119_920))
        coarse = load_terrain("file", path=path, shape=[13, 1 + 16 // 2])
        np.testing.assert_allclose(coarse.world[2:], (5_119_650, 5_120_010))
        turned = load_terrain("file", path=path, orientation=2)
        assert (turned.world, turned.crs) == (None, "")

    def test_files_beside_it_are_not_looked_at(self, tmp_path):
        path = write(tmp_path / "map.tif", MAP, nodata=-1)
        before = load_terrain("file", path=path)
        (tmp_path / "map.tif.aux.xml").write_text(
            "<PAMDataset><PAMRasterBand band='1'><NoDataValue>"
            f"{MAP[0, 0]}</NoDataValue><UnitType>ft</UnitType></PAMRasterBand></PAMDataset>"
        )
        after = load_terrain("file", path=path)
        assert (after.unit, after.sha256) == (before.unit, before.sha256)
        np.testing.assert_array_equal(after.elevation, before.elevation)


class TestUnits:
    @pytest.mark.parametrize(
        ("stated", "unit"), [("m", "m"), ("metre", "m"), ("ft", "ft"), ("foot", "ft"), (None, "m"),
                             ("US survey foot", "us-ft"), ("degC", "degC")],
    )  # fmt: skip
    def test_the_file_s_own(self, stated, unit, tmp_path):
        assert load_terrain("file", path=write(tmp_path / "map.tif", MAP, unit=stated)).unit == unit

    def test_a_known_one_is_converted(self, tmp_path):
        path = write(tmp_path / "map.tif", MAP, unit="m")
        terrain = load_terrain("file", path=path, unit="ft")
        np.testing.assert_allclose(terrain.elevation, MAP[::-1] / 0.3048)
        assert (terrain.name, terrain.unit) == ("file-map-ft", "ft")

    def test_an_unknown_one_cannot_be(self, tmp_path):
        path = write(tmp_path / "map.tif", MAP, unit="degC")
        with pytest.raises(UsageError, match=r"terrain\.unit=m does not fit .* in degC"):
            load_terrain("file", path=path, unit="m")

    def test_of_a_usgs_file(self, tmp_path):
        assert load_terrain("file", path=write(tmp_path / "map.dem", MAP, "USGSDEM")).unit == "m"


class TestMissing:
    @pytest.mark.parametrize(
        ("name", "driver", "nodata"),
        [
            ("map.tif", "GTiff", -9999),
            ("map.asc", "AAIGrid", -9999),
            ("map.dem", "USGSDEM", -32767),
        ],
    )
    def test_refused_or_filled(self, name, driver, nodata, tmp_path):
        broken = MAP.copy()
        broken[0, :2] = nodata
        path = write(tmp_path / name, broken, driver, nodata=nodata)
        assert "has 2 nodes that are missing" in refusal(path)
        filled = load_terrain("file", path=path, nodata="fill").elevation
        np.testing.assert_array_equal(filled[:-1], MAP[:0:-1])
        np.testing.assert_array_equal(filled[-1, 2:], MAP[0, 2:])
        assert filled[-1, 1] in (MAP[0, 2], MAP[1, 1])
        assert filled[-1, 0] == MAP[1, 0]

    @pytest.mark.parametrize("nodata", ["refuse", "fill"])
    def test_everywhere(self, nodata, tmp_path):
        path = write(tmp_path / "map.tif", np.full((4, 5), -9999, np.int16), nodata=-9999)
        assert "holds no elevation at all" in refusal(path, nodata=nodata)

    def test_nan_is_missing_too(self, tmp_path):
        broken = MAP.astype(np.float32)
        broken[3, 4] = np.nan
        assert "has 1 nodes that are missing" in refusal(write(tmp_path / "map.tif", broken))


class TestLarge:
    def test_more_nodes_than_are_read_are_coarsened_if_a_shape_is_given(
        self, tmp_path, monkeypatch
    ):
        blocks = np.random.default_rng(0).normal(1000, 200, (32, 40)).astype(np.float32)
        path = write(tmp_path / "map.tif", np.kron(blocks, np.ones((2, 2), np.float32)),
                     tiled=True, blockxsize=16, blockysize=16)  # fmt: skip
        monkeypatch.setattr(rasters, "MAX_NODES", 32 * 40)
        assert "give terrain.shape=[rows,columns]" in refusal(path)
        terrain = load_terrain("file", path=path, shape=[32, 40])
        np.testing.assert_allclose(terrain.elevation, blocks[::-1], rtol=1e-6)

    def test_sizes_that_are_no_multiples_of_the_block(self, tmp_path, monkeypatch):
        rows, columns = np.mgrid[0:71, 0:71].astype(np.float32)
        path = write(tmp_path / "map.tif", 1000 + rows - 2 * columns,
                     tiled=True, blockxsize=16, blockysize=16)  # fmt: skip
        for module in (rasters, grids):
            monkeypatch.setattr(module, "MAX_NODES", 1280)
        # Blocks of 2 x 2 would be 36 x 36.
        terrain = load_terrain("file", path=path, shape=[24, 24])
        middle = 71 / 24 * (np.arange(24) + 0.5) - 0.5
        expected = 1000 + middle[::-1, None] - 2 * middle
        np.testing.assert_allclose(terrain.elevation, expected, atol=1.0)

    @settings(max_examples=300, deadline=None)
    @given(rows=st.integers(2, 30_000), columns=st.integers(2, 30_000), most=st.integers(4, 40_000))
    def test_the_block_is_the_smallest_that_leaves_few_enough_nodes(self, rows, columns, most):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(rasters, "MAX_NODES", most)
            shape = rasters._shape_read(SimpleNamespace(height=rows, width=columns))
        blocks = np.arange(1, 30_001)
        shapes = np.stack([-(-rows // blocks), -(-columns // blocks)], axis=1)
        assert shape == tuple(shapes[np.argmax(shapes.prod(axis=1) <= most)])

    def test_missing_elevations_are_left_out_of_the_means(self, tmp_path, monkeypatch):
        fine = np.kron(MAP[:12, :16], np.ones((2, 2), np.int16))
        fine[0, 0] = -9999
        path = write(tmp_path / "map.tif", fine, nodata=-9999)
        monkeypatch.setattr(rasters, "MAX_NODES", 12 * 16)
        monkeypatch.setattr(rasters.math, "prod", lambda _: 0)
        terrain = load_terrain("file", path=path, shape=[12, 16])
        np.testing.assert_allclose(terrain.elevation, MAP[:12, :16][::-1], rtol=1e-6)

    def test_sparse_files_that_announce_too_much(self, tmp_path):
        path = tmp_path / "map.tif"
        with rasterio.open(path, "w", driver="GTiff", height=2**20, width=2**20, count=1,
                           dtype="uint8", tiled=True, SPARSE_OK=True, BIGTIFF="YES",
                           transform=NORTH_UP):  # fmt: skip
            pass
        assert "has 1048576 x 1048576 nodes, too many to be read" in refusal(path)
        assert "too many" in refusal(path, shape=[50, 50])

    def test_bad_files_take_no_memory(self, tmp_path):
        """Read each in a process of its own that may not grow by what the file announces."""
        files = {
            "header.asc": "ncols 30000\nnrows 30000\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3\n",
            "short.csv": "1,2,3\n" + "4," * 100,
        }
        for name, text in files.items():
            (tmp_path / name).write_text(text)
        header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (5000, 5000), }\n"
        (tmp_path / "header.npy").write_bytes(b"\x93NUMPY\x01\x00\x43\x00" + header + bytes(80))
        dem = write(tmp_path / "whole.dem", MAP, "USGSDEM").read_bytes()
        (tmp_path / "whole.dem").unlink()
        (tmp_path / "cut.dem").write_bytes(dem[:1500])
        code = """
import resource, sys
from infoplan.errors import UsageError
from infoplan.terrain import load_terrain
import rasterio, scipy.ndimage
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for path in sys.argv[1:]:
    try:
        load_terrain("file", path=path, nodata="fill", shape=[10, 10])
    except UsageError as error:
        print(error)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""
        paths = sorted(map(str, tmp_path.iterdir()))
        done = subprocess.run(
            [sys.executable, "-c", code, *paths], capture_output=True, text=True, check=True
        )
        *messages, grown = done.stdout.splitlines()
        assert len(messages) == len(paths) == 4
        assert int(grown) < 64 * 1024  # kilobytes
        assert done.stderr == ""


class TestBadFiles:
    @pytest.mark.parametrize(("name", "driver"), FORMATS)
    @pytest.mark.parametrize("keep", [0.0, 0.1, 0.5, 0.9])
    def test_cut_short(self, name, driver, keep, tmp_path, capfd):
        elevation = np.random.default_rng(0).integers(500, 2500, (40, 30)).astype(np.int16)
        content = write(tmp_path / name, elevation, driver).read_bytes()
        path = tmp_path / f"cut-{name}"
        path.write_bytes(content[: int(keep * len(content))])
        assert "cut short" in refusal(path)
        assert capfd.readouterr().err == ""

    def test_an_srtm_file_cut_short_or_misnamed(self, tmp_path):
        path, _ = srtm(tmp_path)
        other = path.rename(tmp_path / "hills.hgt")
        assert "a name like N46W123.hgt" in refusal(other)
        path.write_bytes(other.read_bytes()[:-2])
        assert "cut short" in refusal(path)

    @pytest.mark.parametrize("name", ["map.tif", "map.dem", "N46W123.hgt", "map.asc"])
    @pytest.mark.parametrize("content", [b"", b"II*\x00", b"\x93NUMPY", b"P5 3 3 255\n" + bytes(9)])
    def test_something_else(self, name, content, tmp_path, capfd):
        path = tmp_path / name
        path.write_bytes(content)
        assert "is not a readable" in refusal(path)
        assert capfd.readouterr().err == ""

    def test_a_list_of_other_files_is_not_followed(self, tmp_path):
        source = write(tmp_path / "source.tif", MAP)
        rasterio.shutil.copy(source, tmp_path / "map.vrt", driver="VRT")
        path = (tmp_path / "map.vrt").rename(tmp_path / "map.tif")
        assert "is not a readable GeoTIFF" in refusal(path)

    def test_too_few_rows(self, tmp_path):
        for shape in ((1, 17), (13, 1)):
            path = write(tmp_path / "map.tif", MAP[: shape[0], : shape[1]])
            assert "at least 2 rows and 2 columns" in refusal(path)

    def test_several_bands_and_complex_numbers(self, tmp_path):
        path = write(tmp_path / "map.tif", np.stack([MAP, MAP, MAP]))
        assert "has 3 bands" in refusal(path)
        assert "must be real" in refusal(write(tmp_path / "map.tif", MAP.astype(np.complex64)))

    @pytest.mark.parametrize(("name", "driver"), FORMATS)
    @settings(
        max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
    )
    @given(place=st.integers(0, 1200), byte=st.integers(0, 255))
    def test_mangled_files_are_refused_or_give_a_finite_map(
        self, name, driver, place, byte, tmp_path
    ):
        path = tmp_path / name
        if not (tmp_path / "whole").exists():
            write(path, MAP, driver).rename(tmp_path / "whole")
        content = bytearray((tmp_path / "whole").read_bytes())
        content[place % len(content)] = byte
        path.write_bytes(content)
        try:
            terrain = load_terrain("file", path=path)
        except UsageError:
            return
        assert np.all(np.isfinite(terrain.elevation))
        assert terrain.elevation.size <= grids.MAX_NODES


def test_without_rasterio_one_sentence_names_the_extra(tmp_path, monkeypatch):
    path = write(tmp_path / "map.tif", MAP)
    monkeypatch.setitem(sys.modules, "rasterio", None)
    assert "pip install 'infoplan[geo]'" in refusal(path)
