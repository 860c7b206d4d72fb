"""How often the truth lies where the model's intervals say."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from infoplan.analyse.curves import missions
from infoplan.analyse.tables import Selection, load_maps

LEVELS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)


def calibration_curve(selection: Selection, levels: Sequence[float] = LEVELS) -> pd.DataFrame:
    """Calibration curve of each mission's final model.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_missions`.
    levels
        Probabilities of central intervals of the latent mean and standard deviation.

    Returns
    -------
    DataFrame
        A row a mission and level: ``run``, ``seed``, ``level``, and ``covered``, the share of the
        query grid's nodes whose truth lies within; equal to the level if the model is calibrated,
        NaN where the truth is not known.
    """
    from scipy.stats import norm

    rows = []
    for (run, seed), maps in missions(load_maps(selection)):
        away = np.abs(maps["truth"] - maps["mean"]) / maps["std"]
        for level in levels:
            inside = (away <= norm.ppf(0.5 + level / 2)).where(away.notna())
            rows.append({"run": run, "seed": seed, "level": level, "covered": inside.mean()})
    return pd.DataFrame(rows)
