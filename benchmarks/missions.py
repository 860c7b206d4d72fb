"""Missions to time: configurations, flights, their floor, and replays of the data of one."""

from dataclasses import dataclass, replace
from typing import Any
from unittest.mock import patch

import numpy as np

import infoplan.model.gp
from benchmarks.measure import Seconds, timed
from infoplan.config import METHODS, MissionConfig
from infoplan.mission import explore
from infoplan.model import GaussianProcess
from infoplan.model.inference.exact import ExactInference
from infoplan.samples import Samples
from infoplan.scoring import CurveRow
from infoplan.simulator import Simulator
from infoplan.terrain import Terrain, find_helens, load_terrain


def terrain() -> Terrain:
    """Return the paper's map where it is on this machine, else the built-in one."""
    return load_terrain("helens" if find_helens() else "volcano")


def configuration(
    planner: str = "puct",
    detector: str = "copod",
    *,
    budget: int = 2000,
    grid: tuple[int, int] = (50, 50),
    name: str = "gp",
    **model: Any,
) -> MissionConfig:
    """Return the default configuration with some options changed, those of the model by name."""
    return MissionConfig(
        planner=METHODS["planner"][planner],
        detector=METHODS["detector"][detector],
        model=replace(METHODS["model"][name], **model),
        budget=budget,
        grid=list(grid),
    )


@dataclass
class Flight:
    """A flown mission, its rows and how long it took, without start-up."""

    samples: Samples
    rows: list[CurveRow]
    seconds: Seconds


def fly(config: MissionConfig, seed: int = 0) -> Flight:
    """Fly a mission from its pilot to its budget."""
    simulator = Simulator(config, terrain(), seed)
    rows = []
    with timed() as spent:
        for state in explore(config, simulator, seed):
            rows.append(state.row)
    return Flight(state.samples, rows, spent)


def floor_operations(config: MissionConfig, accepted: list[int]) -> float:
    """Arithmetic of a mission with these numbers of data after the pilot and after each epoch.

    An iteration is a Cholesky factor and an inverse, N^3; a prediction on M nodes is a factor of
    the last hyperparameters and a triangular solve, N^3 / 3 + N^2 M.
    """
    n, nodes = np.array(accepted, dtype=float), float(np.prod(config.grid))
    fits = config.model.iterations * np.sum(n[1:] ** 3)
    return float(fits + np.sum(n**2 * nodes + n**3 / 3.0))


def stages(flight: Flight) -> dict[str, float]:
    """Wall seconds of each part of a mission."""
    parts = {
        part: sum(getattr(row, f"{part}_seconds") for row in flight.rows)
        for part in ("plan", "fit", "predict", "detect")
    }
    return {**parts, "other": flight.seconds.wall - sum(parts.values())}


Batch = tuple[np.ndarray, np.ndarray]


def accepted_batches(samples: Samples) -> list[Batch]:
    """Return the data that the model was given, epoch by epoch, the pilot first."""
    chosen = [(samples.epoch == epoch) & ~samples.flagged for epoch in range(samples.epoch[-1] + 1)]
    return [(samples.x[take], samples.measured[take]) for take in chosen]


@dataclass
class Replay:
    """A model taught the same data again: likelihood after each epoch, evaluations, time.

    The likelihoods are those of the hyperparameters reached, in double precision.
    """

    likelihood: list[float]
    evaluations: list[int]
    seconds: Seconds


class CountingInference(ExactInference):
    """Counts the evaluations of likelihood and gradient."""

    evaluations = 0

    def lml_and_gradient(self, theta: np.ndarray) -> tuple[float, np.ndarray]:
        """Count and evaluate."""
        self.evaluations += 1
        return super().lml_and_gradient(theta)


def replay(batches: list[Batch], iterations: int, pilot_iterations: int, **model: Any) -> Replay:
    """Teach a model the batches of a mission with some optimiser."""
    result = Replay([], [], Seconds(0.0, 0.0))
    with patch.object(infoplan.model.gp, "ExactInference", CountingInference):
        gp = GaussianProcess(*batches[0], **model)
    counted = gp._inference
    assert isinstance(counted, CountingInference)
    for epoch, batch in enumerate(batches):
        with timed() as spent:
            if epoch:
                gp.append(*batch)
            gp.optimize(iterations if epoch else pilot_iterations)
        result.seconds.wall += spent.wall
        result.seconds.cpu += spent.cpu
        result.evaluations.append(counted.evaluations)
        counted.evaluations = 0
        result.likelihood.append(_double_precision_likelihood(gp))
    return result


def _double_precision_likelihood(gp: GaussianProcess) -> float:
    inference = ExactInference(gp._kernel, 1e-6)
    inference.set_data(gp._inference._x, gp._inference._y)
    return inference.lml(gp._theta)
