"""The rules of judgement."""

import math

import pytest

from infoplan.analyse import Comparison, Interval, Stated
from infoplan.analyse.judging import Claim, judge, more_seeds, overall, seeds_needed

BELOW, ABOVE, WITHIN = Stated(high=0.0), Stated(low=0.0), Stated(-60.0, 60.0)


def effect(low, high, n=10, mean=None):
    return Interval((low + high) / 2 if mean is None else mean, low, high, n)


def compared(low, high, stated, n=10, lacks=""):
    return Comparison("a - b", "ft", stated, effect(low, high, n), lacks=lacks)


@pytest.mark.parametrize(
    ("low", "high", "stated", "verdict"),
    [
        (-30, -1, BELOW, "supported"),
        (-30, 1, BELOW, "undecided"),
        (1, 30, BELOW, "contradicted"),
        (1, 30, ABOVE, "supported"),
        (-30, -1, ABOVE, "contradicted"),
        (0, 0, ABOVE, "undecided"),
        (-59, 59, WITHIN, "supported"),
        (0, 0, WITHIN, "supported"),
        (-59, 61, WITHIN, "undecided"),
        (-61, -59, WITHIN, "undecided"),
        (61, 90, WITHIN, "contradicted"),
        (-90, -61, WITHIN, "contradicted"),
        (-50, 400, Stated(low=-60.0), "supported"),
        (-90, 400, Stated(low=-60.0), "undecided"),
        (-90, -61, Stated(low=-60.0), "contradicted"),
        (61, 400, Stated(low=60.0), "supported"),
        (10, 59, Stated(low=60.0), "contradicted"),
    ],
)
def test_a_comparison_is_judged_by_its_interval(low, high, stated, verdict):
    assert judge(effect(low, high), stated) == verdict


def test_a_single_seed_decides_nothing():
    single = Interval(-1000.0, math.nan, math.nan, 1)
    assert judge(single, BELOW) == "undecided"
    assert math.isnan(seeds_needed(single, BELOW))
    assert math.isnan(more_seeds([Comparison("a", "", BELOW, single)]))


@pytest.mark.parametrize(
    ("verdicts", "verdict"),
    [
        (["supported", "supported"], "supported"),
        (["supported", "undecided"], "undecided"),
        (["supported", "undecided", "contradicted"], "contradicted"),
        (["supported", "missing"], "missing"),
        (["contradicted", "missing"], "contradicted"),
    ],
)
def test_a_claim_is_judged_by_all_its_comparisons(verdicts, verdict):
    assert overall(verdicts) == verdict


def test_seeds_needed_follow_the_root():
    # Half width 40 with 10 seeds; the bound is 20 away, half of it: four times the seeds.
    assert seeds_needed(effect(-60, 20), BELOW) == 40
    assert seeds_needed(effect(-20, 60), BELOW) == 40  # heads for contradicted
    assert seeds_needed(effect(-30, 90), WITHIN) == 10 * (60 / 30) ** 2
    assert seeds_needed(effect(0, 80), Stated(low=60.0)) == 40


def test_no_seeds_help_an_effect_at_its_bound():
    assert math.isinf(seeds_needed(effect(-10, 10), BELOW))
    assert math.isinf(seeds_needed(effect(-10, 10.1), BELOW))
    assert math.isinf(seeds_needed(effect(0, 0), BELOW))


def test_more_seeds_of_a_claim():
    near, far = compared(-60, 20, BELOW), compared(-50, 30, BELOW)
    decided, against = compared(-60, -20, BELOW), compared(-20, 60, BELOW)
    assert more_seeds([near, decided]) == 30
    assert more_seeds([near, far, decided]) == 150  # both must be settled: the slower counts
    assert more_seeds([far, against]) == 30  # one is enough to contradict
    assert math.isinf(more_seeds([near, compared(-10, 10, BELOW)]))


def test_a_claim_adds_up():
    claim = Claim("C0", "so it is", (compared(-60, -20, BELOW), compared(-60, 20, BELOW)))
    assert (claim.verdict, claim.more_seeds) == ("undecided", 30)
    settled = Claim("C0", "so it is", (compared(-60, -20, BELOW),))
    assert (settled.verdict, settled.more_seeds) == ("supported", None)
    gone = Claim("C0", "so it is", (compared(-60, -20, BELOW, lacks="a run is missing"),))
    assert gone.verdict == "missing"
