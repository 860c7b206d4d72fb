"""Which figures there are, what they need, and drawing them from the stored results."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from infoplan.analyse.commands import Wanted, commands
from infoplan.analyse.tables import Selection
from infoplan.errors import UsageError
from infoplan.wording import suggest

NAMES = ("fig1", "fig3", "fig4", "fig5", "fig6", "fig7")
"""The paper's data figures, each drawn by the module of its name."""

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
    names: Sequence[str] = (),
    *,
    seed: int = 0,
    single_seeds: bool = False,
) -> list[Drawn]:
    """Draw figures into the folder ``figures`` of the results.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_study`.
    names
        Which; all if none.
    seed
        Of the missions whose maps are shown.
    single_seeds
        Fig. 5 shows each seed, too.

    Returns
    -------
    list of Drawn
        One a figure. Fig. 5 is drawn from whatever is there; the others need all their runs.

    Raises
    ------
    UsageError
        On an unknown figure.
    """
    folder, drawn = selection.results_dir / "figures", []
    for name in check_names(names):
        module = import_module(f"infoplan.draw.{name}")
        lacking = [need for need in module.NEEDS if selection.run(*need) is None]
        files: list[Path] = []
        problem = ""
        if name == "fig5":
            # A study of other methods does not lack the paper's.
            if len(lacking) < len(module.NEEDS):
                problem = _missing(name, lacking, selection)
            files = module.draw(selection, folder, single_seeds=single_seeds)
        else:
            problem = _missing(name, lacking, selection) or _seedless(
                name, module.NEEDS, selection, seed
            )
            if not problem:
                files = module.draw(selection, folder, seed)
        drawn.append(Drawn(name, tuple(files), problem))
    return drawn


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
