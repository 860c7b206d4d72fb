"""Geographers' formats, written by rasterio: elevations, place, unit; large and bad files."""

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rasterio.transform import Affine
from scipy.ndimage import gaussian_filter, map_coordinates
from usgs_dem import write_dem

from infoplan.errors import UsageError
from infoplan.terrain import esri, files, grids, load_terrain, rasters

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


def gaussian(elevation: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Resample by SciPy's filter and interpolation: what the README says, computed by others."""
    factors = [max(old / new, 1.0) for old, new in zip(elevation.shape, shape, strict=True)]
    smooth = gaussian_filter(
        elevation, [(factor - 1) / 2 for factor in factors], mode="mirror", truncate=4
    )
    places = [
        (np.arange(new) + 0.5) * old / new - 0.5
        for old, new in zip(elevation.shape, shape, strict=True)
    ]
    return map_coordinates(smooth, np.meshgrid(*places, indexing="ij"), order=1, mode="mirror")


def add_overviews(path: Path, *, outside: bool = False) -> Path:
    """Add overviews made of single nodes, in the file or beside it."""
    with rasterio.Env(TIFF_USE_OVR="YES" if outside else "NO"):
        with rasterio.open(path, "r" if outside else "r+") as out:
            if not outside:
                out.build_overviews([2, 4, 8], rasterio.enums.Resampling.nearest)
        if outside:
            whole = path.read_bytes()
            with rasterio.open(path, "r+") as out:
                out.build_overviews([2, 4, 8], rasterio.enums.Resampling.nearest)
            path.write_bytes(whole)
    return path


def checkerboard(rows: int, columns: int) -> np.ndarray:
    """Squares of one node, 0, 200, 100, 0: the mean of every four is 75."""
    return np.tile(np.array([[0, 200], [100, 0]], np.uint8), (rows // 2 + 1, columns // 2 + 1))[
        :rows, :columns
    ]


class TestLarge:
    @pytest.fixture(params=[True, False], ids=["resampled while read", "read whole"])
    def limit(self, request, monkeypatch):
        """Both ways to the same numbers: as a map above the limit, and below it."""
        if request.param:
            monkeypatch.setattr(grids, "MAX_NODES", 2000)
            monkeypatch.setattr(rasters, "WINDOW", 500)

    @pytest.mark.parametrize(("name", "driver"), [("map.tif", "GTiff"), ("map.asc", "AAIGrid")])
    @pytest.mark.parametrize("tiled", [True, False])
    def test_resampling_is_the_documented_filter_of_all_nodes(
        self, name, driver, tiled, limit, tmp_path, monkeypatch
    ):
        monkeypatch.setattr(esri, "CHUNK", 1000)
        fine = np.random.default_rng(0).normal(1000, 200, (83, 131)).astype(np.float32)
        profile = {"tiled": True, "blockxsize": 16, "blockysize": 16} if tiled else {}
        path = write(tmp_path / name, fine, driver, **profile)
        for shape in ([20, 30], [7, 90], [41, 2]):
            terrain = load_terrain("file", path=path, shape=shape)
            np.testing.assert_allclose(terrain.elevation, gaussian(fine[::-1], shape), rtol=1e-6)

    @pytest.mark.parametrize("outside", [True, False])
    def test_overviews_are_not_looked_at(self, outside, limit, tmp_path):
        fine = checkerboard(96, 128)
        path = write(tmp_path / "map.tif", fine, tiled=True, blockxsize=16, blockysize=16)
        before = load_terrain("file", path=path, shape=[12, 16])
        np.testing.assert_allclose(before.elevation, 75.0, atol=0.05)
        after = load_terrain("file", path=add_overviews(path, outside=outside), shape=[12, 16])
        np.testing.assert_array_equal(after.elevation, before.elevation)

    @pytest.mark.long
    def test_a_map_above_the_true_limit_is_the_mean_of_its_nodes(self, tmp_path):
        fine = checkerboard(5800, 5800)
        profile = {"tiled": True, "blockxsize": 256, "blockysize": 256, "compress": "deflate"}
        path = write(tmp_path / "map.tif", fine, **profile)
        blocks = fine[::-1].reshape(580, 10, 580, 10).mean(axis=(1, 3))
        before = load_terrain("file", path=path, shape=[580, 580])
        np.testing.assert_allclose(before.elevation, blocks, atol=0.05)
        after = load_terrain("file", path=add_overviews(path), shape=[580, 580])
        np.testing.assert_array_equal(after.elevation, before.elevation)

    def test_a_shape_is_needed_above_the_limit(self, tmp_path, monkeypatch):
        monkeypatch.setattr(grids, "MAX_NODES", 200)
        for name, driver in FORMATS[:3]:
            message = refusal(write(tmp_path / name, MAP, driver))
            assert "give terrain.shape=[rows,columns]" in message

    def test_digest_above_the_limit_is_not_that_of_versions_that_took_means_first(
        self, tmp_path, monkeypatch
    ):
        path = write(tmp_path / "map.tif", MAP)
        below = load_terrain("file", path=path, shape=[5, 5])
        monkeypatch.setattr(grids, "MAX_NODES", 200)
        above = load_terrain("file", path=path, shape=[5, 5])
        np.testing.assert_allclose(above.elevation, below.elevation)
        assert above.sha256 != below.sha256

    def test_missing_elevations_are_left_out_of_the_means(self, tmp_path, monkeypatch):
        fine = np.full((40, 60), 500, np.int16)
        fine[:, 30:] = 800
        fine[3:30, 3:12] = -9999
        fine[8, 40] = -1
        path = write(tmp_path / "map.tif", fine, nodata=-9999)
        monkeypatch.setattr(grids, "MAX_NODES", 1000)
        assert f"has {27 * 9} nodes that are missing" in refusal(path, shape=[20, 30])
        terrain = load_terrain("file", path=path, shape=[20, 30], nodata=-1)
        np.testing.assert_allclose(terrain.elevation[:, :13], 500.0)
        np.testing.assert_allclose(terrain.elevation[:, 17:], 800.0)

    def test_files_too_large_for_memory_are_read_where_they_are(self, tmp_path, monkeypatch):
        for name, driver in FORMATS[:3]:
            path = write(tmp_path / name, MAP, driver)
            before = load_terrain("file", path=path)
            with monkeypatch.context() as patch:
                patch.setattr(files, "IN_MEMORY", 10)
                patch.setattr(files.archives, "IN_MEMORY", 10)
                after = load_terrain("file", path=path)
                with zipfile.ZipFile(tmp_path / "map.zip", "w") as out:
                    out.write(path, name)
                packed = load_terrain("file", path=tmp_path / "map.zip")
            for other in (after, packed):
                assert (other.sha256, other.world) == (before.sha256, before.world)
                np.testing.assert_array_equal(other.elevation, before.elevation)

    def test_one_that_changes_meanwhile_is_refused(self, tmp_path, monkeypatch):
        path = write(tmp_path / "map.tif", MAP)
        monkeypatch.setattr(files, "IN_MEMORY", 10)
        read = rasters.read_raster

        def changing(*arguments):
            grid = read(*arguments)
            with path.open("r+b") as stream:
                stream.seek(-1, 2)
                stream.write(b"\x07")
            return grid

        monkeypatch.setattr(rasters, "read_raster", changing)
        assert "changed while it was read" in refusal(path)

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

    def test_a_picture_is_no_map(self, tmp_path):
        path = tmp_path / "map.tif"
        with rasterio.open(
            path, "w", driver="GTiff", height=3, width=4, count=1, dtype="uint8", crs=UTM,
            transform=NORTH_UP, photometric="palette",
        ) as out:  # fmt: skip
            out.write(MAP[:3, :4].astype(np.uint8)[None])
            out.write_colormap(1, {0: (255, 0, 0, 255), 200: (0, 0, 255, 255)})
        assert "numbers stand for colours, not elevations" in refusal(path)

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
