"""Every option exists under its name, has its default, and changes a mission."""

import copy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flown import fly

from infoplan.config import METHODS, Config, CopodConfig, MissionConfig, TerrainConfig
from infoplan.options import walk, with_values
from infoplan.terrain import load_terrain

DEFAULTS = {
    "terrain.name": "helens",
    "terrain.extent": [0, 50, 0, 50],
    "terrain.obstacles": [],
    "grid": [50, 50],
    "robot.speed": 0.7,
    "robot.samples_per_action": 10,
    "robot.max_steering": 0.15,
    "robot.steering_angles": 5,
    "sensor.noise_std": 1.0,
    "pilot.samples": 100,
    "pilot.outliers": False,
    "model.amplitude": 1.0,
    "model.lengthscale": 0.5,
    "model.noise_variance": 1.0,
    "model.jitter": 1e-6,
    "model.optimizer": "adam",
    "model.learning_rate": 0.01,
    "model.pilot_iterations": 500,
    "model.iterations": 5,
    "model.min_noise_variance": 1e-4,
    "model.kernel": "squared_exponential",
    "model.min_lengthscale": 0.0,
    "model.lengthscale_prior": None,
    "model.noise_prior": None,
    "model.restarts": 0,
    "model.noise_start": "carried",
    "model.optimizer_state": "carried",
    "planner.noisy_std": False,
    "planner.reward": "std",
    "planner.kappa": 2.0,
    "planner.iterations": 500,
    "planner.rollouts": 5,
    "planner.rollout_step": "action",
    "planner.average": "driven",
    "planner.border": "struck",
    "planner.exploration": 0.3,
    "planner.execute_actions": None,
    "planner.smoothing": 2.0,
    "fault.count": "round",
    "fault.amplitude": [1, 2],
    "fault.quantiles": [0.05, 0.95],
    "detector.contamination": 0.1,
    "detector.score": "pyod",
    "fault.draw": "spike",
    "detector.scope": "batch",
    "detector.judge_pilot": False,
    "budget": 2000,
    "seeds": 10,
    "rho": 0.1,
}

READINGS_OF_THE_SEARCH = {
    "planner.rollout_step": "sample",
    "planner.average": "planned",
    "planner.border": "terminal",
}
DETECTOR = {"detector.scope": "historical", "detector.judge_pilot": True}
LEARNING = {"model.noise_start": "restarted", "model.optimizer_state": "reset"}
CHANGES = {
    "terrain.extent": [0.0, 60.0, 0.0, 40.0],
    "terrain.unit": "m",
    "terrain.orientation": 3,
    "terrain.obstacles": [[[22.0, 27.0], [36.0, 27.0], [36.0, 34.0], [22.0, 34.0]]],
    "grid": [14, 11],
    "robot.speed": 0.5,
    "robot.samples_per_action": 7,
    "robot.max_steering": 0.2,
    "robot.steering_angles": 3,
    "sensor.noise_std": 5.0,
    "pilot.samples": 90,
    "pilot.outliers": True,
    "pilot.control_points": [[0.1, 0.1], [0.9, 0.2], [0.5, 0.9]],
    "model.amplitude": 2.0,
    "model.lengthscale": 0.3,
    "model.noise_variance": 0.1,
    "model.jitter": 1e-4,
    "model.optimizer": "lbfgs",
    "model.learning_rate": 0.05,
    "model.pilot_iterations": 10,
    "model.iterations": "per_sample",
    "model.min_noise_variance": 0.9,
    "model.kernel": "matern32",
    "model.min_lengthscale": 30.0,
    "model.lengthscale_prior": [0.05, 0.1],
    "model.noise_prior": [0.01, 0.1],
    "model.restarts": 2,
    **LEARNING,
    "model.dtype": "float32",
    "planner.name": "uct",
    "planner.noisy_std": True,
    "planner.reward": "variance_reduction",
    "planner.kappa": 5.0,
    "planner.iterations": 60,
    "planner.rollouts": 1,
    **READINGS_OF_THE_SEARCH,
    "planner.exploration": 2.0,
    "planner.execute_actions": 1,
    "planner.smoothing": 6.0,
    "fault.count": "bernoulli",
    "fault.amplitude": [3.0, 4.0],
    "fault.quantiles": [0.25, 0.75],
    "detector.contamination": 0.3,
    "detector.score": "paper",
    "fault.draw": "batch",
    **DETECTOR,
    "budget": 210,
    "rho": 0.4,
}


