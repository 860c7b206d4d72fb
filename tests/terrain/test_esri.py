"""ESRI ASCII grids: headers of all kinds, double precision, and faults named by their place."""

import codecs
import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from infoplan.errors import UsageError
from infoplan.terrain import esri, grids, load_terrain

HEADER = "ncols 3\nnrows 2\nxllcorner 100\nyllcorner 200\ncellsize 10\nNODATA_value -9999\n"
MAP = [[4.0, 5.0, 6.5], [1.0, 2.0, 3.0]]
"""As stored: the south first."""


def asc(folder: Path, content: str | bytes, name: str = "map.asc") -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def refusal(path: Path, **options) -> str:
    with pytest.raises(UsageError) as caught:
        load_terrain("file", path=path, **options)
    message = str(caught.value)
    assert "\n" not in message
    assert str(path) in message
    return message


@pytest.mark.parametrize(
    "content",
    [
        HEADER + "1 2 3\n4 5 6.5\n",
        HEADER.upper() + "1 2 3\n4 5 6.5",
        HEADER.replace("\n", "\r\n") + "1 2 3\r\n4 5 6.5\r\n",
        HEADER.replace("\n", "\r") + "1 2 3\r4 5 6.5\r",
        "\n" + HEADER.replace("\n", "\n\n") + "\n1 2 3\n\n4 5 6.5\n\n",
        HEADER + "\t1\t2\t3\n\t4\t5\t6.5\n",
        HEADER + "1 2\n3 4\n5 6.5\n",
        HEADER + "1 2 3 4 5 6.5",
        HEADER + "1.e0 +2 .3E1\n4 5 65e-1\n",
        HEADER.replace("xllcorner 100", "xllcenter 105").replace("yllcorner 200", "YLLCENTER 205")
        + "1 2 3\n4 5 6.5\n",
        HEADER.replace("cellsize 10", "dx 10\ndy 10") + "1 2 3\n4 5 6.5\n",
        HEADER.replace("NODATA_value -9999\n", "") + "1 2 3\n4 5 6.5\n",
        HEADER.replace("-9999", "nan") + "1 2 3\n4 5 6.5\n",
        HEADER.replace("ncols 3", "ncols 3.0") + "1 2 3\n4 5 6.5\n",
        "nrows 2\nncols 3\ncellsize 10\nyllcorner 200\nxllcorner 100\n1 2 3\n4 5 6.5\n",
        codecs.BOM_UTF8 + (HEADER + "1 2 3\n4 5 6.5\n").encode(),
        (HEADER + "1 2 3\n4 5 6.5\n").encode("utf-16"),
    ],
)
@pytest.mark.parametrize("chunk", [esri.CHUNK, 7])
def test_spellings(content, chunk, tmp_path, monkeypatch):
    monkeypatch.setattr(esri, "CHUNK", chunk)
    terrain = load_terrain("file", path=asc(tmp_path, content))
    np.testing.assert_array_equal(terrain.elevation, MAP)
    assert terrain.world == (105, 125, 205, 215)


def test_no_place_in_the_world(tmp_path):
    path = asc(tmp_path, "ncols 3\nnrows 2\ncellsize 10\n1 2 3\n4 5 6.5\n")
    assert load_terrain("file", path=path).world is None


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(values=st.lists(st.floats(-9000, 9000), min_size=6, max_size=6, unique=True),
       chunk=st.integers(1, 60))  # fmt: skip
@pytest.mark.filterwarnings("ignore:an elevation of")
def test_elevations_are_read_in_double_precision(values, chunk, tmp_path):
    if max(values) - min(values) < 1e-90:
        return
    rows = [" ".join(map(repr, values[:3])), " ".join(map(repr, values[3:]))]
    path = asc(tmp_path, HEADER + "\n".join(rows))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(esri, "CHUNK", 30 + chunk)
        terrain = load_terrain("file", path=path)
    np.testing.assert_array_equal(terrain.elevation, [values[3:], values[:3]])


def test_digest_is_the_file_s_unless_versions_before_read_other_elevations(tmp_path):
    whole = load_terrain("file", path=asc(tmp_path, HEADER + "1 2 3\n4 5 6.5\n"))
    path = tmp_path / "map.asc"
    assert whole.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    asc(tmp_path, HEADER + "1 2 3\n4 5 995.73\n")
    fine = load_terrain("file", path=path)
    assert fine.elevation[0, 2] == 995.73
    assert fine.sha256 != hashlib.sha256(path.read_bytes()).hexdigest()


BAD = {
    "NA": "'NA' is not a number", "-": "'-' is not a number", "*": "'*' is not a number",
    "NULL": "'NULL'", "N/A": "'N/A'", "#N/A": "'#N/A'", "Inf": "'Inf' is not a number",
    "-inf": "'-inf'", "1.#INF": "'1.#INF'", "1.#QNAN": "'1.#QNAN'", "nan(ind)": "'nan(ind)'",
    "1e400": "1e400 is too large a number", "-1e999": "-1e999 is too large",
    "1,234.5": "'1,234.5'", "12m": "'12m'", "0x10": "'0x10'", "1_000": "'1_000'", "1e": "'1e'",
    "１２": "'１２'", "1D5": "'1D5'", "1.2.3": "'1.2.3'", "+-1": "'+-1'", "--": "'--'",
    "\x1b[31m": r"'\\x1b[31m'", "infinity": "'infinity'", "'1'": "\"'1'\"",
}  # fmt: skip


