"""Write down again what follows from the code: options in conf/, tables in docs/.

``make derived`` does it; a test compares. In the YAML files the comment on top, the defaults list
and the section ``hydra`` are written by hand, in the page all but what is between the marks.
"""

import re
import sys
import textwrap
import tomllib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from infoplan.config import KERNELS, METHODS, TERRAIN_SCHEMAS, Config, MissionConfig
from infoplan.model.kernels import as_kernel
from infoplan.options import allowed_values
from infoplan.study.universes import Universe, universes
from infoplan.tables import TABLES

ROOT = Path(__file__).parents[1]
GROUPS: dict[str, dict[str, Any]] = METHODS | {
    "terrain": {name: schema(name=name) for name, schema in TERRAIN_SCHEMAS.items()}
}
WIDTH = 100
OPTIONS_OF = re.compile(
    r"(<!-- options of (\w+)=(\w+): make derived -->\n).*?(<!-- end -->)", re.DOTALL
)
CHOICES_OF = re.compile(r"(<!-- choices of (\w+): make derived -->\n).*?(<!-- end -->)", re.DOTALL)
PUBLIC_NAMES = re.compile(r"(<!-- public names: make derived -->\n).*?(<!-- end -->)", re.DOTALL)
PUBLIC = ("infoplan", "infoplan.analyse", "infoplan.plan", "infoplan.detect", "infoplan.model",
          "infoplan.fault", "infoplan.terrain")  # fmt: skip
"""What users may import, and what is documented for it."""
TOLD_WITH = {"model": "gp", "detector": "none"}
"""The options of these choices are those of others of their group, and are not told with each."""
KERNELS_TABLE = re.compile(r"(<!-- kernels: make derived -->\n).*?(<!-- end -->)", re.DOTALL)
EXTRAS_TABLE = re.compile(r"(<!-- extras: make derived -->\n).*?(<!-- end -->)", re.DOTALL)
LEAST = re.compile(r"([\w-]+)>=([\d.]+)")
OLDEST = ("cmaes", "dask", "geo", "survey", "sweep", "tracking")
"""Extras whose oldest versions are tested; those of the others are tools."""
MARKS = ("<!-- columns: make derived -->", "<!-- end of the columns -->")


