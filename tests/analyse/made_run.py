"""A small honest mission made by plain NumPy, stored in the layout of the result tables.

It follows the conventions with other means than the audit: de Casteljau for the Bezier curve, the
tails written out for COPOD, Cholesky by hand for the Gaussian process, a sum over all flagged
samples for the outlier density. Its actions are drawn at random among those that stay inside.
"""

import copy
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from made_tables import PROVENANCE

from infoplan.study.columns import values_digest
from infoplan.study.identity import run_name
from infoplan.study.store import sealed

SEED = 3

CONFIGURATION: dict[str, Any] = {
    "planner": {
        "name": "puct",
        "iterations": 50,
        "rollouts": 5,
        "exploration": 0.3,
        "noisy_std": False,
        "execute_actions": None,
        "smoothing": 1.5,
    },
    "detector": {"name": "copod", "scope": "batch", "contamination": 0.1, "score": "pyod"},
    "terrain": {
        "name": "file-hills",
        "extent": [-2.0, 18.0, 1.0, 13.0],
        "unit": "m",
        "orientation": 0,
        "array": None,
        "nodata": "refuse",
        "shape": None,
        "crop": None,
        "sha256": "0" * 64,
    },
    "model": {
        "name": "gp",
        "amplitude": 1.0,
        "lengthscale": 0.5,
        "noise_variance": 1.0,
        "min_noise_variance": 1e-4,
        "jitter": 1e-6,
        "optimizer": "adam",
        "learning_rate": 0.01,
        "pilot_iterations": 500,
        "iterations": 5,
        "dtype": "float64",
    },
    "robot": {
        "speed": 0.5,
        "samples_per_action": 4,
        "max_steering": 0.15,
        "steering_angles": 5,
    },
    "pilot": {
        "samples": 30,
        "outliers": False,
        "control_points": [[0.2, 0.0], [0.0, 0.3], [0.1, 1.0], [1.0, 0.9], [0.9, 0.1], [0.5, 0.5]],
    },
    "sensor": {"noise_std": 1.0},
    "outliers": {"count": "round", "amplitude": [1.0, 2.0], "quantiles": [0.05, 0.95]},
    "rho": 0.15,
    "budget": 150,
    "grid": [9, 13],
    "numerics_version": 1,
}

RUN = run_name(CONFIGURATION)


def with_options(**options: Any) -> dict[str, Any]:
    """Copy the configuration with some options set; a double underscore stands for the dot."""
    configuration = copy.deepcopy(CONFIGURATION)
    if options.get("detector__name", "copod") != "copod":
        configuration["detector"] = {"name": options["detector__name"], "scope": "batch"}
    for name, value in options.items():
        *groups, key = name.split("__")
        place = configuration
        for group in groups:
            place = place[group]
        place[key] = value
    return configuration


def hills() -> np.ndarray:
    """Elevations of a terrain of 21 x 31 nodes."""
    i, j = np.mgrid[0:21, 0:31]
    return 800.0 + 300.0 * np.sin(i / 5.0) * np.cos(j / 7.0) + 9.0 * i + 150.0 * (j > 20)


def elevation(x: np.ndarray, extent: list[float]) -> np.ndarray:
    """Bilinear elevation at positions of shape (n, 2), written out."""
    xmin, xmax, ymin, ymax = extent
    terrain = hills()
    rows, columns = terrain.shape
    v = (x[:, 1] - ymin) / (ymax - ymin) * (rows - 1)
    u = (x[:, 0] - xmin) / (xmax - xmin) * (columns - 1)
    i = np.clip(v.astype(int), 0, rows - 2)
    j = np.clip(u.astype(int), 0, columns - 2)
    v, u = v - i, u - j
    south = (1 - u) * terrain[i, j] + u * terrain[i, j + 1]
    north = (1 - u) * terrain[i + 1, j] + u * terrain[i + 1, j + 1]
    return (1 - v) * south + v * north


def pilot_path(configuration: dict[str, Any]) -> np.ndarray:
    """Poses along the Bezier curve by de Casteljau, shape (n, 3)."""
    xmin, xmax, ymin, ymax = configuration["terrain"]["extent"]
    poses = []
    for t in np.linspace(0.0, 1.0, configuration["pilot"]["samples"]):
        points = [
            np.array([xmin + a * (xmax - xmin), ymin + b * (ymax - ymin)])
            for a, b in configuration["pilot"]["control_points"]
        ]
        while len(points) > 1:
            tangent = points[-1] - points[0]
            points = [(1 - t) * p + t * q for p, q in pairwise(points)]
        poses.append([*points[0], math.atan2(tangent[1], tangent[0]) % (2 * math.pi)])
    return np.array(poses)


