"""The leaderboard for the terminal, as Markdown, and as one self-contained HTML page."""

import html
import math
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from infoplan.analyse.leaderboard import Leaderboard, Standing
from infoplan.analyse.statistics import Interval
from infoplan.draw import fault_table
from infoplan.draw.console import say
from infoplan.draw.table_layout import TextColumn, print_table
from infoplan.files import writing
from infoplan.method_identity import SPIKE
from infoplan.options import plain_number
from infoplan.wording import counted, harmless, markdown_cell

TITLE = "Leaderboard"

STYLE = """
:root { color-scheme: light dark; --line: #8885; --bar: #3b7dd8; }
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem; padding: 0 1rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
.wide { overflow-x: auto; }
th, td { padding: .3rem .7rem; border-bottom: 1px solid var(--line); text-align: right; }
table:not(.faults) :is(th, td):nth-child(2) { text-align: left; }
td { white-space: nowrap; }
.faults th:first-child { text-align: left; }
.faults td { text-align: center; padding: .2rem .5rem; line-height: 1.3; }
svg { display: block; width: 12rem; height: 1rem; }
svg line { stroke: var(--bar); stroke-width: 2; }
svg circle { fill: var(--bar); }
"""


def print_leaderboard(board: Leaderboard, console: Console) -> None:
    """Print the leaderboard as a table; where there is little room, without single maps.

    Where there are several faults, a table by fault follows.
    """
    named = columns(board)
    first_map = 5 + len(board.rhos)
    shown = [
        TextColumn(
            name,
            right=name != "method",
            spare=number if first_map <= number < len(named) - 3 else 0,
        )
        for number, name in enumerate(named)
    ]
    rows = [
        [harmless(cell).replace(" [", "\n[") for cell in cells(number, standing, decimals(board))]
        for number, standing in enumerate(board.standings, start=1)
    ]
    print_table(console, heading(board), shown, rows, named=2)
    for line in remarks(board):
        say(console, line)
    if board.by_fault:
        console.print()
        fault_table.print_by_fault(board.by_fault, console)


def markdown(board: Leaderboard) -> str:
    """Write the leaderboard as a Markdown table, and by fault as another."""
    by_fault = board.by_fault
    standings = (replace(one, method=markdown_cell(one.method)) for one in board.standings)
    maps = {markdown_cell(name): seeds for name, seeds in board.maps.items()}
    faults = tuple(map(markdown_cell, board.faults))
    notes = tuple(map(markdown_cell, board.notes))
    board = replace(board, standings=tuple(standings), maps=maps, faults=faults, notes=notes)
    named = columns(board)
    lines = [
        f"{heading(board)}",
        "",
        f"| {' | '.join(named)} |",
        f"|{'|'.join('---' if name == 'method' else '---:' for name in named)}|",
        *(
            f"| {' | '.join(cells(number, standing, decimals(board)))} |"
            for number, standing in enumerate(board.standings, start=1)
        ),
        "",
        *(f"{line}  " for line in remarks(board)),
    ]
    below = ["", fault_table.markdown(by_fault)] if by_fault else []
    return "\n".join([*lines, *below]).rstrip()


