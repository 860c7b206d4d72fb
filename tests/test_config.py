"""Bounds and types of options, through the public check."""

import pytest

from infoplan.config import Config, CopodConfig, seed_list, validate
from infoplan.errors import UsageError


def test_defaults_are_valid():
    validate(Config())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: setattr(c, "rho", -0.1), "rho=-0.1"),
        (lambda c: setattr(c, "rho", 1.5), "at least 0 and at most 1"),
        (lambda c: setattr(c, "rho", float("nan")), "finite"),
        (lambda c: setattr(c, "budget", 50), "pilot"),
        (lambda c: setattr(c, "grid", [50]), "2 entries"),
        (lambda c: setattr(c, "grid", [50, 1]), "at least 2"),
        (lambda c: setattr(c.planner, "execute_actions", 0), "planner.execute_actions=0"),
        (lambda c: setattr(c.model, "iterations", "often"), "per_sample or a whole number"),
        (lambda c: setattr(c.detector, "contamination", 0.6), "at most 0.5"),
        (lambda c: setattr(c.detector, "score", "mine"), "pyod or paper"),
        (lambda c: setattr(c.fault, "amplitude", [2.0, 1.0]), "wrong way round"),
        (lambda c: setattr(c.terrain, "extent", [0.0, 0.0, 0.0, 50.0]), "xmin < xmax"),
        (lambda c: setattr(c.terrain, "extent", [0.0, 5.0, 0.0, 50.0]), "too small for the robot"),
        (lambda c: setattr(c.pilot, "control_points", [[0.0, 0.0]]), "at least two"),
        (lambda c: setattr(c, "n_jobs", 0), "n_jobs=0"),
        (lambda c: setattr(c, "seeds", 0), "seeds=0"),
    ],
)
def test_a_wrong_value_is_named(change, words):
    config = Config(detector=CopodConfig())
    change(config)
    with pytest.raises(UsageError, match=words.replace("[", r"\[")):
        validate(config)


@pytest.mark.parametrize(("seeds", "expected"), [(3, [0, 1, 2]), ([4, 0], [4, 0])])
def test_seeds(seeds, expected):
    assert list(seed_list(seeds)) == expected


@pytest.mark.parametrize("seeds", [0, -1, [], [1, 1], [1, -2], [1.5], "ten", True, None, 2.0])
def test_seeds_that_are_none(seeds):
    with pytest.raises(UsageError, match="seeds="):
        seed_list(seeds)


def test_half_a_side_holds_an_action():
    """From the middle an action of 10 samples of 0.7 stays inside 14 x 14, whatever its heading."""
    config = Config()
    config.terrain.extent = [-7.0, 7.0, -7.0, 7.0]
    validate(config)
    for extent in ([-6.95, 6.95, -7.0, 7.0], [-7.0, 7.0, -6.95, 6.95]):
        config.terrain.extent = extent
        with pytest.raises(UsageError, match=r"too small for the robot.*= 14"):
            validate(config)
