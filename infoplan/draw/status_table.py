"""The state of a results folder as a table."""

from rich.console import Console

from infoplan.analyse.status import Status
from infoplan.draw.console import say
from infoplan.draw.study_tables import option_cells
from infoplan.draw.table_layout import WHOLE, TextColumn, print_table
from infoplan.palette import TERMINAL
from infoplan.study.estimate import duration
from infoplan.wording import figure, spans


def print_status(found: Status, console: Console) -> None:
    """Print the state of a results folder, and what is wrong in it."""
    if found.runs:
        _print_table(found, console)
    else:
        say(console, f"there is no run in {found.results_dir} yet")
    for problem in found.problems:
        say(console, problem, style=TERMINAL["caution"])


def _print_table(found: Status, console: Console) -> None:
    rare = [name for name in ("failed", "running", "broken")
            if any(getattr(run, name) for run in found.runs)]  # fmt: skip
    kept = ["done", *rare, "missing"]
    apart = list(dict.fromkeys(name for run in found.runs for name in run.options))
    columns = [
        TextColumn("run", least=WHOLE),
        *(TextColumn(name, right=True) for name in apart),
        *(
            TextColumn(
                name,
                right=True,
                empty="none",
                style=TERMINAL["failure"] if name in ("failed", "broken") else "",
            )
            for name in kept
        ),
        TextColumn("last (UTC)", right=True, spare=1),
        TextColumn("s a seed", right=True, spare=2),
        TextColumn("in all", right=True, spare=3),
    ]
    rows = []
    for run in found.runs:
        mean = figure(run.seconds / len(run.done)) if run.done else ""
        ended = run.last[:16].replace("T", " ") if run.last else ""
        rows.append([run.run, *option_cells(run.options, apart).values(),
                     *(spans(getattr(run, name)) for name in kept), ended, mean,
                     duration(run.seconds) if run.done else ""])  # fmt: skip
    title = f"runs in {found.results_dir}, and which of their seeds are done"
    print_table(console, title, columns, rows)
