"""Overrides of ``infoplan replay``: another detector or model in a stored configuration."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException

from infoplan.config import (
    REPLAY_GROUPS,
    REPLAY_HOW,
    REPLAY_OPTIONS,
    SURVEY_HOW,
    SURVEY_OPTIONS,
    Config,
    MissionConfig,
    is_survey,
    validate,
)
from infoplan.errors import UsageError
from infoplan.hydra_front.compose import compose
from infoplan.wording import suggest


@dataclass(frozen=True)
class Opening:
    """What overrides may change besides some groups and `REPLAY_OPTIONS`.

    Attributes
    ----------
    what
        That is changed, why it is not open to all, and what is: the end of a sentence.
    options
        Further options of the root.
    how
        Options that say how it is run.
    groups
        Which groups.
    """

    what: str
    options: tuple[str, ...] = ()
    how: tuple[str, ...] = REPLAY_HOW
    groups: tuple[str, ...] = REPLAY_GROUPS


REPLAY = Opening(
    "replay, which keeps trajectory and measurements: change detector, model, their options or "
    "planner.smoothing, or fly it with infoplan run"
)
SURVEY = Opening(
    "survey, whose track and measurements are what they are: change detector, model, their "
    "options, planner.smoothing or grid",
    SURVEY_OPTIONS,
    SURVEY_HOW,
)
AHEAD = Opening(
    "track ahead, for which the survey is as it is: change planner or its options",
    how=(),
    groups=("planner",),
)


def reconfigure(
    config: MissionConfig, overrides: Sequence[str], opened: Opening = REPLAY
) -> Config:
    """Put another detector, scope or model into a configuration, and say how to run it.

    Parameters
    ----------
    config
        The source's.
    overrides
        Hydra's: ``detector=...`` or ``model=...`` (of `Opening.groups`) chooses anew, with that
        choice's defaults, but for a survey's detector, whose scope is historical; ``detector.*``,
        ``model.*`` and ``planner.smoothing`` change an option, those of `Opening.how` say how it
        is run, and all else stays.
    opened
        What else may be changed, and of what.

    Returns
    -------
    Config
        Valid.

    Raises
    ------
    UsageError
        If an override would change anything else, is unknown or has no possible value.
    """
    names = names_opened(overrides, opened)
    chosen = [f"{group}={getattr(config, group).name}" for group in ("planner", *REPLAY_GROUPS)]
    kept = [choice for choice in chosen if choice.partition("=")[0] not in names]
    composed = compose([*kept, *overrides])
    parts: dict[str, Any] = {"planner": config.planner, "detector": config.detector,
                             "model": config.model}  # fmt: skip
    parts |= {group: getattr(composed, group) for group in opened.groups if group in names}
    for name in names:
        group, _, rest = name.partition(".")
        if not rest or group in names:  # of a group that is chosen anew all is as composed
            continue
        option = rest.partition(".")[0]
        value = getattr(getattr(composed, group), option)
        if isinstance(value, dict):
            value = {**getattr(parts[group], option), **value}
        parts[group] = replace(parts[group], **{option: value})
    if is_survey(config.terrain.name) and "detector" in names and "detector.scope" not in names:
        parts["detector"] = replace(parts["detector"], scope="historical")
    mission = {item.name: getattr(config, item.name) for item in fields(MissionConfig)} | parts
    mission |= {name: getattr(composed, name) for name in opened.options if name in names}
    how = {name: getattr(composed, name) for name in REPLAY_HOW}
    changed = Config(**mission, **how)
    # Of the stored terrain no file is known, which a terrain that is to be loaded needs.
    validate(
        replace(changed, terrain=replace(MissionConfig().terrain, extent=config.terrain.extent))
    )
    return changed


def how_to_replay(overrides: Sequence[str]) -> list[str]:
    """List the overrides that say how a replay is run."""
    return [override for override in overrides if _opened(override, REPLAY) in REPLAY_HOW]


def _opened(override: str, opened: Opening) -> str:
    """Name what an override changes, if that is open."""
    try:
        parsed = OverridesParser.create().parse_override(override)
    except HydraException as error:
        raise UsageError(
            f"the override {override!r} cannot be read: write option=value, like detector=best"
        ) from error
    name = parsed.key_or_group
    if parsed.is_delete() or (
        name.split(".")[0] not in opened.groups
        and name not in (*REPLAY_OPTIONS, *opened.how, *opened.options)
    ):
        open_to_it = [*opened.groups, *REPLAY_OPTIONS, *opened.how, *opened.options]
        raise UsageError(f"{override}{suggest(name, open_to_it)} is not open to a {opened.what}")
    if parsed.is_sweep_override():
        kind = opened.what.partition(",")[0]
        raise UsageError(f"{override} has several values: a {kind} takes one, so {kind} for each")
    return name


def names_opened(overrides: Sequence[str], opened: Opening) -> list[str]:
    """Name what overrides change; all of it must be open."""
    return [_opened(override, opened) for override in overrides]


def named_functions(overrides: Sequence[str]) -> set[str]:
    """List the groups whose function is named by an override."""
    names = names_opened(overrides, REPLAY)
    return {name.partition(".")[0] for name in names if name.endswith(".function")}
