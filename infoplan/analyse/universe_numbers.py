"""The numbers of every universe: which stored mission belongs to which, and what claims compare."""

import json
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from joblib import Parallel, delayed

from infoplan.analyse.configurations import Options, defaults_of
from infoplan.analyse.curves import EARLY, mean_between, value_at
from infoplan.analyse.judging import USUAL, Rules
from infoplan.analyse.measures import MEASURES, Measures
from infoplan.analyse.tables import Selection, find_missions, study_of
from infoplan.errors import UsageError
from infoplan.files import writing
from infoplan.study.universes import CHOICES, FILTERED, METHODS, Universe, universes
from infoplan.text_options import as_command
from infoplan.wording import counted, harmless

SUMMED = ("final", "early", "late", "rise", "precision")
"""Numbers out of a mission's curve; the others take its samples and maps."""

EARLY_WINDOWS = (EARLY, (100, 300), (100, 1000))
"""Readings of the paper's early stage, the usual first: the first epochs after the pilot, and all
before the 1000 samples after which the paper says that COPOD helps."""

NUMBERS = (*SUMMED, *MEASURES)
LABELS = ("universe", "method", "rho", "scope", "seed")

STEP = 50
"""Samples between two values of the curves that are kept."""

OPTIONS = {name for one in CHOICES for level in one.levels.values() for name in level}
"""Options by which universes differ."""

ABOUT = b"infoplan.multiverse"
"""Name of what a file tells about itself."""

SAID_EVERY = 5.0
"""Seconds between two lines about how far it is."""

Levels = tuple[tuple[str, Any], ...]
"""Options of a run that are not the defaults, and their values, sorted."""


@dataclass(frozen=True)
class Multiverse:
    """The missions of all universes that were flown.

    Attributes
    ----------
    missions
        A row a mission and universe: `LABELS`; the numbers that claims compare, `NUMBERS`, NaN
        where a mission has none, and those of other early samples (`early_column`);
        ``collapsed``, true or false; and ``rmse``, the values of its curve at `axis`.
    axis
        Numbers of collected samples.
    terrain, unit, budget, model
        Common to all missions.
    deviation
        Standard deviation of the terrain, in that unit.
    """

    missions: pd.DataFrame
    axis: tuple[int, ...]
    terrain: str
    unit: str
    budget: int
    model: str
    deviation: float

    @property
    def universes(self) -> list[Universe]:
        """Those of which there are missions, in the order in which they are flown."""
        there = set(self.missions["universe"])
        return [one for one in universes() if one.name in there]

    @property
    def seeds_of_runs(self) -> list[int]:
        """How many seeds each run of each universe has."""
        return [len(rows) for of_universe in self._runs.values() for rows in of_universe.values()]

    @cached_property
    def numbers(self) -> dict[str, "OfUniverse"]:
        """The numbers of each universe, as claims are judged by."""
        return self.judged_by(USUAL)

    def judged_by(self, rules: Rules) -> dict[str, "OfUniverse"]:
        """Give the numbers of each universe by other rules, of `EARLY_WINDOWS` and any margin."""
        return {
            name: OfUniverse(found, self.unit, self.deviation, rules)
            for name, found in self._runs.items()
        }

    @cached_property
    def _runs(self) -> dict[str, dict[tuple[str, float, str], pd.DataFrame]]:
        runs: dict[str, dict[tuple[str, float, str], pd.DataFrame]] = {}
        grouped: Any = self.missions.set_index("seed").groupby(list(LABELS[:-1]), sort=False)
        for (universe, method, rho, scope), rows in grouped:
            runs.setdefault(universe, {})[method, rho, scope] = rows
        return runs


@dataclass(frozen=True)
class OfUniverse:
    """Numbers of one universe, by method, rho and scope (`infoplan.analyse.claims.Numbers`)."""

    runs: Mapping[tuple[str, float, str], pd.DataFrame]
    unit: str
    deviation: float
    rules: Rules = USUAL

    @property
    def margin(self) -> float:
        """What is negligible of errors."""
        return self.rules.margin * self.deviation

    def numbers(self, name: str, method: str, rho: float, scope: str) -> "pd.Series[float] | None":
        """Give one number a seed; None if there is no such run."""
        found = self.runs.get((method, rho, scope))
        if found is None and method not in FILTERED:
            # None and best are the same missions under both scopes, and stored under one.
            found = self.runs.get((method, rho, "batch"))
        column = early_column(self.rules.early) if name == "early" else name
        return None if found is None else found[column]