PLANNER = {"planner.execute_actions": 1, "planner.smoothing": 6.0}
GATHERING = {
    "planner.noisy_std": True,
    "planner.reward": "variance_reduction",
    "planner.kappa": 5.0,
}
MODEL = {"model.pilot_iterations": 10, "model.iterations": "per_sample"}
NUMBERS_OF_THE_GP = {
    "model.amplitude": 2.0,
    "model.lengthscale": 0.3,
    "model.noise_variance": 0.1,
    "model.jitter": 1e-4,
    "model.optimizer": "lbfgs",
    "model.learning_rate": 0.05,
    "model.min_noise_variance": 0.9,
    "model.kernel": "matern32",
}
GUARDS = {
    "model.min_lengthscale": 30.0,
    "model.lengthscale_prior": [0.05, 0.1],
    "model.noise_prior": [0.01, 0.1],
    "model.restarts": 2,
}
OF_THE_CHOICE = {
    ("planner", "uct"): {
        "planner.iterations": 60,
        "planner.rollouts": 1,
        **READINGS_OF_THE_SEARCH,
        "planner.exploration": 2.0,
        **GATHERING,
        **PLANNER,
    },
    ("planner", "weighted"): {
        "planner.weight": 0.9,
        "planner.iterations": 60,
        "planner.rollouts": 1,
        **READINGS_OF_THE_SEARCH,
        "planner.exploration": 2.0,
        **GATHERING,
        **PLANNER,
    },
    ("planner", "greedy"): {"planner.actions": 2, **GATHERING, **PLANNER},
    ("planner", "bayes_opt"): {
        "planner.actions": 2,
        "planner.distance_penalty": 20.0,
        "planner.reward": "variance_reduction",
        "planner.kappa": 5.0,
        **PLANNER,
    },
    ("planner", "rig_tree"): {
        "planner.samples": 30,
        "planner.actions": 3,
        "planner.near": 9.0,
        "planner.prune": 8.0,
        **GATHERING,
        **PLANNER,
    },
    ("planner", "cmaes"): {
        "planner.waypoints": 2,
        "planner.actions": 3,
        "planner.spread": 0.5,
        "planner.evaluations": 10,
        **GATHERING,
        **PLANNER,
    },
    ("planner", "lawnmower"): {
        "planner.actions": 2,
        "planner.spacing": 9.0,
        "planner.lookahead": 1,
        **PLANNER,
    },
    ("planner", "random"): {"planner.actions": 2, **PLANNER},
    ("planner", "own"): {
        "planner.options": {"actions": 1},
        "planner.function": "own_methods.leftmost",
        "planner.noisy_std": True,
        **PLANNER,
    },
    ("detector", "pyod"): {
        "detector.model": "KNN",
        "detector.features": ["x1", "x2", "y"],
        "detector.contamination": 0.3,
        "detector.params": {"n_neighbors": 2},
        **DETECTOR,
    },
    ("detector", "gp_residual"): {
        "detector.threshold": 0.5,
        "detector.one_by_one": False,
        **DETECTOR,
    },
    ("detector", "local"): {"detector.threshold": 1.0, "detector.neighbours": 4, **DETECTOR},
    ("detector", "hampel"): {"detector.threshold": 1.0, "detector.reach": 2, **DETECTOR},
    ("detector", "qartod"): {
        "detector.gross_range": 0.5,
        "detector.spike": 1.0,
        "detector.rate": 1.0,
        "detector.flat": None,
        "detector.tolerance": 30.0,
        **DETECTOR,
    },
    ("detector", "own"): {
        "detector.options": {"share": 0.5},
        "detector.function": "own_methods.low",
        **DETECTOR,
    },
    ("model", "student_t"): {
        "model.dof": 30.0,
        **NUMBERS_OF_THE_GP,
        **LEARNING,
        **GUARDS,
        **MODEL,
    },
    ("model", "rcgp"): {
        "model.outlier_fraction": 0.3,
        "model.centre_neighbours": None,
        "model.criterion": "plain",
        **NUMBERS_OF_THE_GP,
        **LEARNING,
        **MODEL,
    },
    ("model", "itgp"): {
        "model.alpha1": 0.8,
        "model.alpha2": 0.6,
        "model.shrinking": 0,
        "model.concentrating": 0,
        "model.reweighting": 0,
        "model.dtype": "float32",
        **NUMBERS_OF_THE_GP,
        **MODEL,
    },
    ("model", "relevance_pursuit"): {
        "model.outlier_fraction": 0.001,
        "model.fractions": [0.02],
        **NUMBERS_OF_THE_GP,
        **LEARNING,
        **MODEL,
    },
    ("model", "vecchia"): {
        "model.neighbours": 3,
        "model.block": 2,
        "model.prediction_neighbours": 9,
        "model.ordering": "maxmin",
        "model.dtype": "float32",
        **NUMBERS_OF_THE_GP,
        **LEARNING,
        **GUARDS,
        **MODEL,
    },
    ("model", "own"): {
        "model.options": {"width": 0.2},
        "model.function": "own_methods.Rough",
        **MODEL,
    },
    ("fault", "max_range"): {"fault.level": 3.0},
    ("fault", "uniform"): {"fault.bounds": [0.0, 1.0]},
    ("fault", "burst"): {"fault.length": 2.0, "fault.amplitude": [0.5, 0.6]},
    ("fault", "stuck"): {"fault.length": 4.0},
    ("fault", "bias"): {"fault.length": 4.0, "fault.amplitude": [0.5, 0.6]},
    ("fault", "drift"): {"fault.length": 4.0, "fault.rate": 0.1},
    ("fault", "heavy_tail"): {"fault.dof": 1.0, "fault.scale": 0.2},
    ("fault", "local"): {
        "fault.regions": [0.0, 25.0, 0.0, 50.0],
        "fault.factor": 2.0,
        "fault.amplitude": [0.5, 0.6],
    },
    ("fault", "dropout"): {"fault.length": 9.0},
    ("fault", "mixed"): {
        "fault.faults": ["dropout", "drift"],
        "fault.weights": [1.0, 2.0, 3.0],
        "fault.options": {"burst": {"length": 2.0}},
    },
    ("fault", "own"): {
        "fault.options": {"size": 50.0},
        "fault.function": "own_methods.lowered",
    },
}
"""A change of every option of the choices that are not the default of their group."""

