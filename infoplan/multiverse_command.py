"""What ``infoplan multiverse`` does: work out or read the numbers, sum them up, draw them."""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from infoplan.analyse.claims import TEXTS
from infoplan.analyse.multiverse import ClaimCurve, claim_curves, nearest_tenth, why_unjudged
from infoplan.analyse.tables import LABELS
from infoplan.analyse.universe_numbers import (
    OPTIONS,
    Multiverse,
    collect,
    how_to_fly,
    read,
    write,
)
from infoplan.draw.console import say
from infoplan.draw.latex import LatexConsole
from infoplan.draw.multiverse_markdown import markdown
from infoplan.draw.multiverse_page import write_multiverse_page
from infoplan.draw.multiverse_page_data import Moved, summary_data, what_moves
from infoplan.draw.multiverse_table import (
    chosen,
    print_claim,
    print_multiverse,
    print_unflown,
    print_universe,
)
from infoplan.draw.specification_curves import draw_claim, draw_effects, draw_overview
from infoplan.errors import UsageError
from infoplan.study.store import list_missions
from infoplan.study.universes import CHOICES, Universe, universes
from infoplan.text_options import as_command, as_override
from infoplan.wording import counted, suggest

PARTING = {*LABELS, *OPTIONS} - {"terrain", "budget"}
"""Filters that leave some of a universe's missions out, or some universes."""


def list_universes(console: Console) -> int:
    """Name all universes, and what each chooses."""
    for universe in universes():
        say(console, f"{universe.name}: {chosen(universe)}", indent="    ")
    return 0


def multiverse(
    results_dir: Path,
    table: Path | None,
    universe: str | None,
    claim: str | None,
    filters: Mapping[str, Any],
    console: Console,
    as_json: bool = False,
    as_markdown: bool = False,
) -> int:
    """Sum up a multiverse, or tell about one universe or claim.

    Parameters
    ----------
    results_dir
        Folder of the result tables; pictures land there in any case.
    table
        Numbers written by an earlier call; None: they are worked out from the results.
    universe
        Name of one.
    claim
        Name of one, as C4.
    filters
        Options of runs that are looked at.
    console
        Where the tables go; on one for LaTeX files are named on standard error.
    as_json
        Print how all claims fare for scripts, and draw nothing.
    as_markdown
        Print that and what every level does for documents, and draw nothing.
    """
    if (as_json or as_markdown) and (universe or claim):
        flag = "--json" if as_json else "--markdown"
        raise UsageError(f"{flag} is of all claims and universes: leave universe= and claim= out")
    if universe and claim:
        raise UsageError("universe= and claim= are told one at a time: leave one of them out")
    given = [name for name, value in filters.items() if value is not None]
    if table and given:
        raise UsageError(
            f"{given[0]}= chooses among stored runs, and table= holds numbers of all: leave one of "
            "them out"
        )
    one = None if universe is None else _named(universe)
    if claim is not None and claim.upper() not in TEXTS:
        raise UsageError(f"there is no claim {claim}: it is one of {', '.join(TEXTS)}")
    if one and not table and not list_missions(results_dir):
        told = f"results_dir={results_dir} holds no mission"
        print_unflown(one, told, _commands(one, results_dir), console)
        return 0
    numbers = read(table) if table else _collect(results_dir, filters)
    folder = results_dir / "figures"
    draw: Callable[[], list[Path]] = list
    if one and one.name not in numbers.numbers:
        told = f"it is not among {counted(len(numbers.universes), 'universe')} that were flown"
        print_unflown(one, told, _commands(one, results_dir, numbers), console)
    elif one:
        print_universe(numbers, one, _commands(one, results_dir, numbers), console)
    elif claim is not None:
        curve = _curve(claim.upper(), numbers)
        moved = what_moves(curve, numbers)
        print_claim(numbers, curve, moved.alone, moved.jointly, moved.pairs, moved.rules,
                    moved.test, console)  # fmt: skip
        draw = partial(draw_claim, curve, numbers, nearest_tenth(numbers), folder)
    else:
        curves, nearest = claim_curves(numbers), nearest_tenth(numbers)
        found = {curve.name: what_moves(curve, numbers) for curve in curves}
        if as_json:
            document = summary_data(numbers, curves, found, nearest)
            print(json.dumps(document, indent=2, allow_nan=False))
        elif as_markdown:
            print(markdown(numbers, curves, found, nearest))
        else:
            moves = {name: moved.jointly for name, moved in found.items()}
            tests = [moved.test for moved in found.values()]
            print_multiverse(numbers, curves, tests, nearest, moves, console)
            draw = partial(_draw_all, numbers, curves, found, nearest, results_dir)
    # What is told is not lost where nothing can be written.
    if not table:
        _keep(numbers, results_dir, filters)
    for path in draw():
        print(path, file=sys.stderr if isinstance(console, LatexConsole) else sys.stdout)
    return 0


