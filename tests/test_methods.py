"""Planners, detectors and models by their options, the user's own among them."""

import hashlib
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from flown import fly

from infoplan.belief import Belief
from infoplan.config import (
    METHODS,
    Config,
    GpResidualConfig,
    OwnDetectorConfig,
    OwnModelConfig,
    OwnPlannerConfig,
    PyodConfig,
    TerrainConfig,
)
from infoplan.errors import RunError, UsageError
from infoplan.methods import complete, method_from_stored, method_label, stored_methods
from infoplan.simulator import Simulator
from infoplan.study.identity import identify

CODE = """
import numpy as np

from infoplan.fault import Corrupted


def picky(samples, model, rng, *, threshold: float = 2, how: str = "far", deep: list[int] = [1]):
    return samples.measured > 1e9, samples.measured


def lowered(sensed, state, rho, rng, *, by: float = 3.0):
    return Corrupted(sensed.measured - by, np.ones(len(sensed), dtype=bool), state)


def ahead(situation, rng, *, actions: int = 2):
    pose, plan = situation.pose, []
    for _ in range(actions):
        plan.append(situation.valid_actions(pose)[0])
        pose = situation.drive(plan[-1:], pose)[-1]
    return plan


def {broken}


class Flat:
    def __init__(self, x_pilot, y_pilot, *, std: float = 5.0):
        self.y, self.std = y_pilot, std

    def append(self, x, y):
        self.replace(x, np.append(self.y, y))

    def replace(self, x, y):
        self.y = y

    def optimize(self, iterations):
        self.iterations = iterations

    def predict(self, x):
        return np.full(len(x), self.y.mean()), np.full(len(x), self.std)


class Odd(Flat):
    def predict(self, x):
        return {odd}


def copod(samples, model, rng):
    return picky(samples, model, rng)


def few(samples):
    return None
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Write the module ``mine`` into the current folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))

    def write(broken="unused(): pass", odd="None"):
        # A cached module would come first, and so would the code of a file as old and as long.
        sys.modules.pop("mine", None)
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
        (tmp_path / "mine.py").write_text(CODE.format(broken=broken, odd=odd))
        return tmp_path / "mine.py"

    yield write
    sys.modules.pop("mine", None)


def config(**groups):
    made = Config(budget=130, grid=[8, 8], terrain=TerrainConfig(name="volcano"))
    made.planner = replace(made.planner, iterations=20)
    made.model = replace(made.model, pilot_iterations=5, iterations=1)
    return replace(made, **groups)


def test_labels():
    assert method_label(METHODS["planner"]["puct"]) == "puct"
    assert method_label(PyodConfig(model="IForest")) == "pyod_iforest"
    assert method_label(OwnDetectorConfig(function="deep.inside.picky")) == "picky"


def test_defaults_are_filled_in_and_typed(write):
    write()
    detector = OwnDetectorConfig(function="mine.picky", options={"threshold": 7})
    completed = complete(config(detector=detector))
    assert completed.detector.options == {"threshold": 7.0, "how": "far", "deep": [1]}
    assert type(completed.detector.options["threshold"]) is float
    assert detector.options == {"threshold": 7}


def test_options_and_code_decide_the_run_s_name(write, volcano):
    path = write()

    def name(**options):
        own = OwnDetectorConfig(function="mine.picky", options=options)
        return identify(config(detector=own), volcano).name

    assert name().startswith("puct-picky-volcano-rho0.1-batch-")
    assert name() == name(threshold=2.0) == name(how="far")
    assert name() != name(threshold=3.0)
    before = name()
    path.write_text(path.read_text() + "# changed\n")
    assert name() != before


def test_other_models_are_in_the_run_s_name(write, volcano):
    write()
    model = OwnModelConfig(function="mine.Flat", options={"std": 2.0})
    assert identify(config(model=model), volcano).name.startswith("puct-copod-Flat-volcano-")
    student = METHODS["model"]["student_t"]
    assert identify(config(model=student), volcano).name.startswith("puct-copod-student_t-volcano-")


@pytest.mark.parametrize(
    ("group", "choice"), [(group, choice) for group in METHODS for choice in METHODS[group]]
)
def test_what_is_stored_comes_back(group, choice, write):
    path = write()
    options = METHODS[group][choice]
    if choice == "own":
        function = {
            "planner": "ahead", "detector": "picky", "model": "Flat", "fault": "lowered",
        }[group]  # fmt: skip
        options = replace(options, function=f"mine.{function}")
    completed = complete(config(**{group: options}))
    stored = yaml.safe_load(yaml.safe_dump(stored_methods(completed)))
    assert method_from_stored(group, stored[group]) == getattr(completed, group)
    assert stored[group]["name"] == method_label(options)
    if choice == "own":
        assert stored[group]["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    del stored[group]["name"]
    with pytest.raises(KeyError):
        method_from_stored(group, stored[group])


def test_what_is_stored_must_be_whole():
    stored = stored_methods(config())["planner"]
    with pytest.raises(KeyError, match=r"planner\.exploration"):
        method_from_stored("planner", {k: v for k, v in stored.items() if k != "exploration"})
    with pytest.raises(TypeError, match="depth"):
        method_from_stored("planner", stored | {"depth": 3})
    with pytest.raises(KeyError, match="planner=astar"):
        method_from_stored("planner", stored | {"name": "astar"})


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        ({"detector": OwnDetectorConfig()}, "detector=own needs detector.function"),
        ({"model": OwnModelConfig()}, "model.function=module.Class"),
        ({"detector": OwnDetectorConfig(function="mine.pick")}, "did you mean 'picky'"),
        ({"detector": OwnDetectorConfig(function="mine.copod")}, "give it another name"),
        ({"detector": OwnDetectorConfig(function="mine.few")}, r"takes \(samples, model, rng"),
        ({"planner": OwnPlannerConfig(function="mine.picky")}, "cannot be called as a planner"),
        ({"detector": PyodConfig(model="Ecod")}, "did you mean 'ECOD'"),
        ({"detector": PyodConfig(params={"jobs": 2})}, "did you mean 'n_jobs'"),
        (
            {"planner": OwnPlannerConfig(function="mine.ahead", options={"action": 2})},
            "no option planner.options.action .did you mean 'actions'",
        ),
        (
            {"planner": OwnPlannerConfig(function="mine.ahead", options={"actions": 1.5})},
            "planner.options.actions=1.5 does not fit ahead: it must be a whole number",
        ),
        (
            {"detector": GpResidualConfig(), "model": OwnModelConfig(function="mine.Flat")},
            "needs a model with a method weights_and_inverse",
        ),
    ],
)
def test_what_cannot_be_is_one_sentence(groups, words, write, volcano):
    write()
    with pytest.raises(UsageError, match=words) as caught:
        identify(config(**groups), volcano)
    assert "\n" not in str(caught.value)


def test_own_methods_fly(write, volcano):
    write()
    made = config(
        planner=OwnPlannerConfig(function="mine.ahead", options={"actions": 1}),
        detector=OwnDetectorConfig(function="mine.picky"),
        model=OwnModelConfig(function="mine.Flat", options={"std": 9.0}, iterations=4),
    )
    states = fly(made, volcano)
    assert [state.row.collected for state in states] == [100, 110, 120, 130]
    row, samples, maps = states[-1].row, states[-1].samples, states[-1].maps
    assert (maps.std == 9.0).all()
    np.testing.assert_allclose(maps.mean, samples.measured.mean())
    np.testing.assert_array_equal(samples.score[100:], samples.measured[100:])
    assert np.isnan([row.lml, row.amplitude, row.jitter]).all()
    simulator = Simulator(made, volcano, 0)
    belief = Belief(made, volcano.extent, 0, simulator.pilot().readings())
    belief.learn(simulator.sample(1, belief.plan()).readings())
    assert belief.model.iterations == 4


DETECTOR = "wrong(samples, model, rng):"
PLANNER = "wrong(situation, rng):"
BROKEN = {
    f"{DETECTOR} return 1 / 0, 2": r"detector wrong failed in epoch 1: ZeroDivisionError: "
    r"division by zero \(mine.py, line 23\)",
    f"{DETECTOR} return samples.flagged": "detector wrong gave no pair of arrays",
    f"{DETECTOR} return samples.flagged, samples.x": r"flags of shape \(\d+,\) and scores",
    f"{DETECTOR} return samples.flagged[:5], samples.measured": "one entry for each of the",
    f"{DETECTOR} return samples.measured, samples.measured": "flags must be true or false",
    f"{DETECTOR} samples.measured[:] = 0": "failed in epoch 1: ValueError: assignment destination",
    f"{PLANNER} raise KeyError('way')": r"planner wrong failed in epoch 1: KeyError: 'way'",
    f"{PLANNER} return []": "gave no action where",
    f"{PLANNER} return [0, 7]": "each must be an index into situation.steering, from 0 to 4",
    f"{PLANNER} return [-1]": "from 0 to 4",
    f"{PLANNER} return [0.5]": "must return a list of actions, whole numbers",
    f"{PLANNER} return None": "must return a list of actions",
    f"{PLANNER} return [[0], [1, 2]]": r"wrong gave \[\[0\], \[1, 2\]\]: it must return a list of",
    f"{PLANNER} return np.zeros((2, 2), int)": "must return a list of actions",
    f"{PLANNER} return [2] * 30": "leave the workspace",
    f"{PLANNER} situation.std[:] = 1": "failed in epoch 1: ValueError: assignment destination",
}


@pytest.mark.parametrize("broken", BROKEN)
def test_a_function_that_fails_is_one_sentence(broken, write, volcano):
    write(broken)
    own = OwnDetectorConfig if broken.startswith(DETECTOR) else OwnPlannerConfig
    group = "detector" if own is OwnDetectorConfig else "planner"
    with pytest.raises(RunError, match=BROKEN[broken]) as caught:
        fly(config(**{group: own(function="mine.wrong")}), volcano)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("odd", "words"),
    [
        ("None", "must return .mean, std."),
        ("(np.zeros(3), np.ones(3))", r"means of shape \(3,\)"),
        ("(np.zeros(len(x)), np.zeros(len(x)))", "positive deviations"),
        ("(np.full(len(x), np.nan), np.ones(len(x)))", "finite means"),
        ("self.nothing", "model Odd failed on the pilot samples: AttributeError"),
    ],
)
def test_a_model_that_fails_is_one_sentence(odd, words, write, volcano):
    write(odd=odd)
    with pytest.raises(RunError, match=words) as caught:
        fly(config(model=OwnModelConfig(function="mine.Odd")), volcano)
    assert "\n" not in str(caught.value)


ONE_FILE = """
import functools

