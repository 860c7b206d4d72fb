"""Maps in .zip archives, and archives that are none, damaged or booby-trapped."""

import errno
import hashlib
import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from infoplan.errors import UsageError
from infoplan.terrain import archives, load_terrain

MAP = np.arange(12.0).reshape(3, 4)


def npy(array: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def tif(folder: Path) -> bytes:
    path = folder / "source.tif"
    with rasterio.open(path, "w", driver="GTiff", height=3, width=4, count=1, dtype="float64",
                       crs="EPSG:32610", transform=Affine(10, 0, 0, 0, -10, 0)) as out:  # fmt: skip
        out.write(MAP[::-1], 1)
    return path.read_bytes()


def pack(folder: Path, method: int = zipfile.ZIP_DEFLATED, **members: bytes) -> Path:
    path = folder / "maps.zip"
    with zipfile.ZipFile(path, "w", method) as out:
        for name, content in members.items():
            out.writestr(name, content)
    return path


def refusal(path: Path, **options) -> str:
    with pytest.raises(UsageError) as caught:
        load_terrain("file", path=path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


@pytest.mark.parametrize(
    "method",
    [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA],
)
def test_the_only_map_is_taken_whatever_lies_beside_it(method, tmp_path):
    path = pack(
        tmp_path,
        method,
        **{
            "read me.md": b"",
            "maps/": b"",
            "maps/Hills.NPY": npy(MAP),
            "maps/.hidden.npy": b"",
            "__MACOSX/maps/._Hills.npy": b"",
        },
    )
    terrain = load_terrain("file", path=path)
    np.testing.assert_array_equal(terrain.elevation, MAP)
    assert terrain.name == "file-maps"
    assert terrain.sha256 == hashlib.sha256(npy(MAP)).hexdigest()


def test_every_format_is_unpacked(tmp_path):
    npz, text = io.BytesIO(), io.StringIO()
    np.savez(npz, elevation=MAP)
    np.savetxt(text, MAP, delimiter=",")
    contents = {
        "map.npy": npy(MAP),
        "map.npz": npz.getvalue(),
        "map.csv": text.getvalue().encode(),
        "map.tif": tif(tmp_path),
    }
    path = pack(tmp_path, **contents)
    for name in contents:
        np.testing.assert_array_equal(
            load_terrain("file", path=path, member=name).elevation, MAP, err_msg=name
        )
    assert load_terrain("file", path=path, member="map.tif").crs == "EPSG:32610"


def test_one_of_several_is_named(tmp_path):
    path = pack(tmp_path, **{"before.npy": npy(MAP), "deep/after.npy": npy(MAP + 1)})
    assert "holds 2 maps: choose one with terrain.member= (before.npy, deep/after.npy)" in refusal(
        path
    )
    assert "did you mean 'deep/after.npy'" in refusal(path, member="after.npy")
    assert load_terrain("file", path=path, member="deep/after.npy").elevation[0, 0] == 1


def test_a_member_has_no_use_elsewhere(tmp_path):
    path = tmp_path / "map.npy"
    path.write_bytes(npy(MAP))
    assert "which is no .zip archive" in refusal(path, member="map.npy")


def test_no_map(tmp_path):
    assert "holds no map: a map's name ends in .npy" in refusal(pack(tmp_path, **{"a.md": b"a"}))


def test_messages_name_archive_and_map(tmp_path):
    assert "maps.zip (bad.npy) is not a .npy file" in refusal(pack(tmp_path, **{"bad.npy": b"x"}))


@pytest.mark.parametrize(
    "name",
    ["../map.npy", "a/../../map.npy", "/tmp/map.npy", "..\\map.npy", "C:\\map.npy", "C:map.npy",
     "\\\\host\\share\\map.npy", "a/.."],
)  # fmt: skip
def test_paths_that_lead_out(name, tmp_path):
    folder = tmp_path / "inner"
    folder.mkdir()
    path = pack(folder, **{"good.npy": npy(MAP), name: npy(MAP + 1)})
    assert "leads out of it" in refusal(path, member="good.npy")
    assert not (tmp_path / "map.npy").exists()


def test_links(tmp_path):
    path = tmp_path / "maps.zip"
    with zipfile.ZipFile(path, "w") as out:
        link = zipfile.ZipInfo("map.npy")
        link.external_attr = 0o120777 << 16
        out.writestr(link, "/etc/passwd")
    assert "holds the link 'map.npy'" in refusal(path)


def patched(path: Path, offset: int, size: int) -> Path:
    """Change a size in the directory of an archive of one file: offset 20 packed, 24 unpacked."""
    content = bytearray(path.read_bytes())
    start = content.index(b"PK\x01\x02") + offset
    content[start : start + 4] = struct.pack("<I", size)
    path.write_bytes(content)
    return path


def test_more_than_is_unpacked(tmp_path):
    path = patched(pack(tmp_path, **{"map.npy": npy(MAP)}), 24, archives.MAX_BYTES + 1)
    assert "unpacks to 1073741825 bytes" in refusal(path)


def test_a_bomb_that_claims_to_be_small(tmp_path):
    bomb = npy(np.zeros((1000, 1000)))
    path = patched(pack(tmp_path, **{"map.npy": bomb}), 24, 1000)
    assert "cannot be unpacked, it is damaged: get it again" in refusal(path)


@pytest.mark.parametrize("keep", [0.0, 0.2, 0.7, 0.95])
def test_cut_short(keep, tmp_path):
    path = pack(tmp_path, **{"map.npy": npy(np.random.default_rng(0).normal(size=(30, 30)))})
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content))])
    assert "cannot be unpacked, it is damaged: get it again" in refusal(path)


