"""Draw methods against faults for docs/outliers.md: ``draw_outliers.py [results folder]``.

With a folder its scores are written to docs/outliers.csv first. Picture and table are then drawn
from that file alone, without any results.
"""

import re
import sys
from pathlib import Path

import pandas as pd

from infoplan.analyse.by_fault import by_fault
from infoplan.analyse.mission_scores import read_scores
from infoplan.draw import style
from infoplan.draw.fault_table import markdown
from infoplan.draw.outliers import picture
from infoplan.errors import RunError, UsageError

FOLDER = Path(__file__).parents[1] / "docs"
SHIPPED = ["method", "fault", "rho", "terrain", "seed", "reference", "area", "final"]
BLOCK = re.compile(r"(<!-- methods against faults: make outliers -->\n).*?(<!-- end -->)", re.S)


def take_scores(results_dir: Path, folder: Path = FOLDER) -> Path:
    """Write the scores of a results folder, a row a mission, and return the file."""
    table = read_scores(results_dir).table[SHIPPED].sort_values(SHIPPED[:5])
    path = folder / "outliers.csv"
    table.to_csv(path, index=False, float_format="%.6g")
    return path


def draw_outliers(folder: Path = FOLDER) -> Path:
    """Draw the picture, write the table of the page, and return the picture."""
    table = by_fault(pd.read_csv(folder / "outliers.csv"))
    path = folder / "outliers.png"
    with style.journal():
        picture(table).savefig(path, dpi=160)
    page = folder / "outliers.md"
    text = page.read_text(encoding="utf-8")
    page.write_text(
        BLOCK.sub(lambda old: f"{old[1]}\n{markdown(table)}\n\n{old[2]}", text), "utf-8"
    )
    return path


if __name__ == "__main__":
    try:
        for results in map(Path, sys.argv[1:]):
            print(take_scores(results))
        print(draw_outliers())
    except (UsageError, RunError) as error:
        sys.exit(str(error))
