"""The multiverse on made-up numbers, whose truth is known, and on small missions."""

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as t_distribution
from scipy.stats import ttest_rel
from statsmodels.api import OLS
from statsmodels.stats.multitest import multipletests
from universes import ALL, AXIS, MARGIN, SEEDS, by_choice, made_up

from infoplan.analyse.multiverse import (
    CLIP,
    claim_curves,
    compare_models,
    effects_alone,
    effects_jointly,
    effects_of_rules,
    errors_by_universe,
    errors_jointly,
    joint_test,
    nearest_tenth,
    nearness,
    orders_by_collapse,
    pairs_of_choices,
)
from infoplan.study.universes import (
    CHOICES,
    DEFAULT,
    JOINT,
    METHODS,
    joint_universes,
    universes,
)


@pytest.fixture(scope="module")
def multiverse():
    return made_up(by_choice)


def test_every_level_of_a_choice_is_equally_frequent_among_joint_universes():
    made = joint_universes()
    assert len(made) == JOINT
    assert len({tuple(one.levels.values()) for one in made}) == JOINT
    for choice in CHOICES:
        counts = pd.Series([one.levels[choice.name] for one in made]).value_counts()
        assert set(counts.index) == set(choice.levels)
        assert counts.min() == counts.max() == JOINT / len(choice.levels)


def test_single_choices_are_those_of_one_level_each():
    alone = [one for one in universes() if not one.name.startswith("joint")]
    assert alone[0].name == DEFAULT
    assert len(alone) == 1 + sum(len(choice.levels) - 1 for choice in CHOICES)
    assert len({one.name for one in universes()}) == len(universes()) >= 100
    for one in alone[1:]:
        changed = [c.name for c in CHOICES if one.levels[c.name] != c.default]
        assert [f"{name}: {one.levels[name]}" for name in changed] == [one.name]


def test_a_claim_is_judged_in_every_universe(multiverse):
    (curve,) = claim_curves(multiverse, ["C2"])
    # BEST lies 300 ft below the next one everywhere, PUCT-COPOD or, with all of it, NONE.
    assert set(curve.verdicts) == {"supported"}
    assert curve.what == "UCT-BEST - PUCT-COPOD: final RMSE"
    assert curve.means == pytest.approx(-300.0, abs=10.0)
    (third,) = claim_curves(multiverse, ["C7"])
    ends = np.array([by_choice(one, "UCT-NONE", 0.1) for one in multiverse.universes])
    holds = ends - 400.0 < MARGIN
    expected = np.where(holds, "supported", "contradicted")
    assert list(third.verdicts) == expected.tolist()


def test_a_level_alone_is_compared_with_the_defaults_by_seed(multiverse):
    (curve,) = claim_curves(multiverse, ["C7"])
    table = effects_alone(curve, multiverse).set_index(["choice", "level"])
    assert len(table) == sum(len(choice.levels) - 1 for choice in CHOICES)
    assert table.loc[("noise", "floor 1"), "mean"] == pytest.approx(500.0, abs=15.0)
    inside = (table["low"] < 0) & (table["high"] > 0)
    assert inside.drop([("noise", "floor 1"), ("pilot", "spiky")]).mean() > 0.8
    base, other = (
        curve.effects[curve.universes.index(name)] for name in (DEFAULT, "noise: floor 1")
    )
    assert table.loc[("noise", "floor 1"), "mean"] == pytest.approx(np.mean(other - base))


def joint_design(methods):
    """Levels that can matter to one of some methods, and in which joint universes they do."""
    names = [(c.name, level) for c in CHOICES if set(methods) & set(c.methods)
             for level in list(c.levels)[1:]]  # fmt: skip
    only_none, only_best = (methods == [name] for name in ("UCT-NONE", "UCT-BEST"))
    if only_none:
        names.remove(("pilot", "spiky, judged"))

    def has(one, name, level):
        learning, pilot = one.levels["learning"], one.levels["pilot"]
        if name == "learning rate" and learning in ("lbfgs 5", "lbfgs 20"):
            return False
        if learning == "frozen" and level in ("restarted", "reset"):
            return False
        if only_none and name == "pilot":
            return pilot != "clean"
        if only_best and name == "spike draw" and pilot == "clean":
            return False
        return one.levels[name] == level

    rows = [[1.0] + [float(has(one, *name)) for name in names] for one in joint_universes()]
    return names, np.array(rows)


