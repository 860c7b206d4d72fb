"""Stored missions: which are there, which belong together, and their tables."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pyarrow as pa

from infoplan.analyse.configurations import (
    Options,
    defaults_of,
    differing,
    option_text,
    stored_options,
)
from infoplan.errors import RunError, UsageError
from infoplan.files import user_path
from infoplan.html_table import html_table
from infoplan.method_identity import (
    GP,
    NEVER_ERRS,
    PAPERS_CHOICES,
    PAPERS_FOUR,
    REPLAY,
    labels,
    method_of,
)
from infoplan.study.run_names import choose_run
from infoplan.text_options import as_command, as_override, renamed
from infoplan.wording import counted, harmless, suggest

if TYPE_CHECKING:
    from infoplan.study.records import Footer

DEFAULT_TERRAIN = "helens"

LABELS = ("run", "seed", "method", "planner", "detector", "scope", "rho", "terrain", "budget")
"""What a mission can be chosen by, besides every option of its configuration."""


LISTED = 30
"""So many runs does a notebook show of a selection."""


@dataclass(frozen=True, repr=False)
class Selection:
    """Missions of one terrain and one budget, their tables comparable.

    Attributes
    ----------
    results_dir
        Where their tables are.
    missions
        One row a mission: the columns `LABELS`.
    options
        Configuration of each run, dotted names.
    terrain, unit, budget
        Common to all: the map's name, the unit of its elevations, samples of a mission.
    notes
        What was left out, and why: sentences for the reader.
    """

    results_dir: Path
    missions: pd.DataFrame
    options: dict[str, Options]
    terrain: str
    unit: str
    budget: int
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Sum up in a line."""
        counts = f"{counted(len(self.options), 'run')}, {counted(len(self.missions), 'mission')}"
        return harmless(
            f"Selection({counts}: {self.terrain}, budget {self.budget}, in {self.results_dir})"
        )

    def _repr_html_(self) -> str:
        """Show the runs in a notebook."""
        named = differing(self.options)
        rows = []
        for run, flat in list(self.options.items())[:LISTED]:
            values = [option_text(flat[name]) if name in flat else "" for name in named]
            rows.append([run, ", ".join(map(str, self.seeds(run))), *values])
        more = len(self.options) - LISTED
        below = [f"and {counted(more, 'run')} more"] if more > 0 else []
        return html_table(repr(self), rows, ["run", "seeds", *named], [*below, *self.notes])

    def run(self, method: str, rho: float, scope: str = "batch") -> str | None:
        """Name of a method's run at an outlier share; None if there is none.

        Parameters
        ----------
        method
            As ``PUCT-COPOD``.
        rho
            Share of outliers.
        scope
            Of the detector; NONE and BEST are the same mission under both.

        Raises
        ------
        UsageError
            If several runs answer to this: take the selection from `find_study`.
        """
        missions = self.missions
        chosen = missions[
            (missions["method"] == method)
            & ((missions["scope"] == scope) | missions["detector"].isin(NEVER_ERRS))
            & ((missions["rho"] - rho).abs() < 1e-9)
        ]
        names = sorted(set(chosen["run"]))
        if len(names) > 1:
            raise UsageError(f"{method} at rho={rho:g} is {' and '.join(names)}: choose with run=")
        return names[0] if names else None

    def seeds(self, run: str) -> list[int]:
        """Seeds of a run, ascending."""
        return sorted(self.missions.loc[self.missions["run"] == run, "seed"])

    def only(self, runs: Iterable[str], seeds: Iterable[int] | None = None) -> "Selection":
        """Return the missions of some runs, and of some seeds, alone."""
        kept = set(runs)
        missions = self.missions[self.missions["run"].isin(kept)]
        if seeds is not None:
            missions = missions[missions["seed"].isin(list(seeds))]
        return replace(
            self,
            missions=missions.reset_index(drop=True),
            options={run: flat for run, flat in self.options.items() if run in kept},
        )


