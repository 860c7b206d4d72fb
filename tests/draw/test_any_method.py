"""Whatever was flown can be drawn: by report, figures and animation, under its right name."""

import hashlib
import json
import re
import sys
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import made_methods
import numpy as np
import pandas as pd
import pytest
from PIL import Image
from rich.console import Console

from infoplan.analyse import find_missions, find_study
from infoplan.cli import main
from infoplan.draw import style
from infoplan.draw.animate import animate
from infoplan.draw.fig5 import curves_figure, plotted_numbers
from infoplan.draw.figures import OF_STUDY, draw_figures
from infoplan.draw.recording import read_recording, run_to_show
from infoplan.draw.report import render
from infoplan.method_identity import OTHERS, PAPERS, labels, looks, method_of

OTHER = {
    "UCT-NONE-STUDENT_T": {"model": "student_t"},
    "LEFTMOST-HIGH-SMOOTH": {"planner": "flown_methods.leftmost", "detector": "flown_methods.high",
                             "model": "flown_methods.Smooth"},
    "UCT-PYOD_KNN": {"detector": "pyod_knn"},
    "PUCT-HIGH": {"planner": "puct", "detector": "flown_methods.high"},
    "REPLAY-UCT-LOCAL": {"detector": "local", "replay": "uct-none-volcano-rho0.1-batch-0123abcd"},
}  # fmt: skip
"""Label, and what was chosen."""


def embedded(page: str) -> dict:
    text = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1]
    return json.loads(text)


def name_of(planner: str, detector: str) -> str:
    return f"{planner}-{detector}".upper()


QUICK = [pair for pair in made_methods.PAIRS if pair[0] in ("uct", "puct") or pair[1] == "none"]


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(QUICK, id="many"),
        pytest.param(made_methods.PAIRS, id="all", marks=pytest.mark.long),
    ],
)
def everything(request, tmp_path_factory) -> tuple[Path, set[str]]:
    """Pairs, those of two planners in both scopes, what is not built in; and their labels."""
    folder = tmp_path_factory.mktemp("methods")
    for planner, detector in request.param:
        made_methods.store(folder, planner, detector)
        if planner in ("uct", "random") and detector not in ("none", "best"):
            made_methods.store(folder, planner, detector, scope="historical")
    for label, chosen in OTHER.items():
        if not label.startswith("REPLAY"):
            made_methods.store(folder, **chosen)
    others = {label for label in OTHER if not label.startswith("REPLAY")}
    return folder, {name_of(*pair) for pair in request.param} | others


CORNERS = {("uct", "none"), ("puct", "pyod_ecod"), ("random", "local")}


def pairs(quick: Callable[[str, str], bool]) -> list[Any]:
    """All pairs, of which some are tried with the long tests only."""
    return [
        pair if quick(*pair) else pytest.param(*pair, marks=pytest.mark.long)
        for pair in made_methods.PAIRS
    ]


@pytest.mark.parametrize(
    ("planner", "detector"), pairs(lambda planner, detector: planner == "uct" or detector == "none")
)
def test_any_pair_alone_has_a_report_and_curves(planner, detector, tmp_path):
    made_methods.store(tmp_path, planner, detector)
    method = name_of(planner, detector)
    data = embedded(render(find_missions(tmp_path)))
    assert [line["method"] for line in data["panels"][0]["lines"]] == [method]
    assert [(one["name"], one["shown"]) for one in data["methods"]] == [(method, True)]
    assert set(plotted_numbers(find_study(tmp_path))["method"]) == {method}


@pytest.mark.parametrize(("label", "chosen"), OTHER.items())
def test_what_is_not_built_in_has_a_report_and_curves(label, chosen, tmp_path):
    made_methods.store(tmp_path, **chosen)
    data = embedded(render(find_missions(tmp_path)))
    assert [one["name"] for one in data["methods"]] == [label]
    assert set(plotted_numbers(find_study(tmp_path))["method"]) == {label}
    assert "flown_methods" not in sys.modules


def test_a_report_of_everything_leaves_nothing_out(everything):
    folder, expected = everything
    page = render(find_missions(folder))
    data = embedded(page)
    batch, historical = data["panels"]
    assert {line["method"] for line in batch["lines"]} == expected
    scopes = find_missions(folder).missions.groupby("method")["scope"].agg(set)
    alike = {m for m in expected if m.endswith(("-NONE", "-BEST", "-NONE-STUDENT_T"))}
    both = {method for method, of in scopes.items() if of != {"batch"}}
    assert {line["method"] for line in historical["lines"]} == both | alike
    assert len({one["colour"] for one in data["methods"]}) >= min(len(OTHERS), len(expected))
    assert len({one["dash"] for one in data["methods"]}) == len(expected)


