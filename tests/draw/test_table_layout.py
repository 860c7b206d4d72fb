"""Tables that fit: what is broken, left out, stacked; and text of any origin."""

import io
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from infoplan.draw.console import UNLIMITED, PlainConsole, say, say_command
from infoplan.draw.table_layout import WHOLE, TextColumn, print_table

COLUMNS = [
    TextColumn("run", least=WHOLE),
    TextColumn("planner.exploration", right=True),
    TextColumn("curve", drawn=True, spare=1),
    TextColumn("at 500", right=True),
    TextColumn("false alarms", right=True, spare=2),
]
ROWS = [
    ["uct none batch\nab12", "0.5", "* *\n * ", "1125\n[1001, 1250]", "17.5"],
    ["puct copod batch\ncd34", "0.25", "***\n   ", "96.0\n[80.1, 112.0]", "3.0"],
]


def printed(width: int, columns=COLUMNS, rows=ROWS, named: int = 1, encoding: str = "utf-8") -> str:
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding=encoding)
    print_table(Console(file=stream, width=width), "RMSE", columns, rows, named=named)
    stream.flush()
    return raw.getvalue().decode(encoding)


def too_long(text: str, width: int) -> list[str]:
    """Lines longer than the width, but for words that no line could hold."""
    lines = [line.rstrip() for line in text.splitlines()]
    return [line for line in lines if cell_len(line) > width and " " in line.strip()]


def test_a_wide_table_has_a_line_a_line_of_its_cells():
    lines = [line.split() for line in printed(UNLIMITED).splitlines()]
    assert lines[2] == ["run", "planner.exploration", "curve", "at", "500", "false", "alarms"]
    assert lines[4] == ["uct", "none", "batch", "0.5", "*", "*", "1125", "17.5"]
    assert lines[5] == ["ab12", "*", "[1001,", "1250]"]


def test_less_room_breaks_headings_and_intervals_between_words():
    said = printed(60)
    assert "planner." in said
    assert "planner.exploration" not in said
    assert "left out" not in said
    assert not too_long(said, 60)


def test_still_less_leaves_out_what_can_be_spared_and_names_it():
    said = printed(50)
    assert "left out for want of room: false alarms" in " ".join(said.split())
    assert "17.5" not in said
    assert "* *" in said
    said = printed(44)
    assert "left out for want of room: curve, false alarms" in " ".join(said.split())
    assert "1125" in said


def test_the_least_room_stacks_rows_with_every_field():
    said = printed(36)
    assert said.splitlines()[2:10] == [
        "uct none batch",
        "ab12",
        "  planner.exploration  0.5",
        "  curve                * *",
        "                        * ",
        "  at 500               1125 [1001,",
        "                       1250]",
        "  false alarms         17.5",
    ]


def test_a_field_that_cannot_stand_beside_its_title_stands_below():
    said = printed(20)
    assert "  planner.exploration\n    0.5" in said
    assert "    1125 [1001,\n    1250]" in said


@given(
    st.lists(
        st.lists(
            st.floats(1e-9, 1e9).map("{:.3g}".format) | st.sampled_from(["", "-", "[1.5, 2]"]),
            min_size=4,
            max_size=4,
        ),
        min_size=1,
        max_size=3,
    ),
    st.integers(24, 90),
    st.lists(st.integers(0, 2), min_size=4, max_size=4),
)
def test_no_number_is_ever_cut(rows, width, spare):
    titles = ["run", "planner.exploration", "at 500", "false alarms"]
    columns = [TextColumn(title, spare=spare[k] if k else 0) for k, title in enumerate(titles)]
    said = printed(width, columns, rows)
    assert not too_long(said, width)
    flat = " ".join(said.split())
    left_out = flat.partition("left out for want of room: ")[2].split(", ")
    words = flat.split()
    for row in rows:
        for title, cell in zip(titles, row, strict=True):
            if title not in left_out:
                assert all(word in words for word in cell.split())


def test_encodings_without_lines_get_plain_ones():
    for encoding in ("ascii", "latin-1"):
        said = printed(UNLIMITED, [TextColumn("±ü漢")], [["±ü漢"]], encoding=encoding)
        assert "---" in said
        assert "\\u6f22" in said
    assert "---" not in printed(UNLIMITED)


def test_cells_are_text_and_their_control_characters_are_seen():
    said = printed(UNLIMITED, [TextColumn("[b]x[/b]")], [["[red]a[/x]\x1b[31m\r:smile:"]])
    assert "[b]x[/b]" in said
    assert r"[red]a[/x]\x1b[31m\r:smile:" in said
    assert "\x1b" not in said


def test_wide_characters_count_twice():
    said = printed(34, [TextColumn("a"), TextColumn("b")], [["漢字漢字漢字漢字", "12345 67890"]])
    assert not too_long(said, 34)
    assert "12345 67890" in said


def console(width: int) -> Console:
    return PlainConsole(file=io.StringIO(), width=width)


def test_sentences_break_between_words_and_paths_stay_whole():
    on = console(20)
    say(on, "tables are in /a/path/that/is/longer/than/a/line, all", indent="  ")
    assert on.file.getvalue().splitlines() == [
        "tables are in",
        "  /a/path/that/is/longer/than/a/line,",
        "  all",
    ]


@pytest.mark.parametrize("width", [40, 60, 1000])
def test_a_command_can_be_pasted_at_any_width(width):
    command = "infoplan run -m planner=uct,puct 'results_dir=a b  c' rho=0.1"
    on = console(width)
    say_command(on, "to be had with", command)
    said = on.file.getvalue()
    assert not too_long(said, width)
    pasted = said[said.index("infoplan") :].replace("\\\n", " ")
    assert re.sub(r" +(?=[-pr'])", " ", pasted).strip() == command


def test_a_plain_console_interprets_nothing():
    on = console(200)
    on.print("[red]m[/b]k\x1b[2J :smile:", Text("\x1b[b]"), soft_wrap=True)
    assert on.file.getvalue() == "[red]m[/b]k\\x1b[2J :smile: \\x1b[b]\n"
