"""Made-up missions for which the verdicts are known."""

from pathlib import Path

import made_tables
import numpy as np
import pytest

from infoplan.analyse import METHODS, find_study, judge_claims
from infoplan.analyse.claims import COMPARISONS, TEXTS
from infoplan.analyse.measures import recall_lost, returned
from infoplan.cli import main

SEEDS = 6
AXIS = [100, 150, 500, 1000, 2000]
# The margin is 5 % of the terrain's standard deviation, which is 100.
WIGGLE = np.array([1.0, -1.0, 0.5, -0.5, 0.2, -0.2])


def store(folder: Path, method: str, rho=0.1, scope="batch", *, curve=None, wiggle=1.0, **more):
    """Store a method's seeds: a curve given by its values at `AXIS`, each seed a little off."""
    for seed in range(SEEDS):
        # What all methods share in a seed must not matter: pairs take it away.
        offset = 37.0 * seed + wiggle * WIGGLE[seed] * (method == "UCT-NONE")
        rmse = np.array(curve if curve is not None else [500] * 5) + offset
        made_tables.store(
            folder, method.lower(), rho, scope, seed, collected=AXIS, rmse=rmse, **more
        )


def finals(folder: Path, rho: float, wiggle=1.0, **ends: float):
    """Store the four methods, which end at the errors given."""
    for method in METHODS:
        end = ends[method.lower().replace("-", "_")]
        store(folder, method, rho, curve=[500, 500, 500, 500, end], wiggle=wiggle)


def judged(folder: Path, name: str):
    (claim,) = judge_claims(find_study(folder), [name])
    return claim


def verdicts(folder: Path, name: str) -> list[str]:
    return [comparison.verdict for comparison in judged(folder, name).comparisons]


EQUAL = {"uct_none": 300, "uct_best": 300, "uct_copod": 301, "puct_copod": 299}
ORDERED = {"uct_none": 600, "uct_best": 100, "uct_copod": 400, "puct_copod": 200}


@pytest.mark.parametrize(
    ("ends", "wiggle", "verdict"),
    [
        (EQUAL, 1, "supported"),
        (EQUAL | {"uct_none": 340}, 1, "contradicted"),
        (EQUAL | {"uct_none": 303}, 10, "undecided"),
    ],
)
def test_c1_negligible_is_within_the_margin(tmp_path, ends, wiggle, verdict):
    finals(tmp_path, 0.05, wiggle, **ends)
    claim = judged(tmp_path, "C1")
    assert len(claim.comparisons) == 6
    assert claim.verdict == verdict
    assert claim.comparisons[0].stated.high == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("ends", "wiggle", "verdict"),
    [
        (ORDERED, 1, "supported"),
        (ORDERED | {"uct_best": 300}, 1, "contradicted"),
        (ORDERED | {"uct_none": 105}, 30, "undecided"),
    ],
)
def test_c2_best_ends_lowest(tmp_path, ends, wiggle, verdict):
    finals(tmp_path, 0.1, wiggle, **ends)
    assert judged(tmp_path, "C2").verdict == verdict


@pytest.mark.parametrize(
    ("none", "expected"),
    [
        ([500, 400, 300, 450, 600], ["supported"] * 4),
        ([900, 800, 700, 650, 600], ["contradicted", *["supported"] * 3]),
        ([500, 400, 300, 330, 350], ["supported", "supported", "contradicted", "supported"]),
        ([609, 605, 600, 602, 605], ["undecided", *["supported"] * 3]),
        ([620, 615, 600, 610, 603], ["contradicted", *["supported"] * 3]),
    ],
)
def test_c3_none_falls_then_rises_and_ends_highest(tmp_path, none, expected):
    finals(tmp_path, 0.1, **ORDERED)
    for seed in range(SEEDS):
        # One value of each seed differs, so that its rise has a spread around the margin of 5.
        rmse = np.array(none, dtype=float)
        rmse[-1] += WIGGLE[seed]
        made_tables.store(
            tmp_path, "uct-none", 0.1, seed=seed, collected=AXIS, rmse=rmse + 37 * seed
        )
    assert verdicts(tmp_path, "C3") == expected


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        ((100, 200, 300, 400), ["supported"] * 3),
        ((100, 300, 200, 400), ["supported", "contradicted", "supported"]),
    ],
)
def test_c4_order_of_the_late_errors(tmp_path, levels, expected):
    for method, level in zip(
        ("UCT-BEST", "PUCT-COPOD", "UCT-COPOD", "UCT-NONE"), levels, strict=True
    ):
        # The end alone would say the opposite: late is the mean from 1000 on.
        store(tmp_path, method, curve=[500, 500, 500, 2 * level + 500, 500 - level])
    assert verdicts(tmp_path, "C4") == expected


