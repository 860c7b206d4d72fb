"""Checks of what the model predicts: hyperparameters, scores, the final and earlier models."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import islice
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats
from scipy.interpolate import RegularGridInterpolator
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel

from infoplan.analyse.audit import neighbours, repeat
from infoplan.analyse.audit.neighbours import Neighbourhood
from infoplan.analyse.audit.stored import (
    ROUNDING,
    Booleans,
    Epochs,
    FaultError,
    Floats,
    Judgements,
    Partial,
    StoredMission,
    demand,
    demand_close,
    is_told,
)
from infoplan.config import is_survey
from infoplan.model.kernels import as_kernel
from infoplan.model.theta import names_of
from infoplan.study.terms import as_meant
from infoplan.tables import TABLES
from infoplan.wording import spans

PRECISION = {"float64": 1e-6, "float32": 3e-3}
"""Relative difference allowed to a prediction, by the precision of the model's matrices."""

OWN = "the model, which is the user's own"
"""What is not recomputed of a model that would have to be called."""

UNSTORED = {
    "itgp": "which samples the model trimmed is not stored",
    "relevance_pursuit": "which samples have noise of their own is not stored",
}
"""Models that are not recomputed, and why."""

NORMAL_95 = 1.959964


def check_hyperparameters(mission: StoredMission) -> str | Partial:
    """Check that hyperparameters keep their floors, and stay where nothing is learned."""
    if mission.is_own("model"):
        return Partial("", OWN)
    curves = mission.curves
    floor = float(mission.option("model.min_noise_variance"))
    kernel = as_kernel(mission.option("model.kernel"))
    names = names_of(kernel)
    if absent := [name for name in names if name not in curves]:
        raise FaultError(f"the curves have no column {absent[0]}")
    demand(
        ((curves[names] > 0) & (curves[names] < np.inf)).all(axis=1).to_numpy(),
        lambda e: f"a hyperparameter of epoch {e} is not positive",
    )
    demand(
        (curves["noise_std"] ** 2 >= floor * (1 - ROUNDING)).to_numpy(),
        lambda e: f"the noise variance of epoch {e} is {curves['noise_std'][e] ** 2:.4g} < {floor}",
    )
    jitter = float(mission.option("model.jitter"))
    demand(
        (curves["jitter"] >= jitter * (1 - ROUNDING)).to_numpy(),
        lambda e: f"the jitter of epoch {e} is {curves['jitter'][e]:.4g} < {jitter}",
    )
    low, high = pilot_box(mission)
    # Not every model has that guard.
    shortest = float(as_meant(mission.configuration)["model"].get("min_lengthscale", 0.0))
    spacing = shortest * spacing_of_samples(mission)
    floors = dict(zip(("lengthscale_1", "lengthscale_2"), 2 * spacing / (high - low), strict=True))
    for name in sorted(floors.keys() & set(names)):
        _demand_floor(name, curves[name].to_numpy(), floors[name])
    if mission.option("model.pilot_iterations") == 0:
        untouched = curves if mission.option("model.iterations") == 0 else curves[:1]
        amplitude, lengthscale = (
            float(mission.option(f"model.{start}")) for start in ("amplitude", "lengthscale")
        )
        own = [lengthscale if one.start is None else one.start for one in kernel.hyperparameters]
        for name, start in zip(names, [amplitude, *own], strict=False):
            expected = max(start, floors.get(name, 0.0))
            values = untouched[name].to_numpy()
            demand_close(f"{name} of untrained epoch", values, expected, ROUNDING * expected)
    _check_collapse(mission)
    _check_rate_limit(mission, names)
    last = curves.iloc[-1]
    return "at the end " + ", ".join(f"{name} {last[name]:.4g}" for name in [*names, "jitter"])


