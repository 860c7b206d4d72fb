"""Random fields: covariance against the kernel, seeds, bytes, bounds."""

import numpy as np
import pytest

from infoplan.errors import UsageError
from infoplan.terrain import load_terrain
from infoplan.terrain.random_field import _wave_number, _waves, random_field


@pytest.mark.parametrize("lengthscale", [0.7, 3.0, 12.0, 80.0])
def test_covariance_along_an_axis_is_the_kernel_s(lengthscale):
    waves = _waves(41, 20.0, lengthscale, _wave_number(20.0, lengthscale))
    x = np.linspace(0, 20, 41)
    expected = np.exp(-((x[:, None] - x) ** 2) / (2 * lengthscale**2))
    np.testing.assert_allclose(waves @ waves.T, expected, atol=1e-13)


def test_moments_over_many_seeds():
    fields = np.array(
        [random_field(seed, (6, 5), (10.0, 10.0), (2.0, 4.0), 30.0, 500.0) for seed in range(3000)]
    )
    y, x = np.meshgrid(np.linspace(0, 10, 6), np.linspace(0, 10, 5), indexing="ij")
    x, y = x.ravel(), y.ravel()
    expected = 900 * np.exp(-((x[:, None] - x) ** 2) / 8 - (y[:, None] - y) ** 2 / 32)
    flat = fields.reshape(3000, 30)
    # Standard errors: 30 / sqrt(3000) of a mean, at most 900 sqrt(2 / 3000) of a covariance.
    np.testing.assert_allclose(flat.mean(axis=0), 500, atol=5 * 30 / np.sqrt(3000))
    np.testing.assert_allclose(np.cov(flat.T), expected, atol=5 * 900 * np.sqrt(2 / 3000))


def test_the_same_seed_is_the_same_landscape_however_finely_it_is_looked_at():
    coarse = load_terrain("random_field", shape=[11, 21], seed=4)
    fine = load_terrain("random_field", shape=[21, 41], seed=4)
    np.testing.assert_allclose(fine.elevation[::2, ::2], coarse.elevation, atol=2e-4)


def test_seeds_give_different_maps_with_names_of_their_own():
    one, other = load_terrain("random_field"), load_terrain("random_field", seed=1)
    assert (one.name, other.name) == ("random_field-seed0", "random_field-seed1")
    assert one.sha256 != other.sha256
    assert np.corrcoef(one.elevation.ravel(), other.elevation.ravel())[0, 1] < 0.5


def test_bytes_are_the_same_everywhere():
    terrain = load_terrain("random_field", seed=7, lengthscale=[5, 9], shape=[40, 30])
    assert terrain.sha256 == "54b4df0f351f76e64ffcd22a183b7cdea6e055f6ef62683e948a4694aecf2520"


def test_lengthscales_are_workspace_units_along_x_and_y():
    """A Gaussian field has a mean square slope of (amplitude / lengthscale)^2 along each axis."""
    maps = [
        load_terrain("random_field", seed=seed, lengthscale=[3.0, 9.0], amplitude=1.0, mean=0.0)
        for seed in range(150)
    ]
    step = 50 / 99
    along_y, along_x = (
        np.mean([np.mean((np.diff(terrain.elevation, axis=axis) / step) ** 2) for terrain in maps])
        for axis in (0, 1)
    )
    assert along_x == pytest.approx(1 / 9, rel=0.1)
    assert along_y == pytest.approx(1 / 81, rel=0.1)


def test_amplitude_mean_and_unit():
    plain = load_terrain("random_field", amplitude=1.0, mean=0.0)
    scaled = load_terrain("random_field", amplitude=200.0, mean=-50.0, unit="feet")
    np.testing.assert_allclose(scaled.elevation, 200 * plain.elevation - 50, atol=2e-4)
    assert (plain.unit, scaled.unit, scaled.name) == ("m", "ft", "random_field-seed0")


def test_what_is_too_large():
    with pytest.raises(UsageError, match=r"terrain\.shape=.* has more than"):
        load_terrain("random_field", shape=[100_000, 100_000])
    with pytest.raises(UsageError, match=r"terrain\.lengthscale=.* too short for a workspace"):
        load_terrain("random_field", lengthscale=[1e-3, 1e-3])
    with pytest.raises(UsageError, match=r"terrain\.lengthscale=.* too short for a workspace"):
        load_terrain("random_field", lengthscale=[1e-300, 5.0])
    with pytest.raises(UsageError, match=r"terrain\.lengthscale=.* too short for a workspace"):
        load_terrain("random_field", lengthscale=[1e-320, 6.0])
    with pytest.raises(UsageError, match=r"terrain\.lengthscale=.* too short for a workspace"):
        load_terrain("random_field", lengthscale=[0.001, 1000.0])  # 137 000 waves along x
    with pytest.raises(UsageError, match=r"terrain\.shape=\[2, 9000000\] .* ask for fewer"):
        load_terrain("random_field", lengthscale=[6.0, 6.0], shape=[2, 9_000_000])
    assert load_terrain("random_field", lengthscale=[0.05, 0.05], shape=[9, 9]).elevation.std() > 0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("amplitude", [1e-320, 1e-300, 1e308])
def test_elevations_that_no_double_holds_are_refused(amplitude):
    with pytest.raises(UsageError, match=r"terrain=random_field .* terrain\.amplitude="):
        load_terrain("random_field", amplitude=amplitude)


@pytest.mark.parametrize("options", [{"lengthscale": [1e9, 1e9]}, {"mean": 1e300}])
def test_a_field_that_does_not_vary_is_no_map(options):
    with pytest.raises(UsageError, match=r"terrain=random_field .* everywhere: there is nothing"):
        load_terrain("random_field", **options)
    assert load_terrain("random_field", lengthscale=[1e9, 6.0]).elevation.std() > 0


@pytest.mark.parametrize(
    ("option", "value"),
    [("seed", -1), ("amplitude", 0.0), ("lengthscale", [1.0, 0.0]), ("lengthscale", [1.0]),
     ("lengthscale", [6.0, 1e308]), ("shape", [1, 5]), ("mean", float("nan"))],
)  # fmt: skip
def test_bounds(option, value):
    with pytest.raises(UsageError, match=rf"terrain\.{option}="):
        load_terrain("random_field", **{option: value})