OWN_FUNCTIONS = {
    "planner": "by_the_digits", "detector": "high", "model": "Smooth", "fault": "raised",
}  # fmt: skip


def base() -> Config:
    config = Config(budget=220, grid=[12, 12], rho=0.15, terrain=TerrainConfig(name="volcano"))
    config.planner = replace(config.planner, iterations=40)
    config.model = replace(config.model, pilot_iterations=30, iterations=3)
    config.detector = CopodConfig()
    return config


def base_of(group: str, choice: str) -> Config:
    """A mission with a choice of a group; what its change needs to show is set."""
    config = base()
    options = copy.deepcopy(METHODS[group][choice])
    if choice == "own":
        options.function = f"own_methods.{OWN_FUNCTIONS[group]}"
    if choice == "qartod":  # of which each test has something to find
        config.rho, config.fault = 0.4, METHODS["fault"]["stuck"]
        options.flat, options.gross_range = 2, 100.0
    if choice == "pyod":
        options.model = "LOF"
    if choice == "gp_residual":
        options.threshold = 1.0
    if choice == "itgp":  # of which the learning rate has something to do, and every step
        options.optimizer, options.learning_rate, options.alpha2 = "adam", 0.3, 0.8
    if choice == "greedy":
        config.robot = replace(config.robot, steering_angles=11, samples_per_action=20)
    setattr(config, group, options)
    if group == "model":
        config.model = replace(config.model, pilot_iterations=30, iterations=3)
    config.planner = with_values(config.planner, iterations=40)
    return config


def changed(config: Config, name: str, value: object) -> Config:
    config = copy.deepcopy(config)
    owner = config
    *groups, last = name.split(".")
    for group in groups:
        owner = getattr(owner, group)
    assert hasattr(owner, last)
    setattr(owner, last, value)
    return config