def spacing_of_samples(mission: StoredMission) -> float:
    """Distance of two successive samples: the robot's, of a survey the usual one of its pilot."""
    if not is_survey(mission.option("terrain.name")):
        return float(mission.option("robot.speed"))
    x = mission.x[(mission.epoch == 0) & mission.told]
    steps = np.linalg.norm(x[1:] - x[:-1], axis=1)
    return float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0


def _demand_floor(name: str, found: Floats, floor: float) -> None:
    """Check that a lengthscale keeps the floor that `model.min_lengthscale` sets."""
    demand(
        found >= floor * (1 - ROUNDING),
        lambda e: (
            f"{name} of epoch {e} is {found[e]:.4g}, below the floor {floor:.4g} of "
            "model.min_lengthscale"
        ),
    )


def _check_collapse(mission: StoredMission) -> None:
    """Check which epochs are said to have a lengthscale below the distance of two samples."""
    curves = mission.curves
    if curves["collapsed"].isna().all():  # of an older version, or a kernel without lengthscales
        return
    low, high = pilot_box(mission)
    lengthscales = curves[["lengthscale_1", "lengthscale_2"]].to_numpy(dtype=float)
    smaller = (lengthscales * (high - low) / 2).min(axis=1)
    speed = spacing_of_samples(mission)
    said = curves["collapsed"].to_numpy()
    # At the very distance rounding decides.
    demand(
        (said == (smaller < speed)) | (np.abs(smaller - speed) <= ROUNDING * speed),
        lambda e: (
            f"epoch {e} has collapsed {said[e]}, with a lengthscale of {smaller[e]:.4g} "
            f"workspace units and samples {speed:g} apart"
        ),
    )


def _check_rate_limit(mission: StoredMission, names: Sequence[str]) -> None:
    """Check in which epochs hyperparameters are said to have moved about as far as they can."""
    said = mission.curves["rate_limited"]
    if said.isna().all():  # of an older version, or nothing limits them
        return
    theta = np.log(mission.curves[list(names)].to_numpy(dtype=float))
    theta[:, list(names).index("noise_std")] *= 2.0  # the variance is learned
    moved = np.abs(theta[1:] - theta[:-1]).max(axis=1)
    wanted = mission.option("model.iterations")
    steps = np.diff(mission.curves["collected"]) if wanted == "per_sample" else float(wanted)
    limit = 0.5 * float(mission.option("model.learning_rate")) * steps
    found = said.to_numpy()[1:].astype(bool)
    # At the very limit rounding decides.
    demand(
        (found == (moved >= limit)) | (np.abs(moved - limit) <= 1e-9 * (1 + np.abs(theta).max())),
        lambda e: (
            f"epoch {e + 1} has rate_limited {found[e]}, where a hyperparameter moved by "
            f"{moved[e]:.4g}"
        ),
    )


def _fit(mission: StoredMission, row: int, used: Booleans) -> tuple[Floats, Floats, float]:
    """Fit scikit-learn's Gaussian process with the hyperparameters of a row of the curve.

    Parameters
    ----------
    row
        Epoch whose hyperparameters count.
    used
        Which of the first samples the model holds, shape (m,).

    Returns
    -------
    mean, std : ndarrays, shape (rows * columns,)
        Latent prediction on the query grid, terrain's unit.
    lml : float
        Log marginal likelihood, scaled units.
    """
    state = mission.curves.iloc[row]
    model = GaussianProcessRegressor(
        reference_kernel(mission, state),
        alpha=state["noise_std"] ** 2 + state["jitter"],
        optimizer=None,
    )
    x, y = scaled_samples(mission)
    model.fit(x[: len(used)][used], y[: len(used)][used])
    mean, std = model.predict(_scaled(mission, mission.maps), return_std=True)
    centre, scale = _elevation_scaler(mission)
    return centre + scale * mean, scale * std, float(model.log_marginal_likelihood_value_)


