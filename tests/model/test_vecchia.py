"""The process of nearest neighbours: exact with all of them, else the product of conditionals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist
from scipy.stats import multivariate_normal
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

from infoplan.errors import RunError
from infoplan.model import GaussianProcess, VecchiaProcess, log_marginal_likelihood
from infoplan.model.inference.neighbours import build, cut, maxmin
from infoplan.model.inference.vecchia import VecchiaInference
from infoplan.model.kernels import as_kernel

ORDERINGS = ("collected", "maxmin", "random")
THETA = np.log([1.3, 0.3, 0.5, 0.02])
JITTER = 1e-6


def places(n, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (2, n))


def heights(x, seed=0):
    noise = 0.1 * np.random.default_rng(seed).normal(size=x.shape[1])
    return np.sin(4.0 * x[0]) * np.cos(3.0 * x[1]) + noise


def inference(neighbours, block=5, ordering="collected", prediction_neighbours=20, **options):
    return VecchiaInference(
        as_kernel("squared_exponential"), JITTER, neighbours=neighbours, block=block,
        ordering=ordering, prediction_neighbours=prediction_neighbours, **options,
    )  # fmt: skip


def covariance(x, theta=THETA):
    amplitude, *lengthscales = np.exp(theta[:-1])
    kernel = ConstantKernel(amplitude**2) * RBF(lengthscales)
    return kernel(x.T) + (np.exp(theta[-1]) + JITTER) * np.eye(x.shape[1])


def log_density(x, y, numbers):
    numbers = np.asarray(numbers, dtype=int)
    if not numbers.size:
        return 0.0
    zero = np.zeros(len(numbers))
    return multivariate_normal(zero, covariance(x[:, numbers])).logpdf(y[numbers])


class TestBlocks:
    @settings(max_examples=60, deadline=None)
    @given(st.integers(0, 90), st.integers(1, 12), st.sampled_from(ORDERINGS))
    def test_each_datum_is_in_one_block_and_blocks_are_full(self, n, size, ordering):
        blocks = build(places(n), ordering, size, 4)
        assert sorted(blocks.members) == list(range(n))
        sizes = np.diff(blocks.starts)
        assert len(blocks) == -(-n // size)
        assert np.all((sizes >= 1) & (sizes <= size))

    def test_blocks_lie_together(self):
        x = places(700)
        spreads = [np.linalg.norm(np.ptp(x[:, numbers], axis=1)) for numbers in cut(x, 7)]
        assert np.mean(spreads) < 0.45  # a square with seven of 700 data has a diagonal of 0.28

    @pytest.mark.parametrize("ordering", ORDERINGS)
    @pytest.mark.parametrize("neighbours", [1, 6, 40])
    def test_neighbours_are_the_nearest_of_earlier_blocks(self, ordering, neighbours):
        x = places(60)
        blocks = build(x, ordering, 4, neighbours)
        for b in range(len(blocks)):
            earlier = blocks.members[: blocks.starts[b]]
            block = blocks.members[blocks.starts[b] : blocks.starts[b + 1]]
            distance = cdist(x[:, block].T, x[:, earlier].T).min(axis=0)
            expected = earlier[np.argsort(distance, kind="stable")[:neighbours]]
            found = blocks.neighbours[b]
            np.testing.assert_array_equal(found[: len(expected)], expected)
            assert np.all(found[len(expected) :] == -1)

    def test_maxmin_is_farthest_from_all_before(self):
        x = places(25)
        order = maxmin(x)
        assert sorted(order) == list(range(25))
        for rank in range(1, 25):
            least = cdist(x.T, x[:, order[:rank]].T).min(axis=1)
            assert least[order[rank]] == pytest.approx(least.max())

    def test_a_log_in_one_line_and_equal_places_are_cut(self):
        line = np.stack([np.arange(50.0), np.zeros(50)])
        assert [list(block) for block in cut(line, 10)] == [
            list(range(i, i + 10)) for i in range(0, 50, 10)
        ]
        assert [len(block) for block in cut(np.zeros((2, 23)), 7)] == [7, 7, 7, 2]


class TestLikelihood:
    @settings(max_examples=40, deadline=None)
    @given(
        st.integers(1, 45),
        st.integers(1, 9),
        st.sampled_from(ORDERINGS),
        st.tuples(*[st.floats(-2.0, 1.0)] * 3, st.floats(-5.0, 1.0)),
    )
    def test_with_all_neighbours_it_is_the_exact_one(self, n, block, ordering, theta):
        x, theta = places(n, n), np.array(theta)
        y = heights(x)
        near = inference(n, block, ordering, n)
        near.set_data(x, y)
        expected, gradient = log_marginal_likelihood(x.T, y, theta, jitter=JITTER)
        value, found = near.lml_and_gradient(theta)
        assert value == pytest.approx(expected, rel=1e-8, abs=1e-8)
        scale = 1e-7 * (1.0 + np.abs(gradient).max())
        np.testing.assert_allclose(found, gradient, atol=scale)
        assert near.lml(theta) == value

    @pytest.mark.parametrize("ordering", ORDERINGS)
    @pytest.mark.parametrize("block", [1, 4])
    def test_with_few_it_is_the_product_of_conditionals(self, ordering, block):
        x = places(40)
        y = heights(x)
        near = inference(5, block, ordering)
        near.set_data(x, y)
        expected = 0.0
        for b in range(len(near.blocks)):
            members = near.blocks.members[near.blocks.starts[b] : near.blocks.starts[b + 1]]
            given_ones = near.blocks.neighbours[b][near.blocks.neighbours[b] >= 0]
            joint = np.concatenate([given_ones, members])
            expected += log_density(x, y, joint) - log_density(x, y, given_ones)
        assert near.lml(THETA) == pytest.approx(expected, rel=1e-9)

    @settings(max_examples=25, deadline=None)
    @given(st.integers(2, 40), st.integers(1, 6), st.integers(1, 6))
    def test_gradient_equals_finite_differences(self, n, block, neighbours):
        x = places(n, n)
        near = inference(neighbours, block)
        near.set_data(x, heights(x))
        _, gradient = near.lml_and_gradient(THETA)
        for k, step in enumerate(1e-5 * np.eye(4)):
            slope = (near.lml(THETA + step) - near.lml(THETA - step)) / 2e-5
            assert gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-5)

    def test_data_that_follow_make_blocks_of_their_own(self):
        x = places(50)
        y = heights(x)
        grown, whole = inference(6), inference(6)
        grown.set_data(x[:, :30], y[:30])
        before = grown.blocks
        grown.set_data(x, y)
        np.testing.assert_array_equal(grown.blocks.members[:30], before.members)
        np.testing.assert_array_equal(grown.blocks.neighbours[: len(before)], before.neighbours)
        assert set(grown.blocks.members[30:]) == set(range(30, 50))
        whole.set_data(x[:, 1:], y[1:])
        whole.set_data(x, y)  # none that follow: everything anew
        fresh = build(x, "collected", 5, 6)
        np.testing.assert_array_equal(whole.blocks.members, fresh.members)
        np.testing.assert_array_equal(whole.blocks.neighbours, fresh.neighbours)

    def test_neighbours_follow_the_lengthscales(self):
        x = places(80)
        near = inference(5)
        near.set_data(x, heights(x))
        before = near.blocks
        near.settle(np.log([1.0, 0.4, 0.3, 0.1]))
        assert near.blocks is before
        near.settle(np.log([1.0, 0.9, 0.1, 0.1]))
        fresh = build(x / [[0.9], [0.1]], "collected", 5, 5)
        np.testing.assert_array_equal(near.blocks.members, fresh.members)
        np.testing.assert_array_equal(near.blocks.neighbours, fresh.neighbours)

    def test_without_data_it_is_zero(self):
        near = inference(5)
        near.set_data(np.empty((2, 0)), np.empty(0))
        assert near.lml(THETA) == 0.0
        value, gradient = near.lml_and_gradient(THETA)
        assert value == 0.0
        assert not gradient.any()
        mean, variance = near.predict(THETA, places(3))
        assert not mean.any()
        np.testing.assert_allclose(variance, np.exp(2.0 * THETA[0]))

    def test_weights_and_inverse_are_those_of_its_own_density(self):
        """The log density is quadratic in the data: its second differences are the precision."""
        x = places(30)
        y = heights(x)
        near = inference(4, 3)

        def density(data):
            near.set_data(x, data)
            return near.lml(THETA)

        chosen = np.array([4, 29, 0, 17])
        unit = np.eye(30)
        nothing = density(np.zeros(30))
        inverse = [
            [
                -(density(unit[i] + unit[j]) - density(unit[i]) - density(unit[j]) + nothing)
                for j in chosen
            ]
            for i in chosen
        ]
        weights = [(density(y - unit[i]) - density(y + unit[i])) / 2.0 for i in chosen]
        near.set_data(x, y)
        found, precision = near.weights_and_inverse(THETA, chosen)
        np.testing.assert_allclose(precision, inverse, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(found, weights, rtol=1e-6, atol=1e-6)


class TestPrediction:
    @pytest.mark.parametrize("neighbours", [10, 40])
    def test_a_group_is_predicted_from_its_nearest_data(self, neighbours):
        x, queries = places(60), places(90, 1)
        y = heights(x)
        near = inference(5, prediction_neighbours=neighbours)
        near.set_data(x, y)
        mean, variance = near.predict(THETA, queries)
        kernel = ConstantKernel(np.exp(2.0 * THETA[0])) * RBF(np.exp(THETA[1:3]))
        for group in cut(queries, 25):
            distance = cdist(queries[:, group].T, x.T).min(axis=0)
            chosen = np.argsort(distance, kind="stable")[:neighbours]
            regressor = GaussianProcessRegressor(
                kernel, alpha=np.exp(THETA[3]) + JITTER, optimizer=None
            ).fit(x[:, chosen].T, y[chosen])
            expected, deviation = regressor.predict(queries[:, group].T, return_std=True)
            np.testing.assert_allclose(mean[group], expected, atol=1e-9)
            np.testing.assert_allclose(variance[group], deviation**2, atol=1e-9)

    def test_no_place_is_no_prediction(self):
        near = inference(5)
        near.set_data(places(9), heights(places(9)))
        assert [len(part) for part in near.predict(THETA, np.empty((2, 0)))] == [0, 0]


class TestProcess:
    @pytest.mark.parametrize("ordering", ORDERINGS)
    @pytest.mark.parametrize(
        ("dtype", "precision", "optimizer"),
        [("float64", 1e-9, "adam"), ("float64", 1e-6, "lbfgs"), ("float32", 1e-3, "adam")],
    )
    def test_with_all_neighbours_it_is_the_gp(self, ordering, dtype, precision, optimizer):
        x, more, queries = (25.0 * places(n, n).T for n in (40, 20, 70))
        common = {"dtype": dtype, "optimizer": optimizer}
        exact = GaussianProcess(x, heights(x.T / 25), **common)
        near = VecchiaProcess(
            x, heights(x.T / 25), neighbours=99, prediction_neighbours=99, ordering=ordering,
            **common,
        )  # fmt: skip
        for model in (exact, near):
            model.optimize(20)
            model.append(more, heights(more.T / 25))
            model.optimize(5)
        expected, found = exact.predict(queries), near.predict(queries)
        np.testing.assert_allclose(found, expected, rtol=precision, atol=precision)
        assert near.log_marginal_likelihood == pytest.approx(
            exact.log_marginal_likelihood, rel=precision
        )
        everything = np.concatenate([x, more]), heights(np.concatenate([x, more]).T / 25)
        chosen = np.arange(40, 60)
        for one, other in zip(
            near.weights_and_inverse(*everything, chosen),
            exact.weights_and_inverse(*everything, chosen),
            strict=True,
        ):
            np.testing.assert_allclose(one, other, rtol=10 * precision, atol=10 * precision)

    def test_few_neighbours_are_near_the_gp(self):
        x, queries = 25.0 * places(400).T, 25.0 * places(100, 1).T
        y = heights(x.T / 25)
        exact, near = GaussianProcess(x, y), VecchiaProcess(x, y)
        for model in (exact, near):
            model.optimize(60)
        assert near.log_marginal_likelihood == pytest.approx(
            exact.log_marginal_likelihood, abs=0.05 * 400
        )
        expected, deviation = exact.predict(queries)
        mean, std = near.predict(queries)
        assert np.sqrt(np.mean((mean - expected) ** 2)) < 0.2 * deviation.mean()
        np.testing.assert_allclose(std, deviation, rtol=0.3)

    def test_data_at_one_place_raise_the_jitter_or_are_refused(self):
        x = np.concatenate([25.0 * places(8).T, np.zeros((60, 2))])
        y = np.arange(68.0)
        options = {"jitter": 0.0, "noise_variance": 1e-20, "min_noise_variance": 0.0}
        near = VecchiaProcess(x, y, **options)
        assert np.isfinite(near.log_marginal_likelihood)
        assert near.jitter > 0.0
        with pytest.raises(RunError, match="Vecchia process cannot factorise"):
            VecchiaProcess(x, y, amplitude=1e200, **options).predict(x)
