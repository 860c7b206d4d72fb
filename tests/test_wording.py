"""Numbers and text for people."""

import csv
import io
import math
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from infoplan.wording import (
    UNSEEN,
    counted,
    csv_cell,
    encodable,
    figure,
    harmless,
    interval,
    markdown_cell,
    spans,
    suggest,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1125.4, "1125"), (96.04, "96.0"), (0.01234, "0.0123"), (0.9996, "1.00"), (999.6, "1000"),
        (-3.14159, "-3.14"), (0.0, "0"), (math.nan, ""), (math.inf, "inf"), (1.5e-7, "1.50e-07"),
        (123456.7, "123457"),
    ],
)  # fmt: skip
def test_figures(value, text):
    assert figure(value) == text


@given(st.floats(-1e12, 1e12).filter(lambda x: abs(x) > 1e-12))
def test_figures_keep_three_significant_digits(value):
    assert float(figure(value)) == pytest.approx(value, rel=5.0001e-3)


def test_whole_numbers_in_short():
    assert spans({3, 0, 1, 7, 8}) == "0-1, 3, 7-8"
    assert spans([]) == ""


def test_counts():
    assert counted(1, "mission") == "1 mission"
    assert counted(0, "mission") == "0 missions"
    assert counted(2, "copy", "copies") == "2 copies"


@given(st.text())
def test_harmless_text_has_no_control_characters(text):
    assert not {unicodedata.category(character) for character in harmless(text)} & {*UNSEEN}


def test_harmless_keeps_what_people_write():
    assert harmless("Höhe in m² 山 'a' [b]") == "Höhe in m² 山 'a' [b]"
    assert harmless("a\x1b[31mb\nc\u202e") == "a\\x1b[31mb\\nc\\u202e"


def test_markdown_cells():
    assert markdown_cell("a|b<script>") == "a\\|b&lt;script&gt;"


@given(st.text())
def test_csv_cells_are_read_back_and_start_no_formula(text):
    written = io.StringIO()
    csv.writer(written).writerow([csv_cell(text), "end"])
    (row,) = csv.reader(io.StringIO(written.getvalue()))
    assert row[1] == "end"
    assert row[0][:1] not in ("=", "@")
    assert row[0][:1] not in ("+", "-") or isinstance(float(row[0]), float)


def test_suggestions():
    assert suggest("pla", ["puct", "plan"]) == " (did you mean 'plan'?)"
    assert suggest("xyz", ["puct"]) == ""
    assert suggest("rh", ["rho", "rhe"], n=2).count("rh") == 2


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ((1125.4, 1001, 1250), "1125 [1001, 1250]"),
        ((0.0123, 0.009, 0.015), "0.0123 [0.0090, 0.0150]"),
        ((9.5, 8.7, 10.25), "9.50 [8.70, 10.25]"),
        ((0.7, -21, 26), "0.7 [-21.0, 26.0]"),
        ((-0.0001, -0.3, 0.3), "0.000 [-0.300, 0.300]"),
        ((1e-5, 1e-6, 2e-5), "1.00e-05 [1.00e-06, 2.00e-05]"),
        ((0, 0, 0), "0 [0, 0]"),
        ((5, math.nan, math.nan), "5.00"),
        ((math.nan, math.nan, math.nan), ""),
    ],
)
def test_an_interval_has_the_decimals_of_its_mean(numbers, text):
    assert interval(*numbers) == text


def test_what_an_encoding_lacks_is_written_otherwise():
    assert encodable("within ±3 µm", "utf-8") == "within ±3 µm"
    assert encodable("within ±3 µm", "latin-1") == "within ±3 µm"
    assert encodable("within ±3 µm 漢", "ascii") == "within +-3 \\xb5m \\u6f22"
    assert encodable("±", "no-such-encoding") == "+-"