def write_page(board: Leaderboard, path: Path) -> Path:
    """Write the leaderboard as an HTML page that needs nothing else.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    named = columns(board)
    scores = [standing.score for standing in board.standings]
    ends = [end for score in scores for end in (score.mean, score.low, score.high)]
    ends = [end for end in ends if math.isfinite(end)]
    head = "".join(f"<th>{_escape(name)}</th>" for name in [*named[:3], "", *named[3:]])
    rows = []
    for number, standing in enumerate(board.standings, start=1):
        shown = [f"<td>{_escape(cell)}</td>" for cell in cells(number, standing, decimals(board))]
        shown.insert(3, f"<td>{_bar(standing.score, min(ends), max(ends))}</td>")
        rows.append(f"<tr>{''.join(shown)}</tr>")
    notes = "".join(f"<p>{_escape(line)}</p>" for line in remarks(board))
    if board.by_fault:
        notes += f"<h2>{fault_table.TITLE}</h2>{fault_table.page_table(board.by_fault)}"
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{TITLE}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{STYLE}</style></head><body><h1>{TITLE}</h1>"
        f"<p>{_escape(heading(board))}</p>"
        f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody>'
        f"</table></div>{notes}</body></html>\n"
    )
    with writing(path):
        path.write_text(page, encoding="utf-8")
    return path


def heading(board: Leaderboard) -> str:
    """Say what was compared."""
    maps = ", ".join(
        f"{name} ({counted(len(seeds), 'seed')})" for name, seeds in board.maps.items()
    )
    rhos = ", ".join(map(plain_number, board.rhos))
    faults = "" if board.faults == (SPIKE.name,) else f"fault {', '.join(board.faults)}; "
    return (
        f"{maps}; {faults}rho {rhos}; budget {board.budget}; {counted(board.missions, 'mission')}"
    )


def columns(board: Leaderboard) -> list[str]:
    """Name the columns."""
    return ["", "method", "area [95 %]", "behind the first",
            "first is better",
            *(f"rho {plain_number(rho)}" for rho in board.rhos),
            *(board.maps if len(board.maps) > 1 else ()), "final",
            "collapsed", "s a mission"]  # fmt: skip


def cells(number: int, standing: Standing, digits: int) -> list[str]:
    """Write a row, its scores with that many decimals."""
    by_map = standing.by_map.values() if len(standing.by_map) > 1 else ()
    return [
        str(number),
        standing.method,
        _interval(standing.score, digits),
        _interval(standing.behind, digits) if number > 1 else "",
        _interval(standing.beaten, 2) if number > 1 else "",
        *(f"{score:.{digits}f}" for score in standing.by_rho.values()),
        *(f"{score:.{digits}f}" for score in by_map),
        f"{standing.final:.{digits}f}",
        "-" if math.isnan(standing.collapsed) else f"{100 * standing.collapsed:.0f} %",
        f"{standing.seconds:.1f}",
    ]


def remarks(board: Leaderboard) -> list[str]:
    """Say how to read the table, and what was left out."""
    these = "these maps" if len(board.maps) > 1 else "this map"
    lines = [
        "area: mean RMSE from the pilot's end to the budget, divided by the standard deviation of "
        "the map, so that maps can be averaged; 0 is perfect, 1 no better than the map's mean",
        f"intervals: 95 %, over the seeds of {these}, and for {these} alone; methods whose "
        "distance to the first, paired by map and seed, has an interval that reaches 0 are not "
        "told apart from it",
        "first is better: probability that the first has the smaller area on the same map and seed",
        "collapsed: missions that end with a collapsed model, of which a mean says little",
    ]
    return [*lines, *board.notes]


def decimals(board: Leaderboard) -> int:
    """Count the decimals of all scores: three, or as many as the least needs for three digits."""
    scores = [one.score.mean for one in board.standings] + [one.final for one in board.standings]
    least = min((score for score in scores if score > 0), default=1.0)
    return max(3, 2 - math.floor(math.log10(least)))


def _interval(interval: Interval, digits: int) -> str:
    if math.isnan(interval.low):
        return f"{interval.mean:.{digits}f}"
    return f"{interval.mean:.{digits}f} [{interval.low:.{digits}f}, {interval.high:.{digits}f}]"


def _escape(text: str) -> str:
    return html.escape(harmless(text))


def _bar(interval: Interval, low: float, high: float) -> str:
    """Draw a mean with its interval between the least and the greatest end of all."""

    def at(value: float) -> str:
        return f"{4 + 192 * (value - low) / ((high - low) or 1):.1f}"

    line = ""
    if not math.isnan(interval.low):
        line = f'<line x1="{at(interval.low)}" x2="{at(interval.high)}" y1="8" y2="8"/>'
    return f'<svg viewBox="0 0 200 16">{line}<circle cx="{at(interval.mean)}" cy="8" r="4"/></svg>'