def _fit_student_t(
    mission: StoredMission, row: int, used: Booleans
) -> tuple[Floats, Floats, float]:
    """Do as `_fit` for Student-t noise, from the stored map: the posterior's mode nearest to it."""
    state = mission.curves.iloc[row]
    x, y = scaled_samples(mission)
    centre, scale = _elevation_scaler(mission)
    rows, columns = (int(nodes) for nodes in mission.option("grid"))
    axes = (np.unique(mission.maps["x2"]), np.unique(mission.maps["x1"]))
    surface = RegularGridInterpolator(
        axes, mission.maps["mean"].to_numpy().reshape(rows, columns), bounds_error=False,
        fill_value=None,
    )  # fmt: skip
    start = (surface(mission.x[: len(used)][used][:, ::-1]) - centre) / scale
    mean, std, lml = repeat.student_t(
        x[: len(used)][used], y[: len(used)][used], _scaled(mission, mission.maps),
        reference_kernel(mission, state), state["noise_std"], float(mission.option("model.dof")),
        state["jitter"], start,
    )  # fmt: skip
    return centre + scale * mean, scale * std, lml


def _fit_rcgp(mission: StoredMission, row: int, used: Booleans) -> tuple[Floats, Floats, float]:
    """Do as `_fit` for the robust and conjugate process, by its definition."""
    state, (x, y) = mission.curves.iloc[row], scaled_samples(mission)
    count, criterion = mission.option("model.centre_neighbours"), mission.option("model.criterion")
    mean, std, density = repeat.robust_conjugate(
        x[: len(used)][used], y[: len(used)][used], _scaled(mission, mission.maps),
        reference_kernel(mission, state), state["noise_std"] ** 2, state["jitter"],
        float(mission.option("model.outlier_fraction")), None if count is None else int(count),
        criterion == "weighted",
    )  # fmt: skip
    centre, scale = _elevation_scaler(mission)
    return centre + scale * mean, scale * std, density


def _fit_vecchia(mission: StoredMission, row: int, used: Booleans) -> tuple[Floats, Floats, float]:
    """Do as `_fit` for the process of nearest neighbours, by its definition."""
    state, (x, y) = mission.curves.iloc[row], scaled_samples(mission)
    kernel, noise = reference_kernel(mission, state), state["noise_std"] ** 2 + state["jitter"]
    found = _all_neighbourhoods(mission)[row]
    assert found is not None  # what was in use by then is known, and so is what was before
    blocks, units = found
    centre, scale = _elevation_scaler(mission)
    mean, std = neighbours.predict(
        x, y, kernel, noise, np.flatnonzero(used), _scaled(mission, mission.maps), units,
        int(mission.option("model.prediction_neighbours")),
    )  # fmt: skip
    lml = neighbours.log_likelihood(x, y, kernel, noise, blocks)
    return centre + scale * mean, scale * std, lml


def neighbourhoods(mission: StoredMission, judgements: Judgements) -> Iterator[Neighbourhood]:
    """Give the blocks that the process of nearest neighbours has after each epoch.

    Parameters
    ----------
    judgements
        May grow while the epochs are gone through.
    """
    names = ["lengthscale_1", "lengthscale_2"]
    return neighbours.follow(
        scaled_samples(mission)[0],
        (None if judged is None else np.flatnonzero(~judged[1]) for judged in judgements),
        iter(mission.curves[names].to_numpy(dtype=float)),
        int(mission.option("model.block")),
        int(mission.option("model.neighbours")),
        str(mission.option("model.ordering")),
    )


@lru_cache(maxsize=1)
def _all_neighbourhoods(mission: StoredMission) -> list[Neighbourhood]:
    return list(islice(neighbourhoods(mission, mission.judgements), len(mission.curves)))


def _elevation_scaler(mission: StoredMission) -> tuple[float, float]:
    """Mean and deviation of the pilot's measurements."""
    pilot = mission.samples["measured"].to_numpy()[: mission.n_pilot]
    pilot = pilot[mission.told[: mission.n_pilot]]
    if not len(pilot):
        raise FaultError("no sample of the pilot has a measurement")
    return float(pilot.mean()), float(pilot.std())


