"""Figures of matplotlib for notebooks and programs: each function returns one, and writes nothing.

They know nothing of pyplot: none is open afterwards, and no setting has changed.
"""

from typing import TYPE_CHECKING

import numpy as np

from infoplan.analyse.later_logs import read_origins
from infoplan.analyse.stretches import demand_truth
from infoplan.analyse.tables import Selection, load_maps, load_samples
from infoplan.api import Frames
from infoplan.config import is_survey
from infoplan.draw import style
from infoplan.draw.fig5 import curves_figure, plotted_numbers
from infoplan.draw.mission_picture import mission_figure
from infoplan.draw.survey_picture import LOG, survey_figure
from infoplan.draw.terrain_map import terrain_figure
from infoplan.errors import UsageError
from infoplan.terrain import Terrain
from infoplan.wording import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_terrain(terrain: Terrain) -> "Figure":
    """Draw a terrain, hill-shaded, with the default pilot path.

    Parameters
    ----------
    terrain
        From `load_terrain`.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    UsageError
        If its elevation is not known.
    """
    if not np.isfinite(terrain.elevation).all():
        raise UsageError(f"the elevation of {terrain.name} is not known: there is nothing to draw")
    with style.journal():
        return terrain_figure(terrain)[0]


def plot_mission(frames: Frames) -> "Figure":
    """Draw a mission: track and flags on the final mean, its deviation, and how the error went.

    Parameters
    ----------
    frames
        From `fly` or `frames`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with style.journal():
        return mission_figure(frames.curves, frames.samples, frames.maps)


def plot_curves(selection: Selection, *, single_seeds: bool = False) -> "Figure":
    """Draw the error of stored runs against the number of samples, as ``infoplan figures fig5``.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_study`.
    single_seeds
        Show each seed as a thin line, too.

    Returns
    -------
    matplotlib.figure.Figure
        Mean over seeds, its pointwise 95 % t interval, a panel for each outlier share and scope.

    Raises
    ------
    UsageError
        If they are surveys, whose error nobody knows.
    RunError
        If a table cannot be read.
    """
    demand_truth(selection, "curves")
    with style.journal():
        return curves_figure(selection, plotted_numbers(selection), single_seeds=single_seeds)


def plot_survey(selection: Selection) -> "Figure":
    """Draw a stored survey: track and flags, the mean, and its deviation.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_missions`, of one run that ``infoplan survey`` has stored.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    UsageError
        If it is no survey, or several.
    RunError
        If a table cannot be read.
    """
    if not is_survey(selection.terrain):
        raise UsageError(f"missions on {selection.terrain} are no survey: draw one by plot_mission")
    if len(selection.missions) != 1:
        surveys = counted(len(selection.missions), "survey")
        raise UsageError(f"there are {surveys}, and one is drawn: choose it with run=")
    samples, maps = load_samples(selection), load_maps(selection)
    row = selection.missions.iloc[0]
    origins = read_origins(selection.results_dir, str(row["run"]), int(row["seed"]))
    if origins is not None:
        samples[LOG] = origins["log"]
    place = selection.terrain.removeprefix("survey-")
    with style.journal():
        return survey_figure(samples, maps, place, selection.unit)[0]