def fits_of_statsmodels(effects, design):
    """Fit the means, and each seed.

    Gives the fit, and a function of a combination of coefficients: its 95 % interval, and p.
    """
    n, seeds = len(design), effects.shape[1]
    fitted = OLS(effects.mean(axis=1), design).fit()
    robust = fitted.get_robustcov_results("HC2").cov_params()
    by_seed = [OLS(one, design).fit() for one in effects.T]
    influence, inverse = fitted.get_influence(), np.linalg.inv(design.T @ design)
    left = np.eye(n) - design @ inverse @ design.T
    scaled = np.stack([one.resid for one in by_seed]) / np.sqrt(1 - influence.hat_matrix_diag)

    def judge(combination):
        weight = design @ inverse @ combination
        # Bell and McCaffrey: squares of a normal vector's projections on these columns.
        columns = left * (weight / np.sqrt(np.diag(left)))
        roots = np.linalg.eigvalsh(columns.T @ columns)
        free = roots.sum() ** 2 / np.sum(roots**2)
        units = combination @ robust @ combination
        common = np.var([combination @ one.params for one in by_seed], ddof=1) / seeds
        # What seeds differ by in each universe for itself, beyond what the levels explain.
        own = weight**2 @ np.var(scaled, axis=0, ddof=1) / seeds
        bottom = units**2 / free
        if common > own:
            bottom += common**2 / (seeds - 1) + own**2 / (seeds - 1) / free
        variance = units + max(common - own, 0)
        spread = t_distribution(variance**2 / bottom, combination @ fitted.params, variance**0.5)
        return spread.interval(0.95), 2 * min(spread.cdf(0), spread.sf(0))

    return fitted, judge


