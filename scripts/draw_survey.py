"""Draw the survey of examples/harbour.csv: ``draw_survey.py [folder]``, else docs."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from infoplan.cli import main

ROOT = Path(__file__).parents[1]
WIDTH = 1000
"""Pixels; what the command draws is almost twice as wide."""


def draw_survey(folder: Path = ROOT / "docs", *options: str) -> Path:
    """Clean the log as the command does, and keep its picture; return the file."""
    with TemporaryDirectory() as results:
        log = str(ROOT / "examples" / "harbour.csv")
        if main(["survey", log, f"results_dir={results}", *options]):
            raise SystemExit(1)
        (drawn,) = Path(results).glob("surveys/*/picture.png")
        with Image.open(drawn) as picture:
            size = WIDTH, round(picture.height * WIDTH / picture.width)
            # All colours: a palette of 256 turns the marks of flags brown.
            small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    small.save(folder / "survey.png", optimize=True)
    return folder / "survey.png"


if __name__ == "__main__":
    print(draw_survey(*map(Path, sys.argv[1:])))
