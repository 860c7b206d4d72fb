"""The score of every stored mission: its error in standard deviations of its map.

The score is the area under a mission's RMSE curve from the pilot's end to the budget, divided by
the curve's length and by the standard deviation of its map on the query grid, so that maps of any
unit and height can be averaged.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from infoplan.analyse.configurations import Options, option_text, stored_options
from infoplan.analyse.curves import mean_between
from infoplan.analyse.stretches import NO_TRUTH
from infoplan.analyse.tables import REPLAY, demand_whole, stored_footers
from infoplan.config import METHODS, is_survey
from infoplan.errors import UsageError
from infoplan.files import user_path
from infoplan.method_identity import SPIKE, Method, labels, method_of
from infoplan.options import plain_number
from infoplan.study.store import read_table
from infoplan.study.stored_curves import ended_collapsed
from infoplan.text_options import as_command
from infoplan.wording import counted

CONDITIONS = ("terrain", "fault", "rho")
"""Parts of a configuration under which methods are compared, each with each."""

COLUMNS = (
    "method", "fault", "rho", "terrain", "seed", "reference", "area", "final", "seconds",
    "collapsed",
)  # fmt: skip
"""Of a table of scores."""


@dataclass(frozen=True)
class Entry:
    """A stored mission that stands for its method.

    Attributes
    ----------
    run, seed
        The mission.
    method
        Whose it is.
    options
        All options of its configuration, by dotted names.
    """

    run: str
    seed: int
    method: Method
    options: Options

    def part(self, *groups: str) -> Options:
        """Options of some groups alone."""
        return {k: v for k, v in self.options.items() if k.partition(".")[0] in groups}

    @property
    def settings(self) -> Options:
        """Options that are neither its method's nor a condition."""
        return {k: v for k, v in self.options.items()
                if k.partition(".")[0] not in (*METHODS, *CONDITIONS)}  # fmt: skip


class Condition(NamedTuple):
    """What a mission is flown under: the label of its map, that of its fault, the outlier share."""

    terrain: str
    fault: str
    rho: float

    def __str__(self) -> str:
        """Write it for a note: ``helens rho 0.1``, ``helens stuck rho 0.1``."""
        fault = "" if self.fault == SPIKE.name else f"{self.fault} "
        return f"{self.terrain} {fault}rho {plain_number(self.rho)}"


Entries = dict[tuple[str, Condition, int], Entry]
"""Missions by the label of the method, the condition and the seed."""


@dataclass(frozen=True)
class MissionScores:
    """Missions of one budget and the same settings, with their scores.

    Attributes
    ----------
    table
        One row a mission: the columns `COLUMNS`. ``reference`` is true if the detector is given the
        true labels; ``area`` and ``final``, the RMSE at the budget, are in standard deviations of
        the map, not finite where an error is not; ``seconds`` is the computing time, ``collapsed``
        1 if the mission ends with a collapsed model, 0 if not, NaN if that is not known.
    budget
        Samples of a mission.
    notes
        What was left out, and why: sentences for the reader.
    """

    table: pd.DataFrame
    budget: int
    notes: tuple[str, ...]


def read_scores(results_dir: str | Path, filters: Mapping[str, Any] | None = None) -> MissionScores:
    """Read the missions of a results folder that answer to all filters, and score them.

    Parameters
    ----------
    results_dir
        Folder of the result tables.
    filters
        An option of the runs, ``terrain``, ``planner``, ``detector``, ``model``, ``fault``,
        ``method``, ``scope``, ``run`` or ``seed``, and its value, or a list of which any will do. A
        run without the option passes.

    Returns
    -------
    MissionScores
        Of the missions with the settings that most have.

    Raises
    ------
    UsageError
        If no mission answers, or surveys alone, whose truth nobody knows.
    RunError
        If a table cannot be read.
    """
    folder = user_path(results_dir)
    chosen = _chosen(folder, filters or {})
    entries = [entry for entry in chosen if not is_survey(str(entry.options["terrain.name"]))]
    if not entries:
        raise UsageError(
            f"results_dir={folder} holds surveys alone, and {NO_TRUTH}: methods are ranked by "
            "their errors on missions that infoplan run has flown"
        )
    surveys = len(chosen) - len(entries)
    entries, notes = _with_common_settings(entries)
    if surveys:
        notes.append(f"{counted(surveys, 'survey')} left out: {NO_TRUTH}")
    demand_whole(folder, [(entry.run, entry.seed) for entry in entries])
    rows = []
    for (method, condition, seed), entry in _named(entries).items():
        reference = entry.method.detector.name == "best" and not entry.method.detector.function
        terrain, fault, rho = condition
        rows.append((method, fault, rho, terrain, seed, reference, *_numbers(folder, entry)))
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    return MissionScores(table, int(entries[0].options["budget"]), tuple(notes))


def stored_faults(results_dir: str | Path, filters: Mapping[str, Any] | None = None) -> set[str]:
    """Name the faults of the missions that answer to all filters; no table is read."""
    return {
        str(entry.options["fault.name"]) for entry in _chosen(user_path(results_dir), filters or {})
    }