@pytest.mark.parametrize(("early", "verdict"), [(700, "supported"), (300, "contradicted")])
def test_c5_early_is_150_to_500_samples(tmp_path, early, verdict):
    store(tmp_path, "UCT-NONE", curve=[2000, 500, 500, 2000, 2000])
    store(tmp_path, "UCT-COPOD", curve=[500, early, early, 500, 500])
    claim = judged(tmp_path, "C5")
    assert claim.verdict == verdict
    assert claim.comparisons[0].effect.mean == pytest.approx(early - 500)


@pytest.mark.parametrize(
    ("ends", "expected"),
    [
        ({"uct_none": 400, "uct_copod": 398, "puct_copod": 200}, ["supported"] * 3),
        (
            {"uct_none": 400, "uct_copod": 300, "puct_copod": 350},
            ["contradicted", "contradicted", "supported"],
        ),
    ],
)
def test_c6_copod_loses_its_advantage_unless_it_plans_for_it(tmp_path, ends, expected):
    finals(tmp_path, 0.15, uct_best=100, **ends)
    assert verdicts(tmp_path, "C6") == expected


@pytest.mark.parametrize(
    ("lower", "verdict"), [(-20.0, "supported"), (100.0, "contradicted"), (5.5, "undecided")]
)
def test_c7_ineffective_is_not_below_none_by_the_margin(tmp_path, lower, verdict):
    for seed in range(SEEDS):
        none = 1000.0 + 5 * WIGGLE[seed]
        made_tables.store(tmp_path, "uct-none", seed=seed, rmse=[500, 500, none])
        for method in ("uct-copod", "puct-copod"):
            rmse = [500, 500, 1000.0 - lower]
            made_tables.store(tmp_path, method, scope="historical", seed=seed, rmse=rmse)
    assert judged(tmp_path, "C7").verdict == verdict


@pytest.mark.parametrize(
    ("tp", "fp", "verdict"),
    [
        (8, 2, "supported"),
        (6, 6, "contradicted"),  # more alarms, the same share of them false
        (3, 3, "contradicted"),  # fewer, but still the same share
        (53, 47, "contradicted"),  # 0.03 better is negligible
    ],
)
def test_c8_false_alarms_are_judged_by_precision(tmp_path, tp, fp, verdict):
    store(tmp_path, "UCT-COPOD", counts=[(0, 0, 0, 0)] + [(5, 5, 1, 90)] * 4)
    store(tmp_path, "PUCT-COPOD", counts=[(0, 0, 0, 0)] + [(tp, fp, 1, 90)] * 4)
    claim = judged(tmp_path, "C8")
    assert claim.verdict == verdict
    assert claim.comparisons[0].effect.mean == pytest.approx(tp / (tp + fp) - 0.5)
    assert claim.comparisons[0].stated.low == 0.05


@pytest.mark.parametrize(("alarm_at", "verdict"), [(45.0, "supported"), (5.0, "contradicted")])
def test_c9_relief_at_false_alarms(tmp_path, alarm_at, verdict):
    samples = {
        "epoch": [0, 0, 1, 1, 1, 1],
        "x1": [5.0, 45.0, alarm_at, 5.0, 45.0, 25.0],
        "x2": [20.0] * 6,
        "is_outlier": [False, False, False, False, False, True],
        "flagged": [False, False, True, False, False, True],
    }
    for method in ("UCT-COPOD", "PUCT-COPOD"):
        store(tmp_path, method, samples=samples)
    assert verdicts(tmp_path, "C9") == [verdict] * 2


