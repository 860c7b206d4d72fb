"""Footers of tables and configurations of runs, read as typed records or not at all.

Both come out of files that anybody may have written: every field is checked for type, range and
size before any of it is used, and nothing that it names is imported or called.
"""

import copy
import hashlib
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime, timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from infoplan.config import MissionConfig
from infoplan.errors import UsageError
from infoplan.files import read_regular
from infoplan.own import fits, in_words
from infoplan.study.identity import digest, restored, run_name
from infoplan.tables import MAX_DOCUMENT, SCHEMA_VERSION
from infoplan.wording import harmless

MAX_DEPTH = 32
"""Levels of a document, at most."""

MAX_ENTRIES = 100_000
"""Values of a document, at most, aliases counted as often as they stand for something."""

DIGESTS = ("values_sha256", "footer_sha256")
"""Fields in which the footers of a mission's tables differ."""

BLAS = {
    "internal_api": str, "version": str | None, "architecture": str | None, "num_threads": int,
}  # fmt: skip
"""What a footer tells of each BLAS library."""

SHA256 = re.compile(r"[0-9a-f]{64}")
COMMIT = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}")


class MisfitError(ValueError):
    """A document does not fit its record; the message names the field."""


@dataclass(frozen=True)
class Footer:
    """Provenance of a table.

    Attributes
    ----------
    schema_version
        Of the table's columns.
    mission
        Different for each flight; common to its tables.
    run, seed
        Whose.
    terrain
        ``name`` and ``sha256`` of the map.
    configuration
        All that decides the numbers, as in ``runs/<run>.yaml``.
    started, ended
        ISO 8601, UTC.
    seconds
        Computing time.
    python, libraries, cpu, platform, blas
        Versions and machine.
    git
        ``commit`` and ``dirty`` of the code's repository; None where there was none.
    command
        What was typed.
    values_sha256
        Digest of the table's names and values.
    footer_sha256
        Digest of the rest of the footer; None in tables of version 0.1.0.
    """

    schema_version: int
    mission: str
    run: str
    seed: int
    terrain: dict[str, str]
    configuration: dict[str, Any]
    started: str
    ended: str
    seconds: float
    python: str
    libraries: dict[str, str | None]
    cpu: str
    platform: str
    blas: list[dict[str, Any]]
    git: dict[str, Any] | None
    command: list[str]
    values_sha256: str
    footer_sha256: str | None = None

    @property
    def config(self) -> MissionConfig:
        """The configuration as a record."""
        return copy.deepcopy(_config(json.dumps(self.configuration)))

    def story(self) -> dict[str, Any]:
        """Give what the tables of a mission have in common."""
        names = [item.name for item in fields(self) if item.name not in DIGESTS]
        return {name: getattr(self, name) for name in names}


def read_document(text: bytes) -> Footer:
    """Read the JSON document of a table's footer.

    Raises
    ------
    MisfitError
        If it is none, a field has another type, range or size than it must have, or it does not
        belong to the run that it names.
    """
    if len(text) > MAX_DOCUMENT:
        raise MisfitError(f"it has {len(text)} bytes, more than {MAX_DOCUMENT}")
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise MisfitError(f"it is no JSON ({type(error).__name__})") from error
    demand_plain(document)
    if not isinstance(document, dict):
        raise MisfitError(f"it is {_what(document)}, no mapping")
    version = document.get("schema_version")
    if type(version) is int and version != SCHEMA_VERSION:
        raise MisfitError(
            f"it has schema version {version}, but this infoplan reads version {SCHEMA_VERSION}"
        )
    known: dict[str, Any] = {}
    for item in fields(Footer):
        if item.name not in document and item.name != "footer_sha256":
            raise MisfitError(f"it lacks {item.name}")
        value = document.get(item.name)
        if not fits(value, item.type):
            raise MisfitError(f"{item.name} is {_what(value)}, not {in_words(item.type)}")
        known[item.name] = value
    footer = Footer(**known)
    _check_footer(footer)
    if footer.footer_sha256 is not None and footer.footer_sha256 != footer_digest(document):
        raise MisfitError("it is not the one that was written")
    return footer


