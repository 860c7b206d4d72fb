"""Maps in NumPy's files and in texts: what is read, and what is refused in which words."""

import codecs
import hashlib
import os
import struct
import threading
import tracemalloc
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from infoplan.config import FileConfig
from infoplan.errors import UsageError
from infoplan.terrain import TerrainValueWarning, find_helens, grids, load_terrain, texts

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

    @pytest.mark.filterwarnings("ignore:an elevation of")
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

    @pytest.mark.parametrize(
        ("text", "place"),
        [
            ("1,2\n3,x\n", "line 2, column 3: 'x'"),
            ("# made by hand\n\n1,2\n\n# more\n3,x\n", "line 6, column 3: 'x'"),
            ('"1","2"\n"3","x"\n', "line 2, column 5: 'x'"),
            ("1\t2\n3\t\t4\n", "line 2, column 3: there is no number"),
            ("1 2\n  3   x\n", "line 2, column 7: 'x'"),
            ("1;2\r\n3;x\r\n", "line 2, column 3: 'x'"),
            ("1,2\r3,x\r", "line 2, column 3: 'x'"),
            ("1,2\n3,1e400\n", "line 2, column 3: 1e400 is too large"),
            ("1,2\n3,-inf\n", "line 2, column 3: '-inf' is not a number"),
            ("1,2\n3,1_000\n", "line 2, column 3: '1_000'"),
            ("1,2\n3,0x10\n", "line 2, column 3: '0x10'"),
            ("1,2\n3,１\n", "line 2, column 3: '１'"),
            ("1,2\n3,1e\n", "line 2, column 3: '1e'"),
            ("1,2\n3,1D5\n", "line 2, column 3: '1D5'"),
            ("1,2,3\n4,5,#N/A\n", "line 2, column 5: '#N/A'"),
            ("1 2\n3 4 #N/A\n", "line 2, column 5: '#N/A'"),
            ("1,2\n3,\x1b[31m\n", r"line 2, column 3: '\\x1b[31m'"),
            ("1,2\n3," + "x" * 1000, "line 2, column 3: 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...'"),
        ],
    )
    @pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
    def test_a_fault_is_named_by_its_place_in_an_editor(self, text, place, encoding, tmp_path):
        path = tmp_path / "map.csv"
        path.write_bytes(text.encode(encoding))
        message = refusal(path, nodata="fill")
        assert place in message
        assert "\x1b" not in message

    @pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "latin-1", "utf-8", "utf-8-sig"])
    def test_encodings(self, encoding, tmp_path):
        path = tmp_path / "map.csv"
        path.write_bytes("# Höhe\n1;2\n3;4.5\n".encode(encoding))
        if encoding == "utf-16-le":
            assert "is a text in UTF-16 without its mark: save it as UTF-8" in refusal(path)
            return
        np.testing.assert_array_equal(load_terrain("file", path=path).elevation, [[1, 2], [3, 4.5]])
        path.write_bytes("# Höhe\n1;2\n3;4°\n".encode(encoding))
        assert "line 3, column 3: '4°'" in refusal(path)

    @pytest.mark.parametrize("encoding", ["utf-32", "utf-32-le", "utf-32-be"])
    @pytest.mark.parametrize("name", ["map.csv", "map.asc"])
    def test_utf_32_is_named(self, name, encoding, tmp_path):
        path = tmp_path / name
        marks = {"utf-32-le": codecs.BOM_UTF32_LE, "utf-32-be": codecs.BOM_UTF32_BE}
        path.write_bytes(marks.get(encoding, b"") + "1;2\n3;4\n".encode(encoding))
        assert "is a text in UTF-32: save it as UTF-8" in refusal(path)

    def test_what_numpy_writes_with_a_heading_is_read(self, tmp_path):
        path = tmp_path / "map.txt"
        np.savetxt(path, MAP, header="made by\nnumpy")
        np.testing.assert_array_equal(load_terrain("file", path=path).elevation, MAP)


