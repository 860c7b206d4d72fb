"""The compiled passes against plain NumPy."""

import numpy as np
import pytest
from scipy.linalg import lapack

from infoplan.model.covariance import passes_of
from infoplan.model.kernels.squared_exponential import KERNEL
from infoplan.model.packed import diagonal, position

PASSES = passes_of(KERNEL)


def dense(a, b, rates, variance):
    difference = a[:, :, None] - b[:, None, :]
    return variance * np.exp(-np.einsum("d,dij->ij", rates, difference**2))


@pytest.mark.parametrize("n", [1, 2, 7, 8, 33])
def test_packed_layout_is_that_of_lapack(n):
    matrix = np.random.default_rng(n).normal(size=(n, n))
    packed, _ = lapack.dtrttf(matrix, transr="N", uplo="L")
    for i in range(n):
        for j in range(i + 1):
            assert packed[position(i, j, n)] == matrix[i, j]
    np.testing.assert_array_equal(diagonal(n, packed), np.diagonal(matrix))


@pytest.mark.parametrize("n", [1, 2, 50, 51])
def test_covariance(n):
    x = np.random.default_rng(n).uniform(-1, 1, (2, n))
    rates = (2.0, 0.7)
    packed = np.full(n * (n + 1) // 2, np.nan)
    PASSES.fill(x, rates, 1.7, 9.0, packed)
    full, _ = lapack.dtfttr(n, packed, transr="N", uplo="L")
    expected = dense(x, x, rates, 1.7)
    np.fill_diagonal(expected, 9.0)
    np.testing.assert_allclose(np.tril(full), np.tril(expected), rtol=1e-14)


def test_cross_covariance_over_the_whole_range_of_the_exponential():
    a = np.zeros((2, 1))
    exponents = np.concatenate([np.linspace(0.0, 46.0, 5001), [1e-300, 1e-17, 5e-9]])
    b = np.stack([np.sqrt(exponents), np.zeros_like(exponents)])
    out = np.empty((1, exponents.size))
    PASSES.fill_cross(a, b, (1.0, 1.0), 1.0, out)
    np.testing.assert_allclose(out[0], np.exp(-(b[0] ** 2)), rtol=1e-14)


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_negligible_entries_are_zero_and_none_is_subnormal(dtype):
    a = np.zeros((2, 1))
    b = np.stack([np.geomspace(1e-3, 1e200, 4000), np.zeros(4000)])
    out = np.empty((1, 4000), dtype=dtype)
    # The smallest amplitude that the optimisers allow.
    PASSES.fill_cross(a, b, (1.0, 1.0), 1e-12, out)
    assert (out[0, b[0] > 6.8] == 0.0).all()
    assert out[out > 0.0].min() > np.finfo(dtype).tiny
