"""Which figures there are, what they need, and drawing them from the stored results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from infoplan.analyse.by_fault import by_fault
from infoplan.analyse.commands import Wanted, commands
from infoplan.analyse.error_sources import stored_explanations
from infoplan.analyse.mission_scores import read_scores
from infoplan.analyse.tables import REPLAY, Selection
from infoplan.draw import calibration, error_sources, fig5, outliers
from infoplan.errors import UsageError
from infoplan.text_options import as_command
from infoplan.wording import suggest

OF_STUDY = ("fig1", "fig3", "fig4", "fig5", "fig6", "fig7", "calibration")
"""The paper's data figures, and how far models are calibrated, on one map."""

OUTLIERS = "outliers"
"""Methods against faults, over all maps."""

EXPLAIN = "explain"
"""Where errors come from, of the runs that ``infoplan explain`` has explained."""

NAMES = (*OF_STUDY, OUTLIERS, EXPLAIN)

MOST_NAMED = 4
"""So many missing runs are named at most."""


@dataclass(frozen=True)
class Drawn:
    """What became of a figure.

    Attributes
    ----------
    name
        Which.
    files
        Its PNG, PDF and CSV; none if it could not be drawn.
    problem
        A sentence about what is missing, with the command that makes it; empty if nothing is.
    """

    name: str
    files: tuple[Path, ...]
    problem: str


def draw_figures(
    selection: Selection,
    names: Sequence[str] = OF_STUDY,
    *,
    seed: int = 0,
    single_seeds: bool = False,
) -> list[Drawn]:
    """Draw figures of a study into the folder ``figures`` of the results.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_study`.
    names
        Which of `OF_STUDY`.
    seed
        Of the missions whose maps are shown.
    single_seeds
        Fig. 5 shows each seed, too.

    Returns
    -------
    list of Drawn
        One a figure. Fig. 5 and the calibration are drawn from whatever is there; the others need
        all their runs.
    """
    folder, drawn = selection.results_dir / "figures", []
    for name in names:
        files: list[Path] = []
        problem = ""
        if name == "fig5":
            lacking = _lacking(fig5.NEEDS, selection)
            # A study of other methods does not lack the paper's.
            if len(lacking) < len(fig5.NEEDS):
                problem = _missing(name, lacking, selection)
            files = fig5.draw(selection, folder, single_seeds=single_seeds)
        elif name == "calibration":
            files = calibration.draw(selection, folder)
        else:
            module = import_module(f"infoplan.draw.{name}")
            problem = _missing(name, _lacking(module.NEEDS, selection), selection) or _seedless(
                name, module.NEEDS, selection, seed
            )
            if not problem:
                files = module.draw(selection, folder, seed)
        drawn.append(Drawn(name, tuple(files), problem))
    return drawn


def draw_outliers(results_dir: Path, filters: Mapping[str, Any]) -> tuple[Drawn, tuple[str, ...]]:
    """Draw methods against faults into the folder ``figures`` of the results.

    Parameters
    ----------
    results_dir, filters
        As of `infoplan.analyse.mission_scores.read_scores`.

    Returns
    -------
    drawn : Drawn
    notes : tuple of str
        What was left out, and why.

    Raises
    ------
    UsageError, RunError
        As `read_scores`; and if the filters ask for replays.
    """
    if filters.get(REPLAY) is not None:
        raise UsageError(f"{OUTLIERS} shows methods, and a replay is nobody's: leave out {REPLAY}=")
    scores = read_scores(results_dir, filters)
    table = by_fault(scores.table)
    if table.cells.empty:
        problem = f"{OUTLIERS} needs a method with one seed on all its maps and at all its rhos"
        return Drawn(OUTLIERS, (), f"{problem}: choose with terrain=, rho= or the like"), ()
    return Drawn(OUTLIERS, tuple(outliers.draw(table, results_dir / "figures")), ""), scores.notes


def draw_explain(selection: Selection) -> Drawn:
    """Draw where the errors of a study's runs come from into the folder ``figures``.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_study`.
    """
    sources = stored_explanations(selection)
    if sources:
        files = error_sources.draw(sources, selection.results_dir / "figures")
        return Drawn(EXPLAIN, tuple(files), "")
    runs = [run for run, options in selection.options.items()
            if options["detector.name"] != "best"]  # fmt: skip
    cure = as_command(f"infoplan explain {runs[0]}" if runs else "infoplan run",
                      selection.results_dir)  # fmt: skip
    return Drawn(EXPLAIN, (), f"{EXPLAIN} needs a run that has been explained: run {cure}")


def check_names(names: Sequence[str]) -> list[str]:
    """Return figures' names, each once; none stands for all.

    Raises
    ------
    UsageError
        On an unknown figure.
    """
    for name in names:
        if name not in NAMES:
            raise UsageError(
                f"there is no figure {name!r}{suggest(name, NAMES)}: use {', '.join(NAMES)}"
            )
    return list(dict.fromkeys(names)) or list(NAMES)


def _lacking(needs: Sequence[Wanted], selection: Selection) -> list[Wanted]:
    return [need for need in needs if selection.run(*need) is None]


def _missing(name: str, lacking: list[Wanted], selection: Selection) -> str:
    if not lacking:
        return ""
    runs = [
        f"{method} at rho {rho:g}" + (" historical" if scope == "historical" else "")
        for method, rho, scope in lacking
    ]
    if len(runs) > MOST_NAMED:
        runs = [*runs[:MOST_NAMED], f"{len(runs) - MOST_NAMED} more"]
    cure = "; ".join(commands(selection, lacking))
    return f"{name} lacks {', '.join(runs)}: run {cure}"


def _seedless(name: str, needs: Sequence[Wanted], selection: Selection, seed: int) -> str:
    common: set[int] | None = None
    for need in needs:
        seeds = set(selection.seeds(str(selection.run(*need))))
        common = seeds if common is None else common & seeds
    if common and seed in common:
        return ""
    if not common:
        cure = "; ".join(commands(selection, needs))
        return f"{name} needs a seed that all its runs have: run {cure}"
    known = ", ".join(map(str, sorted(common)))
    return f"{name} cannot show seed {seed}, which not all its runs have: choose seed= of {known}"
