"""The YAML files repeat the dataclasses, and every choice composes."""

from dataclasses import asdict
from importlib.resources import files

import pytest
import yaml

from infoplan.config import GROUPS, Config, MissionConfig, options

CONF = files("infoplan.conf")


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
    for name, _, metadata in options(Config()):
        assert metadata["doc"], name
    assert {name for name, _, _ in options(MissionConfig())} < {
        name for name, _, _ in options(Config())
    }