def test_fig5_draws_everything_and_the_others_name_what_they_lack(everything, tmp_path):
    folder, expected = everything
    study = find_study(folder)
    assert study.notes == ()
    drawn = {one.name: one for one in draw_figures(study)}
    assert set(drawn) == set(OF_STUDY)
    shown = pd.read_csv(drawn["fig5"].files[2])
    assert set(shown[shown["panel"] == "b"]["method"]) == expected
    assert drawn["fig7"].files, "the paper's four are among them"
    made_methods.store(tmp_path, "greedy", "local")
    for one in draw_figures(find_study(tmp_path), ["fig1", "fig3", "fig4", "fig6", "fig7"]):
        assert not one.files
        assert f"{one.name} lacks" in one.problem
        assert "infoplan run" in one.problem


@pytest.mark.parametrize("single_seeds", [False, True])
def test_bands_of_two_seeds_do_not_squash_the_lines(single_seeds, tmp_path):
    for seed, rmse in enumerate((100.0, 200.0)):
        made_methods.store(tmp_path, "uct", "none", seed=seed, rmse=[rmse] * 4)
    study = find_study(tmp_path)
    numbers = plotted_numbers(study)
    assert numbers["high"].max() > 700, "the interval itself stays what it is"
    with style.journal():
        figure = curves_figure(study, numbers, single_seeds=single_seeds)
    highest = 200.0 if single_seeds else 150.0
    assert figure.axes[0].get_ylim() == (0.0, 1.5 * highest)


def test_other_shares_of_outliers_get_panels_of_their_own(tmp_path):
    made_methods.store(tmp_path, "greedy", "local", rho=0.2)
    made_methods.store(tmp_path, "greedy", "none", rho=0.3)
    (drawn,) = draw_figures(find_study(tmp_path), ["fig5"])
    shown = pd.read_csv(drawn.files[2])
    assert shown.groupby("panel")["rho"].first().to_dict() == {"a": 0.2, "b": 0.3}
    assert drawn.problem == "", "nobody asked for the paper's"


@pytest.mark.parametrize(
    ("planner", "detector"),
    pairs(lambda planner, detector: (planner, detector) in CORNERS),
)
def test_any_pair_can_be_animated(planner, detector, tmp_path):
    made_methods.store(tmp_path, planner, detector)
    animated(tmp_path)


def animated(folder: Path, **options) -> str:
    console = Console(width=300, record=True, force_terminal=False)
    with Image.open(animate(folder, console, **options)) as gif:
        assert gif.n_frames == made_methods.EPOCHS + 1
    return console.export_text()


@pytest.mark.parametrize(("label", "chosen"), OTHER.items())
def test_what_is_not_built_in_can_be_animated_without_its_code(label, chosen, tmp_path):
    run = made_methods.store(tmp_path, **chosen)
    assert read_recording(tmp_path, run, 0).method == label
    said = animated(tmp_path)
    own = [chosen.get(group, "") for group in ("detector", "model")]
    own = [name for name in own if "flown_methods" in name]
    assert ("only the maps of the end are shown" in said) == bool(own)
    assert all(name in said for name in own)
    assert "flown_methods" not in sys.modules


def test_own_methods_are_imported_where_they_are_trusted(tmp_path, monkeypatch):
    code = b"def high(samples, model, rng):\n    return samples.measured > 1100, samples.measured\n"
    (tmp_path / "trusted_methods.py").write_bytes(code)
    monkeypatch.chdir(tmp_path)
    flown_with = hashlib.sha256(code).hexdigest()
    made_methods.store(tmp_path, detector="trusted_methods.high", detector__sha256=flown_with)
    assert "trusted_methods" not in animated(tmp_path).partition("such as")[0]
    assert "trusted_methods" not in sys.modules
    said = animated(tmp_path, trust=True)
    assert "importing trusted_methods.high" in said
    assert "only the maps of the end" not in said
    assert "trusted_methods" in sys.modules


def test_the_papers_own_is_not_mistaken_when_a_run_is_chosen(tmp_path):
    made_methods.store(tmp_path, "puct", "copod", model="student_t")
    papers = made_methods.store(tmp_path, "puct", "copod")
    made_methods.store(tmp_path, "puct", "copod", replay="uct-none-x-0")
    assert run_to_show(tmp_path, None) == papers


def test_a_note_blames_the_option_that_differs(tmp_path):
    made_methods.store(tmp_path, "uct", "local")
    made_methods.store(tmp_path, "lawnmower", "copod")
    made_methods.store(tmp_path, "puct", "none", model="student_t")
    assert find_study(tmp_path).notes == ()
    made_methods.store(tmp_path, "lawnmower", "copod", planner__spacing=3.0)
    (note,) = find_study(tmp_path).notes
    assert note == (
        "1 run with other than the default planner.spacing is left out; "
        "choose it with planner.spacing=..."
    )


