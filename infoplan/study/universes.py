"""Readings of what the paper leaves open: choices, their levels, and universes made of them.

A universe is one reading: a level of every choice. The multiverse has the defaults, every level
alone against the defaults, and joint universes, in which all choices vary at once.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from infoplan.method_identity import PAPERS_CHOICES

METHODS = ("UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD")
FILTERED = ("UCT-COPOD", "PUCT-COPOD")
RHOS = (0.05, 0.1, 0.15)

DEFAULT = "default"
"""Name of the universe of all defaults."""

JOINT = 72
"""So many joint universes: a multiple of the numbers of levels."""

_JOINT = "joint"

SEED = 0
"""Of the joint design."""

OF_LATER_EPOCHS = ("model.noise_start", "model.optimizer_state")
"""Options without use where hyperparameters stay as the pilot made them."""

Overrides = Mapping[str, str]


@dataclass(frozen=True)
class Choice:
    """One of the paper's open choices.

    Attributes
    ----------
    name
        In a word.
    levels
        Options of each reading, as the command line takes them, by its name; the defaults first.
    methods
        Which methods it makes a difference to.
    """

    name: str
    levels: Mapping[str, Overrides]
    methods: tuple[str, ...] = METHODS

    @property
    def default(self) -> str:
        """Name of the default level."""
        return next(iter(self.levels))


def _of(option: str, *values: str, methods: tuple[str, ...] = METHODS, name: str = "") -> Choice:
    """Make a choice of the values of one option, the default first."""
    levels: dict[str, Overrides] = {value: {option: value} for value in values[1:]}
    return Choice(name or option.partition(".")[2], {values[0]: {}, **levels}, methods)


CHOICES = (
    Choice("noise", {
        "carried": {},
        "restarted": {"model.noise_start": "restarted"},
        "floor 1": {"model.min_noise_variance": "1"},
    }),
    Choice("pilot", {
        "clean": {},
        "spiky": {"pilot.outliers": "true"},
        "spiky, judged": {"pilot.outliers": "true", "detector.judge_pilot": "true"},
    }),
    _of("detector.score", "pyod", "paper", methods=FILTERED),
    Choice("learning", {
        "adam 5": {},
        "adam 20": {"model.iterations": "20"},
        "adam per sample": {"model.iterations": "per_sample"},
        "lbfgs 5": {"model.optimizer": "lbfgs"},
        "lbfgs 20": {"model.optimizer": "lbfgs", "model.iterations": "20"},
        "frozen": {"model.iterations": "0"},
    }),
    _of("planner.execute_actions", "all", "2", "1", name="actions driven"),
    _of("planner.average", "driven", "planned"),
    _of("planner.border", "struck", "visit", "terminal"),
    _of("planner.rollout_step", "action", "sample", name="rollout step"),
    _of("detector.contamination", "0.1", "0.05", "0.2", methods=FILTERED),
    _of("fault.count", "round", "floor", "bernoulli", name="spike count"),
    _of("fault.draw", "spike", "batch", name="spike draw"),
    _of("robot.speed", "0.7", "0.4", "1"),
    _of("planner.exploration", "0.3", "0.1", "1"),
    _of("planner.smoothing", "2", "1", "4", methods=("PUCT-COPOD",)),
    _of("planner.noisy_std", "false", "true", name="noisy deviation"),
    _of("model.min_lengthscale", "none", "1", name="lengthscale floor"),
    _of("model.learning_rate", "0.01", "0.003", "0.03", name="learning rate"),
    _of("model.optimizer_state", "carried", "reset", name="optimiser's state"),
)  # fmt: skip
"""The choices, those first of which most is expected."""


@dataclass(frozen=True)
class Universe:
    """One reading of the paper.

    Attributes
    ----------
    name
        ``default``, ``<choice>: <level>``, or ``joint <number>``.
    levels
        Level of every choice, by its name.
    """

    name: str
    levels: Mapping[str, str]

    @property
    def changed(self) -> list[str]:
        """Choices of which it has another level than the default."""
        return [one.name for one in CHOICES if self.levels[one.name] != one.default]

    @property
    def is_joint(self) -> bool:
        """Whether all choices vary in it at once."""
        return self.name.startswith(_JOINT)

    @property
    def idle(self) -> list[str]:
        """Those of them that make no difference under its way of learning."""
        learning = self.levels["learning"]
        idle = ["learning rate"] if learning.startswith("lbfgs") else []
        if learning == "frozen":
            idle += ["optimiser's state"]
            idle += ["noise"] if self.levels["noise"] == "restarted" else []
        return [name for name in self.changed if name in idle]

    @property
    def levels_in_use(self) -> dict[str, str]:
        """Level of every choice, the default's where it is idle."""
        default = {one.name: one.default for one in CHOICES if one.name in self.idle}
        return {**self.levels, **default}

    def levels_for(self, method: str) -> dict[str, str]:
        """Level of every choice as a method meets it: the default's where it meets no difference.

        Nothing judges what UCT-NONE measured in the pilot, and how large spikes are matters to
        UCT-BEST only in the pilot, to which the scales are fitted.
        """
        levels = self.levels_in_use
        levels |= {one.name: one.default for one in CHOICES if method not in one.methods}
        if method == "UCT-NONE" and levels["pilot"] == "spiky, judged":
            levels["pilot"] = "spiky"
        if method == "UCT-BEST" and levels["pilot"] == "clean":
            levels["spike draw"] = "spike"
        return levels

    def options(self, method: str) -> dict[str, str]:
        """Options of a method in this universe that are not the defaults, as they are typed."""
        options: dict[str, str] = {}
        for choice in CHOICES:
            if method in choice.methods:
                options |= choice.levels[self.levels[choice.name]]
        if method == "UCT-NONE":
            options.pop("detector.judge_pilot", None)
        if options.get("model.iterations") == "0":
            for name in OF_LATER_EPOCHS:
                options.pop(name, None)
        return options

    def lines(self) -> Iterator[str]:
        """Give what follows ``infoplan run -m``: the paper's Fig. 5 in this universe."""
        rhos = ",".join(map(str, RHOS))
        for method in METHODS:
            planner, detector = PAPERS_CHOICES[method]
            words = [f"{name}={value}" for name, value in self.options(method).items()]
            head = f"planner={planner} detector={detector}"
            yield " ".join([head, f"rho={rhos}", *words])
            if method in FILTERED:
                yield " ".join([head, "rho=0.1 detector.scope=historical", *words])


def universes() -> tuple[Universe, ...]:
    """List all universes: the default, those of single choices, then joint ones."""
    default = {choice.name: choice.default for choice in CHOICES}
    alone = [
        Universe(f"{choice.name}: {level}", MappingProxyType({**default, choice.name: level}))
        for choice in CHOICES
        for level in list(choice.levels)[1:]
    ]
    return (Universe(DEFAULT, MappingProxyType(default)), *alone, *joint_universes())


def joint_universes() -> tuple[Universe, ...]:
    """Draw the joint universes: every level of a choice equally often, in any order.

    A Latin hypercube over levels (McKay, Beckman and Conover, Technometrics 21, 1979).
    """
    rng = np.random.default_rng(SEED)
    columns = {}
    for choice in CHOICES:
        levels = np.resize(np.array(list(choice.levels)), JOINT)
        columns[choice.name] = rng.permutation(levels).tolist()
    return tuple(
        Universe(
            f"{_JOINT} {number + 1}",
            MappingProxyType({name: column[number] for name, column in columns.items()}),
        )
        for number in range(JOINT)
    )
