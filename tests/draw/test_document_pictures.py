"""The pictures of detectors, models, maps, the survey and the loop show what they are to show."""

import re
import runpy
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from infoplan.detect import DETECTORS
from infoplan.model import MODELS

ROOT = Path(__file__).parents[2]


@pytest.fixture
def titles(monkeypatch) -> list[str]:
    found: list[str] = []
    monkeypatch.setattr(
        "infoplan.draw.style.panel", lambda axes, letter, title: found.append(title)
    )
    return found


def script(name: str) -> dict:
    return runpy.run_path(str(ROOT / "scripts" / f"draw_{name}.py"))


def is_drawn(path: Path) -> bool:
    """Tell whether there is more than a background."""
    with PIL.Image.open(path) as picture:
        return len(np.unique(np.asarray(picture.convert("L")))) > 20


def test_every_detector_is_told_and_drawn(tmp_path, titles):
    page = (ROOT / "docs" / "detectors.md").read_text(encoding="utf-8")
    table = page.partition("| detector | looks at |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", table)) >= set(DETECTORS)
    assert set(re.findall(r"options of detector=(\w+)", page)) >= set(DETECTORS) - {"best"}
    assert is_drawn(script("detectors")["draw_detectors"](tmp_path, budget=160))
    assert [title.partition(":")[0] for title in titles] == [n for n in DETECTORS if n != "none"]
    counts = [[int(count) for count in re.findall(r"\d+", title)] for title in titles]
    assert counts[0][1:] == [0, 0]  # the true labels miss nothing
    assert len({found + missed for found, missed, _ in counts}) == 1  # the track is the same


def test_every_model_is_told_and_drawn(tmp_path, titles):
    page = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")
    table = page.partition("| model | use it |")[2].partition("\n\n")[0]
    assert set(re.findall(r"`(\w+)`", table)) >= set(MODELS)
    drawn = script("models")["draw_models"](tmp_path, 110, ("gp", "student_t"))
    assert is_drawn(drawn)
    assert [title.split()[0] for title in titles] == ["truth", "gp", "student_t"]


def test_maps_are_drawn(tmp_path, titles):
    drawn = script("maps")["draw_maps"](tmp_path)
    assert is_drawn(drawn)
    assert len(titles) == 4


def test_the_loop_is_drawn(tmp_path):
    made = script("loop")
    assert is_drawn(made["draw_loop"](tmp_path))
    ends = {end for start, end, _ in made["ARROWS"]} | {start for start, end, _ in made["ARROWS"]}
    assert ends == set(made["BOXES"])


def test_the_survey_is_drawn(tmp_path, capsys):
    small = ["grid=[8,8]", "model.pilot_iterations=3", "model.iterations=1"]
    drawn = script("survey")["draw_survey"](tmp_path, *small)
    assert is_drawn(drawn)
    with PIL.Image.open(drawn) as picture:
        assert picture.width == 1000
    assert [path.name for path in tmp_path.iterdir()] == ["survey.png"]
