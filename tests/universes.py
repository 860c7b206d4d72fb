"""Made-up multiverses, whose truth is known."""

from itertools import product

import numpy as np
import pandas as pd

from infoplan.analyse.judging import USUAL
from infoplan.analyse.universe_numbers import NUMBERS, OTHERS, Multiverse
from infoplan.study.universes import METHODS, universes

MARGIN = 60.0
AXIS = tuple(range(100, 2001, 50))
SEEDS = range(6)
ALL = universes()


def made_up(final, seed=0, noise=5.0, there=ALL):
    """Missions whose final RMSE is a function of universe, method and rho, and noise."""
    rng = np.random.default_rng(seed)
    rows = []
    for universe, method, rho in product(there, METHODS, (0.05, 0.1, 0.15)):
        scopes = ("batch", "historical") if method.endswith("COPOD") and rho == 0.1 else ("batch",)
        for scope, number in product(scopes, SEEDS):
            end = final(universe, method, rho) + noise * rng.standard_normal()
            rows.append(
                {"universe": universe.name, "method": method, "rho": rho, "scope": scope,
                 "seed": number, **dict.fromkeys((*NUMBERS, *OTHERS), end), "collapsed": False,
                 "rmse": np.full(len(AXIS), end)}
            )  # fmt: skip
    return Multiverse(pd.DataFrame(rows), AXIS, "helens", "ft", 2000, "gp",
                      MARGIN / USUAL.margin)  # fmt: skip


def by_choice(universe, method, rho):
    """NONE ends high, but with a noise floor; the pilot adds to that, and both together more."""
    floor, spiky = universe.levels["noise"] == "floor 1", universe.levels["pilot"] == "spiky"
    if method == "UCT-NONE":
        return 1000.0 - 500.0 * floor - 200.0 * spiky + 130.0 * (floor and spiky)
    return {"UCT-BEST": 100.0, "UCT-COPOD": 600.0, "PUCT-COPOD": 400.0}[method]
