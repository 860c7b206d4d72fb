"""The options of configurations as commands take them: declarations, completion, help."""

import inspect
import re
from collections.abc import Container, Iterable, Mapping
from importlib.resources import files
from typing import Any

import click
import yaml
from click.shell_completion import CompletionItem

from infoplan.command_line.settings import More, Setting
from infoplan.command_line.types import path_items, written
from infoplan.config import (
    GROUPS,
    REPLAY_GROUPS,
    REPLAY_HOW,
    REPLAY_OPTIONS,
    SURVEY_HOW,
    SURVEY_OPTIONS,
    Config,
    MissionConfig,
)
from infoplan.errors import UsageError
from infoplan.options import allowed_values, walk
from infoplan.text_options import decimal, typed_text

OF_OWN = re.compile(r"(planner|detector|model|fault|terrain)\.(options|params)\.\w")
"""Options of a user's own function, or of one of PyOD's classes: of these there is no list."""

NOT_STORED = ("terrain.path", "terrain.member", "terrain.on_missing")
"""Where a map came from is not stored, so no run can be chosen by it."""

NOT_OF_SURVEYS = ("best",)
"""Choices that need the true labels, which nobody has of a survey."""

PATHS = ("results_dir", "scheduler", "terrain.path")
"""Options that are paths."""

MULTIRUN = ("-m", "--multirun")


class Value(click.ParamType):
    """Values of an option of configurations.

    Parameters
    ----------
    name
        Of the option.
    metadata
        As `infoplan.options.walk` yields them.
    """

    name = "value"

    def __init__(self, name: str, metadata: dict[str, Any]):
        self.kind = str(getattr(metadata["type"], "__name__", metadata["type"]))
        self.words = allowed_values({**metadata, "unit": ""})
        self.choices = metadata["choices"] or (("true", "false") if self.kind == "bool" else ())
        self.listed = self.kind.startswith("list") and bool(metadata["choices"])
        self.path = name in PATHS

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Read it as a filter: one value, or a list of which any will do."""
        if not isinstance(value, str):
            return value
        if "list" not in self.kind and value.startswith("[") and value.endswith("]"):
            return [self._read(entry.strip(), param) for entry in value[1:-1].split(",")]
        read = self._read(value, param)
        return [None] if read is None else read  # None alone would filter nothing

    def _read(self, text: str, param: Any) -> Any:
        if text == "null" and ("None" in self.kind or self.kind == "Any"):
            return None
        try:
            if self.kind.startswith("str"):
                return typed_text(param.word, text)
            if self.kind.startswith("float"):
                return decimal(float(text))
            return yaml.safe_load(text)
        except (ValueError, yaml.YAMLError) as error:
            raise UsageError(f"{param.word}={text} cannot be read: it is {self.words}") from error

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        """Offer the choices, or files."""
        if self.path:
            return path_items(incomplete, folders_alone=param.word == "results_dir")
        return [CompletionItem(c) for c in self.choices if c.startswith(incomplete)]


class Free(click.ParamType):
    """Values of an option of which nothing is known."""

    name, words = "free", "what its function takes"

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Read it as YAML."""
        try:
            return yaml.safe_load(value) if isinstance(value, str) else value
        except yaml.YAMLError as error:
            raise UsageError(
                f"{param.word}={value} cannot be read: check its brackets and quotes"
            ) from error


def experiments() -> list[str]:
    """Name the experiments that come with infoplan."""
    names = (entry.name for entry in files("infoplan.conf").joinpath("experiment").iterdir())
    return sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml"))


def chosen(given: Mapping[str, Any]) -> dict[str, str]:
    """Give the choice of each group, from the words of a command line."""
    default = Config()
    found = {}
    for group, choices in GROUPS.items():
        name = str(given.get(group, getattr(default, group).name)).split(",")[0]
        found[group] = name if name in choices else getattr(default, group).name
    return found


