"""Informative planning in the presence of outliers: a config-driven experiment runner.

In a notebook or a program of your own:

>>> import infoplan
>>> config = infoplan.configure("planner=uct", "terrain=volcano", rho=0.05)  # doctest: +SKIP
>>> frames = infoplan.fly(config, seed=0)  # doctest: +SKIP
>>> frames.curves[["collected", "rmse"]]  # doctest: +SKIP
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from infoplan.api import Frames, Mission, as_samples, configure, fly, frames, workspace
    from infoplan.config import MissionConfig
    from infoplan.errors import RunError, UsageError
    from infoplan.plots import plot_curves, plot_mission, plot_survey, plot_terrain
    from infoplan.samples import Batch, Samples
    from infoplan.scoring import CurveRow
    from infoplan.terrain import Terrain, load_terrain

__version__ = version("infoplan")

_HOMES = {
    "api": ("Frames", "Mission", "as_samples", "configure", "fly", "frames", "workspace"),
    "config": ("MissionConfig",),
    "errors": ("RunError", "UsageError"),
    "plots": ("plot_curves", "plot_mission", "plot_survey", "plot_terrain"),
    "samples": ("Batch", "Samples"),
    "scoring": ("CurveRow",),
    "terrain": ("Terrain", "load_terrain"),
}

__all__ = [
    "Batch",
    "CurveRow",
    "Frames",
    "Mission",
    "MissionConfig",
    "RunError",
    "Samples",
    "Terrain",
    "UsageError",
    "as_samples",
    "configure",
    "fly",
    "frames",
    "load_terrain",
    "plot_curves",
    "plot_mission",
    "plot_survey",
    "plot_terrain",
    "workspace",
]


def __getattr__(name: str) -> Any:
    # NumPy and Hydra are loaded when a name is first used: the command line stays quick.
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