def find_missions(results_dir: str | Path, **filters: Any) -> Selection:
    """Find the finished missions that answer to all filters.

    Parameters
    ----------
    results_dir
        Folder of the result tables.
    **filters
        One of `LABELS` or an option of the configuration (``**{"planner.exploration": 0.5}``), and
        its value, or a list of which any will do. A run may be named by its hash alone, or by the
        beginning of either; the terrain ``file`` is any that was read from a user's file. Without
        ``terrain`` it is helens if that is there. None filters nothing, and a run without the
        option (NONE has no contamination) passes. Replays are left out where there are flown
        missions, unless ``run``, ``method`` (as ``REPLAY-UCT-NONE``) or ``replay``, the name of the
        run that was flown or True for any, asks for them.

    Returns
    -------
    Selection

    Raises
    ------
    UsageError
        If nothing answers, a filter is unknown, or what answers mixes terrains or budgets; the
        sentence says what was found.
    RunError
        If a table cannot be read.
    """
    folder = user_path(results_dir)
    missions, options = _scan(folder)
    if missions.empty:
        raise UsageError(
            f"results_dir={folder} holds no finished mission: make some with "
            f"{as_command('infoplan run', folder)}, all of the paper's with "
            f"{as_command('infoplan run -m experiment=fig5', folder)}"
        )
    for name, wanted in filters.items():
        if wanted is not None:
            missions = _filtered(folder, missions, options, name, wanted)
    notes: tuple[str, ...] = ()
    replays = missions["run"].map(lambda run: REPLAY in options[run]).astype(bool)
    if all(filters.get(name) is None for name in ("run", "method", REPLAY)) and not replays.all():
        missions = missions[~replays]
        if replays.any():
            notes = (f"{counted(int(replays.sum()), 'replayed mission')} left out; choose with "
                     f"{REPLAY}=true",)  # fmt: skip
    if filters.get("terrain") is None and DEFAULT_TERRAIN in set(missions["terrain"]):
        others = missions[missions["terrain"] != DEFAULT_TERRAIN]
        missions = missions[missions["terrain"] == DEFAULT_TERRAIN]
        if len(others):
            notes = (*notes, f"missions on {_found(others, options, 'terrain')} left out; choose "
                             "with terrain=")  # fmt: skip
    runs = list(dict.fromkeys(missions["run"]))
    options = {run: options[run] for run in runs}
    _check_together(missions, options)
    demand_whole(folder, zip(missions["run"], missions["seed"].tolist(), strict=True))
    first = options[runs[0]]
    return Selection(
        folder,
        missions[list(LABELS)].sort_values(["run", "seed"], ignore_index=True),
        options,
        terrain=str(first["terrain.name"]),
        unit=str(first["terrain.unit"]),
        budget=int(first["budget"]),
        notes=notes,
    )


def find_study(results_dir: str | Path, **filters: Any) -> Selection:
    """Find missions that differ in method, scope, rho and seed alone; see `study_of`.

    Parameters
    ----------
    results_dir, **filters
        As for `find_missions`.

    Returns
    -------
    Selection

    Raises
    ------
    UsageError, RunError
        As `find_missions` and `study_of`.
    """
    return study_of(find_missions(results_dir, **filters))


def study_of(selection: Selection, free: Iterable[str] = ()) -> Selection:
    """Keep the missions that differ in method, scope, rho and seed alone.

    Where runs with other options are there, too, those with the default options are taken, and the
    selection's notes say what was left out. Options of a planner, detector or model are its alone:
    they are compared among its own runs.

    Parameters
    ----------
    selection
        From `find_missions`.
    free
        Further options in which they may differ.

    Raises
    ------
    UsageError
        If runs differ in an option and none has its default.
    """
    of_detectors = {
        name for flat in selection.options.values() for name in flat if name.startswith("detector.")
    }
    free = set(free)
    selection = _agreeing(selection, set(differing(selection.options)) - of_detectors - free)
    selection = _agreeing(selection, set(differing(selection.options)) - free)
    selection = _papers_methods(selection)
    seeds = selection.missions.groupby("run")["seed"].nunique()
    if seeds.min() == seeds.max():
        return selection
    note = f"the runs have {seeds.min()} to {seeds.max()} seeds; pairs use the seeds both have"
    return replace(selection, notes=tuple(dict.fromkeys((*selection.notes, note))))


def _papers_methods(selection: Selection) -> Selection:
    """Call the paper's methods by their names, too, where all have one other model."""
    models = {str(flat["model.name"]) for flat in selection.options.values()}
    methods = {run: method_of(flat) for run, flat in selection.options.items()}
    named = {run: replace(one, model=GP).label for run, one in methods.items()}
    own = {one.model for one in methods.values()} == {GP}
    if own or len(models) > 1 or not PAPERS_FOUR <= set(named.values()) <= set(PAPERS_CHOICES):
        return selection
    missions = selection.missions.assign(method=selection.missions["run"].map(named))
    note = f"all missions have model={models.pop()}"
    return replace(selection, missions=missions, notes=(*selection.notes, note))