def _curve(name: str, numbers: Multiverse) -> ClaimCurve:
    curves = claim_curves(numbers, [name])
    if not curves:
        raise UsageError(f"no universe can judge {name}: {why_unjudged(name, numbers)}")
    return curves[0]


def _draw_all(
    numbers: Multiverse,
    curves: Sequence[ClaimCurve],
    found: Mapping[str, Moved],
    nearest: Sequence[str],
    results_dir: Path,
) -> list[Path]:
    """Draw all claims' curves and what moves them, and write the page."""
    folder, page = results_dir / "figures", results_dir / "multiverse.html"
    files = draw_overview(curves, nearest, folder) if curves else []
    write_multiverse_page(page, numbers, curves, found, nearest,
                          lambda each: _commands(each, results_dir, numbers))  # fmt: skip
    moves = {name: moved.jointly for name, moved in found.items()}
    shares, p = (by_choice(moves, column) for column in ("share", "p"))
    if not shares.empty:
        files += draw_effects(shares, p, folder)
    return [*files, page]


def by_choice(moves: Mapping[str, pd.DataFrame], column: str) -> pd.DataFrame:
    """Lay out a column of `effects_jointly`: a row a claim that has any, a column a choice.

    Choices that move no claim are left out.
    """
    of_claim = {
        name: effects.drop_duplicates("choice").set_index("choice")[column]
        for name, effects in moves.items() if not effects.empty
    }  # fmt: skip
    met = {choice for column_of in of_claim.values() for choice in column_of.index}
    return pd.DataFrame(of_claim).T.reindex(
        columns=[choice.name for choice in CHOICES if choice.name in met]
    )


def _collect(results_dir: Path, filters: Mapping[str, Any]) -> Multiverse:
    """Work out the numbers of what is stored."""
    if not list_missions(results_dir):
        raise UsageError(f"results_dir={results_dir} holds no mission: {how_to_fly(results_dir)}")
    return collect(results_dir, _tell, **filters)


def _keep(numbers: Multiverse, results_dir: Path, filters: Mapping[str, Any]) -> None:
    """Write the numbers unless they are of a part."""
    told = f"numbers of {counted(len(numbers.universes), 'universe')}"
    parted = [name for name in filters if name in PARTING and filters[name] is not None]
    if parted:
        _tell(f"{told}, not written as {parted[0]}= leaves out parts of them")
        return
    table = results_dir / "multiverse.parquet"
    write(numbers, table)
    _tell(f"{told}: {table}")


def _named(text: str) -> Universe:
    names = {universe.name: universe for universe in universes()}
    if text not in names:
        raise UsageError(
            f"there is no universe {text}{suggest(text, names)}: infoplan multiverse --list names "
            "them"
        )
    return names[text]


def _commands(
    universe: Universe, results_dir: Path, numbers: Multiverse | None = None
) -> list[str]:
    """Commands that fly a universe, as those of the others were flown if some were."""
    common = ["seeds=6"]
    if numbers:
        common = [as_override("terrain", numbers.terrain), as_override("budget", numbers.budget),
                  as_override("model", numbers.model), as_override("seeds", _seeds(numbers)),
                  ]  # fmt: skip
    return [
        as_command(" ".join(["infoplan run -m", line, *common]), results_dir)
        for line in universe.lines()
    ]


def _seeds(numbers: Multiverse) -> int | list[int]:
    seeds = sorted(numbers.missions["seed"].unique().tolist())
    return len(seeds) if seeds == list(range(len(seeds))) else seeds


def _tell(text: str) -> None:
    print(text, file=sys.stderr)