@pytest.mark.parametrize("word", BAD)
@pytest.mark.parametrize("chunk", [esri.CHUNK, 10])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_what_is_no_number_is_named_with_its_place(word, chunk, end, tmp_path, monkeypatch):
    monkeypatch.setattr(esri, "CHUNK", chunk)
    text = (HEADER + f"1 2 3\n\n4 5.25 {word}\n").replace("\n", end)
    path = asc(tmp_path, text)
    for nodata in ("refuse", "fill", -9999):
        message = refusal(path, nodata=nodata)
        assert "line 9, column 8" in message
        assert BAD[word] in message


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("1 2 3\n4 5\n", "line 8 has 2"),
        ("1 2\n3 4 5\n", "line 7 has 2"),
        ("1 2\n3 4 5 6\n", "line 7 has 2"),
        ("1 2 3\n4 5 6 7\n", "line 8 has 4"),
        ("1 2 3\n4 5 6\n7 8 9\n", "more than 6"),
        ("1 2 3 4 5 6 7", "line 7 has 7"),
        ("1 2 3\n", "there are 3"),
        ("", "cut short"),
    ],
)
@pytest.mark.parametrize("chunk", [esri.CHUNK, 3])
def test_too_few_and_too_many(body, words, chunk, tmp_path, monkeypatch):
    monkeypatch.setattr(esri, "CHUNK", chunk)
    assert words in refusal(asc(tmp_path, HEADER + body + " " * 12))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("cellsize 10", "cellsize 0", "line 5, column 10: cellsize 0: it must be above 0"),
        ("cellsize 10", "cellsize -10", "cellsize -10: it must be above 0"),
        ("cellsize 10", "cellsize nan", "it must be a finite number"),
        ("cellsize 10", "cellsize 1e999", "too large a number"),
        ("cellsize 10", "cellsize 30,5", "'30,5' is not a number"),
        ("cellsize 10", "dx 10", "do not give cellsize"),
        ("cellsize 10\n", "", "do not give cellsize"),
        ("ncols 3", "ncols -3", "line 1, column 7: ncols -3: it must be a whole number"),
        ("ncols 3", "ncols 0", "it must be a whole number"),
        ("ncols 3", "ncols 2.5", "it must be a whole number"),
        ("ncols 3", "ncols 1e300", "it must be a whole number"),
        ("ncols 3", "ncols three", "'three' is not a number"),
        ("ncols 3\n", "", "do not give ncols"),
        ("ncols 3", "north: 3", "do not give ncols, nrows"),
        ("xllcorner 100", "xllcorner inf", "'inf' is not a number"),
        ("-9999", "NA", "line 6, column 14: NODATA_value NA: 'NA' is not a number"),
        ("-9999", "1e400", "too large"),
        ("nrows 2", "nrows 20000", "cut short: it announces 20000 x 3 nodes"),
    ],
)
def test_wrong_headers(old, new, words, tmp_path):
    assert words in refusal(asc(tmp_path, HEADER.replace(old, new) + "1 2 3\n4 5 6\n"))


@pytest.mark.parametrize(
    ("nodata", "cell"),
    [("NODATA_value -9999", "-9999.0"), ("nodata_value 0", "0"), ("NODATA_value nan", "NaN"),
     ("NODATA_VALUE -3.4028234663852886e+38", "-3.40282346638529e+38"), ("", "-9999"),
     ("NODATA_value -1", "nan")],
)  # fmt: skip
def test_missing_elevations(nodata, cell, tmp_path):
    path = asc(tmp_path, HEADER.replace("NODATA_value -9999", nodata) + f"1 {cell} 3\n4 5 6\n")
    assert "has 1 nodes that are missing" in refusal(path)
    terrain = load_terrain("file", path=path, nodata="fill")
    assert terrain.elevation[1, 1] in (1, 3, 5)
    np.testing.assert_array_equal(np.delete(terrain.elevation.ravel(), 4), [4, 5, 6, 1, 3])


@pytest.mark.parametrize("content", [b"", b"\x00" * 500, b"x" * 10_000, b"ncols", b"\xff\xfe\x00"])
def test_something_else(content, tmp_path):
    refusal(asc(tmp_path, content))


def test_a_word_as_long_as_a_chunk(tmp_path, monkeypatch):
    monkeypatch.setattr(esri, "CHUNK", 64)
    message = refusal(asc(tmp_path, HEADER + "1 2 " + "7" * 1000 + "\n4 5 6\n"))
    assert "line 7, column 5" in message
    assert len(message) < 400


def test_more_nodes_than_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(grids, "MAX_NODES", 5)
    path = asc(tmp_path, HEADER + "1 2 3\n4 5 6\n")
    assert "has 2 x 3 nodes, more than the 5" in refusal(path)
