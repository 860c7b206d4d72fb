"""Who a method is: its name for people, and how it is drawn.

A method is a planner, a detector with its scope, and a model; the fault that it has to stand is
told with it, unless that is a condition under which methods are compared. Everything that shows
methods, in words or lines, takes their names and looks from here, and never reads them back out of
a name.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import count, product
from typing import Any

from infoplan import palette
from infoplan.config import METHODS, is_survey
from infoplan.wording import harmless

NEVER_ERRS = ("none", "best")
"""Detectors that nobody need judge; they say the same under every scope."""

REPLAY = "replay"
"""The key that the configuration of a replay has: the name of the run that was flown."""

Dashes = tuple[float, ...]
"""Lengths of strokes and gaps in turn, in line widths; empty: a solid line."""


@dataclass(frozen=True)
class Choice:
    """A planner, detector, model or fault.

    Attributes
    ----------
    group
        ``planner``, ``detector``, ``model`` or ``fault``.
    name
        As in tables: ``uct``, ``pyod_ecod``, or the name of a function of the user's.
    function
        Dotted path of a function of the user's; empty: built in.
    """

    group: str
    name: str
    function: str = ""

    @property
    def word(self) -> str:
        """Its part of a label: the name in capitals; the path, if that could be mistaken."""
        mistaken = self.function and self.name.lower() in METHODS[self.group]
        return self.function if mistaken else self.name.upper()


SURVEY = Choice("planner", "survey")
"""What stands for the planner of a survey, which nobody planned."""

GP, SPIKE, BATCH = Choice("model", "gp"), Choice("fault", "spike"), "batch"
"""The paper's, which labels do not tell."""


@dataclass(frozen=True)
class Method:
    """A planner, a detector and a model, and the fault that they face.

    Attributes
    ----------
    planner, detector, model, fault
        The choices.
    replayed
        The planner has not planned: a flown run's samples were judged and fitted anew.
    scope
        What the detector judges, ``batch`` or ``historical``; no part of the label, because most
        drawings have a panel for each.
    """

    planner: Choice
    detector: Choice
    model: Choice
    replayed: bool = False
    fault: Choice = SPIKE
    scope: str = BATCH

    @property
    def label(self) -> str:
        """Its name: ``UCT-NONE``, ``UCT-NONE-STUDENT_T``, ``REPLAY-UCT-NONE``."""
        return "-".join(self._parts(choice.word for choice in self.choices))

    @property
    def full_label(self) -> str:
        """Its name with the dotted paths of the user's functions."""
        return "-".join(self._parts(choice.function or choice.word for choice in self.choices))

    @property
    def faultless(self) -> "Method":
        """The same where the fault is told beside it."""
        return replace(self, fault=SPIKE)

    @property
    def choices(self) -> tuple[Choice, ...]:
        """Planner and detector, and model and fault where they are not the usual ones."""
        unusual = [one for one in (self.model, self.fault) if one not in (GP, SPIKE)]
        return (self.planner, self.detector, *unusual)

    @property
    def can_err(self) -> bool:
        """Whether its detector can be wrong."""
        return bool(self.detector.function) or self.detector.name not in NEVER_ERRS

    def _parts(self, words: Iterable[str]) -> list[str]:
        return [*(("REPLAY",) if self.replayed else ()), *words]


PAPERS_OWN = Method(Choice("planner", "puct"), Choice("detector", "copod"), GP)
"""What the paper proposes: PUCT-COPOD, scope batch."""


@dataclass(frozen=True)
class Look:
    """How a method is drawn.

    Attributes
    ----------
    colour
        As ``#0072B2``.
    dashes
        Of its line, for print and eyes without colours; no other method of the set has them.
    """

    colour: str
    dashes: Dashes