def test_c9_without_a_false_alarm_has_no_number(tmp_path):
    for method in ("UCT-COPOD", "PUCT-COPOD"):
        store(tmp_path, method)
    assert judged(tmp_path, "C9").verdict == "missing"


@pytest.mark.parametrize(
    ("share", "std", "expected"),
    [
        (0.5, 80.0, ["supported", "supported"]),
        (1.5, 80.0, ["contradicted", "supported"]),
        (0.5, 20.0, ["supported", "contradicted"]),
    ],
)
def test_c10_flat_mean_and_blurred_uncertainty(tmp_path, share, std, expected):
    truth = made_tables.truth()
    store(tmp_path, "UCT-BEST", mean=truth, std=50.0)
    store(tmp_path, "UCT-NONE", mean=1000 + share * (truth - 1000), std=std)
    claim = judged(tmp_path, "C10")
    assert [item.verdict for item in claim.comparisons] == expected
    assert claim.comparisons[0].effect.mean == pytest.approx(100 * (share - 1))
    assert claim.comparisons[1].effect.mean == pytest.approx(std - 50)


def reexamined(lost: bool) -> dict:
    """A spike that is found at once and drowned by later heights, or the other way round."""
    rng = np.random.default_rng(0)
    first, second = rng.normal(0.0, 1.0, 40), rng.normal(0.0, 1.0, 40)
    first[35] = 50.0 if lost else 0.0
    if lost:
        second[:20] += 100.0
    outlier = np.arange(80) == 35
    return {
        "epoch": [0] * 20 + [1] * 20 + [2] * 40,
        "measured": np.concatenate([first, second]),
        "is_outlier": outlier,
        "flagged": outlier & (not lost),
    }


@pytest.mark.parametrize(("lost", "verdict"), [(True, "supported"), (False, "contradicted")])
def test_c11_recall_at_once_and_at_the_end(tmp_path, lost, verdict):
    for method in ("UCT-COPOD", "PUCT-COPOD"):
        store(tmp_path, method, scope="historical", samples=reexamined(lost))
    claim = judged(tmp_path, "C11")
    assert claim.verdict == verdict
    study = find_study(tmp_path)
    numbers = recall_lost(study.only([study.run("UCT-COPOD", 0.1, "historical")]))
    assert numbers.to_list() == [1.0 if lost else -1.0] * SEEDS


def path_with_a_flag(x_after: list[float]) -> dict:
    return {
        "epoch": [0, 1, 1, 1, 2, 2, 2, 2],
        "x1": [0.0, 10.0, 11.0, 30.0, *x_after],
        "x2": [10.0] * 8,
        "flagged": [False, True, False, False, False, False, False, False],
    }


@pytest.mark.parametrize(("there", "verdict"), [("puct", "supported"), ("uct", "contradicted")])
def test_c12_going_back_to_flagged_places(tmp_path, there, verdict):
    back, away = path_with_a_flag([12.0, 8.1, 12.1, 40.0]), path_with_a_flag([40.0] * 4)
    store(tmp_path, "PUCT-COPOD", samples=back if there == "puct" else away)
    store(tmp_path, "UCT-COPOD", samples=back if there == "uct" else away)
    claim = judged(tmp_path, "C12")
    assert claim.verdict == verdict
    study = find_study(tmp_path)
    of_back = study.only([study.run(f"{there.upper()}-COPOD", 0.1)])
    # 12.0 and 8.1 of seven planned samples; 11.0 is near too, but of the same epoch.
    assert returned(of_back).to_list() == pytest.approx([2 / 7] * SEEDS)


def test_missing_runs_are_named_with_their_command(tmp_path):
    store(tmp_path, "UCT-COPOD")
    claim = judged(tmp_path, "C5")
    assert claim.verdict == "missing"
    assert claim.commands == (
        "infoplan run planner=uct detector=none rho=0.1 'grid=[26,26]' seeds=6 "
        f"results_dir={tmp_path}",
    )
    many = judged(tmp_path, "C2")
    assert many.commands[0].startswith("infoplan run -m experiment=fig5 ")


