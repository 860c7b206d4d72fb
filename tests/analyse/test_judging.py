"""The rules of judgement."""

import math

import numpy as np
import pytest
from scipy import stats

from infoplan.analyse import Comparison, Stated
from infoplan.analyse.judging import Claim, corrected, overall, with_holm

BELOW, ABOVE, WITHIN = Stated(high=0.0), Stated(low=0.0), Stated(-60.0, 60.0)


def seeds(low: float, high: float, n: int = 10) -> dict[int, float]:
    """Numbers of so many seeds whose 95 % t interval has these ends."""
    shape = np.linspace(-1.0, 1.0, n)
    half = stats.t.ppf(0.975, n - 1) * shape.std(ddof=1) / math.sqrt(n)
    return dict(enumerate((low + high) / 2 + shape * (high - low) / 2 / half))


def compared(low, high, stated, n=10, lacks="", among=1):
    values = {} if lacks else seeds(low, high, n)
    return Comparison("a - b", "ft", stated, values, among, lacks)


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
        (65, 90, WITHIN, "contradicted"),
        (-90, -65, WITHIN, "contradicted"),
        (-50, 400, Stated(low=-60.0), "supported"),
        (-90, 400, Stated(low=-60.0), "undecided"),
        (-90, -61, Stated(low=-60.0), "contradicted"),
        (61, 400, Stated(low=60.0), "supported"),
        (10, 59, Stated(low=60.0), "contradicted"),
    ],
)
def test_a_comparison_is_judged_by_its_interval(low, high, stated, verdict):
    made = compared(low, high, stated)
    assert (made.effect.low, made.effect.high) == pytest.approx((low, high))
    assert made.verdict == verdict


def test_of_several_comparisons_one_is_contradicted_by_a_wider_interval():
    # The interval of 1 - 0.05 / 6 is 1.48 times as wide with ten seeds.
    wider = stats.t.ppf(1 - 0.025 / 6, 9) / stats.t.ppf(0.975, 9)
    clear, near = (20 * wider + share for share in (0.1, -0.1))
    for middle, verdict in ((clear, "contradicted"), (near, "undecided")):
        assert compared(middle - 20, middle + 20, BELOW, among=6).verdict == verdict
        assert compared(middle - 20, middle + 20, BELOW).verdict == "contradicted"
        # Supported needs them all, and is not corrected.
        assert compared(-middle - 20, -middle + 20, BELOW, among=6).verdict == "supported"
    claim = Claim("C0", "so it is", corrected([compared(1, 30, BELOW), compared(-30, -1, BELOW)]))
    assert [one.among for one in claim.comparisons] == [2, 2]
    assert claim.verdict == "undecided"


def test_fewer_than_six_seeds_decide_nothing():
    for n, verdict in ((5, "undecided"), (6, "supported")):
        assert compared(-1000.0, -999.0, BELOW, n).verdict == verdict
        assert compared(-1.0, 1.0, WITHIN, n).verdict == verdict
    assert compared(999.0, 1000.0, BELOW, 5).verdict == "undecided"
    single = Comparison("a", "", BELOW, {0: -1000.0})
    assert (single.verdict, single.p_supported, single.p_contradicted) == ("undecided", 1.0, 1.0)


def test_an_infinite_effect_decides_nothing():
    made = Comparison("a", "", BELOW, dict.fromkeys(range(8), -math.inf))
    assert made.verdict == "undecided"


def test_the_exact_p_is_for_the_side_on_which_the_mean_lies():
    values = {seed: -70.0 - seed for seed in range(6)}
    assert Comparison("a", "", BELOW, values).p_exact == 1 / 64
    assert Comparison("a", "", ABOVE, values).p_exact == 1 / 64
    assert Comparison("a", "", Stated(low=-100.0), values).p_exact == 1 / 64
    assert Comparison("a", "", WITHIN, values).p_exact == 2 / 64  # either side could be passed
    assert Comparison("a", "", Stated(-74.0, 60.0), values).p_exact > 1 / 64


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


def test_a_claim_adds_up():
    claim = Claim("C0", "so it is", (compared(-60, -20, BELOW), compared(-60, 20, BELOW)))
    assert claim.verdict == "undecided"
    settled = Claim("C0", "so it is", (compared(-60, -20, BELOW),))
    assert settled.verdict == "supported"
    gone = Claim("C0", "so it is", (compared(-60, -20, BELOW, lacks="a run is missing"),))
    assert (gone.verdict, gone.p, gone.seeds) == ("missing", 1.0, 0)


def test_the_p_of_a_claim_is_that_of_its_weakest_comparison_or_of_what_contradicts_it():
    weak, strong = compared(-60, -1, BELOW), compared(-60, -40, BELOW)
    claim = Claim("C0", "so it is", corrected([weak, strong]))
    theirs = stats.ttest_1samp(list(weak.values.values()), 0.0).pvalue
    assert claim.p == pytest.approx(theirs)
    against = Claim("C0", "so it is", corrected([compared(5, 30, BELOW), strong]))
    theirs = stats.ttest_1samp(list(seeds(5, 30).values()), 0.0).pvalue
    assert (against.verdict, against.p) == ("contradicted", pytest.approx(2 * theirs))


def test_some_verdicts_do_not_survive_the_number_of_claims():
    strong, weak = (Claim("C", "", (compared(-60, high, BELOW),)) for high in (-40, -1))
    assert weak.verdict == "supported"
    assert weak.p > 0.05 / 4
    judged = with_holm([strong, weak, *[Claim("C", "", (compared(-9, 9, BELOW),))] * 4])
    assert [claim.survives for claim in judged] == [True, False, False, False, False, False]
    assert judged[0].p_holm == pytest.approx(6 * strong.p)
    assert with_holm([weak])[0].survives