class TestNodata:
    """A number marks missing elevations and fills them, in every format."""

    BROKEN = np.array([[10.0, 11, 12, 13], [14, -9999, 16, 17], [18, 19, 20, -9999]])

    @pytest.mark.parametrize("name", ["map.npy", "map.npz", "map.csv"])
    @pytest.mark.parametrize("number", [-9999, -9999.0])
    def test_marks_and_fills(self, name, number, tmp_path):
        path = tmp_path / name
        {"map.npy": np.save, "map.npz": np.savez, "map.csv": np.savetxt}[name](path, self.BROKEN)
        terrain = load_terrain("file", path=path, nodata=number)
        kept = self.BROKEN != -9999
        np.testing.assert_array_equal(terrain.elevation[kept], self.BROKEN[kept])
        assert terrain.elevation[1, 1] in (11, 14, 16, 19)
        assert terrain.elevation[2, 3] in (17, 20)

    def test_what_was_missing_besides_is_filled_too(self, tmp_path):
        broken = self.BROKEN.copy()
        broken[0, 0] = np.nan
        path = saved(tmp_path, broken)
        assert "has 1 nodes" in refusal(path)
        assert np.isfinite(load_terrain("file", path=path, nodata=-9999).elevation).all()

    def test_single_precision_is_met(self, tmp_path):
        lowest = float(np.finfo(np.float32).min)
        path = saved(tmp_path, np.where(self.BROKEN == -9999, lowest, self.BROKEN).astype("f4"))
        assert load_terrain("file", path=path, nodata=-3.4028235e38).elevation.min() == 10
        path = saved(tmp_path, np.where(self.BROKEN == -9999, 0.1, self.BROKEN).astype("f4"))
        assert load_terrain("file", path=path, nodata=0.1).elevation.min() == 10

    def test_maps_differ_by_what_was_marked(self, tmp_path):
        broken = np.where(self.BROKEN == -9999, np.nan, self.BROKEN)
        path = saved(tmp_path, broken)
        with pytest.warns(TerrainValueWarning, match=r"terrain\.nodata=-1 marks no node"):
            one = load_terrain("file", path=path, nodata=-1)
        assert one.sha256 != load_terrain("file", path=path, nodata="fill").sha256

    def test_one_spelling_of_a_number(self):
        assert repr(FileConfig(nodata=-9999)) == repr(FileConfig(nodata=-9999.0))

    @pytest.mark.parametrize("nodata", [True, [1.0], ["fill"], {"a": 1}])
    def test_something_else(self, nodata, tmp_path):
        with pytest.raises(UsageError, match=r"terrain\.nodata="):
            load_terrain("file", path=saved(tmp_path, MAP), nodata=nodata)

    @pytest.mark.parametrize("nodata", ["keep", float("nan"), float("inf")])
    def test_no_number(self, nodata, tmp_path):
        with pytest.raises(UsageError, match=r"use refuse or fill or a number|must be finite"):
            load_terrain("file", path=saved(tmp_path, MAP), nodata=nodata)

    @pytest.mark.parametrize(
        "mark", [-9999.0, -32768.0, 9999.0, -3.4028234663852886e38, 1e20, -99999, 32767, 50_000]
    )
    def test_a_lone_extreme_is_told(self, mark, tmp_path):
        broken = np.random.default_rng(0).normal(1000, 200, (30, 30))
        broken[3, 4:6] = mark
        path = saved(tmp_path, broken)
        with pytest.warns(TerrainValueWarning, match="is far from all others") as caught:
            terrain = load_terrain("file", path=path)
        np.testing.assert_array_equal(terrain.elevation, broken)
        # What it says to do does it.
        said = str(caught[0].message)
        option = said.partition("terrain.nodata=")[2].partition(" ")[0]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            filled = load_terrain("file", path=path, nodata=float(option))
        assert np.abs(filled.elevation - 1000).max() < 1000

    @pytest.mark.parametrize("kind", ["helens", "volcano", "jacksboro", "field", "sea"])
    def test_nothing_is_said_of_a_real_map(self, kind, tmp_path, monkeypatch):
        if kind == "helens" and not find_helens():
            pytest.skip("helens is not on this machine")
        if kind == "field":
            maps = [load_terrain("random_field", seed=seed).elevation for seed in range(20)]
        elif kind == "sea":
            maps = [np.maximum(load_terrain("volcano").elevation - 5000, 0)]
        else:
            maps = [load_terrain(kind).elevation]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for elevation in maps:
                load_terrain("file", path=saved(tmp_path, elevation))


