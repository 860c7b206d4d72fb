"""Why a perfect filter can hurt: UCT-BEST's samples with the hyperparameters of UCT-NONE.

``python -m benchmarks.swapped_hyperparameters RESULTS`` takes the stored missions of the
multiverse, and the ``multiverse.parquet`` that ``infoplan multiverse`` has made of them. For each
joint universe in which UCT-BEST ends above UCT-NONE by more than the margin at rho 0.10 it prints a
row of a Markdown table, means over seeds of the final RMSE: UCT-BEST as it ended; UCT-BEST's
samples with its own last hyperparameters and with UCT-NONE's, by the exact process; UCT-NONE as it
ended; how far UCT-BEST, and its samples with those of UCT-NONE, end above that, with 95 % t
intervals; and the lengthscales of both. Where those of UCT-NONE bring the samples near UCT-NONE's
end the hyperparameters make the difference, not the places.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from infoplan.analyse.judging import USUAL
from infoplan.analyse.multiverse import errors_by_universe
from infoplan.analyse.statistics import mean_interval
from infoplan.analyse.tables import find_missions, study_of
from infoplan.analyse.universe_numbers import OPTIONS, read, universes_of_runs
from infoplan.errors import RunError, UsageError
from infoplan.model import GaussianProcess
from infoplan.wording import figure, interval

RHO = 0.1


def by_swapping(folder: Path, best: str, none: str, seed: int) -> tuple[float, ...]:
    """Give the numbers of one seed.

    Returns
    -------
    tuple
        Final RMSE of BEST, of its samples with its own hyperparameters and with NONE's, of NONE;
        geometric means of the two lengthscales of BEST and NONE, in half the pilot's box.
    """
    samples, maps, ends, others = (
        pd.read_parquet(folder / table / f"run={run}" / f"seed={seed}.parquet", partitioning=None)
        for table, run in (("samples", best), ("maps", best), ("curves", best), ("curves", none))
    )
    x, y = samples[["x1", "x2"]].to_numpy(), samples["measured"].to_numpy()
    pilot, used = (samples["epoch"] == 0).to_numpy(), samples["used"].to_numpy()
    model = GaussianProcess(x[pilot], y[pilot])
    model.replace(x[used], y[used])
    rows, errors = (ends.iloc[-1], others.iloc[-1]), []
    for row in rows:
        model.recall({name: float(row[name]) for name in vars(model.hyperparameters)})
        mean, _ = model.predict(maps[["x1", "x2"]].to_numpy())
        errors.append(float(np.sqrt(np.mean((mean - maps["truth"].to_numpy()) ** 2))))
    lengthscales = [float(np.sqrt(row["lengthscale_1"] * row["lengthscale_2"])) for row in rows]
    return float(rows[0]["rmse"]), *errors, float(rows[1]["rmse"]), *lengthscales


def main() -> None:
    """Print the table, or say what is wrong with the folder."""
    try:
        print_table()
    except (UsageError, RunError) as error:
        sys.exit(str(error))


def print_table() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.swapped_hyperparameters")
    parser.add_argument("results", type=Path, help="folder of a flown multiverse")
    folder = parser.parse_args().results
    multiverse = read(folder / "multiverse.parquet")
    ends = errors_by_universe(multiverse, RHO)
    worse = ends["UCT-BEST"] - ends["UCT-NONE"] > USUAL.margin * multiverse.deviation
    joint = [one.name for one in multiverse.universes if one.is_joint and worse[one.name]]
    selection = study_of(find_missions(folder, rho=RHO), free=OPTIONS)
    belongs = universes_of_runs(selection)
    missions = selection.missions[selection.missions["run"].isin(belongs)]
    of_run = missions.drop_duplicates("run").set_index("run")["method"]
    print(
        "| universe | UCT-BEST | its samples, its own | its samples, UCT-NONE's | UCT-NONE | "
        "UCT-BEST above it | with UCT-NONE's above it | lengthscale of UCT-BEST | of UCT-NONE |"
    )
    print("|---|---:|---:|---:|---:|---:|---:|---:|---:|")
    for name in joint:
        best, none = (
            next(run for run, universes in belongs.items()
                 if name in universes and of_run[run] == method)
            for method in ("UCT-BEST", "UCT-NONE")
        )  # fmt: skip
        seeds = missions.loc[missions["run"] == best, "seed"]
        found = np.array([by_swapping(folder, best, none, seed) for seed in seeds])
        above = [mean_interval(found[:, column] - found[:, 3]) for column in (0, 2)]
        told = [interval(one.mean, one.low, one.high) for one in above]
        means = [figure(value) for value in found.mean(axis=0)]
        cells = [*means[:4], *told, *means[4:]]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
