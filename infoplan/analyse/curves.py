"""Learning curves: stored tables, and their values on a common axis of collected samples."""

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray


def load_curve(results_dir: Path, run: str, seed: int) -> pd.DataFrame:
    """Read one mission's learning curve, one row a decision epoch."""
    return pd.read_parquet(results_dir / "curves" / f"run={run}" / f"seed={seed}.parquet",
                           partitioning=None)  # fmt: skip


def value_at(curve: pd.DataFrame, samples: ArrayLike, column: str = "rmse") -> NDArray[np.float64]:
    """Value of a curve after given numbers of collected samples, linear between epochs.

    Parameters
    ----------
    curve
        One mission's rows.
    samples
        Numbers of collected samples; NaN is returned outside of the curve.
    column
        Which column.
    """
    return np.interp(samples, curve["collected"], curve[column], left=np.nan, right=np.nan)
