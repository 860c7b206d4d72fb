"""Tables for LaTeX: read back by rules of LaTeX's own, they have the cells of the others."""

import json
import re
import string
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.text import Text

from infoplan.cli import main
from infoplan.draw.latex import LatexConsole, escaped, tabular
from infoplan.draw.table_layout import TextColumn, print_table

OLD = Path(__file__).parents[1] / "data" / "results-0.1.0"
WORDS = {
    "textbackslash": "\\", "textasciitilde": "~", "textasciicircum": "^", "textless": "<",
    "textgreater": ">", "textbar": "|", "textendash": "–",
}  # fmt: skip
"""What LaTeX sets for a command, by its manual."""


def as_set(latex: str) -> str:
    """Text that LaTeX sets: commands carried out, braces gone; an active sign is an error."""
    text, rest = "", latex
    while rest:
        if found := re.match(r"\\([a-zA-Z]+)\{\}", rest):
            text += WORDS[found[1]]
        elif found := re.match(r"\\([{}$&#%_])", rest):
            text += found[1]
        elif found := re.match(r"\$-\$", rest):
            text += "-"
        elif found := re.match(r"\{\}|\{(?=\[)|(?<=\[)\}", rest):
            pass
        else:
            found = re.match(r"[^\\{}$&#%_~^]", rest)
            assert found, f"{rest[:10]} means something to LaTeX"
            text += found[0]
        rest = rest[found.end() :]
    return text


def cells(latex: str) -> list[list[str]]:
    """Cells of all rows of the tables in a document, headings included."""
    rows = []
    tables = r"\\begin\{(tabular|longtable)\}\{.*?\}\n(.*?)\\end\{\1\}"
    for _, table in re.findall(tables, latex, re.DOTALL):
        once = re.sub(r"\\endfirsthead\n.*?\\endhead\n", "", table, flags=re.DOTALL)
        for line in once.splitlines():
            if line in (r"\toprule", r"\midrule", r"\bottomrule", r"\addlinespace"):
                continue
            if line.startswith(r"\caption{"):
                continue
            assert line.endswith(r" \\"), line
            parts = re.split(r"(?<!\\) & ", line.removesuffix(r" \\"))
            plain = [re.sub(r"^\\text(?:bf|it)\{(.*)\}$", r"\1", part) for part in parts]
            rows.append([as_set(part) for part in plain])
    return rows


def printed(capsys, *words: str) -> str:
    assert main([*words, f"results_dir={OLD}"]) == 0
    return capsys.readouterr().out


@given(st.text(string.ascii_letters + string.digits + string.punctuation.replace('"', "") + " –"))
def test_text_of_any_origin_is_set_as_it_is(text):
    written = escaped(text)
    assert as_set(written) == " ".join(text.split())
    assert "--" not in written


def test_signs_of_numbers_are_minus_and_dashes_of_names_are_none():
    assert escaped("-85.4 [-100, -7] ft") == "$-$85.4 [$-$100, $-$7] ft"
    assert escaped("UCT-COPOD run-0f3 1e-05 -inf") == "UCT-COPOD run-0f3 1e-05 $-$inf"
    assert escaped("±5 µm²") == r"$\pm$5 $\mu$m$^2$"


def test_what_begins_a_row_is_no_argument_of_the_one_before():
    rows = [[Text("[50,50]"), Text("a")], None, [Text("*"), Text("b")], None]
    lines = tabular(["grid", ""], [False, True], rows).splitlines()
    assert lines[0] == r"\begin{tabular}{lr}"
    assert lines[4:] == [r"{[}50,50] & a \\", r"\addlinespace", r"{*} & b \\", r"\bottomrule",
                         r"\end{tabular}"]  # fmt: skip


def test_a_table_is_whole_at_any_width_and_sentences_are_comments(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    console = LatexConsole()
    columns = [TextColumn("run"), TextColumn("a wide column", spare=1, right=True)]
    print_table(console, "50 % of all_runs", columns, [["uct\nab12", "1.5\n[1.0, 2.0]"]])
    console.print()
    console.print("first\nsecond")
    said = capsys.readouterr().out
    assert cells(said) == [["run", "a wide column"], ["uct ab12", "1.5 [1.0, 2.0]"]]
    assert r"\caption{50 \% of all\_runs}" in said
    assert said.endswith("\\end{table}\n\n% first\n% second\n")


def test_a_table_longer_than_a_page_breaks_between_pages_under_its_heading_again(capsys):
    rows = [[f"run {number}", str(number)] for number in range(60)]
    columns = [TextColumn("run"), TextColumn("seeds", right=True)]
    print_table(LatexConsole(), "all runs", columns, rows)
    said = capsys.readouterr().out
    assert cells(said) == [["run", "seeds"], *rows]
    assert said.startswith("\\begin{longtable}{lr}\n\\caption{all runs} \\\\\n\\toprule\n")
    assert said.count(r"run & seeds \\") == 2
    assert said.index(r"\endfirsthead") < said.rindex(r"run & seeds") < said.index(r"\endhead")


def test_the_leaderboard_has_the_cells_of_the_one_for_documents(capsys):
    markdown = printed(capsys, "leaderboard", "--markdown").splitlines()
    rows = [line[2:-2].split(" | ") for line in markdown if line.startswith("| ")]
    told = [[re.sub(r"\\(.)", r"\1", cell).strip() for cell in row] for row in rows]
    assert cells(printed(capsys, "leaderboard", "--latex")) == told


def test_claims_have_every_comparison_with_its_numbers(capsys):
    claims = json.loads(printed(capsys, "claims", "--json"))["claims"]
    head, *rows = cells(printed(capsys, "claims", "--latex"))
    assert head == ["claim", "compared", "effect [95 %]", "p", "stated", "seeds", "verdict"]
    assert {row[0]: row[6] for row in rows if row[0]} == {
        claim["name"]: claim["verdict"].upper() for claim in claims
    }
    compared = [one for claim in claims for one in claim["comparisons"] if not one["lacks"]]
    assert len(compared) > 10
    told = {row[1]: row for row in rows}
    for one in compared:
        number, _, unit = told[one["what"]][2].partition(" ")
        assert float(number) == pytest.approx(one["effect"], rel=5e-3, abs=1e-9)
        assert unit == one["unit"]


@pytest.mark.parametrize(
    "words", [("claims", "--latex", "--csv"), ("leaderboard", "--latex", "--html"),
              ("explain", "x", "--latex", "--json")],
)  # fmt: skip
def test_one_format_at_a_time(capsys, words):
    assert main([*words, f"results_dir={OLD}"]) == 2
    assert "or --latex: choose one" in capsys.readouterr().err
