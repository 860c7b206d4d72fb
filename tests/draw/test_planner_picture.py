"""The page of planners tells and shows every one."""

import re
import runpy
from pathlib import Path

import pytest

from infoplan.plan import PLANNERS

ROOT = Path(__file__).parents[2]


@pytest.mark.long
def test_every_planner_is_told_and_drawn(tmp_path, monkeypatch):
    page = (ROOT / "docs" / "planners.md").read_text(encoding="utf-8")
    table = page.partition("| planner | looks at |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", table)) >= set(PLANNERS)
    script = runpy.run_path(str(ROOT / "scripts" / "draw_planners.py"))
    titles = []
    monkeypatch.setattr(
        "infoplan.draw.style.panel", lambda axes, letter, title: titles.append(title)
    )
    drawn = script["draw_planners"](tmp_path, budget=110)
    assert drawn.name in page
    assert drawn.stat().st_size > 20_000
    assert [title.partition(",")[0] for title in titles] == list(PLANNERS)