def early_column(early: tuple[int, int]) -> str:
    """Name the column with the mean RMSE over these collected samples."""
    return "early" if early == EARLY else f"early_{early[0]}_{early[1]}"


OTHERS = tuple(map(early_column, EARLY_WINDOWS[1:]))


def collect(results_dir: str | Path, say: Callable[[str], None], **filters: Any) -> Multiverse:
    """Work out the numbers of all universes of which a results folder holds missions.

    Parameters
    ----------
    results_dir
        Folder of the result tables.
    say
        Is told how far it has come.
    **filters
        As for `infoplan.analyse.tables.find_missions`.

    Raises
    ------
    UsageError
        If there are none, or they differ in other options than the choices of the multiverse.
    """
    selection = study_of(find_missions(results_dir, **filters), free=OPTIONS)
    for note in selection.notes:
        say(note)
    belongs = universes_of_runs(selection)
    if not belongs:
        raise UsageError(
            f"results_dir={results_dir} holds no universe with all four methods: "
            f"{how_to_fly(results_dir)}"
        )
    axis = tuple(range(100, selection.budget + 1, STEP))
    tasks = [delayed(_of_run)(selection.only([run]), axis) for run in belongs]
    frames: dict[str, pd.DataFrame] = {}
    told = time.monotonic()
    for frame in Parallel(n_jobs=-1, return_as="generator")(tasks):
        run = str(frame["run"].iloc[0])
        frames[run] = frame.drop(columns="run")
        if time.monotonic() - told > SAID_EVERY:
            told = time.monotonic()
            say(f"numbers of {len(frames)} of {counted(len(belongs), 'run')}")
    rows = [
        frames[run].assign(universe=universe)
        for run, names in belongs.items()
        for universe in names
    ]
    missions = pd.concat(rows, ignore_index=True)
    missions = in_order(missions)
    first = next(iter(selection.options.values()))
    columns = [*LABELS, *NUMBERS, *OTHERS, "collapsed", "rmse"]
    return Multiverse(
        missions[columns], axis, selection.terrain, selection.unit, selection.budget,
        str(first["model.name"]), Measures(selection).deviation,
    )  # fmt: skip


def how_to_fly(results_dir: str | Path) -> str:
    """Say how the universes get into a results folder."""
    fly = as_command("infoplan run -m experiment=multiverse model=vecchia", results_dir)
    return f"fly them with {fly}"


def in_order(missions: pd.DataFrame) -> pd.DataFrame:
    """Sort missions by their `LABELS`: universes and methods in the order of their definition."""
    orders = {"universe": [one.name for one in universes()], "method": METHODS}

    def place(labels: Any) -> Any:
        return labels.map(orders[labels.name].index) if labels.name in orders else labels

    return missions.sort_values(list(LABELS), key=place, ignore_index=True)


def write(multiverse: Multiverse, path: Path) -> None:
    """Write the missions as Parquet, with what they have in common in its metadata."""
    about = {name: value for name, value in vars(multiverse).items()
             if name not in ("missions", "numbers", "_runs")}  # fmt: skip
    table = pa.Table.from_pandas(multiverse.missions, preserve_index=False)
    numbers: list[str] = []
    others: list[str] = []
    for place, field in enumerate(table.schema):
        if field.type == pa.list_(pa.float64()):
            short = table.column(place).cast(pa.list_(pa.float32()))
            table = table.set_column(place, field.name, short)
            numbers.append(f"{field.name}.list.element")
        else:
            (numbers if field.type == pa.float64() else others).append(field.name)
    table = table.replace_schema_metadata({**(table.schema.metadata or {}),
                                           ABOUT: json.dumps(about).encode()})  # fmt: skip
    with writing(path):
        # Numbers split into bytes of like weight compress to two thirds.
        pq.write_table(table, path, compression="zstd", use_dictionary=others,
                       use_byte_stream_split=numbers)  # fmt: skip


