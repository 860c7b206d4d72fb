"""Maps in NumPy's files and in texts: what is read, and what is refused in which words."""

import hashlib
import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from infoplan.errors import UsageError
from infoplan.terrain import grids, load_terrain, texts

MAP = np.arange(12.0).reshape(3, 4)


def saved(folder: Path, array, name: str = "map.npy", **options) -> Path:
    path = folder / name
    np.save(path, array, **options)
    return path


@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<f4", "<f2", "<i2", ">i4", "u1", "<u8"])
def test_every_real_type_is_read(dtype, tmp_path):
    path = saved(tmp_path, MAP.astype(dtype))
    terrain = load_terrain("file", path=path)
    np.testing.assert_array_equal(terrain.elevation, MAP)
    assert terrain.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_column_major_files_are_read(tmp_path):
    terrain = load_terrain("file", path=saved(tmp_path, np.asfortranarray(MAP)))
    np.testing.assert_array_equal(terrain.elevation, MAP)
    assert terrain.elevation.flags.c_contiguous


def test_files_of_format_version_2_and_3_are_read(tmp_path):
    for version in ((2, 0), (3, 0)):
        path = tmp_path / "map.npy"
        with path.open("wb") as file:
            np.lib.format.write_array(file, MAP, version=version)
        np.testing.assert_array_equal(load_terrain("file", path=path).elevation, MAP)


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("hills.npy", "file-hills"),
        ("My hills (2).npy", "file-My-hills-2"),
        ("a_b-c.d=e.npy", "file-a_b-c-d-e"),
        ("山.npy", "file-map"),
    ],
)
def test_name_is_fit_for_a_folder(file, name, tmp_path):
    assert load_terrain("file", path=saved(tmp_path, MAP, file)).name == name


def test_unit_is_metres_unless_given(tmp_path):
    path = saved(tmp_path, MAP)
    assert load_terrain("file", path=path).unit == "m"
    assert load_terrain("file", path=str(path), unit="dBm").unit == "dBm"


def test_home_is_expanded(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    saved(tmp_path, MAP)
    assert load_terrain("file", path="~/map.npy").name == "file-map"


def refusal(path, **options) -> str:
    with pytest.raises(UsageError) as caught:
        load_terrain("file", path=path, **options)
    message = str(caught.value)
    assert "\n" not in message
    if path is not None:
        assert str(path) in message
    return message


def test_no_path():
    assert "needs terrain.path" in refusal(None)


def test_missing_file(tmp_path):
    assert "names no file that exists" in refusal(tmp_path / "nothing.npy")


def test_folder(tmp_path):
    assert "names a folder" in refusal(tmp_path)


@pytest.mark.parametrize(
    "content",
    [b"", b"x", b"ncols 4\nnrows 3\n", b"\x93NUMPY", b"\x93NUMPY\x01\x00\x76\x00{'descr'"],
    ids=["empty", "one byte", "text", "magic only", "half a header"],
)
def test_not_an_npy_file(content, tmp_path):
    path = tmp_path / "map.npy"
    path.write_bytes(content)
    assert "is not a .npy file, or it is damaged" in refusal(path)


def test_other_endings(tmp_path):
    message = refusal(saved(tmp_path, MAP).rename(tmp_path / "map.numpy"))
    assert "ends in .npy, .npz, .csv" in message
    assert "did you mean '.npy'" in message


def test_endings_may_be_capitals(tmp_path):
    path = saved(tmp_path, MAP).rename(tmp_path / "MAP.NPY")
    np.testing.assert_array_equal(load_terrain("file", path=path).elevation, MAP)


def test_unknown_format_version(tmp_path):
    path = saved(tmp_path, MAP)
    content = bytearray(path.read_bytes())
    content[6:8] = 2, 7
    path.write_bytes(content)
    assert "is not a .npy file" in refusal(path)


def test_truncated(tmp_path):
    path = saved(tmp_path, MAP)
    path.write_bytes(path.read_bytes()[:-1])
    assert "cut short: it announces 96 bytes of elevations and has 95" in refusal(path)


def test_header_that_claims_a_huge_array_takes_no_memory(tmp_path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999, 9999999999), }\n"
    path = tmp_path / "map.npy"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(80))
    assert "cut short" in refusal(path)


def test_more_nodes_than_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(grids, "MAX_NODES", 11)
    path = saved(tmp_path, MAP)
    assert "has 3 x 4 nodes, more than the 11 that are read" in refusal(path)


def test_pickled_objects_are_never_loaded(tmp_path):
    class Bomb:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "exploded",))

    path = saved(tmp_path, np.array([[Bomb()] * 2] * 2), allow_pickle=True)
    assert "pickled Python objects" in refusal(path)
    assert not (tmp_path / "exploded").exists()