def pilot_box(mission: StoredMission) -> tuple[Floats, Floats]:
    """Corners of the bounding box of the pilot's measurements, shape (2,) each."""
    pilot = mission.x[: mission.n_pilot][mission.told[: mission.n_pilot]]
    return pilot.min(axis=0), pilot.max(axis=0)


def _scaled(mission: StoredMission, places: pd.DataFrame) -> Floats:
    """Positions in units of the pilot's bounding box, shape (n, 2)."""
    low, high = pilot_box(mission)
    scaled: Floats = 2.0 * (places[["x1", "x2"]].to_numpy() - low) / (high - low) - 1.0
    return scaled


def scaled_samples(mission: StoredMission) -> tuple[Floats, Floats]:
    """Positions and measurements of all samples, scaled as the model has them."""
    centre, scale = _elevation_scaler(mission)
    return _scaled(mission, mission.samples), (
        mission.samples["measured"].to_numpy() - centre
    ) / scale


def reference_kernel(mission: StoredMission, state: "pd.Series[Any]") -> Any:
    """Kernel with the hyperparameters of a row of the curve, as scikit-learn has it."""
    kernel = as_kernel(mission.option("model.kernel"))
    own = kernel.reference({name: float(state[name]) for name in names_of(kernel)})
    return ConstantKernel(state["amplitude"] ** 2, "fixed") * own


def noise_factor(mission: StoredMission) -> float:
    """Variance of the observation noise over the square of `noise_std`."""
    if mission.option("model.name") == "student_t":
        dof = float(mission.option("model.dof"))
        return dof / (dof - 2.0)
    if mission.option("model.name") != "itgp":
        return 1.0
    share = float(mission.option("model.alpha2"))
    if not mission.option("model.reweighting"):
        share = float(mission.option("model.alpha1"))
        if not mission.option("model.concentrating"):
            share += (1.0 - share) / (float(mission.option("model.shrinking")) + 1.0)
    return share / float(stats.chi2(3).cdf(stats.chi2(1).ppf(share)))


def _precision(mission: StoredMission) -> float:
    """Relative difference to allow to the model's numbers."""
    model = mission.configuration.get("model", {})
    return PRECISION[model.get("dtype", "float64")]


def _compare_row(mission: StoredMission, row: int, used: Booleans) -> tuple[Floats, Floats, float]:
    """Fit the model of a row of the curve, compare its scores, and return its prediction.

    Returns
    -------
    mean, std : ndarrays, shape (rows * columns,)
        As `_fit` gives them.
    tolerance : float
        What may lie between them and the mission's, terrain's unit.
    """
    fits = {"student_t": _fit_student_t, "vecchia": _fit_vecchia, "rcgp": _fit_rcgp}
    mean, std, lml = fits.get(mission.option("model.name"), _fit)(mission, row, used)
    precision = _precision(mission)
    tolerance = precision * _elevation_scaler(mission)[1]
    recorded = float(mission.curves["lml"][row])
    if not abs(recorded - lml) <= precision * max(abs(lml), float(np.sum(used))):
        raise FaultError(f"epoch {row} has lml {recorded:.8g}, recomputed {lml:.8g}")
    if not is_survey(mission.option("terrain.name")):
        _compare_scores(mission, row, used, mean, std, tolerance, precision)
    return mean, std, tolerance