def of_choice(group: str, choice: str) -> list[Setting]:
    """Declare the options of a choice of a group, those of the user's own function included."""
    return [
        _setting(name, value, metadata)
        for name, value, metadata in walk(GROUPS[group][choice], f"{group}.")
        if name != f"{group}.name"
    ]


def group_settings(groups: Iterable[str] = GROUPS, without: Container[str] = ()) -> list[Setting]:
    """Declare the groups themselves, ``planner=`` and so on, some of their choices left out."""
    default = Config()
    return [
        Setting(group, click.Choice([name for name in GROUPS[group] if name not in without]),
                f"which {group}", default=getattr(default, group).name)
        for group in groups
    ]  # fmt: skip


def run_settings(given: Mapping[str, Any]) -> list[Setting]:
    """Declare what ``infoplan run`` takes with the choices that are made."""
    experiment = Setting("experiment", click.Choice(experiments()), "a study, from a file")
    settings = [*group_settings(), experiment, *root_settings()]
    choices = {group: str(given.get(group, "")).split(",") for group in GROUPS}
    for group, choice in chosen(given).items():
        known = {setting.word: setting for setting in of_choice(group, choice)}
        for also in choices[group]:
            if also in GROUPS[group]:
                known |= {setting.word: setting for setting in of_choice(group, also)}
        settings += known.values()
    return settings


def root_settings() -> list[Setting]:
    """Declare the options that are of no group."""
    return [
        _setting(name, value, metadata)
        for name, value, metadata in walk(Config())
        if name.partition(".")[0] not in GROUPS
    ]


def filter_settings(given: Mapping[str, Any]) -> list[Setting]:
    """Declare what the runs of a study can be chosen by."""
    return [
        *leaderboard_settings(given),
        Setting("method", _Names(()), "runs of this planner and detector, like PUCT-COPOD"),
        Setting("scope", _Names(("batch", "historical")), "runs whose detector has this scope"),
        Setting("replay", Free(), "replays of this run; true: of any"),
    ]


def leaderboard_settings(given: Mapping[str, Any]) -> list[Setting]:
    """Declare what missions can be chosen by, their options alone."""
    settings: dict[str, Setting] = {}
    for group in GROUPS:
        names = Setting(group, _Names(tuple(GROUPS[group])), f"runs with this {group}")
        settings[group] = names
        for choice in GROUPS[group]:
            for setting in of_choice(group, choice):
                if setting.word not in NOT_STORED:
                    settings.setdefault(setting.word, setting)
    for name, value, metadata in walk(MissionConfig()):
        if name.partition(".")[0] not in GROUPS:
            settings[name] = _setting(name, value, metadata)
    settings["terrain.sha256"] = Setting(
        "terrain.sha256", _Names(()), "runs on the map with this digest"
    )
    for word in given:
        if OF_OWN.match(word):
            settings[word] = Setting(word, Free(), "runs with this option of their own function")
    return list(settings.values())


def replay_settings(given: Mapping[str, Any], without: Container[str] = ()) -> list[Setting]:
    """Declare what a replay may change, some choices left out."""
    settings = group_settings(REPLAY_GROUPS, without)
    for group in REPLAY_GROUPS:
        known: dict[str, Setting] = {}
        listed = [given[group]] if given.get(group) in GROUPS[group] else [*GROUPS[group]]
        for choice in listed:
            for setting in of_choice(group, choice):
                known.setdefault(setting.word, setting)
        settings += known.values()
    smoothing = of_choice("planner", "puct")
    settings += [setting for setting in smoothing if setting.word in REPLAY_OPTIONS]
    return settings + [setting for setting in root_settings() if setting.word in REPLAY_HOW]


