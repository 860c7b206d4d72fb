"""A stored configuration comes back as the one it was made from."""

from dataclasses import replace

import pytest
import yaml

from infoplan.config import METHODS, Config, CopodConfig, DetectorConfig, GpConfig, MissionConfig
from infoplan.errors import RunError
from infoplan.study.identity import config_from_science, identify
from infoplan.terrain import Terrain


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"detector": DetectorConfig(name="best", scope="batch")},
        {"detector": CopodConfig(scope="historical", contamination=0.2, score="paper")},
        {"model": GpConfig(iterations="per_sample"), "grid": [7, 9], "rho": 0.05, "budget": 321},
    ],
)
def test_the_science_of_a_run_gives_its_configuration(changes, volcano):
    config = replace(Config(), **changes)
    config.terrain = replace(config.terrain, name="volcano")
    run = identify(config, volcano)
    stored = yaml.safe_load(yaml.safe_dump(run.science))
    restored = config_from_science(stored)
    assert type(restored) is MissionConfig
    assert restored == run.config
    assert type(restored.detector) is type(run.config.detector)
    again = identify(replace(config, **vars(restored)), volcano)
    assert again.name == run.name


def test_a_map_from_a_file_keeps_its_name(volcano):
    own = Terrain("file-hills", volcano.elevation, volcano.extent, "m", volcano.sha256)
    config = Config()
    config.terrain = replace(config.terrain, name="file", path="hills.npy")
    restored = config_from_science(identify(config, own).science)
    assert (restored.terrain.name, restored.terrain.unit) == ("file-hills", "m")


@pytest.mark.parametrize(
    ("group", "key", "named"),
    [
        (None, "rho", "rho"),
        (None, "robot", "robot"),
        ("planner", "smoothing", "planner.smoothing"),
        ("detector", "name", "name"),
    ],
)
def test_a_missing_option_is_named(group, key, named, volcano):
    science = identify(Config(), volcano).science
    del (science[group] if group else science)[key]
    with pytest.raises(RunError, match=f"{named}.*run it again"):
        config_from_science(science)


def test_an_unknown_option_is_named(volcano):
    science = identify(Config(), volcano).science
    science["planner"] = {**science["planner"], "depth": 3}
    with pytest.raises(RunError, match="depth"):
        config_from_science(science)


def test_the_mapping_is_left_as_it_was(volcano):
    science = identify(Config(), volcano).science
    before = yaml.safe_dump(science)
    config_from_science(science).planner.iterations = 1
    assert yaml.safe_dump(science) == before


@pytest.mark.parametrize("model", ["gp", "student_t"])
def test_an_option_added_later_leaves_the_name_as_it_was(model, volcano):
    config = replace(Config(), model=METHODS["model"][model])
    run = identify(config, volcano)
    assert "kernel" not in run.science["model"]
    assert config_from_science(run.science).model.kernel == "squared_exponential"
    other = identify(replace(config, model=replace(config.model, kernel="matern")), volcano)
    assert other.science["model"]["kernel"] == "matern"
    assert other.name != run.name


LATER = {
    "planner.rollout_step": "sample", "planner.average": "planned", "planner.border": "visit",
    "detector.judge_pilot": True, "model.noise_start": "restarted",
    "model.optimizer_state": "reset", "fault.draw": "batch",
}  # fmt: skip
"""Readings of the paper that had no option once."""


@pytest.mark.parametrize("name", LATER)
def test_a_reading_added_later_is_stored_if_it_is_another_than_before(name, volcano):
    group, option = name.split(".")
    stored = {"fault": "outliers"}.get(group, group)
    usual = identify(Config(), volcano)
    assert option not in usual.science[stored]
    config = Config()
    setattr(config, group, replace(getattr(config, group), **{option: LATER[name]}))
    run = identify(config, volcano)
    assert run.science[stored][option] == LATER[name]
    assert run.name != usual.name
    assert getattr(getattr(config_from_science(run.science), group), option) == LATER[name]


@pytest.mark.parametrize("choice", ["pyod", "own", "best", "hampel"])
def test_every_detector_may_judge_the_pilot(choice, volcano):
    detector = METHODS["detector"][choice]
    if choice == "own":
        detector = replace(detector, function="own_methods.high")
    for judged in (False, True):
        run = identify(replace(Config(), detector=replace(detector, judge_pilot=judged)), volcano)
        assert config_from_science(run.science).detector.judge_pilot is judged


def test_the_name_of_the_default_configuration_is_that_of_0_1_0(volcano):
    config = Config()
    config.terrain = replace(config.terrain, name="volcano")
    assert identify(config, volcano).name == "puct-copod-volcano-rho0.1-batch-9aacda5f"


def test_a_stored_kernel_must_be_a_choice(volcano):
    science = identify(Config(), volcano).science
    science["model"] = {**science["model"], "kernel": "os"}
    with pytest.raises(RunError, match="kernel"):
        config_from_science(science)