def _compare_scores(
    mission: StoredMission,
    row: int,
    used: Booleans,
    mean: Floats,
    std: Floats,
    tolerance: float,
    precision: float,
) -> None:
    """Compare the scores of a row of the curve with those of a prediction.

    Parameters
    ----------
    row
        Epoch.
    used
        What the model holds of the samples so far, shape (n,).
    mean, std
        Prediction on the query grid, shape (rows * columns,), terrain's unit.
    tolerance
        Difference allowed to errors and to the prediction, terrain's unit.
    precision
        Difference allowed to the negative log predictive density, relative above 1.
    """
    truth = mission.maps["truth"].to_numpy()
    error = np.abs(mean - truth)
    nlpd = float(-np.mean(stats.norm.logpdf(truth, mean, std)))
    # The score is E|X - truth| - E|X - X'| / 2 for independent X and X' of the prediction.
    away = stats.foldnorm.mean(error / std, scale=std)
    held = mission.samples["measured"].to_numpy()[: len(used)][used]
    trivial = float(-np.mean(stats.norm.logpdf(truth, held.mean(), held.std() or np.nan)))
    expected = {
        "rmse": (float(np.sqrt(np.mean(error**2))), tolerance),
        "mae": (float(np.mean(error)), tolerance),
        "nlpd": (nlpd, precision * max(1.0, abs(nlpd))),
        "crps": (float(np.mean(away - std / np.sqrt(np.pi))), 2 * tolerance),
        "msll": (nlpd - trivial, precision * max(1.0, abs(nlpd), abs(trivial))),
    } | {
        f"rmse_{name}": (float(np.sqrt(np.mean(error[third] ** 2))), tolerance)
        for name, third in mission.thirds.items()
    }
    for name, (value, allowed) in expected.items():
        if not is_told(mission.curves, TABLES["curves"].columns[name]):
            continue
        recorded = float(mission.curves[name][row])
        if np.isnan(recorded) and np.isnan(value):
            continue
        if not abs(recorded - value) <= allowed:
            raise FaultError(f"epoch {row} has {name} {recorded:.8g}, recomputed {value:.8g}")
    # Nodes so near the bound that rounding decides may count or not.
    least = np.mean(error + tolerance <= NORMAL_95 * (std - tolerance))
    most = np.mean(error - tolerance <= NORMAL_95 * (std + tolerance))
    recorded = float(mission.curves["coverage95"][row])
    if not least - ROUNDING <= recorded <= most + ROUNDING:
        raise FaultError(
            f"epoch {row} has coverage95 {recorded:.6g}, recomputed {least:.6g} to {most:.6g}"
        )


def check_final_scores(mission: StoredMission) -> str:
    """Check that the last row of the curve scores the stored map."""
    mean, std = mission.maps["mean"].to_numpy(), mission.maps["std"].to_numpy()
    demand(std > 0, lambda i: f"node {i} has the standard deviation {std[i]:.6g}")
    last = len(mission.curves) - 1
    used = mission.samples["used"].to_numpy()
    _compare_scores(mission, last, used, mean, std, mission.elevation_tolerance, ROUNDING)
    return f"RMSE {mission.curves['rmse'][last]:.6g} follows from the map"


def check_final_model(mission: StoredMission) -> str | Partial:
    """Check that scikit-learn, given the samples in use, predicts the stored map and last row.

    What it has not, Student-t noise and weighted data, is recomputed step by step.
    """
    if mission.is_own("model"):
        return Partial("", OWN)
    if reason := UNSTORED.get(mission.option("model.name")):
        return Partial("", reason)
    last = len(mission.curves) - 1
    if mission.option("model.name") == "vecchia" and _all_neighbourhoods(mission)[last] is None:
        return Partial("", "the neighbours follow from what the model held before, not all stored")
    used = mission.samples["used"].to_numpy()
    mean, std, tolerance = _compare_row(mission, last, used)
    parts = []
    for name, expected in (("mean", mean), ("std", std)):
        found = mission.maps[name].to_numpy()
        demand_close(f"the {name} at node", found, expected, tolerance)
        parts.append(f"{name} within {np.abs(found - expected).max():.1g}")
    return f"{used.sum()} samples: {', '.join(parts)}"


