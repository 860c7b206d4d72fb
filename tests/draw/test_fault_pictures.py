"""The page of sensor faults tells and shows every one."""

import re
import runpy
from pathlib import Path

from infoplan.config import METHODS
from infoplan.fault import FAULTS

ROOT = Path(__file__).parents[2]


def test_every_fault_has_its_section_and_its_picture(tmp_path):
    page = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^## .*`fault=(\w+)`$", page, re.MULTILINE)) == set(METHODS["fault"])
    tables = re.findall(r"<!-- options of fault=(\w+): make derived -->\n\n\|", page)
    assert set(tables) == set(FAULTS) == set(re.findall(r"\(faults/(\w+)\.png\)", page))
    script = runpy.run_path(str(ROOT / "scripts" / "draw_faults.py"))
    drawn = script["draw_faults"](tmp_path)
    assert [path.name for path in drawn] == [f"{name}.png" for name in FAULTS]
    assert len({path.read_bytes() for path in drawn}) == len(FAULTS)
    shown = {path.name for path in (ROOT / "docs" / "faults").iterdir()}
    assert shown == {path.name for path in tmp_path.iterdir()}