def drive(
    pose: np.ndarray, configuration: dict[str, Any], rng: np.random.Generator
) -> list[list[float]]:
    """Drive some random actions that stay inside; turn on the spot while there is none."""
    robot, extent = configuration["robot"], configuration["terrain"]["extent"]
    most = configuration["planner"]["execute_actions"] or 5
    wanted = int(rng.integers(min(2, most), most + 1))
    trajectory: list[list[float]] = []
    x, y, heading = pose
    while len(trajectory) < wanted * robot["samples_per_action"]:
        choices = []
        for k in range(robot["steering_angles"]):
            u = robot["max_steering"] * (2 * k / (robot["steering_angles"] - 1) - 1)
            action, a, b, theta = [], x, y, heading
            for _ in range(robot["samples_per_action"]):
                a += robot["speed"] * math.cos(theta)
                b += robot["speed"] * math.sin(theta)
                theta = (theta + u) % (2 * math.pi)
                action.append([a, b, theta])
            if all(
                extent[0] <= a <= extent[1] and extent[2] <= b <= extent[3] for a, b, _ in action
            ):
                choices.append(action)
        if choices:
            trajectory += choices[rng.integers(len(choices))]
            x, y, heading = trajectory[-1]
        elif trajectory:
            break
        else:
            heading = (heading + math.pi / 8) % (2 * math.pi)
    return trajectory


