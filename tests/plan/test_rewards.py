"""Rewards against brute force: conditioning on one more sample, and determinants."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel
from studies import quick

import infoplan
from infoplan.belief import Belief
from infoplan.cli import main
from infoplan.errors import RunError, UsageError
from infoplan.extent import query_grid
from infoplan.mission_cost import memory_of, seconds_of
from infoplan.model import MODELS, GaussianProcess
from infoplan.plan.rewards import mutual_information, upper_confidence_bound, variance_reduction
from infoplan.simulator import Simulator
from infoplan.terrain import load_terrain


def posterior(n=24, seed=0):
    """Covariance of a random process at random places."""
    x = np.random.default_rng(seed).uniform(0, 1, (n, 2))
    squared = ((x[:, None] - x) ** 2).sum(axis=2)
    return 7.0 * np.exp(-squared / 0.1) + 1e-6 * np.eye(n)


def test_variance_reduction_is_what_one_more_sample_brings():
    covariance, noise = posterior(), 0.5
    found = variance_reduction(covariance, noise)
    for v in range(len(covariance)):
        gain = covariance[:, [v]] / (covariance[v, v] + noise)
        left = covariance - gain @ covariance[[v]]
        assert found[v] == pytest.approx(np.trace(covariance) - np.trace(left), rel=1e-9)


def test_mutual_information_is_the_entropy_that_the_others_take():
    covariance, noise = posterior(), 0.5
    found = mutual_information(covariance, noise)
    samples = covariance + noise * np.eye(len(covariance))
    for v in range(len(samples)):
        others = np.delete(np.arange(len(samples)), v)
        apart = np.log(samples[v, v]) + np.linalg.slogdet(samples[np.ix_(others, others)])[1]
        assert found[v] == pytest.approx((apart - np.linalg.slogdet(samples)[1]) / 2, rel=1e-9)


def test_a_node_on_which_nothing_depends_says_nothing():
    covariance = posterior(6)
    covariance[0, 1:] = covariance[1:, 0] = 0.0
    found = mutual_information(covariance, 0.1)
    assert found[0] == pytest.approx(0.0, abs=1e-12)
    assert (found[1:] > 0).all()
    assert np.isfinite(mutual_information(np.ones((5, 5)), 0.0)).all()  # nothing but rounding


def test_the_upper_confidence_bound_is_none_negative():
    mean, std = np.array([-5.0, 1.0, 3.0]), np.array([1.0, 4.0, 0.5])
    np.testing.assert_allclose(upper_confidence_bound(mean, std, 2.0), [0.0, 12.0, 7.0])


def data(n=60, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(0, 50, (n, 2))
    return x, 1000 + 200 * np.sin(x[:, 0] / 8) + 15 * rng.standard_normal(n)


def test_the_covariance_of_a_process_is_sklearns():
    x, y = data()
    model = GaussianProcess(x, y, noise_variance=0.1, amplitude=1.3)
    model.append(x[:5] + 1.0, y[:5])
    x, y = np.vstack([x, x[:5] + 1.0]), np.append(y, y[:5])
    low, high = x[:60].min(axis=0), x[:60].max(axis=0)
    kernel = ConstantKernel(1.3**2) * RBF([0.5, 0.5])
    truth = GaussianProcessRegressor(kernel, alpha=0.1 + 1e-6, optimizer=None)
    truth.fit(-1 + 2 * (x - low) / (high - low), y)
    query = query_grid((0, 50, 0, 50), (6, 7))
    _, expected = truth.predict(-1 + 2 * (query - low) / (high - low), return_cov=True)
    found = model.covariance(query)
    np.testing.assert_allclose(found, np.var(y[:60]) * expected, rtol=1e-7, atol=1e-6)


def test_the_covariance_under_student_t_noise():
    x, y = data()
    query = query_grid((0, 50, 0, 50), (5, 5))
    gaussian = GaussianProcess(x, y, noise_variance=0.1).covariance(query)
    nearly = MODELS["student_t"](x, y, noise_variance=0.1, dof=1e9).covariance(query)
    np.testing.assert_allclose(nearly, gaussian, rtol=1e-4, atol=1e-3)
    y[::7] += 900.0
    heavy = MODELS["student_t"](x, y, noise_variance=0.01, dof=4.0)
    found = heavy.covariance(np.vstack([query, query]))
    np.testing.assert_allclose(found, found.T, rtol=1e-9, atol=1e-6)
    variance = heavy.predict(query)[1] ** 2
    for block in (found[:25, :25], found[:25, 25:]):  # a place goes with itself as with its twin
        np.testing.assert_allclose(np.diag(block), variance, rtol=1e-6)
    np.testing.assert_allclose(found[:25, 25:], found[:25, :25], rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("reward", ["mutual_information", "variance_reduction", "ucb"])
def test_a_mission_gathers_the_reward_of_its_model(reward):
    config, seen = quick(), []
    config.planner = replace(config.planner, reward=reward, kappa=1.5)
    belief = Belief(config, (0.0, 50.0, 0.0, 50.0), 0, pilot_of(config))
    planner = belief._planner

    def watched(situation, rng):
        seen.append(situation.reward_map)
        return planner(situation, rng)

    belief._planner = watched
    belief.plan()
    model, nodes = belief.model, query_grid((0.0, 50.0, 0.0, 50.0), (12, 12))
    noise = model.hyperparameters.noise_std * model._scaler.y_std
    expected = {
        "ucb": belief.mean + 1.5 * belief.std - (belief.mean + 1.5 * belief.std).min(),
        "mutual_information": mutual_information(model.covariance(nodes), noise**2),
        "variance_reduction": variance_reduction(model.covariance(nodes), noise**2),
    }[reward]
    np.testing.assert_allclose(seen[0].ravel(), expected, rtol=1e-6, atol=1e-6 * expected.max())


def pilot_of(config):
    return Simulator(config, load_terrain("volcano"), 0).pilot().readings()


def test_what_does_not_go_together_is_refused(capsys, tmp_path):
    for words, said in (
        (["model=vecchia", "planner.reward=mutual_information"], "covariance, which vecchia"),
        (["planner.noisy_std=true", "planner.reward=variance_reduction"], "true has no use"),
        (["planner.reward=entropy"], "std, mutual_information, variance_reduction or ucb"),
        (["planner.reward=ucb", "planner.kappa=-1"], "planner.kappa=-1"),
    ):  # fmt: skip
        assert main(["run", *words, "terrain=volcano", f"results_dir={tmp_path}"]) == 2
        assert said in " ".join(capsys.readouterr().err.split())


def test_a_model_that_tells_too_little_is_refused():
    config = quick()
    config.planner = replace(config.planner, reward="variance_reduction")
    pilot = pilot_of(config)
    config.model = infoplan.configure("model=vecchia").model
    with pytest.raises(UsageError, match="vecchia has not: use"):
        Belief(config, (0.0, 50.0, 0.0, 50.0), 0, pilot)
    config.model = quick().model
    belief = Belief(config, (0.0, 50.0, 0.0, 50.0), 0, pilot)
    belief.model = SimpleNamespace(covariance=lambda x: np.eye(3), observation_noise_std=1.0)
    with pytest.raises(RunError, match="the model gp tells no covariance"):
        belief.plan()
    belief.model = SimpleNamespace(covariance=lambda x: np.eye(144))
    with pytest.raises(RunError, match="reward=variance_reduction needs a model with observation"):
        belief.plan()


def test_the_covariance_of_many_nodes_is_reckoned_with():
    config = replace(quick(), grid=[100, 100])
    with_covariance = replace(config, planner=replace(config.planner, reward="mutual_information"))
    assert memory_of(with_covariance) - memory_of(config) == pytest.approx(24 * 10_000**2)
    assert seconds_of(with_covariance) > 100 * seconds_of(config)
