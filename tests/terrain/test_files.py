"""Maps of the user's own: what is read, and what is refused in which words."""

import hashlib
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from infoplan.errors import UsageError
from infoplan.terrain import load_terrain

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


def refusal(path) -> str:
    with pytest.raises(UsageError) as caught:
        load_terrain("file", path=path)
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


def test_archive_of_arrays(tmp_path):
    path = tmp_path / "map.npz"
    np.savez(path, MAP)
    assert "is not a .npy file" in refusal(path)


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
    assert "has 2 nodes that are NaN or infinite" in refusal(saved(tmp_path, broken))


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
