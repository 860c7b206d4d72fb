"""The leaderboard for the terminal, as Markdown, and as one self-contained HTML page."""

import math
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from infoplan.analyse.leaderboard import Leaderboard, Standing
from infoplan.analyse.statistics import Interval
from infoplan.draw import fault_table
from infoplan.draw.console import say
from infoplan.draw.page import as_html, method_key, style_sheet, write_page
from infoplan.draw.table_layout import TextColumn, print_table
from infoplan.method_identity import SPIKE, Look, looks
from infoplan.options import plain_number
from infoplan.wording import counted, harmless, markdown_cell

TITLE = "Leaderboard"

NUMBER = ' class="number"'


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


def write_leaderboard(board: Leaderboard, path: Path) -> Path:
    """Write the leaderboard as an HTML page that needs nothing else, not even a script.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    scores = [standing.score for standing in board.standings]
    ends = [end for score in scores for end in (score.mean, score.low, score.high)]
    ends = [end for end in ends if math.isfinite(end)]
    head = "".join(
        f'<th scope="col"{NUMBER if name != "method" else ""}>{as_html(name)}</th>'
        for name in columns(board)
    )
    seen = looks(standing.method for standing in board.standings)
    rows = []
    for place, standing in enumerate(board.standings, start=1):
        look = seen[standing.method]
        number, method, score, *others = map(as_html, cells(place, standing, decimals(board)))
        interval = _interval_picture(standing.score, (min(ends), max(ends)), look)
        rows.append(
            f"<tr><td{NUMBER}>{number}</td>"
            f'<th scope="row">{method_key(look)}{method}</th>'
            f"<td{NUMBER}>{score}{interval}</td>"
            + "".join(f"<td{NUMBER}>{text}</td>" for text in others)
            + "</tr>"
        )
    notes = "".join(f"<p>{as_html(line)}</p>" for line in remarks(board))
    if board.by_fault:
        notes += (
            f"<section><h2>{fault_table.TITLE}</h2>{fault_table.page_table(board.by_fault)}"
            "</section>"
        )
    page = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{TITLE}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<style>\n{style_sheet('page', 'leaderboard_page')}</style></head>\n"
        f'<body><header><div><p class="brand">infoplan leaderboard</p><h1>{TITLE}</h1>'
        f'<p class="muted">{as_html(heading(board))}</p></div></header>\n'
        f'<main><div class="scroll" role="region" aria-label="{TITLE}" tabindex="0">'
        f'<table class="board"><thead><tr>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table>'
        f"</div>{notes}</main></body></html>\n"
    )
    write_page(path, page)
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


def _interval_picture(interval: Interval, ends: tuple[float, float], look: Look) -> str:
    """Draw a mean with its interval between the least and the greatest end of all."""
    low, high = ends

    def at(value: float) -> str:
        return f"{6 + 188 * (value - low) / ((high - low) or 1):.1f}"

    line = ""
    if not math.isnan(interval.low):
        line = f'<path class="line" d="M{at(interval.low)} 8H{at(interval.high)}"/>'
    return (
        f'<svg class="interval" viewBox="0 0 200 16" aria-hidden="true" '
        f'style="--colour:{look.colour}">{line}'
        f'<circle class="dot" cx="{at(interval.mean)}" cy="8" r="5"/></svg>'
    )
