"""One mission: the paper's Algorithm 1."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.answers import checked_actions, checked_drive, checked_prediction, checked_verdict
from infoplan.config import MissionConfig
from infoplan.culprit import culprit_named
from infoplan.detect import Evidence, Judgement
from infoplan.errors import RunError
from infoplan.methods import find, method_label
from infoplan.plan import Situation, count_flags, smooth
from infoplan.randomness import generator
from infoplan.robot import bezier_path, steering_angles, turn_on_the_spot
from infoplan.sensing import add_spikes, measure
from infoplan.study.limits import check_mission
from infoplan.terrain import Terrain
from infoplan.threads import one_thread

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Integers = NDArray[np.int64]

LARGEST = 1e100
"""Largest measurement in size: its cube, which detectors sum, is still a number."""

TURNS = 16
"""Turns on the spot that come round once."""


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
    units, elevations in the terrain's. What the model has not (one of the user's) is NaN.
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

    Raises
    ------
    UsageError
        If a planner, detector or model of the user's own cannot be had, or the mission needs more
        memory than the machine has.
    """

    def __init__(self, config: MissionConfig, terrain: Terrain, seed: int):
        check_mission(config)
        self.config = config
        self.terrain = terrain
        self.seed = seed
        self.planner = find("planner", config.planner)
        self.detector = find("detector", config.detector)
        self.new_model = find("model", config.model)
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
        """Fly the mission (Algorithm 1), yielding a row after the pilot and after each epoch.

        Raises
        ------
        RunError
            If a planner, detector or model fails, or gives what it should not.
        """
        with culprit_named(self.config, "on the pilot samples"):
            self.start(self.sample(self.pilot_path()))  # lines 1 to 3
            row = self.evaluate()  # line 5
        yield row
        while self.collected < self.config.budget:  # line 4
            with culprit_named(self.config, f"in epoch {self.epoch + 1}"):
                trajectory = self.plan()  # line 6
                batch = self.sample(trajectory)  # line 7
                self.observe(batch)  # lines 8 to 10
                row = self.evaluate()  # line 5 of the next epoch
            yield row

    @property
    def collected(self) -> int:
        """Number of samples collected so far, the pilot's included."""
        return len(self.samples)

    def pilot_path(self) -> Floats:
        """Poses along the Bezier curve that circles the workspace, shape (n, 3)."""
        pilot = self.config.pilot
        return bezier_path(np.array(pilot.control_points), self.terrain.extent, pilot.samples)

    def start(self, pilot: Samples) -> None:
        """Fit the scalers and the model's hyperparameters to the pilot samples (lines 2 and 3).

        Raises
        ------
        RunError
            If a measurement is beyond 1e100, or the model cannot take the pilot.
        """
        self.samples = _checked_size(pilot)
        self.pose = np.append(pilot.x[-1], pilot.heading[-1])
        with self._timed("fit"):
            self.model = self.new_model(pilot.x.copy(), pilot.measured.copy())
            self.model.optimize(self.config.model.pilot_iterations)

    def plan(self) -> Floats:
        """Plan the next trajectory from the current pose (line 6).

        Returns
        -------
        ndarray, shape (n, 3)
            Poses x1, x2, heading at the samples, cut to the remaining budget.
        """
        self.epoch += 1
        rng = generator(self.seed, "planner", self.epoch)
        with self._timed("plan"):
            situation = self.situation()
            actions = self._ask_planner(situation, rng)
            for _ in range(TURNS):
                if len(actions):
                    break
                situation = replace(situation, pose=turn_on_the_spot(situation.pose))
                actions = self._ask_planner(situation, rng)
            trajectory = checked_drive(situation, actions, method_label(self.config.planner))
        return trajectory[: self.config.budget - self.collected]

    def _ask_planner(self, situation: Situation, rng: np.random.Generator) -> Integers:
        plan = self.planner(situation, rng)
        checked = checked_actions(plan, situation, method_label(self.config.planner))
        return checked[: self.config.planner.execute_actions]

    def situation(self) -> Situation:
        """Gather what the planner is given."""
        robot = self.config.robot
        return Situation(
            pose=self.pose.copy(),
            std=_locked(self.std.reshape(self.shape)),
            outlier_density=self.outlier_density(),
            extent=self.terrain.extent,
            speed=robot.speed,
            samples_per_action=robot.samples_per_action,
            steering=self.steering,
            visited=_locked(self.samples.x),
            n_pilot=int(np.sum(self.samples.epoch == 0)),
            epoch=self.epoch,
            budget=self.config.budget,
        )

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
        """Detect the outliers, drop them, and teach the model the clean data (lines 8 to 10).

        Raises
        ------
        RunError
            If a measurement is beyond 1e100, or the detector gives no verdict.
        """
        self.samples = self.samples.joined(_checked_size(batch))
        self.pose = np.append(batch.x[-1], batch.heading[-1])
        historical = self.config.detector.scope == "historical"
        judged = slice(0 if historical else -len(batch), None)
        with self._timed("detect"):
            flagged, score = self.judge(judged)
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

    def judge(self, judged: slice) -> Judgement:
        """Ask the detector for its verdict on some of the samples."""
        samples = self.samples
        asked = np.zeros(len(samples), dtype=bool)
        asked[judged] = True
        evidence = Evidence(
            *(
                _locked(part)
                for part in (samples.x, samples.measured, samples.epoch, samples.flagged, asked,
                             samples.is_outlier)
            )
        )  # fmt: skip
        verdict = self.detector(evidence, self.model, generator(self.seed, "detector", self.epoch))
        return checked_verdict(verdict, len(samples), method_label(self.config.detector))

    def evaluate(self) -> CurveRow:
        """Predict the query grid (line 5) and score the prediction against the truth.

        Raises
        ------
        RunError
            If the model's prediction is none, or so far off that its errors overflow.
        """
        with self._timed("predict"):
            prediction = self.model.predict(self.grid)
            self.mean, self.latent_std = checked_prediction(
                prediction, len(self.grid), method_label(self.config.model)
            )
            lml = _number(self.model, "log_marginal_likelihood")
        learned = getattr(self.model, "hyperparameters", None)
        errors = self._errors()
        return CurveRow(
            epoch=self.epoch,
            collected=self.collected,
            accepted=int(np.sum(~self.samples.flagged)),
            **errors,
            **self.confusion,
            amplitude=_number(learned, "amplitude"),
            lengthscale_1=_number(learned, "lengthscale_1"),
            lengthscale_2=_number(learned, "lengthscale_2"),
            noise_std=_number(learned, "noise_std"),
            jitter=_number(self.model, "jitter"),
            lml=lml,
            plan_seconds=self.seconds["plan"],
            fit_seconds=self.seconds["fit"],
            predict_seconds=self.seconds["predict"],
            detect_seconds=self.seconds["detect"],
        )

    def _errors(self) -> dict[str, Any]:
        """Compare the prediction with the truth.

        Raises
        ------
        RunError
            If a square overflows: such a prediction is no result.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            error = self.mean - self.grid_truth
            standardised = error / self.latent_std
            log_density = -0.5 * standardised**2 - np.log(self.latent_std) - 0.5 * np.log(2 * np.pi)
            inside = np.where(np.isnan(error), np.nan, np.abs(standardised) <= 1.959964)
            errors = {
                "rmse": float(np.sqrt(np.mean(error**2))),
                "mae": float(np.mean(np.abs(error))),
                "nlpd": float(-np.mean(log_density)),
                "coverage95": float(np.mean(inside)),
            }
        if overflown := [name for name, value in errors.items() if np.isinf(value)]:
            raise RunError(
                f"the {overflown[0]} of the model {method_label(self.config.model)} overflows: it "
                f"predicts {self.mean.min():.3g} to {self.mean.max():.3g} with deviations from "
                f"{self.latent_std.min():.3g}, where the terrain has {self.grid_truth.min():.3g} "
                f"to {self.grid_truth.max():.3g}; look at its data and its numerical precision"
            )
        return errors

    @property
    def std(self) -> Floats:
        """Standard deviation on the query grid that rewards the planner."""
        if not getattr(self.config.planner, "noisy_std", False):
            return self.latent_std
        noise = _number(self.model, "observation_noise_std")
        if np.isnan(noise):
            raise RunError(
                "planner.noisy_std=true needs a model with observation_noise_std, which "
                f"{method_label(self.config.model)} has not: leave planner.noisy_std=false"
            )
        return np.hypot(self.latent_std, noise)

    def outlier_density(self) -> Floats:
        """Outlier matrix smoothed by a Gaussian (paper, Fig. 3b), shape of the query grid."""
        return smooth(self.outlier_counts, self.config.planner.smoothing, self.terrain.extent)

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        start = perf_counter()
        with one_thread():
            yield
        self.seconds[part] = perf_counter() - start


def _number(owner: Any, name: str) -> float:
    """Return a number that a model tells of itself; NaN if it does not."""
    return float(getattr(owner, name, np.nan))


def _checked_size(batch: Samples) -> Samples:
    """Refuse measurements with whose size nothing can be computed."""
    if not np.all(np.abs(batch.measured) <= LARGEST):
        worst = batch.measured[np.argmax(~(np.abs(batch.measured) <= LARGEST))]
        raise RunError(
            f"a measurement is {worst:.3g}, beyond {LARGEST:g} in size: make sensor.noise_std, "
            "outliers.amplitude or the terrain's elevations smaller"
        )
    return batch


def _locked(array: NDArray[Any]) -> NDArray[Any]:
    """View of an array that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def count_confusion(judged: Samples) -> dict[str, int]:
    """Count true and false positives and negatives of the detector; positive means outlier."""
    flagged, outlier = judged.flagged, judged.is_outlier
    return {
        "tp": int(np.sum(flagged & outlier)),
        "fp": int(np.sum(flagged & ~outlier)),
        "fn": int(np.sum(~flagged & outlier)),
        "tn": int(np.sum(~flagged & ~outlier)),
    }