def test_joint_effects_are_those_of_statsmodels():
    rng = np.random.default_rng(1)
    multiverse = made_up(lambda *names: by_choice(*names) + 60.0 * rng.standard_normal())
    # One seed is moved by a level in all universes alike.
    restarted = {one.name for one in ALL if one.levels["noise"] == "restarted"}
    missions = multiverse.missions
    moved = (missions["seed"] == 3) & (missions["method"] == "UCT-NONE")
    missions.loc[moved & missions["universe"].isin(restarted), "final"] += 300.0
    (curve,) = claim_curves(multiverse, ["C7"])
    table = effects_jointly(curve, multiverse)
    names, design = joint_design(METHODS)
    fitted, judge = fits_of_statsmodels(curve.effects[-JOINT:], design)
    units = np.eye(design.shape[1])
    assert list(zip(table["choice"], table["level"], strict=True)) == names
    np.testing.assert_allclose(table["mean"], fitted.params[1:], atol=1e-9)
    np.testing.assert_allclose(
        table[["low", "high"]], [judge(unit)[0] for unit in units[1:]], atol=1e-9
    )
    ps, gained = [], []
    for choice in CHOICES:
        mine = [i + 1 for i, n in enumerate(names) if n[0] == choice.name]
        any_two = [units[i] - (units[j] if j else 0) for i in mine for j in [0, *mine] if j < i]
        ps.append(min(len(any_two) * min(judge(one)[1] for one in any_two), 1.0))
        without = OLS(curve.means[-JOINT:], np.delete(design, mine, axis=1)).fit()
        gained.append((without.ssr - fitted.ssr) / fitted.centered_tss)
    adjusted = multipletests(ps, method="holm")[1]
    once = table.drop_duplicates("choice")
    np.testing.assert_allclose(once["p"], adjusted, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(once["share"], gained, atol=1e-9)
    assert set(once.loc[once["p"] < 0.01, "choice"]) == {"noise", "pilot"}
    wide = (table["high"] - table["low"]).to_numpy() / (2 * 2.02 * fitted.bse[1:])
    assert names[int(wide.argmax())] == ("noise", "restarted")
    assert wide.max() > 2


def test_of_one_seed_alone_joint_effects_have_no_intervals():
    made = made_up(by_choice)
    made = replace(made, missions=made.missions[made.missions["seed"] == 0])
    (curve,) = claim_curves(made, ["C7"])
    table = effects_jointly(curve, made)
    assert np.isfinite(table["mean"]).all()
    assert table[["low", "high", "p"]].isna().all(axis=None)
    assert pairs_of_choices(curve, made)[["low", "high", "p"]].isna().all(axis=None)


def test_errors_of_universes_are_means_over_seeds_at_one_rho():
    few = universes()[:3]
    made = made_up(lambda u, m, r: by_choice(u, m, r) + 1000.0 * (r != 0.1), there=few, noise=0.0)
    missions = made.missions
    missions.loc[missions["scope"] == "historical", "final"] = np.nan
    missions.loc[missions["method"] == "UCT-BEST", "collapsed"] = True
    none = (missions["method"] == "UCT-NONE") & (missions["universe"] == few[1].name)
    missions.loc[none & (missions["seed"] < 3), "collapsed"] = True
    ends = errors_by_universe(made)
    assert list(ends.index) == [one.name for one in few]
    for one in few:
        for method in METHODS:
            assert ends.loc[one.name, method] == pytest.approx(by_choice(one, method, 0.1))
    assert ends["collapsed"].tolist() == [0.0, 3 / 18, 0.0]


def test_methods_rank_otherwise_where_models_collapse():
    few = [*universes()[:6], *joint_universes()[:6]]
    made = made_up(by_choice, there=few)
    missions = made.missions
    none = (missions["method"] == "UCT-NONE") & (missions["rho"] == 0.1)
    # Where NONE ends at 1000 its model collapses; elsewhere that of two seeds does.
    high = missions["final"] > 900
    missions.loc[none & (high | (missions["seed"] < 2)), "collapsed"] = True
    found = orders_by_collapse(made)
    ends = [(one, by_choice(one, "UCT-NONE", 0.1)) for one in few]
    kinds = {
        "collapsed": [end for _, end in ends if end > 900],
        "sound, one choice": [end for one, end in ends if end < 900 and not one.is_joint],
        "sound, joint": [end for one, end in ends if end < 900 and one.is_joint],
    }
    assert found.index.tolist() == list(kinds)
    for kind, values in kinds.items():
        row, own = found.loc[kind], np.array(values)
        assert row["universes"] == len(own) > 0
        assert row["UCT-NONE"] == pytest.approx(np.median(own), abs=10.0)
        assert row["UCT-COPOD < UCT-NONE"] == (own - 600.0 > MARGIN).sum()
        assert row["UCT-COPOD > UCT-NONE"] == (600.0 - own > MARGIN).sum()
        assert row["PUCT-COPOD < UCT-COPOD"] == len(own)
        assert row["PUCT-COPOD > UCT-COPOD"] == 0
    only = orders_by_collapse(made_up(by_choice, there=few[:1]))
    assert only.dropna().index.tolist() == ["sound, one choice"]


def test_two_models_are_compared_by_seed():
    few = universes()[:4]
    exact = made_up(by_choice, there=few[1:3], seed=1, noise=30.0)
    other = made_up(lambda u, m, r: by_choice(u, m, r) + 50.0, there=few, seed=2, noise=30.0)
    other = replace(other, missions=other.missions[other.missions["seed"] != 2])
    found = compare_models(other, exact)
    assert list(found["universe"].unique()) == [one.name for one in few[1:3]]
    assert list(found["method"]) == [*METHODS, *METHODS]
    for row in found.to_dict("records"):
        wanted = (f"universe == '{row['universe']}' and method == '{row['method']}' and "
                  "rho == 0.1 and scope == 'batch' and seed != 2")  # fmt: skip
        first, second = (made.missions.query(wanted)["final"].to_numpy() for made in (other, exact))
        expected = ttest_rel(first, second).confidence_interval(0.95)
        assert (row["low"], row["high"]) == pytest.approx(tuple(expected))
        assert row["mean"] == pytest.approx(np.mean(first - second))
        assert row["end"] == pytest.approx(np.mean(second))


def test_what_a_level_adds_to_errors_is_least_squares(multiverse):
    found, missions = errors_jointly(multiverse), multiverse.missions
    batch = missions[(missions["rho"] == 0.1) & (missions["scope"] == "batch")]
    for method in METHODS:
        names, design = joint_design([method])
        ends = batch[batch["method"] == method].pivot(
            index="universe", columns="seed", values="final"
        )
        effects = ends.loc[[one.name for one in joint_universes()]].to_numpy()
        fitted, judge = fits_of_statsmodels(effects, design)
        intervals = [judge(unit)[0] for unit in np.eye(design.shape[1])[1:]]
        rows = found[found["method"] == method]
        assert list(zip(rows["choice"], rows["level"], strict=True)) == names
        np.testing.assert_allclose(rows["mean"], fitted.params[1:], atol=1e-6)
        np.testing.assert_allclose(rows[["low", "high"]], intervals, atol=1e-6)
    few = made_up(by_choice, there=universes()[:5])
    assert errors_jointly(few).empty


def test_the_pair_that_works_together_is_found(multiverse):
    (curve,) = claim_curves(multiverse, ["C7"])
    pairs = pairs_of_choices(curve, multiverse)
    first = pairs.iloc[0]
    assert {first["first"], first["second"]} == {"noise", "pilot"}
    assert first["levels"] in ("floor 1 x spiky", "spiky x floor 1")
    assert first["low"] < -130.0 < first["high"]
    assert first["p"] < 0.01
    assert (pairs["p"].iloc[1:] > 0.01).mean() > 0.8


def test_a_claim_is_judged_by_other_margins_in_all_universes():
    few = universes()[:6]
    made = made_up(by_choice, there=few)
    (curve,) = claim_curves(made, ["C7"])
    table = effects_of_rules(curve, made)
    assert set(table["choice"]) == {"margin"}, "it compares no early samples"
    rows = table.set_index("level")
    # PUCT-COPOD ends 600, 400, 400, 100 ... below NONE, 100 with a floor: 10 % are 120 ft.
    gaps = np.array([by_choice(one, "UCT-NONE", 0.1) - 400.0 for one in few])
    for level, share in (("2.5 %", 0.025), ("5 %", 0.05), ("10 %", 0.1)):
        supported = int(np.sum(gaps < share * MARGIN / 0.05))
        assert rows.loc[level, "supported"] == supported
        assert rows.loc[level, "contradicted"] == len(few) - supported
    assert rows.loc["10 %", "supported"] == 1
    assert (rows["verdict"] == "contradicted").all()
    assert (rows["mean"] == 0).all(), "the effect is the same, only what is negligible differs"


def test_the_early_samples_decide_the_claim_about_them():
    made = made_up(by_choice, there=universes()[:4])
    own = made.missions["method"] == "UCT-COPOD"
    made.missions.loc[own, "early_100_300"] += 1000.0
    (curve,) = claim_curves(made, ["C5"])
    table = effects_of_rules(curve, made)
    rows = table[table["choice"] == "early samples"].set_index("level")
    assert list(rows.index) == ["150-500", "100-300", "100-1000"]
    assert rows["mean"].tolist() == pytest.approx([0.0, 1000.0, 0.0], abs=1e-9)
    assert rows["verdict"].tolist() == ["contradicted", "supported", "contradicted"]
    assert rows.loc["100-300", "supported"] == 4


def test_the_joint_test_flips_the_seeds_of_all_universes_together():
    few = universes()[:5]
    made = made_up(lambda u, m, r: 100.0 * (m == "UCT-NONE"), noise=80.0, there=few)
    (curve,) = claim_curves(made, ["C5"])
    found = joint_test(curve)
    medians, ts = [], []
    for signs in product((1, -1), repeat=len(SEEDS)):
        values = curve.effects * np.array(signs)
        medians.append(np.median(values.mean(axis=1)))
        errors = values.std(axis=1, ddof=1) / np.sqrt(len(SEEDS))
        ts.append(np.mean(values.mean(axis=1) / errors))
    assert found.flips == 64
    assert found.median == pytest.approx(np.median(curve.means))
    assert found.one_side == max(np.mean(curve.means > 0), np.mean(curve.means < 0))
    assert found.p_median == np.mean(np.abs(medians) >= abs(found.median) - 1e-9)
    assert found.p_mean_t == np.mean(np.abs(ts) >= abs(found.mean_t) - 1e-9)


def test_the_joint_test_is_of_whole_universes():
    """One that is being flown costs the others no seed; of seeds that all lack nothing is said."""
    made = made_up(by_choice, there=universes()[:5])
    (curve,) = claim_curves(made, ["C2"])
    for seeds, expected in (((3, 4), curve.effects[:4]), ((), curve.effects[:, 1:])):
        effects = curve.effects.copy()
        effects[4, list(seeds)] = np.nan
        if not seeds:
            effects[:, 0] = np.nan
        found = joint_test(replace(curve, effects=effects))
        assert found == joint_test(replace(curve, effects=expected))
        assert found.flips == 2 ** expected.shape[1]


def test_the_joint_test_is_of_the_seeds_that_most_have():
    (curve,) = claim_curves(made_up(by_choice, there=universes()[:5]), ["C2"])
    more = np.column_stack([curve.effects, np.full(5, np.nan)])
    more[0, -1] = 1e6
    assert joint_test(replace(curve, effects=more)) == joint_test(curve)


def test_ends_are_of_the_seeds_that_all_methods_have():
    few = universes()[:3]
    made = made_up(by_choice, there=few, noise=30.0)
    m = made.missions
    lacks = (m["universe"] == few[1].name) & (m["method"] == "UCT-BEST") & (m["seed"] == 2)
    never = (m["universe"] == few[2].name) & (m["method"] == "UCT-COPOD")
    part = replace(made, missions=m[~lacks & ~never])
    ends = errors_by_universe(part)
    wanted = m[(m["rho"] == 0.1) & (m["scope"] == "batch") & (m["method"] == "UCT-NONE")]
    for one, seeds in zip(few, [range(6), (0, 1, 3, 4, 5), range(6)], strict=True):
        mine = wanted[(wanted["universe"] == one.name) & wanted["seed"].isin(seeds)]
        assert ends.loc[one.name, "UCT-NONE"] == pytest.approx(mine["final"].mean())
    assert np.isnan(ends.loc[few[2].name, "UCT-COPOD"])


def test_a_mission_without_an_end_takes_its_universe_out_of_what_is_fitted():
    made = made_up(by_choice)
    m = made.missions
    name = joint_universes()[3].name
    one = (m["universe"] == name) & (m["method"] == "UCT-NONE") & (m["rho"] == 0.1)
    infinite = m.assign(final=m["final"].where(~(one & (m["seed"] == 2)), np.inf))
    without = m[m["universe"] != name]
    (ours, theirs) = (replace(made, missions=some) for some in (infinite, without))
    pd.testing.assert_frame_equal(errors_jointly(ours), errors_jointly(theirs))
    curves = [claim_curves(some, ["C7"])[0] for some in (ours, theirs)]
    pd.testing.assert_frame_equal(
        effects_jointly(curves[0], ours), effects_jointly(curves[1], theirs)
    )


def test_two_levels_that_differ_from_each_other_alone_are_found():
    """By more than each does from the default: a test against that would miss them."""
    moves = {"0.4": 22.0, "1": -22.0, "0.7": 0.0}
    rng = np.random.default_rng(2)
    made = made_up(lambda one, method, rho: 400.0 + (method == "UCT-NONE") * (
        moves[one.levels["speed"]] + 60.0 * rng.standard_normal()))  # fmt: skip
    (curve,) = claim_curves(made, ["C7"])
    table = effects_jointly(curve, made).set_index("choice")
    speed = table.loc["speed"]
    # At 1.6 half widths p times the 36 levels and choices is 0.1.
    assert (speed["mean"].abs() < 1.6 * (speed["high"] - speed["mean"])).all()
    assert set(table.index[table["p"] < 0.05]) == {"speed"}


def test_the_joint_test_is_rarely_wrong_without_effect():
    few = universes()[:8]
    wrong = 0
    for seed in range(60):
        (curve,) = claim_curves(made_up(lambda *_: 0.0, seed=seed, there=few), ["C5"])
        wrong += joint_test(curve).p_median <= 0.05
    assert wrong <= 8  # 3 are expected


def test_the_universe_with_the_curve_of_the_clip_is_the_nearest():
    few = universes()[:20]
    made = made_up(lambda *_: 500.0, there=few)
    rmse = np.interp(AXIS, *np.array(CLIP).T)
    own = (made.missions["universe"] == few[7].name) & (made.missions["method"] == "UCT-COPOD")
    own &= made.missions["rho"] == 0.15
    made.missions.loc[own, "rmse"] = pd.Series([rmse] * len(made.missions))[own]
    ranked = nearness(made)
    assert len(ranked) == 20
    assert tuple(ranked.loc[0, ["universe", "method", "rho"]]) == (few[7].name, "UCT-COPOD", 0.15)
    assert ranked.loc[0, "mean"] < 0.06 < ranked.loc[1, "mean"]
    assert nearest_tenth(made) == ranked["universe"].head(2).tolist()