PAPERS: dict[str, Look] = {
    "UCT-NONE": Look(palette.VERMILLION, (1, 1)),
    "UCT-BEST": Look(palette.GREEN, (5, 1.2, 1, 1.2)),
    "UCT-COPOD": Look(palette.PURPLE, (4, 1.5)),
    "PUCT-COPOD": Look(palette.BLUE, ()),
    "PUCT-NONE": Look(palette.ORANGE, (1, 2)),
    "PUCT-BEST": Look(palette.SKY, (5, 1.2, 1, 1.2, 1, 1.2)),
}
"""The paper's methods, and both that complete them."""

PAPERS_CHOICES = {
    f"{planner}-{detector}".upper(): (planner, detector)
    for planner, detector in product(("uct", "puct"), ("none", "best", "copod"))
}
"""Planner and detector of each of them."""

PAPERS_FOUR = {"UCT-NONE", "UCT-BEST", "UCT-COPOD", "PUCT-COPOD"}
"""Those that the paper compares."""

OTHERS = (
    "#551302", "#210784", "#73474C", "#A664FE", "#032EBB", "#4A2F4C", "#88647F", "#B44E32",
    "#932F11", "#5E4784", "#77AF76", "#653BD6", "#361E57", "#591F97", "#D696C6", "#7F8ACC",
    "#710026", "#B180FC", "#5C7B5B", "#DD8736", "#1F376E", "#805562", "#927495", "#3F4568",
    "#AB4ADC", "#643A3F", "#6C5594", "#A33E23", "#6A8D4C", "#013728",
)  # fmt: skip
"""Colours of all others in turn: each the farthest from those before it and from `PAPERS`, as the
least distance in OKLab over normal sight and three kinds of colour blindness."""


def method_of(options: Mapping[str, Any]) -> Method:
    """Read a method out of a stored configuration with dotted names.

    Raises
    ------
    KeyError
        If the configuration lacks a choice.
    """
    planner, detector, model, fault = (
        Choice(group, str(options[f"{group}.name"]), str(options.get(f"{group}.function") or ""))
        for group in METHODS
    )
    if is_survey(str(options.get("terrain.name", ""))):
        planner = SURVEY
    scope = str(options["detector.scope"])
    return Method(planner, detector, model, REPLAY in options, fault, scope)


def labels(methods: Iterable[Method], *, with_scope: bool = False) -> dict[Method, str]:
    """Name some methods, different ones differently.

    Parameters
    ----------
    methods
        In any order.
    with_scope
        Whether the label tells a scope other than batch: ``UCT-COPOD historical``.
    """
    distinct = list(dict.fromkeys(methods))
    met = Counter(label for label, _ in {(one.label, one.full_label) for one in distinct})
    return {
        one: harmless(
            (one.label if met[one.label] == 1 else one.full_label)
            + (f" {one.scope}" if with_scope and one.scope != BATCH else "")
        )
        for one in distinct
    }


def looks(names: Iterable[str]) -> dict[str, Look]:
    """Choose how the methods of a set are drawn.

    Parameters
    ----------
    names
        Their labels, in any order.

    Returns
    -------
    dict of Look
        In the order of a legend: the paper's methods, whose looks never change, then the others by
        name. Dashes are all different, and so are the colours as long as there are any.
    """
    present = set(names)
    chosen = {name: look for name, look in PAPERS.items() if name in present}
    styles = _styles()
    for number, name in enumerate(sorted(present - set(PAPERS))):
        chosen[name] = Look(OTHERS[number % len(OTHERS)], next(styles))
    return chosen


def _styles() -> Iterator[Dashes]:
    """Give line styles without end: rows of long and short strokes that repeat."""
    for length in count(3):
        for row in product((False, True), repeat=length):
            # Of all rows that look alike when repeated only one: the least of its rotations.
            if all(row < row[i:] + row[:i] for i in range(1, length)):
                style = tuple(part for long in row for part in (5.0 if long else 1.0, 1.2))
                if style not in _rotations_of_papers():
                    yield style


def _rotations_of_papers() -> set[Dashes]:
    taken = [look.dashes for look in PAPERS.values()]
    return {dashes[i:] + dashes[:i] for dashes in taken for i in range(0, len(dashes), 2)}