def test_an_elevation_whose_square_is_no_double_is_refused(tmp_path):
    for extreme in (-1.8e300, 1e101, np.finfo(float).max, -np.finfo(float).max):
        broken = MAP.copy()
        broken[0, 0] = extreme
        assert "beyond 1e+100" in refusal(saved(tmp_path, broken))


class TestPlaces:
    """What stands where a map should."""

    @pytest.mark.parametrize(
        "name",
        ["dem (1).npy", "höhe.npy", "山.npy", "o'neill.npy", "a=b.npy", "a,b[1].npy", "$x$ {y}.npy",
         "~f.npy", "#1.npy", '"q".npy', "a b\tc.npy"],
    )  # fmt: skip
    def test_names_are_taken_as_they_are(self, name, tmp_path, monkeypatch):
        path = saved(tmp_path, MAP).rename(tmp_path / name)
        np.testing.assert_array_equal(load_terrain("file", path=str(path)).elevation, MAP)
        monkeypatch.setenv("HOME", str(tmp_path))
        np.testing.assert_array_equal(load_terrain("file", path=f"~/{name}").elevation, MAP)

    @pytest.mark.parametrize("path", ["~nosuchuser/map.npy", "a\0b.npy", "x" * 5000 + ".npy", ""])
    def test_no_such_file(self, path):
        for kind in ("file", "helens"):
            with pytest.raises(UsageError) as caught:
                load_terrain(kind, path=path, **({} if kind == "file" else {"on_missing": "error"}))
            assert "\0" not in str(caught.value)

    @pytest.mark.parametrize("ending", ["npy", "npz", "csv", "tif", "asc", "zip", "dem"])
    def test_pipes_devices_and_links(self, ending, tmp_path):
        pipe = tmp_path / f"pipe.{ending}"
        os.mkfifo(pipe)
        assert "names a pipe, a socket or a device" in refusal(pipe)
        for target in ("/dev/zero", "/dev/tty", "/dev/null"):
            link = tmp_path / f"{target[5:]}.{ending}"
            link.symlink_to(target)
            refusal(link)
        loop = tmp_path / f"loop.{ending}"
        loop.symlink_to(loop)
        assert "cannot be read" in refusal(loop)
        proc = tmp_path / f"proc.{ending}"
        proc.symlink_to("/proc/self/maps")
        refusal(proc)

    def test_messages_are_harmless(self, tmp_path):
        for name in ("a\x1b[31m.npy", "a\x1b[31m.abc", "\u202e.csv"):
            (tmp_path / name).write_bytes(b"")
            with pytest.raises(UsageError) as caught:
                load_terrain("file", path=tmp_path / name)
            assert str(caught.value).isprintable()

    def test_the_digest_is_that_of_the_bytes_that_were_read(self, tmp_path):
        """A writer changes the map all the time; no digest goes with another's elevations."""
        contents = {}
        for shift in range(4):
            path = saved(tmp_path, np.pad(MAP, 100) + shift, f"{shift}.npy")
            contents[hashlib.sha256(path.read_bytes()).hexdigest()] = (shift, path)
        path, stop = tmp_path / "map.npy", threading.Event()
        os.link(tmp_path / "0.npy", path)

        def change() -> None:
            while not stop.is_set():
                for _, source in contents.values():
                    spare = tmp_path / "spare"
                    spare.write_bytes(source.read_bytes())
                    spare.replace(path)

        writer = threading.Thread(target=change)
        writer.start()
        try:
            for _ in range(100):
                terrain = load_terrain("file", path=path)
                assert terrain.elevation[0, 0] == contents[terrain.sha256][0]
        finally:
            stop.set()
            writer.join()
