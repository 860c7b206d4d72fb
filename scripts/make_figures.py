"""Run what the paper's figures lack, then draw them: ``make_figures.py [option=value ...]``.

The options are those of ``infoplan run``: ``budget=400 seeds=2`` for a quick look.
"""

import sys
from dataclasses import fields

from infoplan.cli import main
from infoplan.config import Config, MissionConfig

# Options that say how to run, and where from, but not what: the figures have no use for them.
HOW_TO_RUN = {item.name for item in fields(Config)} - {item.name for item in fields(MissionConfig)}
HOW_TO_RUN = HOW_TO_RUN - {"results_dir"} | {"terrain.path", "terrain.on_missing"}


def make_figures(arguments: list[str]) -> int:
    """Run the study, draw the figures, and return the exit status."""
    if not any(argument.startswith("budget=") for argument in arguments):
        arguments = [f"budget={Config().budget}", *arguments]
    status = main(["run", "-m", "experiment=fig5", *arguments])
    chosen = [argument for argument in arguments if argument.partition("=")[0] not in HOW_TO_RUN]
    return status or main(["figures", *chosen])


if __name__ == "__main__":
    sys.exit(make_figures(sys.argv[1:]))