@pytest.mark.parametrize(
    ("array", "kind"),
    [
        (MAP.astype(complex), "complex128"),
        (MAP > 5, "bool"),
        (MAP.astype("U4"), "<U4"),
        (MAP.astype("S4"), "S4"),
        (MAP.astype("m8[s]"), "timedelta64"),
        (np.zeros((2, 2), dtype=[("z", "f8")]), "z"),
    ],
)
def test_other_types(array, kind, tmp_path):
    message = refusal(saved(tmp_path, array))
    assert "must be real numbers" in message
    assert kind in message


@pytest.mark.parametrize("shape", [(), (12,), (3, 2, 2)])
def test_other_dimensions(shape, tmp_path):
    message = refusal(saved(tmp_path, np.zeros(shape)))
    assert "must have two dimensions" in message
    assert str(shape) in message


@pytest.mark.parametrize("shape", [(1, 12), (12, 1), (0, 3), (1, 1)])
def test_too_small(shape, tmp_path):
    assert "at least 2 rows and 2 columns" in refusal(saved(tmp_path, np.ones(shape)))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_nodes_that_are_not_finite_are_counted(value, tmp_path):
    broken = MAP.copy()
    broken[1, 1:3] = value
    assert "has 2 nodes that are missing, NaN or infinite" in refusal(saved(tmp_path, broken))


def test_a_map_without_any_elevation(tmp_path):
    path = saved(tmp_path, np.full((3, 4), np.nan))
    for nodata in ("refuse", "fill"):
        assert "holds no elevation at all" in refusal(path, nodata=nodata)


def test_constant(tmp_path):
    assert "is 7 everywhere" in refusal(saved(tmp_path, np.full((3, 4), 7)))


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(place=st.integers(0, 127), byte=st.integers(0, 255))
@pytest.mark.filterwarnings("ignore:Reading `.npy`")
def test_a_mangled_header_is_refused_or_gives_a_finite_map(place, byte, tmp_path):
    path = saved(tmp_path, MAP + 1)
    content = bytearray(path.read_bytes())
    content[place] = byte
    path.write_bytes(content)
    try:
        terrain = load_terrain("file", path=path)
    except UsageError:
        return
    assert np.all(np.isfinite(terrain.elevation))
    assert min(terrain.elevation.shape) >= 2


def archive(folder: Path, name: str = "map.npz", **maps) -> Path:
    path = folder / name
    np.savez_compressed(path, **maps)
    return path


class TestNpz:
    def test_the_only_array_is_the_map(self, tmp_path):
        path = archive(tmp_path, elevation=MAP)
        terrain = load_terrain("file", path=path)
        np.testing.assert_array_equal(terrain.elevation, MAP)
        assert terrain.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()

    def test_one_of_several_is_named(self, tmp_path):
        path = archive(tmp_path, before=MAP, after=MAP + 1)
        terrains = [load_terrain("file", path=path, array=name) for name in ("before", "after")]
        np.testing.assert_array_equal(terrains[1].elevation, MAP + 1)
        assert terrains[0].sha256 != terrains[1].sha256
        assert "choose one with terrain.array= (before, after)" in refusal(path)
        assert "did you mean 'after'" in refusal(path, array="aftr")

    def test_an_array_has_no_use_elsewhere(self, tmp_path):
        assert "which is no .npz file" in refusal(saved(tmp_path, MAP), array="elevation")

    def test_no_array(self, tmp_path):
        path = tmp_path / "map.npz"
        with zipfile.ZipFile(path, "w"):
            pass
        assert "holds no array" in refusal(path)

    @pytest.mark.parametrize("keep", [0.0, 0.3, 0.9])
    def test_cut_short(self, keep, tmp_path):
        path = archive(tmp_path, elevation=np.random.default_rng(0).normal(size=(20, 20)))
        content = path.read_bytes()
        path.write_bytes(content[: int(keep * len(content))])
        assert "is not a .npz file, or it is damaged" in refusal(path)

    def test_changed_bytes(self, tmp_path):
        path = archive(tmp_path, elevation=np.random.default_rng(0).normal(size=(20, 20)))
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 255
        path.write_bytes(content)
        assert "damaged" in refusal(path)

    def test_pickled_objects(self, tmp_path):
        path = tmp_path / "map.npz"
        np.savez(path, elevation=np.array([[None] * 2] * 2), allow_pickle=True)
        assert "pickled Python objects" in refusal(path, array="elevation")

    def test_a_header_that_claims_more_than_is_there(self, tmp_path):
        header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (5000, 5000), }\n"
        path = tmp_path / "map.npz"
        with zipfile.ZipFile(path, "w") as out:
            magic = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header))
            out.writestr("elevation.npy", magic + header + bytes(80))
        assert "cut short: it announces 200000000 bytes" in refusal(path)