def survey_settings(given: Mapping[str, Any]) -> list[Setting]:
    """Declare what a survey may choose: what a replay may, and the map's nodes."""
    kept = (*SURVEY_OPTIONS, *SURVEY_HOW)
    replayed = replay_settings(given, NOT_OF_SURVEYS)
    settings = [one for one in replayed if one.word not in REPLAY_HOW]
    return settings + [setting for setting in root_settings() if setting.word in kept]


def ahead_settings(given: Mapping[str, Any]) -> list[Setting]:
    """Declare what a track ahead may choose: its planner."""
    known: dict[str, Setting] = {}
    listed = [given["planner"]] if given.get("planner") in GROUPS["planner"] else GROUPS["planner"]
    for choice in listed:
        for setting in of_choice("planner", choice):
            known.setdefault(setting.word, setting)
    return [*group_settings(["planner"]), *known.values()]


def explain_settings(given: Mapping[str, Any]) -> list[Setting]:
    """Declare how refits are run: as replays are."""
    return [setting for setting in root_settings() if setting.word in REPLAY_HOW]


def hydra_words(incomplete: str) -> list[str]:
    """Complete Hydra's own options: ``hydra/launcher=`` and the like."""
    if not incomplete.startswith("hydra"):
        return []
    from infoplan.hydra_front.front import complete_word

    return complete_word(incomplete)


def terrain_settings(given: Mapping[str, Any]) -> list[Setting]:
    """Declare a map and its options."""
    return [*group_settings(["terrain"]), *of_choice("terrain", chosen(given)["terrain"])]


def write_run_page(formatter: click.HelpFormatter, given: Mapping[str, Any]) -> None:
    """Write all options of ``infoplan run``, the current choice of each group first."""
    current = chosen(given)
    with formatter.section("Choices, the current one first"):
        for group in GROUPS:
            names = [current[group], *(name for name in GROUPS[group] if name != current[group])]
            _write_choice(formatter, group, names)
        _write_choice(formatter, "experiment", experiments())
    mission = {name for name, _, _ in walk(MissionConfig())}
    of_mission = [setting for setting in root_settings() if setting.word in mission]
    of_mission.sort(key=lambda setting: "." in setting.word)
    how = [setting for setting in root_settings() if setting.word not in mission]
    _write_settings(formatter, "The mission", of_mission)
    _write_settings(formatter, "How it is run", how)
    for group in GROUPS:
        write_group(formatter, group, current[group], given)


def write_group(
    formatter: click.HelpFormatter, group: str, current: str, given: Mapping[str, Any]
) -> None:
    """Write the options of every choice of a group: those of all first, then the current one's."""
    of_each = {choice: of_choice(group, choice) for choice in GROUPS[group]}
    records = {choice: {_record(s) for s in listed} for choice, listed in of_each.items()}
    common = set.intersection(*records.values())
    shared = [setting for setting in of_each[current] if _record(setting) in common]
    _write_settings(formatter, f"Every {group}", shared)
    _write_own_function(formatter, group, current, given)
    done: list[str] = []
    for choice in [current, *of_each]:
        alike = [c for c in of_each if records[c] - common == records[choice] - common]
        rest = [setting for setting in of_each[choice] if _record(setting) not in common]
        if choice in done or not rest:
            continue
        done += alike
        names = [choice, *(name for name in alike if name != choice)]
        about = (type(GROUPS[group][choice]).__doc__ or "").splitlines()[0]
        _write_settings(formatter, f"{group}={' or '.join(names)}", rest, about)


def write_survey_page(formatter: click.HelpFormatter, given: Mapping[str, Any]) -> None:
    """Write what a survey may choose."""
    with formatter.section("Choices; without them gp_residual, scope historical, and vecchia"):
        for group in REPLAY_GROUPS:
            names = [name for name in GROUPS[group] if name not in NOT_OF_SURVEYS]
            _write_choice(formatter, group, names)
    others = [one for one in survey_settings({}) if one.word.partition(".")[0] not in REPLAY_GROUPS]
    _write_settings(formatter, "Further options", others)
    with formatter.section("Options of detectors and models"):
        formatter.write_text("infoplan replay --help tells all of them.")