def test_replays_that_are_left_out_are_told(tmp_path, capsys):
    made_methods.store(tmp_path, "uct", "none")
    for seed in (0, 1):
        made_methods.store(tmp_path, detector="local", seed=seed, replay="uct-none-x-0123abcd")
    assert find_study(tmp_path).notes[0] == "2 replayed missions left out; choose with replay=true"
    assert "2 replayed missions left out" in render(find_missions(tmp_path)).lower()
    assert main(["report", f"results_dir={tmp_path}", "replay=true"]) == 0
    data = embedded((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert [one["name"] for one in data["methods"]] == ["REPLAY-UCT-LOCAL"]
    capsys.readouterr()


def test_two_replays_of_one_name_are_told_apart(tmp_path):
    for source in ("uct-none-x-0123abcd", "uct-copod-x-89abcdef"):
        made_methods.store(tmp_path, detector="local", replay=source)
    data = embedded(render(find_missions(tmp_path)))
    assert [one["name"] for one in data["methods"]] == [
        "REPLAY-UCT-LOCAL of 0123abcd", "REPLAY-UCT-LOCAL of 89abcdef",
    ]  # fmt: skip


def test_swept_options_are_in_the_report(tmp_path):
    usual = made_methods.store(tmp_path, "puct", "copod")
    other = made_methods.store(tmp_path, "puct", "copod", planner__exploration=0.5)
    page = render(find_missions(tmp_path))
    names = [one["name"] for one in embedded(page)["methods"]]
    assert names == ["PUCT-COPOD", "PUCT-COPOD planner.exploration=0.5"]
    table = page[page.index('<table class="sortable">') :]
    assert ">planner.exploration</th>" in table
    for run, value in ((usual, "0.3"), (other, "0.5")):
        assert re.search(rf">{run}</th><td[^>]*>0</td><td[^>]*>{value}</td>", table)
    assert "1 run with other than the default planner.exploration is left out" in page


def test_labels_are_different_for_different_methods():
    def method(**names):
        flat = {"planner.name": "uct", "detector.name": "none", "model.name": "gp",
                "fault.name": "spike", "detector.scope": "batch"}  # fmt: skip
        return method_of(flat | names)

    assert method().label == "UCT-NONE"
    assert method(**{"model.name": "student_t"}).label == "UCT-NONE-STUDENT_T"
    assert method(**{"fault.name": "stuck"}).label == "UCT-NONE-STUCK"
    assert method(replay="x").label == "REPLAY-UCT-NONE"
    one, other = (method(**{"detector.name": "mine", "detector.function": f"{module}.mine"})
                  for module in ("first", "second"))  # fmt: skip
    assert labels([one])[one] == "UCT-MINE"
    assert labels([one, other]) == {one: "UCT-first.mine", other: "UCT-second.mine"}
    # A name that only capitals tell from a built-in one's.
    disguised = method(**{"detector.name": "None", "detector.function": "mine.None"})
    assert disguised.label == "UCT-mine.None"
    assert disguised.can_err
    assert not method().can_err


def test_looks_are_stable_and_different():
    names = [f"METHOD-{number}" for number in range(200)]
    chosen = looks([*names, *PAPERS])
    assert looks([*reversed(names), *PAPERS]) == chosen
    assert list(chosen)[: len(PAPERS)] == list(PAPERS)
    assert all(chosen[name] == look for name, look in PAPERS.items())
    dashes = [look.dashes for look in chosen.values()]
    turned = {min(d[i:] + d[:i] for i in range(0, max(len(d), 1), 2)) for d in dashes}
    assert len(turned) == len(dashes), "no two lines look alike"
    few = looks(names[: len(OTHERS)])
    assert len({look.colour for look in few.values()}) == len(few)


def oklab(colour: str) -> np.ndarray:
    """Place of a colour in OKLab, by the definition of that space."""
    srgb = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    cones = np.array([[0.4122214708, 0.5363325363, 0.0514459929],
                      [0.2119034982, 0.6806995451, 0.1073969566],
                      [0.0883024619, 0.2817188376, 0.6299787005]]) @ linear  # fmt: skip
    return np.array([[0.2104542553, 0.7936177850, -0.0040720468],
                     [1.9779984951, -2.4285922050, 0.4505937099],
                     [0.0259040371, 0.7827717662, -0.8086757660]]) @ np.cbrt(cones)  # fmt: skip


def test_the_first_colours_are_far_apart():
    colours = [look.colour for look in PAPERS.values()] + list(OTHERS[:10])
    for a, b in combinations(colours, 2):
        assert np.linalg.norm(oklab(a) - oklab(b)) > 0.07, (a, b)