class TestText:
    @pytest.mark.parametrize(
        ("mark", "ending"), [(",", "csv"), (";", "csv"), ("\t", "tsv"), (" ", "txt"), ("  ", "txt")]
    )
    def test_the_delimiter_is_found_out(self, mark, ending, tmp_path):
        path = tmp_path / f"map.{ending}"
        path.write_text("\n".join(mark.join(map(repr, row.tolist())) for row in MAP))
        terrain = load_terrain("file", path=path)
        np.testing.assert_array_equal(terrain.elevation, MAP)
        assert terrain.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()

    @pytest.mark.parametrize(
        "text",
        [
            "\ufeff1,2\n3,4\n",
            "1,2\r\n3,4\r\n",
            "\n1, 2\n\n3 ,4\n\n",
            "1e0,+2\n3.,4",
            "1\t2\n3\t4",
        ],
    )
    def test_spellings(self, text, tmp_path):
        path = tmp_path / "map.csv"
        path.write_bytes(text.encode())
        terrain = load_terrain("file", path=path)
        np.testing.assert_array_equal(terrain.elevation, [[1, 2], [3, 4]])

    @pytest.mark.filterwarnings("ignore::infoplan.terrain.TerrainValueWarning")
    @settings(
        max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
    )
    @given(
        elevation=hnp.arrays(
            np.float64,
            st.tuples(st.integers(2, 5), st.integers(2, 5)),
            elements=st.floats(-1e5, 1e5),
            unique=True,
        )
    )
    def test_what_numpy_writes_is_read(self, elevation, tmp_path):
        path = tmp_path / "map.csv"
        np.savetxt(path, elevation, delimiter=",", fmt="%.17g")
        np.testing.assert_array_equal(load_terrain("file", path=path).elevation, elevation)

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("", "is empty"),
            ("\n\n", "is empty"),
            ("1,2,3\n", "it must have at least 2 rows"),
            ("1\n2\n3\n", "it must have at least 2 rows"),
            ("x,y,z\n1,2,3\n4,5,6\n", "line 1, column 1: 'x' is not a number, and the line looks"),
            ("1,2\n3\n", "line 2 has another number of numbers, 1, than line 1, 2"),
            ("1,2\n3,4,5\n", "line 2 has another number of numbers, 3, than line 1, 2"),
            ("1,2\n3,\n", "line 2, column 3: there is no number"),
            ("1,5;2,5\n3,5;4,5\n", "line 1, column 1: '1,5' is not a number"),
            ("1,2\n3,#4\n", "line 2, column 3: '#4' is not a number"),
            ("1,2\n3,nan\n", "has 1 nodes that are missing"),
            ("1,1\n1,1\n", "is 1 everywhere"),
        ],
    )
    def test_no_grid_of_numbers(self, text, words, tmp_path):
        path = tmp_path / "map.csv"
        path.write_text(text)
        assert words in refusal(path)

    def test_no_text(self, tmp_path):
        path = saved(tmp_path, MAP).rename(tmp_path / "map.csv")
        assert "is no text" in refusal(path)

    def test_too_long(self, tmp_path):
        path = tmp_path / "map.csv"
        with path.open("wb") as file:
            file.truncate(texts.MAX_TEXT + 1)
        assert "is a text of more than" in refusal(path)

    def test_more_nodes_than_are_read(self, tmp_path, monkeypatch):
        monkeypatch.setattr(grids, "MAX_NODES", 11)
        path = tmp_path / "map.csv"
        np.savetxt(path, MAP)
        assert "more than the 11 that are read" in refusal(path)

    @pytest.mark.parametrize("mark", [",", ";", "\t", " ", " \t "])
    def test_lines_too_long_for_two_rows_are_not_parsed(self, mark, tmp_path, monkeypatch):
        monkeypatch.setattr(grids, "MAX_NODES", 11)
        path = tmp_path / "map.csv"
        path.write_text("\n".join([mark.join("12345"), mark.join("67890")]))
        assert load_terrain("file", path=path).elevation.shape == (2, 5)
        monkeypatch.setattr(np, "loadtxt", None)
        path.write_text(mark.join("123456"))
        message = refusal(path)
        assert "has more than 5 columns, so that two rows are more than the 11 nodes" in message

    @pytest.mark.parametrize("mark", [",", " "])
    def test_columns_are_counted_in_little_memory(self, mark, tmp_path, monkeypatch):
        monkeypatch.setattr(grids, "MAX_NODES", 2 * 50_000 - 1)
        path = tmp_path / "map.csv"
        path.write_text(mark.join(["10"] * 50_000))
        tracemalloc.start()
        try:
            assert "two rows are more than" in refusal(path)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        # A list of the fields would take twenty times the file.
        assert peak < 10 * path.stat().st_size