def spikes(
    noisy: np.ndarray, configuration: dict[str, Any], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Spike a share of a batch."""
    rho, rule, n = configuration["rho"], configuration["outliers"]["count"], len(noisy)
    if rule == "bernoulli":
        chosen = rng.random(n) < rho
    else:
        number = round(rho * n) if rule == "round" else math.floor(rho * n + 1e-9)
        chosen = rng.permutation(n) < number
    low, high = np.quantile(noisy, configuration["outliers"]["quantiles"])
    amplitude = rng.uniform(*configuration["outliers"]["amplitude"], n) * rng.choice([-1, 1], n)
    return noisy + chosen * amplitude * (high - low), chosen


def copod(y: np.ndarray, options: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Scores and flags of COPOD in one dimension, the tails written out."""
    n = len(y)
    left = -np.log((y[None, :] <= y[:, None]).sum(axis=1) / n)
    right = -np.log((y[None, :] >= y[:, None]).sum(axis=1) / n)
    corrected = left if np.mean((y - y.mean()) ** 3) < 0 else right
    if options["score"] == "pyod":
        scores = np.maximum(corrected, (left + right) / 2)
    else:
        scores = np.maximum(np.maximum(left, right), corrected)
    return scores, scores > np.percentile(scores, 100 * (1 - options["contamination"]))


def predict(
    x: np.ndarray, y: np.ndarray, query: np.ndarray, state: dict[str, float]
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean and standard deviation of a Gaussian process, and the log marginal likelihood."""
    lengthscales = np.array([state["lengthscale_1"], state["lengthscale_2"]])

    def kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        distance = (((a[:, None] - b[None]) / lengthscales) ** 2).sum(axis=-1)
        return state["amplitude"] ** 2 * np.exp(-distance / 2)

    noise = state["noise_std"] ** 2 + state["jitter"]
    factor = np.linalg.cholesky(kernel(x, x) + noise * np.eye(len(x)))
    half = np.linalg.solve(factor, kernel(x, query))
    whitened = np.linalg.solve(factor, y)
    variance = state["amplitude"] ** 2 - (half**2).sum(axis=0)
    lml = -0.5 * whitened @ whitened - np.log(np.diag(factor)).sum()
    return half.T @ whitened, np.sqrt(variance), float(lml - len(y) / 2 * math.log(2 * math.pi))


def density(x: np.ndarray, configuration: dict[str, Any]) -> np.ndarray:
    """Smoothed count of samples by nearest node: a sum of Gaussians, cut and folded at borders.

    Beyond the border the nearest node's count goes on: a node there stands for the border's.
    """
    xmin, xmax, ymin, ymax = configuration["terrain"]["extent"]
    rows, columns = configuration["grid"]
    counts = np.zeros((rows, columns))
    for a, b in x:
        i = int(np.argmin(np.abs(np.linspace(ymin, ymax, rows) - b)))
        j = int(np.argmin(np.abs(np.linspace(xmin, xmax, columns) - a)))
        counts[i, j] += 1
    if configuration["planner"]["smoothing"] == 0.0:
        return counts.ravel()
    for axis, spacing in ((0, (ymax - ymin) / (rows - 1)), (1, (xmax - xmin) / (columns - 1))):
        sigma = configuration["planner"]["smoothing"] / spacing
        reach = int(4 * sigma + 0.5)
        offsets = np.arange(-reach, reach + 1)
        weights = np.exp(-0.5 * (offsets / sigma) ** 2)
        weights /= weights.sum()
        nodes = np.arange(counts.shape[axis])
        counts = sum(
            weight * np.take(counts, np.clip(nodes + offset, 0, nodes[-1]), axis=axis)
            for weight, offset in zip(weights, offsets, strict=True)
        )
    return counts.ravel()


def by_relief(query: np.ndarray, truth: np.ndarray, shape: tuple[int, int]) -> list[list[int]]:
    """Nodes in each third by local relief, within 2 workspace units or one spacing."""
    spacing = max(query[1, 0] - query[0, 0], query[shape[1], 1] - query[0, 1])
    reliefs = []
    for place in query:
        near = truth[np.linalg.norm(query - place, axis=1) <= max(2.0, spacing) + 1e-9]
        reliefs.append(near.max() - near.min())
    order = sorted(range(len(query)), key=lambda i: reliefs[i])
    return [[node for k, node in enumerate(order) if k * 3 // len(order) == i] for i in range(3)]


def further_scores(
    mean: np.ndarray,
    std: np.ndarray,
    truth: np.ndarray,
    measured: np.ndarray,
    thirds: list[list[int]],
) -> dict[str, float]:
    """Scores that version 0.1 did not store, written out."""
    error = mean - truth
    probability = np.array([0.5 * (1 + math.erf(z / math.sqrt(2))) for z in -error / std])
    density = np.exp(-0.5 * (error / std) ** 2) / math.sqrt(2 * math.pi)
    crps = -error * (2 * probability - 1) + 2 * std * density - std / math.sqrt(math.pi)
    log_density = -0.5 * (error / std) ** 2 - np.log(std)
    trivial = -0.5 * (truth - measured.mean()) ** 2 / measured.var() - np.log(measured.std())
    names = ("flat", "middle", "rugged")
    return {
        "crps": crps.mean(),
        "smse": (error**2).mean() / truth.var(),
        "msll": (trivial - log_density).mean(),
        **{f"rmse_{name}": math.sqrt(np.mean(error[nodes] ** 2))
           for name, nodes in zip(names, thirds, strict=True)},
    }  # fmt: skip


def rate_limited(before: Any, after: Any, configuration: dict[str, Any]) -> bool:
    """Whether a logarithm moved by half of the learning rate an iteration, that of the variance."""
    model = configuration["model"]
    moved = [
        abs(math.log(after[name]) - math.log(before[name])) * (2 if name == "noise_std" else 1)
        for name in ("amplitude", "lengthscale_1", "lengthscale_2", "noise_std")
    ]
    return max(moved) >= 0.5 * model["learning_rate"] * model["iterations"]


def fly(configuration: dict[str, Any], seed: int = SEED) -> dict[str, pd.DataFrame]:
    """Make the three tables of an honest mission."""
    rng = np.random.default_rng(seed)
    extent, detector = configuration["terrain"]["extent"], configuration["detector"]
    rows, columns = configuration["grid"]
    query = np.array(
        [
            (x, y)
            for y in np.linspace(extent[2], extent[3], rows)
            for x in np.linspace(extent[0], extent[1], columns)
        ]
    )
    truth = elevation(query, extent)
    thirds = by_relief(query, truth, (rows, columns))
    poses, samples, curve = pilot_path(configuration), pd.DataFrame(), []
    epoch = 0
    while True:
        batch = pd.DataFrame({"epoch": epoch, "x1": poses[:, 0], "x2": poses[:, 1]})
        batch["heading"] = poses[:, 2]
        batch["truth"] = elevation(poses[:, :2], extent)
        sigma = configuration["sensor"]["noise_std"]
        batch["measured"] = batch["truth"] + sigma * rng.standard_normal(len(batch))
        batch["is_outlier"] = False
        if epoch or configuration["pilot"]["outliers"]:
            batch["measured"], batch["is_outlier"] = spikes(
                batch["measured"].to_numpy(), configuration, rng
            )
        batch["score"], batch["flagged"] = np.nan, False
        samples = pd.concat([samples, batch], ignore_index=True)
        if epoch == 0:
            low, high = batch[["x1", "x2"]].min().to_numpy(), batch[["x1", "x2"]].max().to_numpy()
            centre, scale = batch["measured"].mean(), batch["measured"].std(ddof=0)
        judged = np.full(len(samples), epoch > 0)
        if detector["scope"] == "batch":
            judged &= samples["epoch"] == epoch
        if detector["name"] == "copod":
            scores, flags = copod(samples["measured"].to_numpy(), detector)
            samples.loc[judged, "score"] = scores[judged]
            samples.loc[judged, "flagged"] = flags[judged]
        elif detector["name"] == "best":
            samples.loc[judged, "flagged"] = samples.loc[judged, "is_outlier"]
        state = {
            "amplitude": 1.0 + 0.05 * epoch,
            "lengthscale_1": 0.4 + 0.02 * epoch,
            "lengthscale_2": 0.3 + 0.03 * epoch,
            "noise_std": 0.1 + 0.01 * epoch,
            "jitter": configuration["model"]["jitter"],
        }
        clean = samples[~samples["flagged"]]
        mean, std, lml = predict(
            2 * (clean[["x1", "x2"]].to_numpy() - low) / (high - low) - 1,
            (clean["measured"].to_numpy() - centre) / scale,
            2 * (query - low) / (high - low) - 1,
            state,
        )
        mean, std = centre + scale * mean, scale * std
        error = mean - truth
        flagged, outlier = samples["flagged"] & judged, samples["is_outlier"] & judged
        curve.append(
            {
                "planner": configuration["planner"]["name"],
                "detector": detector["name"],
                "scope": detector["scope"],
                "rho": configuration["rho"],
                "terrain": configuration["terrain"]["name"],
                "seed": seed,
                "epoch": epoch,
                "collected": len(samples),
                "accepted": len(clean),
                "rmse": math.sqrt(np.mean(error**2)),
                "mae": np.mean(np.abs(error)),
                "nlpd": np.mean(error**2 / std**2 + np.log(2 * math.pi * std**2)) / 2,
                "coverage95": np.mean(np.abs(error) <= 1.959964 * std),
                "tp": (flagged & outlier).sum(),
                "fp": (flagged & ~outlier).sum(),
                "fn": (judged & ~flagged & outlier).sum(),
                "tn": (judged & ~flagged & ~outlier).sum(),
                **state,
                "lml": lml,
                **{f"{part}_seconds": 0.1 for part in ("plan", "fit", "predict", "detect")},
                **further_scores(mean, std, truth, clean["measured"].to_numpy(), thirds),
                "collapsed": bool(
                    min(
                        state["lengthscale_1"] * (high[0] - low[0]) / 2,
                        state["lengthscale_2"] * (high[1] - low[1]) / 2,
                    )
                    < configuration["robot"]["speed"]
                ),
                "rate_limited": rate_limited(curve[-1], state, configuration) if curve else None,
                "path_length": sum(
                    math.dist(a, b) for a, b in pairwise(samples[["x1", "x2"]].to_numpy())
                ),
            }
        )
        left = configuration["budget"] - len(samples)
        if left == 0:
            break
        poses = np.array(drive(poses[-1], configuration, rng))[:left]
        epoch += 1
    samples.insert(0, "seed", seed)
    samples["used"] = ~samples["flagged"]
    maps = pd.DataFrame({"seed": seed, "x1": query[:, 0], "x2": query[:, 1], "truth": truth})
    maps["mean"], maps["std"] = mean, std
    flagged_x = samples.loc[samples["flagged"], ["x1", "x2"]].to_numpy()
    maps["outlier_density"] = density(flagged_x, configuration)
    return {"curves": pd.DataFrame(curve), "samples": samples, "maps": maps}


def store(
    folder: Path,
    configuration: dict[str, Any],
    tables: dict[str, pd.DataFrame],
    seed: int = SEED,
    footer: dict[str, Any] | None = None,
) -> str:
    """Write a mission in the layout of the result tables, digests and all; returns its run."""
    run = run_name(configuration)
    (folder / "runs").mkdir(parents=True, exist_ok=True)
    (folder / "runs" / f"{run}.yaml").write_text(yaml.safe_dump(configuration))
    for name, frame in tables.items():
        # Column by column: a whole frame would turn NaN into missing values.
        table = pa.table({column: pa.array(frame[column].to_numpy()) for column in frame})
        document = {
            "schema_version": 1,
            "mission": f"{run} {seed}",
            "configuration": configuration,
            "run": run,
            "seed": seed,
            "terrain": {key: configuration["terrain"][key] for key in ("name", "sha256")},
            **PROVENANCE,
            "values_sha256": values_digest(table),
            **(footer or {}),
        }
        path = table_path(folder, name, run, seed)
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table.replace_schema_metadata({"infoplan": sealed(document)}), path)
    return run


def table_path(folder: Path, name: str, run: str = RUN, seed: int = SEED) -> Path:
    """Path of one table of a mission."""
    return folder / name / f"run={run}" / f"seed={seed}.parquet"