def told_apart(selection: Selection) -> Selection:
    """Give runs of one method, rho and scope different names, by the options they differ in.

    The run whose options are the defaults keeps the method's name.
    """
    missions = selection.missions.copy()
    names: dict[str, str] = {}
    for method, of_method in missions.groupby("method"):
        runs = of_method.drop_duplicates("run").set_index("run")
        flats = {run: selection.options[run] for run in runs.index}
        differ = [name for name in differing(flats) if not name.endswith(".sha256")]
        for run, flat in flats.items():
            default = defaults_of(flat)
            own = [
                f"{k}={option_text(flat.get(k))}" for k in differ if flat.get(k) != default.get(k)
            ]
            names[run] = " ".join([str(method), *own])
        runs["name"] = pd.Series(names)
        for run in runs.index[runs.duplicated(["rho", "scope", "name"], keep=False)]:
            source = flats[run].get(REPLAY)
            digest = str(source or run).rpartition("-")[2]
            names[run] += f" of {digest}" if source else f" {digest}"
    missions["method"] = missions["run"].map(names)
    return replace(selection, missions=missions)


def load_curves(source: str | Path | Selection, **filters: Any) -> pd.DataFrame:
    """Load learning curves, one row a decision epoch, of all missions that answer to the filters.

    Parameters
    ----------
    source
        Folder of the result tables, or a selection.
    **filters
        As for `find_missions`; not with a selection.

    Returns
    -------
    DataFrame
        The columns of the curve table, and ``run`` and ``method`` (as ``UCT-NONE``); at the end a
        column for each option in which the runs differ (`differing`), as ``planner.exploration``:
        NaN or None where a run has no such option, a list as text (``[50,50]``).

    Raises
    ------
    UsageError, RunError
        As `find_missions`.
    """
    return _load(source, "curves", filters)


def load_samples(source: str | Path | Selection, **filters: Any) -> pd.DataFrame:
    """Load samples, one row a sample in order of collection; otherwise as `load_curves`."""
    return _load(source, "samples", filters)


def load_maps(source: str | Path | Selection, **filters: Any) -> pd.DataFrame:
    """Load final maps, one row a node of the query grid; otherwise as `load_curves`."""
    return _load(source, "maps", filters)


def _scan(folder: Path) -> tuple[pd.DataFrame, dict[str, Options]]:
    """List all finished missions, and the configuration of each run, from the curves' footers."""
    rows, options = [], {}
    for run, seed, footer in stored_footers(folder):
        if run not in options:
            options[run] = stored_options(footer.configuration)
        flat = options[run]
        rows.append(
            {
                "run": run,
                "seed": seed,
                "method": method_of(flat),
                "planner": flat["planner.name"],
                "detector": flat["detector.name"],
                "scope": flat["detector.scope"],
                "rho": float(flat["rho"]),
                "terrain": flat["terrain.name"],
                "budget": int(flat["budget"]),
            }
        )
    missions = pd.DataFrame(rows)
    if rows:
        missions["method"] = missions["method"].map(labels(missions["method"]))
    return missions, options


def stored_footers(folder: Path) -> Iterator[tuple[str, int, "Footer"]]:
    """Read the footers of all curves.

    Yields
    ------
    run : str
    seed : int
    footer : Footer

    Raises
    ------
    RunError
        If a curve cannot be read, or is another mission's than its path says.
    """
    from infoplan.study.store import list_missions, read_footer, table_path

    for run, seeds in list_missions(folder).items():
        for seed in seeds:
            yield run, seed, read_footer(table_path(folder, "curves", run, seed))


def demand_whole(folder: Path, missions: Iterable[tuple[str, int]]) -> None:
    """Refuse missions whose tables are damaged, or do not belong together.

    Raises
    ------
    RunError
        Names the first one.
    """
    from infoplan.study.store import inspect

    for run, seed in missions:
        stored = inspect(folder, run, seed)
        if stored.state != "done":
            raise RunError(stored.reason or f"{run} seed {seed} has gone meanwhile: run it again")


def _rows(missions: pd.DataFrame) -> list[dict[str, Any]]:
    return [
        {str(name): value for name, value in row.items()} for row in missions.to_dict("records")
    ]


def _filtered(
    folder: Path, missions: pd.DataFrame, options: dict[str, Options], name: str, wanted: Any
) -> pd.DataFrame:
    """Keep the missions that answer to one filter; at least one must."""
    name = renamed(name)
    known = {*LABELS, *(key for flat in options.values() for key in flat)}
    if name not in known:
        raise UsageError(
            f"{name}={wanted} chooses nothing{suggest(name, known)}: use {', '.join(LABELS)} or "
            "an option of the runs"
        )
    if name == "run":
        listed = [wanted] if isinstance(wanted, str) else list(wanted)
        runs = [choose_run(str(text), missions["run"], folder) for text in listed]
        return missions[missions["run"].isin(runs)]
    kept = missions[[_answers(row, options, name, wanted) for row in _rows(missions)]]
    if kept.empty:
        raise UsageError(
            f"there is no mission with {name}={option_text(wanted)}: "
            f"there is {_found(missions, options, name)}"
        )
    return kept