import numpy as np


def passed_on(function):
    @functools.wraps(function)
    def inner(*arguments, **options):
        return function(*arguments, **options)
    return inner


def fails_itself(function):
    @functools.wraps(function)
    def inner(*arguments, **options):
        raise KeyError("inner")
    return inner


@passed_on
def ahead(situation, rng):
    if {planner_fails}:
        helper()
    return situation.valid_actions()[:1]


def helper():
    raise KeyError("helper")


def calm(samples, model, rng):
    return samples.measured > 1e9, samples.measured


def wrong(samples, model, rng):
    return helper()


def asks(samples, model, rng):
    return model.nothing


@fails_itself
def wrapped(samples, model, rng):
    return calm(samples, model, rng)


class Base:
    def __init__(self, x_pilot, y_pilot):
        self.mean = y_pilot.mean()

    def append(self, x, y):
        raise KeyError("base")

    def optimize(self, iterations):
        pass

    def predict(self, x):
        return np.full(len(x), self.mean), np.ones(len(x))


class Derived(Base):
    pass


class Whole(Base):
    def append(self, x, y):
        pass

    replace = append
"""


@pytest.mark.parametrize(
    ("planner_fails", "detector", "model", "words"),
    [
        (False, "wrong", "Whole", "the detector wrong failed in epoch 1: KeyError: 'helper'"),
        (False, "asks", "Whole", "the detector asks failed in epoch 1: AttributeError"),
        (True, "wrong", "Whole", "the planner ahead failed in epoch 1: KeyError: 'helper'"),
        (False, "calm", "Derived", "the model Derived failed in epoch 1: KeyError: 'base'"),
    ],
)
def test_of_methods_in_one_file_the_one_that_was_called_is_named(
    planner_fails, detector, model, words, write, volcano
):
    path = write()
    path.write_text(ONE_FILE.format(planner_fails=planner_fails))
    made = config(
        planner=OwnPlannerConfig(function="mine.ahead"),
        detector=OwnDetectorConfig(function=f"mine.{detector}"),
        model=OwnModelConfig(function=f"mine.{model}"),
    )
    with pytest.raises(RunError) as caught:
        fly(made, volcano)
    assert str(caught.value).startswith(words)
    # What failed is helper, asks or append: the last of the lines of this file that were run.
    place = {"asks": "return model.nothing", "calm": 'KeyError("base")'}
    failed = place.get(detector, 'KeyError("helper")')
    lines = path.read_text().splitlines()
    number = next(i for i, line in enumerate(lines, start=1) if failed in line)
    assert str(caught.value).endswith(f"(mine.py, line {number})")


def test_a_decorator_that_fails_is_the_method_s(write, volcano):
    write().write_text(ONE_FILE.format(planner_fails=False))
    with pytest.raises(RunError, match="detector wrapped failed in epoch 1: KeyError: 'inner'"):
        fly(config(detector=OwnDetectorConfig(function="mine.wrapped")), volcano)


def test_a_model_without_noise_has_no_noisy_deviation(write, volcano):
    write()
    made = config(model=OwnModelConfig(function="mine.Flat"))
    made.planner = replace(made.planner, noisy_std=True)
    with pytest.raises(RunError, match="needs a model with observation_noise_std"):
        fly(made, volcano)


def test_what_fails_in_pyod_is_said_to_be_pyod_s(volcano):
    made = config(detector=PyodConfig(model="KNN", params={"n_neighbors": 5000}))
    with pytest.raises(RunError, match="detector pyod_knn failed in epoch 1: ValueError"):
        fly(made, volcano)


def test_an_error_of_infoplan_s_own_stays_what_it_is(volcano, monkeypatch):
    monkeypatch.setattr("infoplan.mission.assess", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        fly(config(), volcano)
