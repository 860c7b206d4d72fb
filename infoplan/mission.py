"""One mission: the paper's Algorithm 1."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.config import MissionConfig
from infoplan.detect import DETECTORS
from infoplan.model import GaussianProcess
from infoplan.plan import count_flags, most_visited_actions, normalise, search, smooth
from infoplan.randomness import generator
from infoplan.robot import bezier_path, drive, steering_angles, turn_on_the_spot
from infoplan.sensing import add_spikes, measure
from infoplan.terrain import Terrain

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


@dataclass
class Samples:
    """Samples in order of collection; every array has one entry a sample.

    Attributes
    ----------
    epoch
        Decision epoch that collected it, 0 for the pilot.
    x
        Location, shape (n, 2), workspace units.
    heading
        After the turn, radians in [0, 2 pi).
    truth, measured
        Elevation, and what the sensor said, terrain's unit.
    is_outlier
        True label: a spike was added.
    flagged, score
        The detector's last judgement; never judged: False and NaN.
    """

    epoch: NDArray[np.int64]
    x: Floats
    heading: Floats
    truth: Floats
    measured: Floats
    is_outlier: Booleans
    flagged: Booleans
    score: Floats

    def __len__(self) -> int:
        return len(self.epoch)

    def __getitem__(self, chosen: slice | Booleans) -> "Samples":
        return Samples(*(getattr(self, item.name)[chosen] for item in fields(self)))

    def joined(self, other: "Samples") -> "Samples":
        """Return these samples followed by others."""
        return Samples(
            *(
                np.concatenate([getattr(self, item.name), getattr(other, item.name)])
                for item in fields(self)
            )
        )


@dataclass(frozen=True)
class CurveRow:
    """The state of a mission after an epoch: a row of its learning curve.

    Errors and scores compare the noise-free truth on the query grid with the model's latent mean
    and standard deviation, and are NaN where the terrain is unknown; hyperparameters are in scaled
    units, elevations in the terrain's.
    """

    epoch: int
    collected: int
    accepted: int
    rmse: float
    mae: float
    nlpd: float
    coverage95: float
    tp: int
    fp: int
    fn: int
    tn: int
    amplitude: float
    lengthscale_1: float
    lengthscale_2: float
    noise_std: float
    jitter: float
    lml: float
    plan_seconds: float
    fit_seconds: float
    predict_seconds: float
    detect_seconds: float


class Mission:
    """A robot that samples a terrain under a budget while spikes corrupt its sensor.

    Parameters
    ----------
    config
        The mission's options, valid (`infoplan.config.validate`).
    terrain
        The ground truth.
    seed
        Seed of all random streams.
    """

    def __init__(self, config: MissionConfig, terrain: Terrain, seed: int):
        self.config = config
        self.terrain = terrain
        self.seed = seed
        self.steering = steering_angles(config.robot.max_steering, config.robot.steering_angles)
        rows, columns = config.grid
        self.shape = (rows, columns)
        self.grid = terrain.query_grid(self.shape)
        self.grid_truth = terrain.elevation_at(self.grid[:, 0], self.grid[:, 1])
        self.sensor_rng = generator(seed, "sensor")
        self.outlier_counts: NDArray[Any] = np.zeros(self.shape)
        self.epoch = 0
        self.confusion = {"tp": 0, "fp": 0, "fn": 0, "tn": 0}
        self.seconds = {"plan": 0.0, "fit": 0.0, "predict": 0.0, "detect": 0.0}

    def run(self) -> Iterator[CurveRow]:
        """Fly the mission (Algorithm 1), yielding a row after the pilot and after each epoch."""
        self.start(self.sample(self.pilot_path()))  # lines 1 to 3
        yield self.evaluate()  # line 5
        while self.collected < self.config.budget:  # line 4
            trajectory = self.plan()  # line 6
            batch = self.sample(trajectory)  # line 7
            self.observe(batch)  # lines 8 to 10
            yield self.evaluate()  # line 5 of the next epoch

    @property
    def collected(self) -> int:
        """Number of samples collected so far, the pilot's included."""
        return len(self.samples)

    def pilot_path(self) -> Floats:
        """Poses along the Bezier curve that circles the workspace, shape (n, 3)."""
        pilot = self.config.pilot
        return bezier_path(np.array(pilot.control_points), self.terrain.extent, pilot.samples)

    def start(self, pilot: Samples) -> None:
        """Fit the scalers and the model's hyperparameters to the pilot samples (lines 2 and 3)."""
        self.samples = pilot
        self.pose = np.append(pilot.x[-1], pilot.heading[-1])
        model = self.config.model
        with self._timed("fit"):
            self.model = GaussianProcess(
                pilot.x,
                pilot.measured,
                amplitude=model.amplitude,
                lengthscale=model.lengthscale,
                noise_variance=model.noise_variance,
                min_noise_variance=model.min_noise_variance,
                jitter=model.jitter,
                optimizer=model.optimizer,
                learning_rate=model.learning_rate,
                dtype=model.dtype,
            )
            self.model.optimize(model.pilot_iterations)

    def plan(self) -> Floats:
        """Plan the next trajectory by tree search from the current pose (line 6).

        Returns
        -------
        ndarray, shape (n, 3)
            Poses x1, x2, heading at the samples, cut to the remaining budget.
        """
        self.epoch += 1
        planner, robot = self.config.planner, self.config.robot
        rng = generator(self.seed, "planner", self.epoch)
        pose = self.pose
        with self._timed("plan"):
            rewards = [normalise(self.std.reshape(self.shape))]
            if planner.name == "puct":
                rewards.append(normalise(self.outlier_density()))
            actions = np.empty(0, dtype=np.int64)
            while len(actions) == 0:
                tree = search(
                    pose,
                    np.stack(rewards),
                    self.terrain.extent,
                    speed=robot.speed,
                    samples_per_action=robot.samples_per_action,
                    steering=self.steering,
                    iterations=planner.iterations,
                    rollouts=planner.rollouts,
                    exploration=planner.exploration,
                    pareto=planner.name == "puct",
                    rng=rng,
                )
                actions = most_visited_actions(tree, rng)
                if len(actions) == 0:
                    pose = turn_on_the_spot(pose)
            trajectory = drive(
                pose,
                actions[: planner.execute_actions],
                self.steering,
                robot.speed,
                robot.samples_per_action,
            )
        return trajectory[: self.config.budget - self.collected]

    def sample(self, trajectory: Floats) -> Samples:
        """Sense the terrain along a trajectory, spikes included (line 7)."""
        x, n = trajectory[:, :2], len(trajectory)
        truth = self.terrain.elevation_at(x[:, 0], x[:, 1])
        sensor_rng = self.sensor_rng if self.epoch else generator(self.seed, "pilot")
        measured = measure(truth, self.config.sensor.noise_std, sensor_rng)
        is_outlier = np.zeros(n, dtype=bool)
        if self.epoch or self.config.pilot.outliers:
            outliers = self.config.outliers
            measured, is_outlier = add_spikes(
                measured,
                self.config.rho,
                generator(self.seed, "spikes", self.epoch),
                count=outliers.count,
                amplitude=outliers.amplitude,
                quantiles=outliers.quantiles,
            )
        return Samples(
            epoch=np.full(n, self.epoch),
            x=x,
            heading=trajectory[:, 2],
            truth=truth,
            measured=measured,
            is_outlier=is_outlier,
            flagged=np.zeros(n, dtype=bool),
            score=np.full(n, np.nan),
        )

    def observe(self, batch: Samples) -> None:
        """Detect the outliers, drop them, and teach the model the clean data (lines 8 to 10)."""
        self.samples = self.samples.joined(batch)
        self.pose = np.append(batch.x[-1], batch.heading[-1])
        historical = self.config.detector.scope == "historical"
        judged = slice(0 if historical else -len(batch), None)
        with self._timed("detect"):
            options = asdict(self.config.detector)
            detector = DETECTORS[options.pop("name")]
            del options["scope"]
            flagged, score = detector(
                self.samples.x, self.samples.measured, self.samples.is_outlier, **options
            )
            self.samples.flagged[judged] = flagged[judged]
            self.samples.score[judged] = score[judged]
            subject = self.samples[judged]
            counts = count_flags(subject.x[subject.flagged], self.terrain.extent, self.shape)
            self.outlier_counts = counts if historical else self.outlier_counts + counts
            self.confusion = count_confusion(subject)
        with self._timed("fit"):
            clean = subject[~subject.flagged]
            (self.model.replace if historical else self.model.append)(clean.x, clean.measured)
            per_sample = self.config.model.iterations == "per_sample"
            self.model.optimize(len(batch) if per_sample else int(self.config.model.iterations))

    def evaluate(self) -> CurveRow:
        """Predict the query grid (line 5) and score the prediction against the truth."""
        with self._timed("predict"):
            self.mean, self.latent_std = self.model.predict(self.grid)
            lml = self.model.log_marginal_likelihood
        error = self.mean - self.grid_truth
        standardised = error / self.latent_std
        log_density = -0.5 * standardised**2 - np.log(self.latent_std) - 0.5 * np.log(2 * np.pi)
        inside = np.where(np.isnan(error), np.nan, np.abs(standardised) <= 1.959964)
        return CurveRow(
            epoch=self.epoch,
            collected=self.collected,
            accepted=self.model.n_data,
            rmse=float(np.sqrt(np.mean(error**2))),
            mae=float(np.mean(np.abs(error))),
            nlpd=float(-np.mean(log_density)),
            coverage95=float(np.mean(inside)),
            **self.confusion,
            **asdict(self.model.hyperparameters),
            jitter=self.model.jitter,
            lml=lml,
            plan_seconds=self.seconds["plan"],
            fit_seconds=self.seconds["fit"],
            predict_seconds=self.seconds["predict"],
            detect_seconds=self.seconds["detect"],
        )

    @property
    def std(self) -> Floats:
        """Standard deviation on the query grid that rewards the planner."""
        if not self.config.planner.noisy_std:
            return self.latent_std
        return np.hypot(self.latent_std, self.model.observation_noise_std)

    def outlier_density(self) -> Floats:
        """Outlier matrix smoothed by a Gaussian (paper, Fig. 3b), shape of the query grid."""
        return smooth(self.outlier_counts, self.config.planner.smoothing, self.terrain.extent)

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        start = perf_counter()
        yield
        self.seconds[part] = perf_counter() - start


def count_confusion(judged: Samples) -> dict[str, int]:
    """Count true and false positives and negatives of the detector; positive means outlier."""
    flagged, outlier = judged.flagged, judged.is_outlier
    return {
        "tp": int(np.sum(flagged & outlier)),
        "fp": int(np.sum(flagged & ~outlier)),
        "fn": int(np.sum(~flagged & outlier)),
        "tn": int(np.sum(~flagged & ~outlier)),
    }