def numbers(config: Config) -> list[np.ndarray]:
    states = fly(config, load_terrain(**vars(config.terrain)), seed=3)
    rows = [state.row for state in states]
    curve = [(row.rmse, row.nlpd, row.lml, row.tp, row.fp) for row in rows]
    samples, maps = states[-1].samples, states[-1].maps
    return [np.array(curve), samples.x, samples.measured, samples.flagged, maps.outlier_density]


@cache
def base_numbers() -> tuple[np.ndarray, ...]:
    return tuple(numbers(base()))


def test_defaults_are_the_documented_ones():
    found = {name: value for name, value, _ in walk(Config())}
    for name, value in DEFAULTS.items():
        assert found[name] == value, name


def names_to_change(config, prefix: str = "") -> set[str]:
    """Options by name, but those of a single choice."""
    return {
        name
        for name, _, metadata in walk(config, prefix)
        if (metadata["type"], len(metadata["choices"])) != (str, 1)
    }


def test_every_scientific_option_is_tried_here():
    names = names_to_change(MissionConfig())
    names -= {
        "terrain.name",
        "terrain.path",
        "terrain.on_missing",
        "terrain.obstacles_mask",
        "detector.name",
    }
    assert names == set(CHANGES)


def differ(before, after) -> bool:
    return any(
        one.shape != other.shape or not np.array_equal(one, other, equal_nan=True)
        for one, other in zip(before, after, strict=True)
    )


MATTERS_WITH = {"planner.kappa": ("planner.reward", "ucb")}
"""Options that have something to say only with a value of another one."""


def is_seen(before, config: Config, name: str, value: object) -> bool:
    """Whether a change of an option changes the mission, whose numbers are these."""
    if name in MATTERS_WITH:
        config = changed(config, *MATTERS_WITH[name])
        before = numbers(config)
    return differ(before, numbers(changed(config, name, value)))


@pytest.mark.parametrize("name", CHANGES)
def test_option_changes_the_mission(name):
    assert is_seen(base_numbers(), base(), name, CHANGES[name])


def test_every_option_of_every_choice_is_tried_here():
    tried = {  # CHANGES
        ("planner", "puct"), ("detector", "copod"), ("model", "gp"), ("fault", "spike"),
    }  # fmt: skip
    trivial = {("detector", "none"), ("detector", "best")}  # a scope that changes nothing
    for group, choices in METHODS.items():
        for choice, schema in choices.items():
            names = names_to_change(schema, f"{group}.") - {f"{group}.name"}
            if (group, choice) not in tried | trivial:
                assert names == set(OF_THE_CHOICE[group, choice]), (group, choice)


@cache
def numbers_of(group: str, choice: str) -> tuple[np.ndarray, ...]:
    return tuple(numbers(base_of(group, choice)))


@pytest.mark.parametrize(
    ("group", "choice", "name"),
    [(*pair, name) for pair, changes in OF_THE_CHOICE.items() for name in changes],
)
def test_option_of_a_choice_changes_the_mission(group, choice, name):
    value = OF_THE_CHOICE[group, choice][name]
    assert is_seen(numbers_of(group, choice), base_of(group, choice), name, value)


@pytest.mark.parametrize(("group", "choice"), OF_THE_CHOICE)
def test_the_choices_of_a_group_are_different_missions(group, choice):
    assert differ(base_numbers(), numbers_of(group, choice))
    assert not differ(numbers_of(group, choice), numbers(base_of(group, choice)))


@pytest.mark.parametrize("rule", ["floor", "round"])
def test_floor_gives_short_batches_no_spikes(rule):
    config = changed(changed(base(), "fault.count", rule), "rho", 0.06)
    last = fly(changed(config, "planner.execute_actions", 1), load_terrain("volcano"))[-1]
    assert last.samples.is_outlier.any() == (rule == "round")


def test_two_missions_with_one_seed_share_their_noise():
    missions = []
    for planner in ("uct", "puct"):
        config = changed(base(), "planner.name", planner)
        missions.append(fly(config, load_terrain("volcano"), 5)[-1].samples)
    noise = [(s.measured - s.truth)[:100] for s in missions]
    np.testing.assert_array_equal(*noise)
    clean = ~(missions[0].is_outlier | missions[1].is_outlier)
    np.testing.assert_allclose(
        *[(s.measured - s.truth)[clean] for s in missions], rtol=0, atol=1e-8
    )
