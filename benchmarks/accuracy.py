"""How near the process of nearest neighbours comes to the exact one, on stored missions.

``python -m benchmarks.accuracy RESULTS [PART]`` takes the final hyperparameters and samples of
one mission of each method that was flown with ``model=gp``, prints a table in Markdown, and draws
``docs/vecchia.png``. Where there are several shares of outliers PART chooses by the runs' names,
``-rho0.1-batch-`` say.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from infoplan.backend import load_matplotlib
from infoplan.model.inference.exact import ExactInference
from infoplan.model.inference.vecchia import VecchiaInference
from infoplan.model.kernels import as_kernel
from infoplan.model.scaling import Scaler
from infoplan.threads import one_thread

NEIGHBOURS = (10, 20, 30, 60, 120)
PREDICTION_NEIGHBOURS = (40, 80, 160, 320)
FIGURE = Path(__file__).parents[1] / "docs" / "vecchia.png"


@dataclass(frozen=True)
class Errors:
    """Differences from the exact process of one setting on one mission.

    Attributes
    ----------
    method
        Planner and detector.
    neighbours
        Of the likelihood, or of the prediction.
    likelihood, slope
        In nats, and of the gradient by the logarithms the largest difference in size.
    mean, deviation
        Root mean square over the query grid: of the mean in the terrain's unit, and of the
        deviation relative to the exact one; NaN for a likelihood.
    """

    method: str
    neighbours: int
    likelihood: float = np.nan
    slope: float = np.nan
    mean: float = np.nan
    deviation: float = np.nan


def compare(folder: Path, run: str, seed: int) -> Iterator[Errors]:
    """Compare the processes at the end of one mission."""
    curves, samples, maps = (
        pd.read_parquet(folder / table / f"run={run}" / f"seed={seed}.parquet", partitioning=None)
        for table in ("curves", "samples", "maps")
    )
    pilot, used = (samples["epoch"] == 0).to_numpy(), samples["used"].to_numpy()
    positions, measured = samples[["x1", "x2"]].to_numpy(), samples["measured"].to_numpy()
    scaler = Scaler.of_pilot(positions[pilot], measured[pilot])
    x, y = scaler.inputs(positions[used]), scaler.outputs(measured[used])
    grid = scaler.inputs(maps[["x1", "x2"]].to_numpy())
    row = curves.iloc[-1]
    values = [row["amplitude"], row["lengthscale_1"], row["lengthscale_2"], row["noise_std"] ** 2]
    theta, kernel = np.log(values), as_kernel("squared_exponential")
    exact = ExactInference(kernel, row["jitter"])
    exact.set_data(x, y)
    mean, variance = exact.predict(theta, grid)
    value, gradient = exact.lml_and_gradient(theta)
    method = run.split("-helens-")[0].upper()

    def near(neighbours: int, prediction_neighbours: int) -> VecchiaInference:
        inference = VecchiaInference(
            kernel, row["jitter"], neighbours=neighbours, block=7, ordering="collected",
            prediction_neighbours=prediction_neighbours,
        )  # fmt: skip
        # As a mission has it: the samples of each epoch make blocks of their own.
        for epoch in np.unique(samples["epoch"][used]):
            there = samples["epoch"][used].to_numpy() <= epoch
            inference.set_data(x[:, there], y[there])
        return inference

    for count in NEIGHBOURS:
        found, slope = near(count, 1).lml_and_gradient(theta)
        yield Errors(method, count, likelihood=found - value, slope=np.abs(slope - gradient).max())
    for count in PREDICTION_NEIGHBOURS:
        means, variances = near(1, count).predict(theta, grid)
        yield Errors(
            method, count,
            mean=scaler.y_std * float(np.sqrt(np.mean((means - mean) ** 2))),
            deviation=float(np.sqrt(np.mean((np.sqrt(variances / variance) - 1.0) ** 2))),
        )  # fmt: skip


def table(errors: list[Errors]) -> str:
    """Write the errors as tables in Markdown, a row a method."""
    methods = list(dict.fromkeys(error.method for error in errors))

    def cells(method: str, name: str, form: str) -> list[str]:
        found = [e for e in errors if e.method == method and np.isfinite(getattr(e, name))]
        return [format(getattr(error, name), form) for error in found]

    lines = []
    for name, form, counts in (
        ("likelihood", "+.2f", NEIGHBOURS), ("slope", ".1f", NEIGHBOURS),
        ("mean", ".2f", PREDICTION_NEIGHBOURS), ("deviation", ".2%", PREDICTION_NEIGHBOURS),
    ):  # fmt: skip
        lines += [
            f"| {name} | " + " | ".join(map(str, counts)) + " |",
            "|---" * (1 + len(counts)) + "|",
        ]
        lines += [f"| {m} | " + " | ".join(cells(m, name, form)) + " |" for m in methods] + [""]
    return "\n".join(lines)


def draw(errors: list[Errors]) -> None:
    """Draw the errors against the number of neighbours."""
    load_matplotlib()
    from matplotlib.figure import Figure

    from infoplan.draw import style
    from infoplan.method_identity import looks

    with style.journal():
        figure = Figure(figsize=(7.2, 2.6), layout="constrained")
        axes = figure.subplots(1, 3)
        for (name, title), panel in zip(
            [("likelihood", "log likelihood (nats)"), ("mean", "mean (ft)"),
             ("deviation", "deviation (relative)")], axes, strict=True,
        ):  # fmt: skip
            chosen = [error for error in errors if np.isfinite(getattr(error, name))]
            for method, look in looks(error.method for error in chosen).items():
                of_it = [error for error in chosen if error.method == method]
                panel.plot(
                    [error.neighbours for error in of_it],
                    [max(abs(getattr(error, name)), 1e-6) for error in of_it],
                    color=look.colour, marker="o", ms=3, label=method,
                    dashes=look.dashes or (None, None),
                )  # fmt: skip
            panel.set(xscale="log", yscale="log", xlabel="neighbours")
            panel.set_title(f"error of the {title}", loc="left")
            counts = sorted({error.neighbours for error in chosen})
            panel.set_xticks(counts, [str(count) for count in counts])
            panel.minorticks_off()
        axes[0].legend()
        figure.savefig(FIGURE, dpi=160)


def main(results: str, part: str = "-batch-") -> None:
    """Compare, print, and draw."""
    folder, errors = Path(results), []
    for run in sorted(path.name.removeprefix("run=") for path in (folder / "curves").iterdir()):
        if "-vecchia-" not in run and part in run:
            with one_thread():
                errors += list(compare(folder, run, 0))
    print(table(errors))
    draw(errors)


if __name__ == "__main__":
    main(*sys.argv[1:])