def write_ahead_page(formatter: click.HelpFormatter, given: Mapping[str, Any]) -> None:
    """Write the options of every planner."""
    with formatter.section("Choices, the current one first"):
        current = chosen(given)["planner"]
        names = [current, *(name for name in GROUPS["planner"] if name != current)]
        _write_choice(formatter, "planner", names)
    write_group(formatter, "planner", current, given)


def write_replay_page(formatter: click.HelpFormatter, given: Mapping[str, Any]) -> None:
    """Write what a replay may change."""
    current = chosen(given)
    with formatter.section("Choices; without them the run's own stay"):
        for group in REPLAY_GROUPS:
            _write_choice(formatter, group, [*GROUPS[group]])
    settings = replay_settings({})
    smoothing = [setting for setting in settings if setting.word in REPLAY_OPTIONS]
    _write_settings(formatter, "Open to a replay, too", smoothing)
    how = [setting for setting in settings if setting.word in REPLAY_HOW]
    _write_settings(formatter, "How it is run", how)
    for group in REPLAY_GROUPS:
        write_group(formatter, group, current[group], given)


def write_terrain_page(formatter: click.HelpFormatter, given: Mapping[str, Any]) -> None:
    """Write the options of every map."""
    with formatter.section("Choices, the current one first"):
        current = chosen(given)["terrain"]
        names = [current, *(name for name in GROUPS["terrain"] if name != current)]
        _write_choice(formatter, "terrain", names)
    write_group(formatter, "terrain", current, given)


def write_filter_page(formatter: click.HelpFormatter, given: Mapping[str, Any]) -> None:
    """Say what runs can be chosen by."""
    with formatter.section("Choosing runs"):
        formatter.write_text(
            "Every option of a run chooses the runs that have it: planner=puct, rho=0.1, "
            "terrain=helens, budget=2000, planner.exploration=0.5. Several values are a list: "
            "rho=[0.05,0.1]. infoplan run --help tells all options; terrain.sha256= chooses by the "
            "map itself."
        )


SEED = Setting("seed", Free(), "missions with this seed, or a list")

RUN = More(
    "overrides", run_settings, lambda name: True,
    several=lambda flags: bool(set(flags) & set(MULTIRUN)), pages=write_run_page,
    words=hydra_words,
)  # fmt: skip
STATUS = More("overrides", run_settings, lambda name: True, several=lambda flags: True)
REPLAY = More("overrides", replay_settings, lambda name: True, pages=write_replay_page)
EXPLAIN = More(
    "overrides", explain_settings, lambda name: False,
    documented=", ".join(f"{name}=" for name in REPLAY_HOW),
)  # fmt: skip
SURVEY = More("overrides", survey_settings, lambda name: True, pages=write_survey_page)
AHEAD = More(
    "overrides", ahead_settings, lambda name: name.startswith("planner."),
    pages=write_ahead_page, documented="planner= with the options of the planner",
)  # fmt: skip
TERRAIN = More(
    "overrides", terrain_settings, lambda name: name.startswith("terrain."),
    pages=write_terrain_page, documented="terrain= with the options of the map",
)  # fmt: skip
LEADERBOARD = More(
    "filters", lambda given: [*leaderboard_settings(given), SEED], lambda name: False,
    pages=write_filter_page,
    documented="any option of a run (infoplan run --help lists them)",
)  # fmt: skip
FILTERS = More(
    "filters", filter_settings, lambda name: False, pages=write_filter_page,
    documented="any option of a run (infoplan run --help lists them)",
)  # fmt: skip


