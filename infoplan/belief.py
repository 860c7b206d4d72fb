"""What is believed of a terrain that nobody sees, and where to go next."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.answers import (
    checked_actions,
    checked_drive,
    checked_prediction,
    checked_verdict,
    number_of,
)
from infoplan.collapse import is_rate_limited, rate_of, spacing_of
from infoplan.config import GuardedConfig, MissionConfig
from infoplan.detect import Evidence
from infoplan.errors import RunError
from infoplan.extent import Extent, query_grid
from infoplan.methods import check_covariance, find, method_label
from infoplan.obstacles import NOWHERE, Obstacles
from infoplan.plan import Situation, count_flags, smooth
from infoplan.planner_reward import deviation_and_reward
from infoplan.randomness import generator
from infoplan.robot import steering_angles, turn_on_the_spot
from infoplan.samples import Readings, joined
from infoplan.threads import one_thread

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LARGEST = 1e100
"""Largest measurement in size: its cube, which detectors sum, is still a number."""

LEAST = 3
"""Measurements without which no model can be begun."""

TURNS = 16
"""Turns on the spot that come round once."""


class Belief:
    """Model, detector, outlier matrix and planner of a mission, taught by its samples.

    Parameters
    ----------
    config
        The mission's options, valid (`infoplan.config.validate`).
    extent
        xmin, xmax, ymin, ymax of the workspace.
    seed
        Of all random streams.
    pilot
        The samples that fit the scalers and the model's first hyperparameters (Algorithm 1, lines
        2 and 3).
    obstacles
        Where the robot must not go.

    Attributes
    ----------
    readings
        All samples so far.
    epochs
        Decision epoch that collected each, 0 for the pilot, shape (n,).
    flagged, score
        The detector's last verdict on each; never judged: False and NaN. Samples without a
        measurement, NaN, are flagged at once, and neither detector nor model gets them.
    judged
        Which of them the last epoch has judged; after the pilot none, or all if they were.
    epoch
        Number of decisions whose samples are in.
    model
        As of now.
    nodes
        Query grid, row-major, shape (rows * columns, 2).
    mean, std, lml
        The model's latent prediction on it, terrain's unit, and log marginal likelihood (NaN if it
        tells none).
    rate_limited
        Whether the last epoch has moved the hyperparameters about as far as its iterations can
        (`infoplan.collapse.is_rate_limited`); None after the pilot, or where nothing tells.
    seconds
        Latest duration of each part of an epoch.

    Raises
    ------
    UsageError
        If a planner, detector or model of the user's own cannot be had, or the planner's reward
        does not go with the model.
    RunError
        If a measurement is beyond 1e100, or the model cannot take the pilot.
    """

    def __init__(
        self,
        config: MissionConfig,
        extent: Extent,
        seed: int,
        pilot: Readings,
        obstacles: Obstacles = NOWHERE,
    ):
        self.config = config
        self.obstacles = obstacles
        self.extent = extent
        self.seed = seed
        check_covariance(config)
        self._planner = find("planner", config.planner)
        self._detector = find("detector", config.detector)
        new_model = find("model", config.model)
        told = _told(pilot)
        if isinstance(config.model, GuardedConfig):
            new_model = partial(new_model, spacing=spacing_of(config, pilot.x[told]))
        self._steering = steering_angles(config.robot.max_steering, config.robot.steering_angles)
        rows, columns = config.grid
        self._shape = (rows, columns)
        self.nodes = query_grid(extent, self._shape)
        self.seconds = {"plan": 0.0, "fit": 0.0, "predict": 0.0, "detect": 0.0}
        self.epoch = 0
        self.readings = _checked_size(pilot)
        if told.sum() < min(LEAST, len(pilot)):
            raise RunError(
                f"only {told.sum()} of the {len(pilot)} pilot samples have a measurement, and the "
                f"model needs {LEAST}: make rho smaller or pilot.samples larger"
            )
        self.epochs, self.flagged, self.score = _unjudged(pilot, 0)
        self.judged = slice(0, 0)
        self.rate_limited: bool | None = None
        with self._timed("fit"):
            self.model = new_model(pilot.x[told], pilot.measured[told])
            self.model.optimize(config.model.pilot_iterations)
        if config.detector.judge_pilot:
            self._judge_pilot(partial(new_model, pilot.x[told], pilot.measured[told]))
        self._flag_counts: NDArray[Any] = count_flags(pilot.x[self.flagged], extent, self._shape)
        self.mean, self.std, self.lml = self._predict()

    @property
    def collected(self) -> int:
        """Number of samples collected so far, the pilot's included."""
        return len(self.readings)

    def plan(self) -> Floats:
        """Plan the next trajectory from where the last sample was taken (line 6).

        Returns
        -------
        ndarray, shape (n, 3)
            Poses x1, x2, heading at the samples, cut to the remaining budget.

        Raises
        ------
        RunError
            If the planner gives no plan that can be driven.
        """
        rng = generator(self.seed, "planner", self.epoch + 1)
        with self._timed("plan"):
            situation = self._situation()
            self._check_place(situation)
            actions = self._ask_planner(situation, rng)
            for _ in range(TURNS):
                if len(actions):
                    break
                situation = replace(situation, pose=turn_on_the_spot(situation.pose))
                actions = self._ask_planner(situation, rng)
            trajectory = checked_drive(situation, actions, method_label(self.config.planner))
        return trajectory[: self.config.budget - self.collected]

    def learn(self, batch: Readings) -> None:
        """Detect the outliers, drop them, and teach the model the clean data (lines 8 to 10, 5).

        Raises
        ------
        RunError
            If a measurement is beyond 1e100, the detector gives no verdict, or the model's
            prediction is none.
        """
        self.epoch += 1
        # New arrays: those of before belong to the states that were told.
        self.readings = joined(self.readings, _checked_size(batch))
        self.epochs, self.flagged, self.score = (
            np.concatenate(pair)
            for pair in zip(
                (self.epochs, self.flagged, self.score), _unjudged(batch, self.epoch), strict=True
            )
        )
        historical = self.config.detector.scope == "historical"
        self.judged = slice(0 if historical else -len(batch), None)
        with self._timed("detect"):
            self._judge()
            flags = self.readings.x[self.judged][self.flagged[self.judged]]
            counts = count_flags(flags, self.extent, self._shape)
            self._flag_counts = counts if historical else self._flag_counts + counts
        with self._timed("fit"):
            kept = ~self.flagged[self.judged]
            x, measured = self.readings.x[self.judged], self.readings.measured[self.judged]
            (self.model.replace if historical else self.model.append)(x[kept], measured[kept])
            self._optimize(len(batch))
        self.mean, self.std, self.lml = self._predict()

    def outlier_density(self) -> Floats:
        """Outlier matrix smoothed by a Gaussian (paper, Fig. 3b), shape of the query grid."""
        return smooth(self._flag_counts, self.config.planner.smoothing, self.extent)

    def _optimize(self, new: int) -> None:
        """Optimise the hyperparameters after so many new samples."""
        wanted, rate = self.config.model.iterations, rate_of(self.config.model)
        iterations = new if wanted == "per_sample" else int(wanted)
        before = None if rate is None else vars(self.model.hyperparameters)
        self.model.optimize(iterations)
        if before is not None:
            after = vars(self.model.hyperparameters)
            self.rate_limited = is_rate_limited(before, after, iterations, rate)

    def _situation(self) -> Situation:
        """Gather what the planner is given."""
        robot, readings = self.config.robot, self.readings
        std, reward = deviation_and_reward(self.config, self.model, self.nodes, self.mean, self.std)
        return Situation(
            pose=np.append(readings.x[-1], readings.heading[-1]),
            std=_locked(std.reshape(self._shape)),
            mean=_locked(self.mean.reshape(self._shape)),
            reward_map=_locked(reward.reshape(self._shape)),
            outlier_density=self.outlier_density(),
            extent=self.extent,
            speed=robot.speed,
            samples_per_action=robot.samples_per_action,
            steering=self._steering,
            visited=_locked(readings.x),
            n_pilot=int(np.sum(self.epochs == 0)),
            epoch=self.epoch + 1,
            budget=self.config.budget,
            obstacles=self.obstacles,
        )

    def _check_place(self, situation: Situation) -> None:
        """Refuse to plan from within an obstacle, which no action could leave."""
        if self.obstacles.contain(situation.pose[:2]).any():
            x, y = situation.pose[:2].tolist()
            raise RunError(
                f"the robot is at ({x:g}, {y:g}), in an obstacle of terrain.obstacles: bring it "
                "out, or make the obstacle smaller"
            )

    def _ask_planner(self, situation: Situation, rng: np.random.Generator) -> Integers:
        plan = self._planner(situation, rng)
        checked = checked_actions(plan, situation, method_label(self.config.planner))
        return checked[: self.config.planner.execute_actions]

    def _judge_pilot(self, new_model: Callable[[], Any]) -> None:
        """Ask for a verdict on the pilot, and let a new model learn from what is not flagged.

        The detector may ask the model of the whole pilot. The scalers are of the whole pilot, too.
        """
        self.judged = slice(0, None)
        with self._timed("detect"):
            self._judge()
        kept, first_fit = ~self.flagged, self.seconds["fit"]
        if kept.sum() < LEAST:
            raise RunError(
                f"{method_label(self.config.detector)} leaves {kept.sum()} of the {len(kept)} "
                f"samples of the pilot, and the model needs {LEAST}: use "
                "detector.judge_pilot=false, or another detector"
            )
        with self._timed("fit"):
            self.model = new_model()
            self.model.replace(self.readings.x[kept], self.readings.measured[kept])
            self.model.optimize(self.config.model.pilot_iterations)
        self.seconds["fit"] += first_fit

    def _judge(self) -> None:
        """Ask the detector for its verdict on the samples that are to be judged."""
        readings, label = self.readings, method_label(self.config.detector)
        told = np.flatnonzero(_told(readings))
        asked = told >= self.judged.indices(len(readings))[0]
        if not asked.any():
            return
        evidence = Evidence(
            _locked(readings.x[told]),
            _locked(readings.measured[told]),
            _locked(self.epochs[told]),
            _locked(self.flagged[told]),
            _locked(asked),
            None if readings.is_outlier is None else _locked(readings.is_outlier[told]),
        )
        rng = generator(self.seed, "detector", self.epoch)
        verdict = self._detector(evidence, self.model, rng)
        flagged, score = checked_verdict(verdict, len(told), label)
        self.flagged[told[asked]] = flagged[asked]
        self.score[told[asked]] = score[asked]

    def _predict(self) -> tuple[Floats, Floats, float]:
        """Predict the query grid (line 5)."""
        with self._timed("predict"):
            mean, std = checked_prediction(
                self.model.predict(self.nodes), len(self.nodes), method_label(self.config.model)
            )
            return mean, std, number_of(self.model, "log_marginal_likelihood")

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        start = perf_counter()
        with one_thread():
            yield
        self.seconds[part] = perf_counter() - start


def _unjudged(batch: Readings, epoch: int) -> tuple[Integers, NDArray[np.bool_], Floats]:
    """Epoch, verdict and score of samples that nobody has judged."""
    n = len(batch)
    return np.full(n, epoch), ~_told(batch), np.full(n, np.nan)


def _told(samples: Readings) -> NDArray[np.bool_]:
    """Tell which samples have a measurement, shape (n,)."""
    return ~np.isnan(samples.measured)


def _checked_size(batch: Readings) -> Readings:
    """Refuse measurements with whose size nothing can be computed."""
    if (huge := np.abs(batch.measured) > LARGEST).any():
        raise RunError(
            f"a measurement is {batch.measured[huge][0]:.3g}, beyond {LARGEST:g} in size: make "
            "sensor.noise_std, the sizes of the fault (fault.amplitude and its like) or the "
            "terrain's elevations smaller"
        )
    return batch


def _locked(array: NDArray[Any]) -> NDArray[Any]:
    """View of an array that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view
