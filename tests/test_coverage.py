"""What docs/statistics.md says of coverage and false verdicts, simulated."""

import re
from pathlib import Path

import pytest

from benchmarks.coverage import (
    Scene,
    at_bound,
    coverage_table,
    equal,
    false_when_equal,
    maps_table,
    missed,
    on_maps,
    on_universes,
    skewed_table,
    universes_table,
    verdict_table,
    verdicts,
)

PAGE = Path(__file__).parents[1] / "docs" / "statistics.md"


def rows(lines: list[str]) -> list[list[str]]:
    """Split a Markdown table into the cells of its rows, the head first."""
    table = [line for line in lines if line.startswith("|") and "---" not in line]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table]


def table_of_the_page(head: list[str]) -> list[list[str]]:
    """Find the table of the page that has this head."""
    lines = [*PAGE.read_text(encoding="utf-8").splitlines(), ""]
    start = next(i for i, line in enumerate(lines) if rows([line]) == [head])
    end = next(i for i in range(start, len(lines)) if not lines[i].startswith("|"))
    return rows(lines[start:end])


def number(cell: str) -> float:
    return float(re.sub(r" \(C\d+\)", "", cell))


def test_t_covers_normal_differences_and_the_percentile_bootstrap_does_not():
    for n in (2, 5, 10):
        found = missed("t", 0, n, 20_000)
        assert found.covered == pytest.approx(0.95, abs=0.006)
        assert found.below == pytest.approx(0.025, abs=0.004)
    assert missed("percentile", 0, 2, 400).covered < 0.6
    assert missed("percentile", 0, 5, 400).covered < 0.9


def test_t_misses_skewed_differences_on_one_side():
    found = missed("t", 6, 10, 10_000)
    assert 0.6 < found.covered < 0.8
    assert found.below > 100 * found.above


def test_equal_methods_and_effects_at_the_bound_are_seldom_judged():
    for name, false in (("C4", "supported"), ("C7", "contradicted")):
        assert false_when_equal(name) == false
        assert verdicts(name, equal, 6, 400)[false] / 400 < 0.04
    assert 0.005 < verdicts("C4", at_bound, 10, 800)["contradicted"] / 800 < 0.05


def test_intervals_on_three_maps_cover():
    area, better = on_maps(5, 500)
    assert 0.92 < area < 0.98
    assert better > 0.93


def test_what_a_level_does_is_covered_however_much_seeds_react_alike():
    covered, _, found, _ = on_universes(Scene(reaction=1.5), 15)
    assert covered > 0.9, "with universes taken as independent it is 0.63"
    assert found < 0.3


@pytest.mark.long
@pytest.mark.parametrize(
    "table", [coverage_table, verdict_table, skewed_table, maps_table, universes_table]
)
def test_the_page_says_what_is_simulated(table):
    head, *simulated = rows(table(1000))
    page_head, *told = table_of_the_page(head)
    assert page_head == head
    named = {maps_table: 1, universes_table: 3}.get(table, 2)
    assert [row[:named] for row in told] == [row[:named] for row in simulated]
    for ours, theirs in zip(simulated, told, strict=True):
        found, said = ([number(cell) for cell in row[named:]] for row in (ours, theirs))
        # Five deviations of the difference of shares of so many and twice as many trials.
        trials = 100 if table is universes_table else 1000
        for a, b in zip(found, said, strict=True):
            share = min(max(b / 100, 0.01), 0.99)
            slack = 500 * (share * (1 - share) * (1 / trials + 1 / (2 * trials))) ** 0.5
            assert a == pytest.approx(b, abs=slack), ours
