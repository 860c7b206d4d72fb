"""Draw docs/multiverse.md again: ``draw_multiverse.py [table]``.

With a table, as ``infoplan multiverse`` writes it, its universes come into docs/multiverse.parquet
first, or with model=gp into docs/multiverse_exact.parquet, as far as they are whole; those that it
does not have stay there. Pictures and tables are then drawn from these files alone, without any
results.
"""

import re
import shutil
import sys
import tempfile
from pathlib import Path

from infoplan.analyse.multiverse import claim_curves, nearest_tenth
from infoplan.analyse.universe_numbers import read, write
from infoplan.analyse.universe_parts import joined, whole
from infoplan.draw.multiverse_markdown import control, markdown
from infoplan.draw.multiverse_page_data import what_moves
from infoplan.draw.specification_curves import draw_claim, draw_effects, draw_overview
from infoplan.errors import RunError, UsageError
from infoplan.multiverse_command import by_choice

FOLDER = Path(__file__).parents[1] / "docs"
BLOCK = re.compile(r"(<!-- all universes: make multiverse -->\n).*?(<!-- end -->)", re.S)
CONTROL = re.compile(r"(<!-- flown exactly: make multiverse -->\n).*?(<!-- end -->)", re.S)
FILES = {"vecchia": "multiverse.parquet", "gp": "multiverse_exact.parquet"}
"""Shipped numbers, by the model of their missions."""

PICTURES = ("multiverse.png", "multiverse_choices.png", "multiverse_c4.png")
CLAIM = "C4"
"""That the filter helps: below its curve the choices are drawn."""


def take_universes(table: Path, folder: Path = FOLDER) -> Path:
    """Put whole universes of a table into the folder's, and return that."""
    found = whole(read(table))
    path = folder / FILES[found.model]
    write(joined(read(path), found) if path.exists() else found, path)
    return path


def draw_multiverse(folder: Path = FOLDER) -> list[Path]:
    """Draw the pictures, write the tables of the page, and return the pictures."""
    numbers, exact = (read(folder / name) for name in FILES.values())
    curves, nearest = claim_curves(numbers), nearest_tenth(numbers)
    moved = {curve.name: what_moves(curve, numbers) for curve in curves}
    jointly = {name: found.jointly for name, found in moved.items()}
    shares, p = (by_choice(jointly, column) for column in ("share", "p"))
    helps = next(curve for curve in curves if curve.name == CLAIM)
    with tempfile.TemporaryDirectory() as made:
        draw_overview(curves, nearest, Path(made))
        draw_effects(shares, p, Path(made))
        draw_claim(helps, numbers, nearest, Path(made))
        pictures = [shutil.copy(Path(made) / name, folder) for name in PICTURES]
    page, tables = folder / "multiverse.md", markdown(numbers, curves, moved, nearest)
    text = page.read_text(encoding="utf-8")
    for block, made in ((BLOCK, tables), (CONTROL, control(numbers, exact))):
        text = block.sub(lambda old, made=made: f"{old[1]}\n{made}\n\n{old[2]}", text)
    page.write_text(text, "utf-8")
    return [Path(picture) for picture in pictures]


if __name__ == "__main__":
    try:
        for table in map(Path, sys.argv[1:]):
            print(take_universes(table))
        print(*draw_multiverse(), sep="\n")
    except (UsageError, RunError) as error:
        sys.exit(str(error))