def _numbers(folder: Path, mission: Entry) -> tuple[float, float, float, float]:
    """Area and final RMSE of a mission in deviations of its map, seconds, whether collapsed."""
    curve, maps = (
        read_table(folder, name, mission.run, mission.seed).to_pandas()
        for name in ("curves", "maps")
    )
    deviation = float(maps["truth"].std(ddof=0))
    area = mean_between(curve, float(curve["collected"].iloc[0]), np.inf)
    seconds = float(curve.filter(like="_seconds").to_numpy().sum())
    last = curve.iloc[-1]
    ended = ended_collapsed(folder, mission.run, mission.seed, last.to_dict())
    collapsed = np.nan if ended is None else float(ended)
    return area / deviation, float(last["rmse"]) / deviation, seconds, collapsed


def _chosen(folder: Path, filters: Mapping[str, Any]) -> list[Entry]:
    """List the missions that answer to all filters; at least one must."""
    entries = _stored(folder)
    chosen = [entry for entry in entries if _answers(entry, filters)]
    if chosen:
        return chosen
    asked = " ".join(f"{name}={option_text(value)}" for name, value in filters.items())
    none = f"results_dir={folder} holds no finished mission{f' with {asked}' if asked else ''}"
    if not entries:
        benchmark = as_command("infoplan run -m experiment=benchmark", folder)
        raise UsageError(f"{none}: make some with {benchmark}")
    there = {
        name: dict.fromkeys(sorted(option_text(_value(entry, name)) for entry in entries))
        for name in filters
    }
    listed = "; ".join(f"{name}={' or '.join(values)}" for name, values in there.items())
    raise UsageError(f"{none}: there is {listed}")


def _stored(folder: Path) -> list[Entry]:
    """List all finished missions that were flown; replays are nobody's method."""
    entries: list[Entry] = []
    options: dict[str, Options] = {}
    for run, seed, footer in stored_footers(folder):
        if run not in options:
            options[run] = stored_options(footer.configuration)
        if REPLAY not in options[run]:
            entries.append(Entry(run, seed, method_of(options[run]).faultless, options[run]))
    return entries


def _value(entry: Entry, name: str) -> Any:
    """Value of an option, a group's choice, the seed or the run; None where there is none."""
    has = {
        **entry.options,
        "seed": entry.seed,
        "run": entry.run,
        "method": entry.method.label,
        "scope": entry.method.scope,
    }
    return has.get(f"{name}.name", has.get(name))


def _answers(entry: Entry, filters: Mapping[str, Any]) -> bool:
    for name, wanted in filters.items():
        value = _value(entry, name)
        if name == "method":
            names = wanted if isinstance(wanted, list) else [wanted]
            wanted = [str(one).upper() for one in names]
        several = isinstance(wanted, list) and not isinstance(value, list)
        if value is not None and value not in (wanted if several else [wanted]):
            return False
    return True


def _with_common_settings(entries: list[Entry]) -> tuple[list[Entry], list[str]]:
    """Keep the missions with the settings that most have: scores of others do not compare."""
    settings = {entry.run: entry.settings for entry in entries}
    counts = Counter(repr(settings[entry.run]) for entry in entries)
    most = max(counts, key=lambda one: counts[one])
    kept = [entry for entry in entries if repr(settings[entry.run]) == most]
    others = [entry for entry in entries if repr(settings[entry.run]) != most]
    if not others:
        return kept, []
    usual = settings[kept[0].run]
    differing = sorted(
        {
            name
            for run in {entry.run for entry in others}
            for name in {*settings[run], *usual}
            if settings[run].get(name) != usual.get(name)
        }
    )
    told = ", ".join(f"{name}={option_text(usual.get(name))}" for name in differing)
    are = "is" if len(others) == 1 else "are"
    left_out = counted(len(others), "mission")
    return kept, [f"{left_out} with other settings than {told} {are} left out"]


def _named(entries: list[Entry]) -> Entries:
    """Find a label for every method, map and fault."""
    called = labels([entry.method for entry in entries], with_scope=True)
    methods = _told_apart(
        [called[entry.method] for entry in entries],
        [entry.part("planner", "detector", "model") for entry in entries],
    )
    terrains, faults = (
        _told_apart([str(entry.options[f"{group}.name"]) for entry in entries],
                    [entry.part(group) for entry in entries])
        for group in ("terrain", "fault")
    )  # fmt: skip
    return {
        (method, Condition(terrain, fault, float(entry.options["rho"])), entry.seed): entry
        for method, terrain, fault, entry in zip(methods, terrains, faults, entries, strict=True)
    }


def _told_apart(names: Sequence[str], options: Sequence[Options]) -> list[str]:
    """Add to each name the options in which those of this name differ."""
    alike: dict[str, list[Options]] = {}
    for name, flat in zip(names, options, strict=True):
        known = alike.setdefault(name, [])
        if flat not in known:
            known.append(flat)
    found = []
    for name, flat in zip(names, options, strict=True):
        others = alike[name]
        differing = sorted(
            option for option in {key for other in others for key in other}
            if any(other.get(option) != flat.get(option) for other in others)
        )  # fmt: skip
        told = [
            f"{option}={_short(option, flat[option])}" for option in differing if option in flat
        ]
        found.append(" ".join([name, *told]))
    return found


def _short(name: str, value: Any) -> str:
    text = option_text(value)
    return text[:8] if name == "terrain.sha256" else text