def test_a_window_beyond_the_budget_is_missing(tmp_path):
    for method in METHODS:
        made_tables.store(tmp_path, method.lower(), collected=[100, 400], rmse=[500, 400])
    claim = judged(tmp_path, "C4")
    assert claim.verdict == "missing"
    assert not claim.commands
    assert judged(tmp_path, "C5").comparisons[0].effect.n == 1


def test_a_single_seed_leaves_all_undecided(tmp_path):
    for method, end in zip(METHODS, (600, 100, 400, 200), strict=True):
        made_tables.store(tmp_path, method.lower(), rmse=[500, 500, end])
    claim = judged(tmp_path, "C2")
    assert claim.verdict == "undecided"
    assert claim.comparisons[0].effect.mean == pytest.approx(-500.0)


def test_pairs_use_the_seeds_that_both_have(tmp_path):
    for seed in (0, 1, 2):
        made_tables.store(tmp_path, "uct-none", seed=seed, rmse=[500, 500, 700 + seed])
    for seed in (1, 2, 9):
        made_tables.store(tmp_path, "uct-best", seed=seed, rmse=[500, 500, 100])
    (best_none, *_) = judged(tmp_path, "C2").comparisons
    assert best_none.effect.n == 2
    assert best_none.effect.mean == pytest.approx(-601.5)


def test_an_effect_below_the_margin_is_none(tmp_path):
    ends = {"uct_none": 304, "uct_best": 300, "uct_copod": 304, "puct_copod": 304}
    finals(tmp_path, 0.1, wiggle=0.1, **ends)
    lowest = judged(tmp_path, "C2")
    assert [item.stated.high for item in lowest.comparisons] == pytest.approx([-5.0] * 3)
    assert [item.effect.mean for item in lowest.comparisons] == pytest.approx([-4.0] * 3, abs=0.1)
    assert lowest.verdict == "contradicted"


def test_all_claims_are_judged_together(tmp_path):
    for rho in (0.05, 0.1, 0.15):
        finals(tmp_path, rho, **ORDERED)
    alone, together = judged(tmp_path, "C2"), judge_claims(find_study(tmp_path))
    assert [claim.name for claim in together] == list(TEXTS) == list(COMPARISONS)
    assert alone.p_holm == alone.p
    assert together[1].p == alone.p
    assert together[1].p_holm >= alone.p


def test_the_share_of_collapsed_missions_stands_beside_what_is_compared(tmp_path, monkeypatch):
    finals(tmp_path, 0.1, **ORDERED)

    def collapsed(folder, run, seed, last):
        return run.startswith("uct-none") and seed < 2

    monkeypatch.setattr("infoplan.analyse.curves.ended_collapsed", collapsed)
    claim = judged(tmp_path, "C2")
    assert claim.collapsed["UCT-NONE"] == (2, SEEDS)
    assert claim.collapsed["UCT-BEST"] == (0, SEEDS)


def test_every_seed_is_written_as_csv(tmp_path, capsys):
    finals(tmp_path, 0.1, **ORDERED)
    assert main(["claims", "--csv", f"results_dir={tmp_path}"]) == 0
    rows = [line.split(",") for line in capsys.readouterr().out.splitlines()]
    assert rows[0] == ["claim", "compared", "unit", "seed", "effect"]
    of_c2 = [row for row in rows if row[0] == "C2" and row[1].startswith("UCT-BEST - UCT-COPOD")]
    assert [row[3] for row in of_c2] == [str(seed) for seed in range(SEEDS)]
    assert [float(row[4]) for row in of_c2] == pytest.approx([-300.0] * SEEDS)
    assert main(["claims", "--csv", "--json", f"results_dir={tmp_path}"]) == 2
    assert "--json, --markdown, --csv or --latex: choose one" in capsys.readouterr().err