def derived() -> Iterator[tuple[Path, str]]:
    """Give each file that follows from the code, and what it must hold."""
    for group, choices in GROUPS.items():
        for choice, schema in choices.items():
            path = ROOT / "conf" / group / f"{choice}.yaml"
            yield path, _head(path, group, choice, schema) + _options(schema)
    path = ROOT / "conf" / "experiment" / "multiverse.yaml"
    yield path, _sweep(path)
    root = ROOT / "conf" / "config.yaml"
    head, _, rest = root.read_text(encoding="utf-8").partition("\n\n")
    _, _, hydra = rest.partition("\nhydra:\n")
    yield root, f"{head}\n\n{_options(Config())}\nhydra:\n{hydra}"
    yield ROOT / "constraints-oldest.txt", _oldest()
    page = ROOT / "docs" / "results.md"
    before, _, rest = page.read_text(encoding="utf-8").partition(MARKS[0])
    yield page, f"{before}{MARKS[0]}\n{_columns()}{MARKS[1]}{rest.partition(MARKS[1])[2]}"
    for page in sorted((ROOT / "docs").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        for pattern, table in TABLES_OF_PAGES.items():
            text = pattern.sub(table, text)
        if any(pattern.search(text) for pattern in TABLES_OF_PAGES):
            yield page, text


def _sweep(path: Path) -> str:
    """Write the sweep of the multiverse: a comment and the entries of a universe, one after other.

    Cheap first. What stands above the entries is written by hand.
    """
    head, _, _ = path.read_text(encoding="utf-8").partition("\nsweep:\n")
    default, *others = universes()
    cheap_first = sorted(others, key=lambda one: (one.is_joint, _steps(one)))
    entries = [
        f"  # {universe.name}\n" + "".join(f"  - {line}\n" for line in universe.lines())
        for universe in (default, *cheap_first)
    ]
    return f"{head}\nsweep:\n{''.join(entries)}"


def _steps(universe: Universe) -> int:
    """Count a mission's optimiser steps; a prediction of the grid takes about as long as ten."""
    epochs = {"all": 30, "2": 80, "1": 190}[universe.levels["actions driven"]]
    learning = universe.levels["learning"]
    if learning == "adam per sample":
        return 2000 + 10 * epochs
    steps = 0 if learning == "frozen" else int(learning.split()[1])
    return epochs * (steps + 10)


def _project() -> dict[str, Any]:
    """Read what pyproject.toml says of the project."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def _oldest() -> str:
    """Write the oldest allowed version of everything that has a bound, as constraints of pip."""
    project = _project()
    needed = list(project["dependencies"])
    for extra in OLDEST:
        needed += project["optional-dependencies"][extra]
    pins = {found[1]: found[2] for entry in needed if (found := LEAST.match(entry))}
    lines = "".join(f"{name}=={pins[name]}\n" for name in sorted(pins))
    head = "# The oldest versions that pyproject.toml allows: make test-oldest. By make derived."
    return f"{head}\n{lines}"


def _extras_table(found: re.Match[str]) -> str:
    """Write the extras, what each is for by its comment in pyproject.toml, and what it installs."""
    begin, end = found.groups()
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    section = text.partition("[project.optional-dependencies]\n")[2].partition("\n[")[0]
    told = dict(re.findall(r"^# ([a-z-]+): (.+)$", section, re.MULTILINE))
    rows = "| extra | for | installs |\n|---|---|---|\n"
    for extra, needed in _project()["optional-dependencies"].items():
        names = [re.split(r"[<>=]", entry)[0] for entry in needed]
        rows += f"| `{extra}` | {told[extra]} | {', '.join(f'`{name}`' for name in names)} |\n"
    return f"{begin}\n{rows}\n{end}"


def _options_table(found: re.Match[str]) -> str:
    """Write the options of a choice as the table of a page."""
    begin, group, choice, end = found.groups()
    text = "| option | default | what it is |\n|---|---|---|\n"
    for item in _own_options(group, choice):
        metadata = {"type": item.type, **item.metadata}
        doc = f"{metadata['doc']}: {allowed_values(metadata)}"
        value = _value(getattr(METHODS[group][choice], item.name))
        text += f"| `{group}.{item.name}` | `{value}` | {doc} |\n"
    return f"{begin}\n{text}\n{end}"


def _own_options(group: str, choice: str) -> list[Any]:
    """Options of a choice but for those that `TOLD_WITH` tells."""
    shown_with = TOLD_WITH.get(group, choice)
    told = {"name"}
    if shown_with != choice:
        told = {item.name for item in fields(METHODS[group][shown_with])}
    return [item for item in fields(METHODS[group][choice]) if item.name not in told]


def _choices_table(found: re.Match[str]) -> str:
    """Write the choices of a group, what each is by its YAML file, and its options, as a table."""
    begin, group, end = found.groups()
    text = f"| `{group}=` | what it is | options of its own |\n|---|---|---|\n"
    for choice, schema in GROUPS[group].items():
        path = ROOT / "conf" / group / f"{choice}.yaml"
        said = re.sub(
            r"(\w+=\S.*)$", r"`\1`", _head(path, group, choice, schema).split("\n")[0][2:]
        )
        of_all = {item.name for item in fields(type(schema).__mro__[-2])}
        of_all |= {item.name for item in fields(GROUPS[group][TOLD_WITH.get(group, choice)])
                   if TOLD_WITH.get(group, choice) != choice}  # fmt: skip
        own = [f"`{item.name}`" for item in fields(schema) if item.name not in of_all]
        text += f"| `{choice}` | {said.rstrip('.')} | {', '.join(own)} |\n"
    return f"{begin}\n{text}\n{end}"


def public_names(home: str) -> list[str]:
    """Name the classes and functions that a module offers, its tables and aliases left out."""
    module = import_module(home)
    offered = {name: getattr(module, name) for name in module.__all__}
    return [name for name, one in offered.items() if _is_of_infoplan(one)]


def _is_of_infoplan(one: Any) -> bool:
    return str(getattr(one, "__module__", "")).startswith("infoplan")


def _public_names(found: re.Match[str]) -> str:
    """Write what may be imported, and the first sentence of its docstring, a table a module."""
    begin, end = found.groups()
    text = ""
    for home in PUBLIC:
        text += f"\n## `{home}`\n\n| name | what it is |\n|---|---|\n"
        for name in public_names(home):
            said = str(getattr(import_module(home), name).__doc__).partition("\n")[0].rstrip(".")
            text += f"| `{name}` | {said} |\n"
    return f"{begin}{text}\n{end}"


def _kernels_table(found: re.Match[str]) -> str:
    """Write the kernels, what each is by its module, and what it learns, as the table of a page."""
    begin, end = found.groups()
    text = "| `model.kernel` | correlation of a and b | hyperparameters |\n|---|---|---|\n"
    for name in KERNELS:
        kernel = as_kernel(name)
        said = str(sys.modules[f"infoplan.model.kernels.{name}"].__doc__).splitlines()[0]
        learned = ", ".join(f"`{one.name}`" for one in kernel.hyperparameters)
        text += f"| `{name}` | {said} | {learned} |\n"
    return f"{begin}\n{text}\n{end}"


TABLES_OF_PAGES = {
    OPTIONS_OF: _options_table,
    CHOICES_OF: _choices_table,
    KERNELS_TABLE: _kernels_table,
    PUBLIC_NAMES: _public_names,
    EXTRAS_TABLE: _extras_table,
}
"""Marks in the pages, and what is written between them and the next end."""


def _head(path: Path, group: str, choice: str, schema: Any) -> str:
    """Comment and defaults list of a choice, as they are, or of a new one."""
    if path.exists():
        return path.read_text(encoding="utf-8").partition("\n\n")[0] + "\n\n"
    said = str(type(schema).__doc__).splitlines()[0]
    return f"# {said}\ndefaults:\n  - /infoplan_schema/{group}/{choice}@_here_\n  - _self_\n\n"


def _options(schema: Any) -> str:
    """Options of a schema as YAML: its own first, then those of its group; sections at the end."""
    base = type(schema).__mro__[-2]
    of_a_choice = base not in (type(schema), MissionConfig)
    shared = {item.name for item in fields(base)} if of_a_choice else set()
    items = [
        item
        for item in fields(schema)
        if not (item.name in GROUPS and is_dataclass(getattr(schema, item.name)))
    ]
    items.sort(key=lambda item: (item.name != "name", item.name in shared))
    sections = [item for item in items if is_dataclass(getattr(schema, item.name))]
    text = "".join(
        _option(item.name, getattr(schema, item.name), item.metadata)
        for item in items
        if item not in sections
    )
    for item in sections:
        section = getattr(schema, item.name)
        said = str(type(section).__doc__).splitlines()[0].rstrip(".")
        text += f"\n{item.name}: # {said}\n" + textwrap.indent(_options(section), "  ")
    return text


def _option(name: str, value: Any, metadata: Any) -> str:
    """One option, its value and what it is."""
    line = f"{name}: {_value(value)}".replace(": \n", ":\n")
    if name == "name":
        return f"{line}\n"
    comment = metadata["doc"]
    if metadata["unit"]:
        comment += f" ({metadata['unit']})"
    has_choice = metadata["choices"] != (value,)
    if has_choice and not all(choice in comment for choice in metadata["choices"]):
        *others, last = metadata["choices"]
        comment += f"; {', '.join(others)} or {last}" if others else f"; or {last}"
    first, *more = line.split("\n")
    if len(first) + len(comment) + 3 <= WIDTH:
        return "\n".join([f"{first} # {comment}", *more]) + "\n"
    wrapped = textwrap.wrap(comment, WIDTH - 2, initial_indent="# ", subsequent_indent="# ")
    return "\n".join([*wrapped, line]) + "\n"


def _value(value: Any) -> str:
    """Write a value as YAML; lists in lists one a line."""
    if isinstance(value, list) and value and isinstance(value[0], list):
        return "".join(f"\n  - {_value(entry)}" for entry in value)
    return (
        yaml.safe_dump(value, default_flow_style=True, width=WIDTH).removesuffix("\n...\n").strip()
    )


def _columns() -> str:
    """Write the tables' columns as the tables of a page."""
    text = ""
    for name, table in TABLES.items():
        since = f" (since {table.since}; may be missing)" if table.may_be_missing else ""
        text += f"\n**{name}**: a row is {table.doc}{since}.\n\n"
        text += "| column | type | unit | what it holds |\n|---|---|---|---|\n"
        for column in table.columns.values():
            doc = f"{column.doc} (since {column.since})" if column.may_be_missing else column.doc
            doc += "; of a survey null" if column.of_truth else ""
            text += f"| {column.name} | {column.kind} | {column.unit} | {doc} |\n"
    return f"{text}\n"


def main() -> int:
    """Write the files that are not as they must be, and name them."""
    for path, text in derived():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            print(path.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