def test_changed_bytes(tmp_path):
    path = pack(tmp_path, **{"map.npy": npy(np.random.default_rng(0).normal(size=(30, 30)))})
    content = bytearray(path.read_bytes())
    content[3000] ^= 255
    path.write_bytes(content)
    assert "cannot be unpacked, it is damaged: get it again" in refusal(path)


def test_encrypted(tmp_path):
    path = pack(tmp_path, zipfile.ZIP_STORED, **{"map.npy": npy(MAP)})
    content = bytearray(path.read_bytes())
    for header, flag in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(header) + flag] |= 1
    path.write_bytes(content)
    assert "cannot be unpacked, it is encrypted: unpack it yourself" in refusal(path)


def test_a_full_temporary_folder_is_not_blamed_on_the_archive(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    path = pack(tmp_path, zipfile.ZIP_STORED, **{"map.npy": npy(MAP)})
    monkeypatch.setattr("shutil.copyfileobj", full)
    said = refusal(path)
    assert "make room, or set TMPDIR" in said
    assert "get it again" not in said


def test_names_in_messages_are_harmless(tmp_path):
    name = "a\x1b[31m\u202e.npy"
    for content, words in ((b"x", "is not a .npy file"), (npy(np.ones((2, 2))), "is 1 everywhere")):
        with pytest.raises(UsageError, match=words) as caught:
            load_terrain("file", path=pack(tmp_path, **{name: content}))
        assert str(caught.value).isprintable()
    for options in ({}, {"member": "b\x07.npy"}):
        with pytest.raises(UsageError) as caught:
            load_terrain("file", path=pack(tmp_path, **{name: b"", "b.npy": b""}), **options)
        assert str(caught.value).isprintable()
    for bad in ("../\x1b.npy", "..\\\x1b.npy"):
        with pytest.raises(UsageError) as caught:
            load_terrain("file", path=pack(tmp_path, **{bad: b""}))
        assert str(caught.value).isprintable()


def test_a_name_too_long_for_a_file_system_is_read(tmp_path):
    path = pack(tmp_path, **{"x" * 400 + ".npy": npy(MAP)})
    np.testing.assert_array_equal(load_terrain("file", path=path).elevation, MAP)
