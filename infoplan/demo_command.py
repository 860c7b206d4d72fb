"""What ``infoplan demo`` does: a small study from mission to report, by the commands themselves."""

import os
import shlex
import sys
import webbrowser
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

from infoplan.analyse.judging import SEEDS_NEEDED
from infoplan.analyse.tables import find_missions
from infoplan.draw.console import say, say_command, wide_console
from infoplan.files import writing
from infoplan.study.store import prepare
from infoplan.text_options import as_command, as_override
from infoplan.wording import counted

TRACK = 100
"""Length of the track that is planned after the survey, metres."""

LOG = "harbour.csv"
"""The log of the tour, as in the folder of examples."""


@dataclass(frozen=True)
class Step:
    """A step of the tour.

    Attributes
    ----------
    title, text
        What it shows.
    commands
        Command lines that make it, as a user would type them; none: the text says why.
    """

    title: str
    text: str
    commands: tuple[str, ...] = ()


def demo(
    results_dir: Path,
    budget: int,
    seeds: int,
    backend: str,
    show_page: bool,
    call: Callable[[list[str]], int],
) -> int:
    """Run ``infoplan demo``.

    Parameters
    ----------
    results_dir
        Folder of all that is made.
    budget
        Samples of a mission.
    seeds
        Missions of each method.
    backend
        As of ``infoplan run``.
    show_page
        Open the report where there are a terminal and a browser.
    call
        Runs a command line, the words after ``infoplan``; gives the exit status.

    Returns
    -------
    int
        1 if a command has failed, else 0.

    Raises
    ------
    UsageError, RunError
        As the commands; UsageError if the folder cannot be written.
    """
    console = wide_console()
    prepare(results_dir)
    with writing(results_dir / LOG):
        (results_dir / LOG).write_bytes((files("infoplan.survey") / LOG).read_bytes())
    for number, step in enumerate(tour(results_dir, budget, seeds, backend), 1):
        say(console, "")
        say(console, f"{number}. {step.title}", style="bold")
        say(console, step.text)
        for command in step.commands:
            say_command(console, "command:", command)
            sys.stdout.flush()
            if call(shlex.split(command)[1:]):
                say(console, "The tour ends here, as this command has failed.", style="bold red")
                return 1
    page = (results_dir / "report.html").resolve()
    opened = show_page and _opened(page)
    say(console, "")
    say(console, "Opened in the browser:" if opened else "Open in a browser:", style="bold")
    say(console, str(page))
    return 0


def tour(results_dir: Path, budget: int, seeds: int, backend: str) -> Iterator[Step]:
    """Give the steps of the tour, each when those before it have been taken.

    Parameters
    ----------
    results_dir, budget, seeds, backend
        As of `demo`.
    """
    options = f"rho=0.1 terrain=volcano budget={budget}"
    how = "" if backend == "loky" else f" backend={backend}"

    def run(choices: str, count: int) -> str:
        return as_command(f"infoplan run {choices} {options} seeds={count}{how}", results_dir)

    def of_study(what: str) -> str:
        return as_command(f"infoplan {what} budget={budget}", results_dir)

    yield Step(
        "The map",
        "A volcano that comes with infoplan. The picture shows it with the path on which the robot "
        "takes its first samples; more of it the robot does not know.",
        (as_command("infoplan terrain show terrain=volcano", results_dir),),
    )
    yield Step(
        "One mission",
        "One sample in ten is a spike. The detector COPOD throws out what looks like one, a "
        "Gaussian process learns the rest, and the paper's planner PUCT says where to drive next.",
        (run("planner=puct detector=copod", 1),),
    )
    missions = find_missions(
        results_dir, terrain="volcano", budget=budget, method="PUCT-COPOD", rho=0.1
    )
    yield Step(
        "What the mission was like",
        "How the error went as samples came in, which spikes the detector has found and which it "
        "has missed, and where the time went. A mission this short ends before all is learned.",
        (as_command(f"infoplan show {missions.missions['run'][0]}", results_dir),),
    )
    yield Step(
        "The paper's four methods",
        f"No detector (NONE), one that knows the spikes (BEST), COPOD, and COPOD with PUCT; "
        f"{counted(seeds, 'mission')} of each. What is stored already is not flown again.",
        (
            run("-m planner=uct detector=none,best,copod", seeds),
            run("planner=puct detector=copod", seeds),
        ),
    )
    yield Step(
        "Two of the paper's figures",
        "Fig. 3 counts where samples were flagged, which PUCT is drawn to; Fig. 6 compares what "
        "COPOD with and without PUCT believes with the ground truth.",
        (of_study("figures fig3 fig6"),),
    )
    few = (
        f"{counted(seeds, 'seed is', 'seeds are')} too few for any verdict: {SEEDS_NEEDED} are "
        "needed, and the paper flies ten. "
        if seeds < SEEDS_NEEDED
        else ""
    )
    yield Step(
        "The paper's claims",
        f"Each claim against these missions, with intervals over seeds. {few}Below the table "
        "stand the commands that make the runs that are missing.",
        (of_study("claims"),),
    )
    yield Step(
        "Curves, maps and claims on one page",
        "All that is above, and the maps of each mission, as one file that opens without network.",
        (of_study("report"),),
    )
    yield from _survey_steps(results_dir)


def _survey_steps(results_dir: Path) -> Iterator[Step]:
    """Give the steps about the log of a boat, which need degrees to be projected."""
    title = "A boat's log"
    if find_spec("pyproj") is None:
        text = "Left out: its degrees take pyproj, which pip install 'infoplan[survey]' brings."
        yield Step(title, text)
        return
    folder = results_dir / "survey"
    log = shlex.quote(str(results_dir / LOG))
    yield Step(
        title,
        "Soundings of a harbour (simulated): six are of fish, and for ten seconds the sounder is "
        "out of the water. Nobody knows the truth, so each sample is judged by the others.",
        (f"infoplan survey {log} batch=100 {as_override('results_dir', folder)}",),
    )
    surveyed = find_missions(folder).missions["run"][0]
    yield Step(
        "Where to sail next",
        f"A track of {TRACK} m towards what is uncertain and what was flagged, by the same "
        "planner, for a plotter or an autopilot.",
        (f"infoplan next {surveyed} budget={TRACK} {as_override('results_dir', folder)}",),
    )


def _opened(page: Path) -> bool:
    """Open a page in the browser of whoever sits at the terminal; False where there is none."""
    windows = {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ) or sys.platform != "linux"
    if not (windows and sys.stdout.isatty()):
        return False
    try:
        return webbrowser.get().open(page.as_uri())
    except webbrowser.Error:
        return False