class _Names(click.ParamType):
    """Names of choices as runs are filtered by them: own methods have other names, too."""

    name, words = "names", "a name, or a list of names"

    def __init__(self, known: tuple[str, ...]):
        self.known = known

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Read one, or a list."""
        if isinstance(value, str) and value.startswith("[") and value.endswith("]"):
            return [entry.strip() for entry in value[1:-1].split(",")]
        return value

    def shell_complete(self, ctx: Any, param: Any, incomplete: str) -> list[CompletionItem]:
        """Offer the choices."""
        return [CompletionItem(name) for name in self.known if name.startswith(incomplete)]


def _setting(name: str, value: Any, metadata: dict[str, Any]) -> Setting:
    return Setting(
        name, Value(name, metadata), metadata["doc"], default=value, unit=metadata["unit"]
    )


def _record(setting: Setting) -> tuple[str, str]:
    """Lines of the help page about an option; a default of null is written."""
    default = "null" if setting.default is None else written(setting.default)
    return f"{setting.word}={default}", f"{setting.doc} ({setting.allowed()})"


def _write_choice(formatter: click.HelpFormatter, group: str, names: list[str]) -> None:
    line = " " * formatter.current_indent + f"{group}="
    indent = " " * len(line)
    for number, name in enumerate(names):
        word = name + "|" * (number < len(names) - 1)
        if number and len(line) + len(word) > formatter.width:
            formatter.write(f"{line}\n")
            line = indent
        line += word
    formatter.write(f"{line}\n")


def _write_settings(
    formatter: click.HelpFormatter, title: str, settings: Iterable[Setting], about: str = ""
) -> None:
    records = []
    for setting in settings:
        term, doc = _record(setting)
        if len(term) > formatter.width - 4:  # the pilot's path
            default = term.partition("=")[2].replace("],", "], ")
            term, doc = f"{setting.word}=...", f"{doc}; default {default}"
        records.append((term, doc))
    if records:
        with formatter.section(title):
            if about:
                formatter.write_text(about)
            formatter.write_dl(records)


def _write_own_function(
    formatter: click.HelpFormatter, group: str, choice: str, given: Mapping[str, Any]
) -> None:
    """Write the options of the function that the command line names: this imports it."""
    path = given.get(f"{group}.function")
    if choice != "own" or not path:
        return
    from infoplan.own import load

    function = load(path.strip("'\""), f"{group}.function")
    doc = inspect.getdoc(function) or ""
    told = parameter_docs(doc)
    if inspect.isclass(function):
        told |= parameter_docs(inspect.getdoc(function.__init__) or "")
    records = []
    for parameter in inspect.signature(function, eval_str=True).parameters.values():
        if parameter.kind is not parameter.KEYWORD_ONLY:
            continue
        default, kind = parameter.default, parameter.annotation
        needed = default is parameter.empty
        text = "..." if needed else "null" if default is None else written(default)
        values = "not annotated" if kind is parameter.empty else inspect.formatannotation(kind)
        about = f"{told.get(parameter.name, '')} ({values}{', required' if needed else ''})"
        records.append((f"{group}.options.{parameter.name}={text}", about.strip()))
    first = doc.splitlines()[0].rstrip(".") if doc else "no docstring"
    with formatter.section(f"{group}.function={path}"):
        formatter.write_text(first)
        if records:
            formatter.write_dl(records)
        else:
            formatter.write_text("It has no options: no keyword-only parameters.")


def parameter_docs(docstring: str) -> dict[str, str]:
    """Read what a numpydoc docstring says about each parameter.

    Parameters
    ----------
    docstring
        As of `inspect.getdoc`.

    Returns
    -------
    dict
        One line a parameter, by name.
    """
    match = re.search(r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n-{3,}$|\Z)", docstring, re.M | re.S)
    found: dict[str, str] = {}
    names: list[str] = []
    for line in match[1].splitlines() if match else []:
        if line and not line[0].isspace():
            names = [name.strip("* ") for name in line.partition(" :")[0].split(",")]
        elif line.strip():
            for name in names:
                found[name] = f"{found.get(name, '')} {line.strip()}".strip().rstrip(".")
    return found