def _answers(row: dict[str, Any], options: dict[str, Options], name: str, wanted: Any) -> bool:
    if name == REPLAY:
        flown = options[row["run"]].get(REPLAY)
        return flown is not None and (wanted is True or flown == wanted)
    if name not in LABELS and name not in options[row["run"]]:
        return True  # NONE and BEST go with any option of COPOD
    value: Any = row[name] if name in LABELS else options[row["run"]][name]
    # An option may be a list itself; a list of lists then offers several.
    several = isinstance(wanted, list | tuple | set) and not isinstance(value, list)
    choices = list(wanted) if several else [wanted]
    if name == "method":
        return value in [str(choice).upper() for choice in choices]
    if name == "terrain" and "file" in choices and value.startswith("file-"):
        return True
    if isinstance(value, float):
        return any(_number(choice) == value for choice in choices)
    return value in choices


def _number(choice: Any) -> float | None:
    return float(choice) if isinstance(choice, int | float) else None


def _found(missions: pd.DataFrame, options: dict[str, Options], name: str) -> str:
    """Say which values of a label or an option there are, and on how many missions."""
    values = (
        missions[name]
        if name in LABELS
        else missions["run"].map(lambda run: option_text(options[run].get(name)))
    )
    counts = values.map(option_text).value_counts(sort=False)
    shown = [f"{value} ({count})" for value, count in counts.items()]
    return ", ".join(shown[:8]) + (" and others" if len(shown) > 8 else "")


def _check_together(missions: pd.DataFrame, options: dict[str, Options]) -> None:
    """Refuse to mix terrains, budgets, or maps of one name."""
    for name in ("terrain", "budget"):
        if missions[name].nunique() > 1:
            raise UsageError(
                f"the missions have different {name}s, {_found(missions, options, name)}: "
                f"choose one with {name}="
            )
    for name in ("terrain.sha256", "terrain.extent", "terrain.unit"):
        if len({repr(flat.get(name)) for flat in options.values()}) > 1:
            raise UsageError(
                f"the missions are on different maps called {missions['terrain'].iloc[0]}, "
                f"{name} {_found(missions, options, name)}: choose one with {name}="
            )


def _agreeing(selection: Selection, names: set[str]) -> Selection:
    """Keep the runs that agree in some options: if several groups do, the default ones."""
    unusual: dict[str, list[str]] = {}
    for run, flat in selection.options.items():
        default = defaults_of(flat)
        others = [name for name in flat if name in names and flat[name] != default.get(name)]
        if others:
            unusual[run] = others
    if not unusual:
        return selection
    named = sorted({name for others in unusual.values() for name in others})
    if len(unusual) == len(selection.options):
        found = {
            name: sorted(
                (flat[name] for flat in selection.options.values() if name in flat), key=option_text
            )
            for name in named
        }
        listed = "; ".join(
            f"{name} ({', '.join(dict.fromkeys(map(option_text, values)))})"
            for name, values in found.items()
        )
        raise UsageError(
            f"the runs do not belong together, they differ in {listed}: "
            f"choose with {as_override(named[0], found[named[0]][0])} or the like"
        )
    which = "is left out; choose it" if len(unusual) == 1 else "are left out; choose them"
    note = (
        f"{counted(len(unusual), 'run')} with other than the default {', '.join(named)} "
        f"{which} with {named[0]}=..."
    )
    kept = selection.only(set(selection.missions["run"]) - set(unusual))
    return replace(kept, notes=(*selection.notes, note))


def _load(source: str | Path | Selection, table: str, filters: dict[str, Any]) -> pd.DataFrame:
    from infoplan.study.store import read_table

    if isinstance(source, Selection):
        if filters:
            raise UsageError("a selection is filtered already: filter where it is made")
        selection = source
    else:
        selection = find_missions(source, **filters)
    labels = ("run", "method", "planner", "detector", "scope", "rho")
    frames = []
    for row in _rows(selection.missions):
        stored = read_table(selection.results_dir, table, row["run"], row["seed"])
        for position, name in enumerate(labels):
            if name not in stored.column_names:
                stored = stored.add_column(position, name, [[row[name]] * len(stored)])
        frames.append(stored)
    # Versions differ in columns: what a file has not is missing in its rows.
    try:
        together: pd.DataFrame = pa.concat_tables(frames, promote_options="permissive").to_pandas()
    except pa.ArrowException as error:
        raise RunError(
            f"the {table} do not go together ({harmless(str(error))}): choose runs with run="
        ) from error
    for name in differing(selection.options):
        values = {run: _value(flat.get(name)) for run, flat in selection.options.items()}
        together[name] = together["run"].map(values)
    return together


def _value(option: Any) -> Any:
    """Give an option's value as the cell of a data frame, which must be hashable."""
    return option_text(option) if isinstance(option, list | dict) else option
