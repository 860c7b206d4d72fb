"""The page of kernels tells every one, and its script draws them."""

import runpy
from pathlib import Path

import numpy as np

from infoplan.config import KERNELS

ROOT = Path(__file__).parents[2]


def test_the_script_draws_every_kernel(tmp_path):
    script = runpy.run_path(str(ROOT / "scripts" / "draw_kernels.py"))
    drawn = script["draw_kernels"](tmp_path / "kernels.png")
    assert drawn.stat().st_size > 10_000
    x = np.linspace(-1.0, 1.0, 5)
    for name in KERNELS:
        found = script["correlations"](name, x, x)
        np.testing.assert_allclose(np.diag(found), 1.0)
        np.testing.assert_allclose(found, found.T)
