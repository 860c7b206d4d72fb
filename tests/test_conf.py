"""What repeats the dataclasses is as they are: YAML files, signatures, the page of the columns."""

import inspect
import re
import runpy
from dataclasses import asdict, replace
from importlib.resources import files
from pathlib import Path

import pytest
import yaml

import infoplan
from infoplan.config import GROUPS, METHODS, Config, MissionConfig, validate
from infoplan.methods import find
from infoplan.options import walk

CONF = files("infoplan.conf")
SCRIPT = Path(__file__).parents[1] / "scripts" / "derive.py"
BUILT_IN = [(group, choice) for group in METHODS for choice in METHODS[group] if choice != "own"]


def read(*path: str) -> dict:
    return yaml.safe_load(CONF.joinpath(*path).read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("group", "choice"), [(group, choice) for group in GROUPS for choice in GROUPS[group]]
)
def test_each_choice_equals_its_dataclass(group, choice):
    written = read(group, f"{choice}.yaml")
    del written["defaults"]
    assert written == asdict(GROUPS[group][choice])


@pytest.mark.parametrize("group", GROUPS)
def test_each_group_has_a_file_for_each_choice_and_no_other(group):
    found = {entry.name for entry in CONF.joinpath(group).iterdir() if entry.name[0] not in "._"}
    assert found == {f"{choice}.yaml" for choice in GROUPS[group]}


def test_the_root_equals_its_dataclass():
    written = read("config.yaml")
    del written["defaults"], written["hydra"]
    expected = asdict(Config())
    for group in GROUPS:
        del expected[group]
    assert written == expected


def test_every_option_says_what_it_is():
    for name, _, metadata in walk(Config()):
        assert metadata["doc"], name
    assert {name for name, _, _ in walk(MissionConfig())} < {name for name, _, _ in walk(Config())}


def test_what_is_derived_is_as_the_code_says():
    """Comments of the YAML files and tables of pages, too: make derived writes them."""
    files = dict(runpy.run_path(str(SCRIPT))["derived"]())
    docs = SCRIPT.parents[1] / "docs"
    marked = {page for page in docs.glob("*.md") if "make derived -->" in page.read_text("utf-8")}
    assert {path for path in files if path.parent == docs} == marked
    assert len(files) == 3 + len(marked) + sum(map(len, GROUPS.values()))
    for path, text in files.items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}: make derived"


def choices(column: int) -> list[tuple[str, str]]:
    """Options and values in a column of the table of choices: 2 defaults, 3 other readings."""
    page = Path(__file__).parents[1] / "docs" / "choices.md"
    text, _, _ = page.read_text(encoding="utf-8").partition("\n## ")
    cells = [row.split("|")[column] for row in text.splitlines() if row.count("|") == 4]
    paragraph = text[text.index("The paper's own numbers") :].split("\n\n")[0]
    told = "".join(cells) + (paragraph if column == 2 else "")
    return re.findall(r"`([a-z_.]+)=([^`]+)`", told)


def as_number(value: str) -> object:
    """Read a value as the command line does: YAML takes 1e-6 for text."""
    return float(value) if re.fullmatch(r"\de-\d", value) else yaml.safe_load(value)


def test_the_page_of_choices_tells_the_defaults():
    defaults = {name: value for name, value, _ in walk(Config())}
    told = choices(2)
    assert len(told) > 35
    for name, value in told:
        if name != "terrain":
            assert as_number(value) == defaults[name], name


def test_every_other_reading_on_the_page_can_be_chosen():
    told, seen = choices(3), [Config()]
    assert len(told) > 20
    for name, value in told:
        config, (group, option) = Config(), name.split(".")
        part = getattr(config, group)
        assert hasattr(part, option), name
        setattr(config, group, replace(part, **{option: as_number(value)}))
        validate(config)
        assert config not in seen, name
        seen.append(config)


def test_other_readings_can_be_joined():
    told = [f"{name}={value}" for name, value in dict(choices(3)[::-1]).items()]
    config = infoplan.configure(*[one for one in told if one != "model.iterations=0"])
    assert (config.planner.border, config.planner.average) == ("visit", "planned")
    assert (config.model.noise_start, config.model.optimizer_state) == ("restarted", "reset")
    assert config.detector.judge_pilot


@pytest.mark.parametrize(("group", "choice"), BUILT_IN)
def test_a_method_s_signature_has_the_defaults_of_its_schema(group, choice):
    bound = find(group, METHODS[group][choice])
    signature = inspect.signature(bound.func).parameters
    for name, default in bound.keywords.items():
        told = signature[name].default
        if told is not inspect.Parameter.empty:
            told = list(told) if isinstance(told, tuple) else told
            # No default may be mutable.
            assert told == default or (told is None and default == {}), name
    keyword_only = {
        name for name, one in signature.items() if one.kind is inspect.Parameter.KEYWORD_ONLY
    }
    assert keyword_only == set(bound.keywords)