def check_stretches(mission: StoredMission) -> str | Partial:
    """Check the cross-validated scores of a survey at its end by other libraries."""
    name = mission.option("model.name")
    if name not in ("gp", "vecchia"):
        return Partial("", "the cross-validated scores, but for those of model=gp and vecchia")
    predict = _predicted if name == "gp" else _predicted_by_neighbours
    last, table = len(mission.curves) - 1, mission.tables["stretches"]
    stored = table[table["epoch"] == last].reset_index(drop=True)
    state, y = mission.curves.iloc[last], scaled_samples(mission)[1]
    scale, used = _elevation_scaler(mission)[1], mission.samples["used"].to_numpy()
    part = np.arange(len(used)) * len(stored) // len(used)
    tolerance = _precision(mission) * scale
    for number, row in stored.iterrows():
        here = used & (part == number)
        if here.sum() != row["samples"]:
            raise FaultError(f"stretch {number} has {row['samples']} samples, counted {here.sum()}")
        if not here.any():
            continue
        sources = {"rmse": used & ~here, "rmse_unfiltered": mission.told & (part != number)}
        for name, source in sources.items():
            error = scale * (predict(mission, state, source, here) - y[here])
            demand_close(
                f"the {name} of stretch {number}, sample", np.array([row[name]]),
                np.sqrt(np.mean(error**2)), tolerance,
            )  # fmt: skip
    return f"{len(stored)} stretches predicted from the others, RMSE within {tolerance:.1g}"


def _predicted(
    mission: StoredMission, state: "pd.Series[Any]", source: Booleans, asked: Booleans
) -> Floats:
    """Predict some samples from others by scikit-learn's Gaussian process, scaled units."""
    x, y = scaled_samples(mission)
    model = GaussianProcessRegressor(
        reference_kernel(mission, state),
        alpha=state["noise_std"] ** 2 + state["jitter"],
        optimizer=None,
    ).fit(x[source], y[source])
    return np.asarray(model.predict(x[asked]), dtype=np.float64)


def _predicted_by_neighbours(
    mission: StoredMission, state: "pd.Series[Any]", source: Booleans, asked: Booleans
) -> Floats:
    """Do as `_predicted` for the process of nearest neighbours, by its definition."""
    x, y = scaled_samples(mission)
    learned, units = state[["lengthscale_1", "lengthscale_2"]].to_numpy(dtype=float), np.ones(2)
    if abs(np.log(learned[0] / learned[1])) > np.log(neighbours.OTHER_RATIO):
        units = learned
    return neighbours.predict(
        x, y, reference_kernel(mission, state), state["noise_std"] ** 2 + state["jitter"],
        np.flatnonzero(source), x[asked], units, int(mission.option("model.prediction_neighbours")),
    )[0]  # fmt: skip


def check_earlier_models(mission: StoredMission) -> str | Partial:
    """Check that scikit-learn, given what was in use by then, gives earlier rows of the curve."""
    last = len(mission.curves) - 1
    if mission.is_own("model"):
        return Partial("", f"epochs {spans(range(last))}: {OWN}")
    if reason := UNSTORED.get(mission.option("model.name")):
        return Partial("", f"epochs {spans(range(last))}: {reason}")
    if mission.option("model.name") == "student_t":
        # No map of then is stored, from which to find the same mode.
        return Partial("", f"epochs {spans(range(last))}: which mode was found is not stored")
    chosen = _chosen(mission.epochs, last)
    known = {row: judgement for row in chosen if (judgement := mission.judgements[row]) is not None}
    if mission.option("model.name") == "vecchia":
        known = {row: known[row] for row in known if _all_neighbourhoods(mission)[row] is not None}
    for row, (_, flags) in known.items():
        _compare_row(mission, row, ~flags)
    detail = f"epochs {spans(known)} give their rows" if known else ""
    omitted = [row for row in range(last) if row not in known]
    return Partial(detail, f"epochs {spans(omitted)}") if omitted else detail


def _chosen(epochs: Epochs, last: int) -> list[int]:
    """List the epochs before the last that are to be recomputed."""
    if epochs is None:
        return list(range(last))
    if isinstance(epochs, int):
        return sorted({last * i // epochs for i in range(epochs)})
    return [row for row in range(last) if row in epochs]
