"""Draw what every detector flags on one track: ``draw_detectors.py [folder]``, else docs."""

import sys
from pathlib import Path

import infoplan
from infoplan.detect import DETECTORS
from infoplan.draw import style
from infoplan.palette import BLUE, MARKS, Mark

FOLDER = Path(__file__).parents[1] / "docs"
OPTIONS = ("planner=lawnmower", "terrain=volcano", "fault=mixed", "rho=0.15", "grid=[10,10]")
FAULTS = ["spike", "burst", "stuck"]
SEED = 0
LOOKS = {
    "found": Mark(BLUE, MARKS["caught"].marker),  # white would not be seen on paper
    "missed": MARKS["missed"],
    "false alarms": MARKS["false-alarm"],
}


def draw_detectors(folder: Path = FOLDER, budget: int = 400) -> Path:
    """Draw a panel for each detector but the one that flags nothing, and return the file."""
    style.load_matplotlib()
    names = [name for name in DETECTORS if name != "none"]
    with style.journal():
        figure = style.new_figure(style.PAGE, 1.0 * len(names) + 0.4)
        panels = figure.subplots(len(names), 1, sharex=True, sharey=True)
        for axes, name in zip(panels, names, strict=True):
            _draw(axes, name, budget)
        panels[-1].set_xlabel("sample")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
        path = folder / "detectors.png"
        figure.savefig(path, dpi=110)
    return path


def _draw(axes, name: str, budget: int) -> None:
    options = {"fault.faults": FAULTS, "budget": budget}
    config = infoplan.configure(f"detector={name}", *OPTIONS, **options)
    samples = infoplan.fly(config, SEED).samples
    samples = samples[samples["epoch"] > 0]  # the pilot is not judged
    outlier, flagged = samples["is_outlier"], samples["flagged"]
    chosen = {
        "found": outlier & flagged,
        "missed": outlier & ~flagged,
        "false alarms": flagged & ~outlier,
    }
    axes.plot(samples.index, samples["measured"], ".", color=style.FAINT, ms=2, label="measurement")
    for what, look in LOOKS.items():
        there = samples[chosen[what]]
        axes.plot(there.index, there["measured"], look.marker, color=look.colour, mfc="none", ms=4,
                  mew=0.9, label=what)  # fmt: skip
    counts = ", ".join(f"{int(one.sum())} {what}" for what, one in chosen.items())
    style.panel(axes, "", f"{name}: {counts}")
    axes.set_ylabel("ft")


if __name__ == "__main__":
    print(draw_detectors(*map(Path, sys.argv[1:])))
