"""What ``infoplan multiverse`` does: work out or read the numbers, sum them up, draw them."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from infoplan.analyse.multiverse import (
    ClaimCurve,
    claim_curves,
    effects_jointly,
    joint_test,
    nearest_tenth,
)
from infoplan.analyse.universe_numbers import Multiverse, collect, read, write
from infoplan.draw.console import wide_console
from infoplan.draw.multiverse_table import chosen, print_multiverse, print_universe
from infoplan.draw.specification_curves import draw_claim, draw_effects, draw_overview
from infoplan.errors import UsageError
from infoplan.study.universes import CHOICES, Universe, universes
from infoplan.text_options import as_override
from infoplan.wording import suggest


def list_universes() -> int:
    """Name all universes, and what each chooses."""
    for universe in universes():
        print(f"{universe.name}: {chosen(universe)}")
    return 0


def multiverse(
    results_dir: Path, table: Path | None, universe: str | None, filters: Mapping[str, Any]
) -> int:
    """Sum up a multiverse, or tell about one universe.

    Parameters
    ----------
    results_dir
        Folder of the result tables; pictures land there in any case.
    table
        Numbers written by an earlier call; None: they are worked out from the results.
    universe
        Its name; None: all of them.
    filters
        Options of runs that are looked at.
    """
    one = None if universe is None else _named(universe)
    if table is None:
        numbers = collect(results_dir, _tell, **filters)
        table = results_dir / "multiverse.parquet"
        write(numbers, table)
        print(f"numbers of {len(numbers.universes)} universes: {table}", file=sys.stderr)
    else:
        numbers = read(table)
    if one is not None:
        if one.name not in numbers.numbers:
            raise UsageError(
                f"universe {one.name} is not in {table}: fly it with {_commands(one, numbers)[0]} "
                "and so on, as infoplan run -m experiment=multiverse does"
            )
        print_universe(numbers, one, _commands(one, numbers), wide_console())
        return 0
    curves = claim_curves(numbers)
    nearest = nearest_tenth(numbers)
    moves = {curve.name: effects_jointly(curve, numbers) for curve in curves}
    tests = [joint_test(curve) for curve in curves]
    print_multiverse(numbers, curves, tests, nearest, moves, wide_console())
    for path in draw(numbers, curves, nearest, moves, results_dir / "figures"):
        print(path)
    return 0


def draw(
    numbers: Multiverse,
    curves: list[ClaimCurve],
    nearest: list[str],
    moves: Mapping[str, pd.DataFrame],
    folder: Path,
) -> list[Path]:
    """Draw all curves together, each with its choices, and which choices move which claims."""
    files = draw_overview(curves, nearest, folder)
    for curve in curves:
        files += draw_claim(curve, numbers, nearest, folder)
    known = {name: table for name, table in moves.items() if not table.empty}
    if known:
        grids = [
            pd.DataFrame(
                {name: table.drop_duplicates("choice").set_index("choice")[column]
                 for name, table in known.items()}
            ).T.reindex(columns=[choice.name for choice in CHOICES]).dropna(axis=1, how="all")
            for column in ("share", "p")
        ]  # fmt: skip
        files += draw_effects(grids[0], grids[1], folder)
    return files


def _named(text: str) -> Universe:
    names = {universe.name: universe for universe in universes()}
    if text not in names:
        raise UsageError(
            f"there is no universe {text}{suggest(text, names)}: infoplan multiverse --list names "
            "them"
        )
    return names[text]


def _commands(universe: Universe, numbers: Multiverse) -> list[str]:
    """Commands that fly a universe as those of the others were flown."""
    common = [as_override("terrain", numbers.terrain), as_override("budget", numbers.budget),
              as_override("model", numbers.model), as_override("seeds", _seeds(numbers)),
              ]  # fmt: skip
    return [" ".join(["infoplan run -m", line, *common]) for line in universe.lines()]


def _seeds(numbers: Multiverse) -> int | list[int]:
    seeds = sorted(numbers.missions["seed"].unique().tolist())
    return len(seeds) if seeds == list(range(len(seeds))) else seeds


def _tell(text: str) -> None:
    print(text, file=sys.stderr)