def read(path: Path) -> Multiverse:
    """Read what `write` wrote.

    Raises
    ------
    UsageError
        If the file is none of these.
    """
    wrong = f"{path} is no table that infoplan multiverse has written"
    if not path.exists():
        raise UsageError(f"there is no file {path}: infoplan multiverse writes a table")
    try:
        # A folder of tables would be read as one.
        with path.open("rb") as file:
            table = pq.read_table(file)
    except OSError as error:
        raise UsageError(f"{path} cannot be read: {error.strerror or error}") from error
    except (pa.ArrowException, ValueError) as error:
        raise UsageError(f"{wrong} ({harmless(str(error))})") from error
    told = (table.schema.metadata or {}).get(ABOUT)
    if told is None:
        raise UsageError(wrong)
    try:
        about = json.loads(told)
        about["axis"] = tuple(about["axis"])
        return Multiverse(missions=table.to_pandas(), **about)
    except (pa.ArrowException, KeyError, ValueError, TypeError) as error:
        raise UsageError(f"{wrong} ({harmless(str(error))})") from error


def universes_of_runs(selection: Selection) -> dict[str, list[str]]:
    """Tell of each run to which universes it belongs, of those with runs of all four methods."""
    known: dict[tuple[str, Levels], list[str]] = {}
    for universe in universes():
        for method in METHODS:
            options = {name: _value(text) for name, text in universe.options(method).items()}
            known.setdefault((method, _sorted(options)), []).append(universe.name)
    methods = selection.missions.drop_duplicates("run").set_index("run")["method"]
    belongs, there = {}, defaultdict(set)
    for run, flat in selection.options.items():
        belongs[run] = known.get((str(methods[run]), _sorted(_chosen(flat))), [])
        for universe_name in belongs[run]:
            there[universe_name].add(methods[run])
    # A run without a filter belongs to universes of which nothing else was flown.
    whole = {name for name, found in there.items() if len(found) == len(METHODS)}
    kept = {run: [name for name in names if name in whole] for run, names in belongs.items()}
    return {run: names for run, names in kept.items() if names}


def _chosen(flat: Options) -> Options:
    """Options of a run among those of the multiverse that are not its defaults."""
    default = defaults_of(flat)
    return {
        name: value for name, value in flat.items()
        if name in OPTIONS and value != default.get(name)
    }  # fmt: skip


def _sorted(options: Options) -> Levels:
    return tuple(sorted((name, _value(value)) for name, value in options.items()))


def _value(text: Any) -> Any:
    """Read an option's value as typed; numbers compare as such."""
    value = yaml.safe_load(text) if isinstance(text, str) else text
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _of_run(run: Selection, axis: tuple[int, ...]) -> pd.DataFrame:
    """Work out the numbers of the missions of one run."""
    (name,) = run.options
    measures = Measures(run)
    method, rho, scope = run.missions.iloc[0][["method", "rho", "scope"]]
    frame = measures.summaries.droplevel("run")[list(SUMMED)].copy()
    for number, measure in MEASURES.items():
        # Only there are samples judged more than once; working it out takes long.
        asked = number != "recall_lost" or scope == "historical"
        frame[number] = measure(run).reindex(frame.index) if asked else np.nan
    frame["collapsed"] = [measures.ends[name, seed] for seed in frame.index]
    curves = measures.curves
    for early in EARLY_WINDOWS[1:]:
        means = {seed: mean_between(rows, *early) for seed, rows in curves.groupby("seed")}
        frame[early_column(early)] = pd.Series(means)
    frame["rmse"] = pd.Series(
        {seed: value_at(rows, np.asarray(axis)) for seed, rows in curves.groupby("seed")}
    )
    frame.insert(0, "run", name)
    labelled = frame.assign(method=method, rho=float(rho), scope=scope)
    return labelled.reset_index(names="seed")