def footer_digest(document: Mapping[str, Any]) -> str:
    """SHA-256 of a footer without its own digest."""
    rest = {name: value for name, value in document.items() if name != "footer_sha256"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def read_science(path: Path) -> dict[str, Any]:
    """Read ``runs/<run>.yaml``.

    Returns
    -------
    dict
        What `infoplan.study.identity.config_from_science` takes; it fits.

    Raises
    ------
    MisfitError
        If it cannot be read, is no regular file, too large, no such configuration, or that of
        another run.
    """
    try:
        science = yaml.safe_load(read_regular(path, MAX_DOCUMENT))
    except UsageError as error:
        raise MisfitError(str(error)) from error
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        reason = getattr(error, "strerror", None) or f"it is no YAML: {type(error).__name__}"
        raise MisfitError(f"it cannot be read ({reason})") from error
    demand_plain(science)
    if not isinstance(science, dict):
        raise MisfitError(f"it is {_what(science)}, no mapping of options")
    check_science(science, path.name.removesuffix(".yaml"))
    return science


def check_science(science: dict[str, Any], run: str) -> None:
    """Check that a configuration fits, and is that of the run.

    Raises
    ------
    MisfitError
        If not.
    """
    _demand_science(json.dumps(science), run)


@lru_cache(maxsize=256)
def _demand_science(text: str, run: str) -> None:
    """Do as `check_science`, once for all missions of a run."""
    science = json.loads(text)
    try:
        _config(text)
    except ValueError as error:
        raise MisfitError(f"its configuration does not fit this version ({error})") from error
    if digest(science) != run.rpartition("-")[2]:
        raise MisfitError("it holds another configuration than its run's")
    if run_name(science) != run:
        raise MisfitError(f"its run is {run_name(science)}, not {run}")


def demand_plain(document: Any) -> None:
    """Check that a document consists of mappings with names, lists and plain values, within bounds.

    Raises
    ------
    MisfitError
        If it is too deep or too large, or holds anything else.
    """
    count, level = 0, [document]
    for _ in range(MAX_DEPTH):
        below: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                if not all(isinstance(key, str) for key in value):
                    raise MisfitError("it has a name that is no text")
                below.extend(value.values())
            elif isinstance(value, list):
                below.extend(value)
            elif isinstance(value, int) and abs(value) >= 1 << 63:
                raise MisfitError("it holds a number of more than 63 bits")
            elif not (value is None or isinstance(value, str | int | float)):
                raise MisfitError(f"it holds {_what(value)}")
            if len(below) + count > MAX_ENTRIES:
                raise MisfitError(f"it has more than {MAX_ENTRIES} entries")
        count += len(level)
        level = below
        if not level:
            return
    raise MisfitError(f"it is more than {MAX_DEPTH} levels deep")


@lru_cache(maxsize=256)
def _config(science: str) -> MissionConfig:
    """Read a configuration out of its JSON text; the missions of a run have it in common."""
    return restored(json.loads(science))


def _check_footer(footer: Footer) -> None:
    """Check the values of a footer whose types fit."""
    for name in ("mission", "run"):
        if not getattr(footer, name):
            raise MisfitError(f"{name} is empty")
    if footer.seed < 0:
        raise MisfitError(f"seed is {footer.seed}, below 0")
    if footer.seconds < 0:
        raise MisfitError(f"seconds is {footer.seconds:g}, below 0")
    for name in ("started", "ended"):
        _demand_time(name, getattr(footer, name))
    for name in DIGESTS:
        value = getattr(footer, name)
        if value is not None and not SHA256.fullmatch(value):
            raise MisfitError(f"{name} is no SHA-256")
    for library in footer.blas:
        for name, kind in BLAS.items():
            if not fits(library.get(name), kind):
                raise MisfitError(f"blas.{name} is {_what(library.get(name))}")
    git = footer.git
    if git is not None and not (
        set(git) == {"commit", "dirty"}
        and isinstance(git["dirty"], bool)
        and isinstance(git["commit"], str)
        and COMMIT.fullmatch(git["commit"])
    ):
        raise MisfitError("git holds something else than a commit and whether it was dirty")
    _demand_science(json.dumps(footer.configuration), footer.run)
    stored = footer.configuration["terrain"]
    if footer.terrain != {"name": stored["name"], "sha256": stored["sha256"]}:
        raise MisfitError("terrain is not that of the configuration")


def _demand_time(name: str, text: str) -> None:
    try:
        offset = datetime.fromisoformat(text).utcoffset()
    except ValueError:
        offset = None
    # All of one form and zone: the order of the texts is that of the times.
    if offset != timedelta(0) or not re.fullmatch(r"\d{4}-\d\d-\d\dT[\d:.]+\+00:00", text):
        raise MisfitError(f"{name} is {text[:40]!r}, no time in UTC as ISO 8601 writes it")


def _what(value: Any) -> str:
    """Say what a value is, shortly."""
    if value is None:
        return "null"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    shown = harmless(repr(value))
    return shown if len(shown) <= 40 else f"{shown[:40]}..."
