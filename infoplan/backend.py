"""Matplotlib without its backends: a canvas in memory is all that is drawn on here."""

import os
import sys
from contextlib import suppress


def load_matplotlib() -> None:
    """Import matplotlib, whatever the environment variable ``MPLBACKEND`` names.

    An inherited backend that is not installed here would fail already when matplotlib is imported.
    One that is installed stays the user's choice for figures of their own.
    """
    wanted = os.environ.get("MPLBACKEND")
    if not wanted or "matplotlib" in sys.modules:
        return
    os.environ["MPLBACKEND"] = "Agg"
    try:
        import matplotlib as mpl
    finally:
        os.environ["MPLBACKEND"] = wanted
    with suppress(ValueError):
        mpl.rcParams["backend"] = wanted
