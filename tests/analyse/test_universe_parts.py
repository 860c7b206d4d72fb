"""Multiverses in parts: what is whole of one that is being flown, and two as one."""

import runpy
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from universes import by_choice, made_up

from infoplan.analyse.universe_numbers import in_order, read, write
from infoplan.analyse.universe_parts import joined, whole
from infoplan.errors import UsageError
from infoplan.study.universes import universes

SCRIPT = Path(__file__).parents[2] / "scripts" / "draw_multiverse.py"
FEW = universes()[:3]
LABELS = ["universe", "method", "rho", "scope", "seed"]


def without(multiverse, left_out):
    return replace(multiverse, missions=multiverse.missions[~left_out].reset_index(drop=True))


def test_what_is_being_flown_is_no_part():
    made = made_up(by_choice, there=FEW)
    m = made.missions
    last = m["universe"] == FEW[2].name
    # At rho 0.1 a run lacks two seeds, at 0.15 the last run has not begun.
    seeds = last & (m["rho"] == 0.1) & (m["method"] == "PUCT-COPOD") & (m["seed"] > 3)
    run = last & (m["rho"] == 0.15) & (m["method"] == "PUCT-COPOD")
    found = whole(without(made, seeds | run)).missions
    expected = m[~last | (m["rho"] == 0.05)]
    pd.testing.assert_frame_equal(found, expected.reset_index(drop=True))
    pd.testing.assert_frame_equal(whole(made).missions, m)


def test_a_seed_that_one_run_has_more_costs_the_others_nothing():
    made = made_up(by_choice, there=FEW)
    m = made.missions
    one = m[(m["universe"] == FEW[0].name) & (m["seed"] == 5)].assign(seed=6)
    more = replace(made, missions=in_order(pd.concat([m, one])))
    pd.testing.assert_frame_equal(whole(more).missions, m)


def test_parts_make_the_whole_whatever_their_order():
    made = made_up(by_choice, there=FEW)
    first = without(made, made.missions["universe"] == FEW[1].name)
    second = without(made, made.missions["universe"] != FEW[1].name)
    for one, other in ((first, second), (second, first)):
        pd.testing.assert_frame_equal(joined(one, other).missions, made.missions)


def test_what_is_flown_anew_replaces_what_was_there():
    old, new = (made_up(by_choice, seed=seed, there=FEW) for seed in (0, 1))
    part = without(new, (new.missions["universe"] != FEW[1].name) | (new.missions["rho"] != 0.1))
    found = joined(old, part).missions
    taken = (found["universe"] == FEW[1].name) & (found["rho"] == 0.1)
    assert found.loc[taken, "final"].tolist() == part.missions["final"].tolist()
    assert found[LABELS].equals(old.missions[LABELS])
    rest = old.missions.loc[~taken, "final"]
    assert found.loc[~taken, "final"].tolist() == rest.tolist()


@pytest.mark.parametrize(("name", "other"), [("budget", 1000), ("model", "vecchia"), ("unit", "m")])
def test_parts_of_different_studies_are_not_joined(name, other):
    made = made_up(by_choice, there=FEW)
    with pytest.raises(UsageError, match=f"the same {name}"):
        joined(made, replace(made, **{name: other}))


@pytest.mark.parametrize(
    ("model", "name"), [("vecchia", "multiverse.parquet"), ("gp", "multiverse_exact.parquet")]
)
def test_a_table_comes_into_the_shipped_one_of_its_model(model, name, tmp_path):
    take = runpy.run_path(str(SCRIPT))["take_universes"]
    made = replace(made_up(by_choice, there=FEW), model=model)
    own = made.missions["universe"] == FEW[0].name
    for part in (without(made, own), without(made, ~own)):
        write(part, tmp_path / "part.parquet")
        shipped = take(tmp_path / "part.parquet", tmp_path)
        assert shipped == tmp_path / name
    assert read(shipped).missions[LABELS].equals(made.missions[LABELS])
    assert read(shipped).missions["final"].tolist() == made.missions["final"].tolist()
