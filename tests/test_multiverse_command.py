"""`infoplan multiverse` over small missions of two universes."""

import io
import json
import re
import shutil
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from rich.console import Console
from universes import by_choice, made_up

import infoplan
from infoplan.analyse import find_study, judge_claims, load_curves
from infoplan.analyse.claims import COMPARISONS
from infoplan.analyse.judging import Rules
from infoplan.analyse.multiverse import claim_curves
from infoplan.analyse.universe_numbers import collect, read, write
from infoplan.cli import main
from infoplan.draw.progress import listener
from infoplan.hydra_front.compose import compose
from infoplan.study.runner import run_study
from infoplan.study.universes import CHOICES, DEFAULT, METHODS, Universe, universes
from infoplan.text_options import renamed

FLOOR = "noise: floor 1"
SMALL = [
    "terrain=volcano", "budget=200", "grid=[12,12]", "planner.iterations=30",
    "model.pilot_iterations=20", "backend=sequential",
]  # fmt: skip


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Two universes, at rho 0.1 alone, a seed; and a run that is of no universe."""
    folder = tmp_path_factory.mktemp("multiverse")
    configs = []
    for universe in universes():
        if universe.name in (DEFAULT, FLOOR):
            for line in universe.lines():
                words = [word for word in line.split() if not word.startswith("rho=")]
                configs.append(compose([*words, "rho=0.1", *SMALL]))
    configs.append(compose(["planner=uct", "detector=none", "model.iterations=7", *SMALL]))
    console = Console(file=io.StringIO())
    run_study(
        [replace(one, seeds=1, results_dir=str(folder)) for one in configs], listener(console)
    )
    return folder


@pytest.fixture(scope="module")
def numbers(flown):
    return collect(flown, lambda _: None)


def test_missions_belong_to_the_universes_whose_lines_fly_them(numbers):
    missions = numbers.missions
    # Where a choice concerns filters alone, NONE and BEST are there, but not the others.
    assert set(missions["universe"]) == {DEFAULT, FLOOR}
    counted = missions.groupby(["universe", "method", "scope"]).size().unstack("scope").fillna(0)
    assert set(counted.index.get_level_values("method")) == set(METHODS)
    assert (counted["batch"] == 1).all()
    filtered = counted.index.get_level_values("method").str.endswith("COPOD")
    assert (counted["historical"] == filtered).all()
    assert numbers.unit == "ft"
    assert numbers.budget == 200


def test_numbers_are_those_by_which_claims_are_judged(flown, numbers):
    study = find_study(flown, **{"model.min_noise_variance": 1, "model.iterations": 5})
    for name in ("C2", "C8", "C9", "C10", "C11", "C12"):
        (claim,) = judge_claims(study, [name])
        made = COMPARISONS[name](numbers.numbers[FLOOR])
        assert [one.what for one in made] == [one.what for one in claim.comparisons]
        for one, other in zip(made, claim.comparisons, strict=True):
            assert one.stated == other.stated
            assert one.values == pytest.approx(other.values)
    (curve,) = claim_curves(numbers, ["C2"])
    assert curve.universes == (DEFAULT, FLOOR)


def test_other_rules_are_those_by_which_claims_are_judged(flown, numbers):
    study = find_study(flown, **{"model.min_noise_variance": 1, "model.iterations": 5})
    for rules in (Rules(margin=0.1), Rules(early=(100, 300))):
        for name in ("C2", "C5", "C8"):
            (claim,) = judge_claims(study, [name], rules)
            made = COMPARISONS[name](numbers.judged_by(rules)[FLOOR])
            for one, other in zip(made, claim.comparisons, strict=True):
                assert (one.what, one.stated) == (other.what, other.stated)
                assert one.values == pytest.approx(other.values)
    (usual,), (wide,) = (judge_claims(study, ["C2"], rules) for rules in (Rules(), Rules(0.1)))
    assert wide.comparisons[0].stated.high == pytest.approx(2 * usual.comparisons[0].stated.high)


def test_the_mean_over_early_samples_is_that_of_the_curve(flown, numbers):
    row = numbers.missions[numbers.missions["method"] == "PUCT-COPOD"].iloc[0]
    curves = load_curves(flown, method="PUCT-COPOD", scope="batch", seed=int(row["seed"]))
    own = curves[curves["rmse"].map(lambda end: np.isclose(end, row["final"]))]["run"]
    curve = curves[curves["run"] == own.iloc[0]]
    axis = np.linspace(100, 200, 100_001)
    rmse = np.interp(axis, curve["collected"], curve["rmse"])
    assert row["early_100_300"] == pytest.approx(rmse.mean(), rel=1e-4)
    assert row["early"] == pytest.approx(rmse[axis >= 150].mean(), rel=1e-4)


def test_the_curve_that_is_kept_is_that_of_the_mission(flown, numbers):
    row = numbers.missions[numbers.missions["method"] == "PUCT-COPOD"].iloc[0]
    curves = load_curves(flown, method="PUCT-COPOD", scope="batch", seed=int(row["seed"]))
    own = curves[curves["rmse"].map(lambda end: np.isclose(end, row["final"]))]["run"]
    curve = curves[curves["run"] == own.iloc[0]]
    expected = np.interp(numbers.axis, curve["collected"], curve["rmse"])
    np.testing.assert_allclose(row["rmse"], expected)
    assert numbers.axis[-1] == 200


def test_the_command_writes_the_numbers_and_draws_from_them_alone(flown, tmp_path, capsys):
    assert main(["multiverse", f"results_dir={flown}"]) == 0
    first = capsys.readouterr().out
    assert "2 universes" in first
    table = flown / "multiverse.parquet"
    assert main(["multiverse", f"table={table}", f"results_dir={tmp_path}"]) == 0
    again = capsys.readouterr().out
    assert again.replace(str(tmp_path), str(flown)) == first
    drawn = pd.read_csv(tmp_path / "figures" / "multiverse.csv")
    curves = {curve.name: curve for curve in claim_curves(read(table))}
    for (claim, universe), rows in drawn.groupby(["claim", "universe"]):
        place = curves[claim].universes.index(universe)
        assert rows["mean"].item() == pytest.approx(curves[claim].means[place], rel=1e-5)
        assert rows["verdict"].item() == curves[claim].verdicts[place]


def test_of_one_seed_all_is_drawn_and_no_p_is_told(tmp_path, capsys):
    made = made_up(by_choice)
    table = tmp_path / "numbers.parquet"
    write(replace(made, missions=made.missions[made.missions["seed"] == 0]), table)
    assert main(["multiverse", f"table={table}", f"results_dir={tmp_path}"]) == 0
    printed = capsys.readouterr().out
    drawn = pd.read_csv(tmp_path / "figures" / "multiverse_choices.csv", index_col="claim")
    assert drawn.loc["C7", "noise"] > 0.2
    assert "multiverse_choices.png" in printed.replace("\n", "")
    (curve,) = claim_curves(read(table), ["C7"])
    assert f"{np.median(curve.means):.0f} ft" in printed


def test_a_claim_tells_what_moves_it_and_draws_the_choices_below_its_curve(tmp_path, capsys):
    table = tmp_path / "numbers.parquet"
    write(made_up(by_choice), table)
    assert main(["multiverse", "claim=C7", f"table={table}", f"results_dir={tmp_path}"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"noise +floor 1 +5\d\d \[.*\] +undecided|noise +floor 1 +5\d\d", out)
    assert re.search(r"noise x pilot|pilot x noise", out)
    assert re.search(r"margin +10 % +0 \[0, 0\] +contradicted", out)
    assert "p 0.0312; 100 % of the universes on one side of zero" in " ".join(out.split())
    assert (tmp_path / "figures" / "multiverse_c7.png").exists()
    assert main(["multiverse", "claim=C13", f"table={table}"]) == 2
    assert "C1, C2" in capsys.readouterr().err


def test_a_universe_tells_the_commands_that_fly_it(flown, capsys):
    table = flown / "multiverse.parquet"
    if not table.exists():
        assert main(["multiverse", f"results_dir={flown}"]) == 0
    assert main(["multiverse", f"universe={FLOOR}", f"table={table}"]) == 0
    out = re.sub(r"\\\n\s*", "", capsys.readouterr().out)
    lines = [line.split("infoplan ", 1)[1] for line in out.splitlines() if "infoplan run" in line]
    (universe,) = [one for one in universes() if one.name == FLOOR]
    assert len(lines) == len(list(universe.lines()))
    assert all("model.min_noise_variance=1" in line and "budget=200" in line for line in lines)
    assert main([*lines[0].split(), "--dry-run", f"results_dir={flown}"]) == 0
    capsys.readouterr()
    assert main(["multiverse", f"universe={FLOOR}", f"table={table}", "--latex"]) == 0
    out = capsys.readouterr().out
    assert out.startswith(f"% universe {FLOOR}: ")
    assert out.count("\\bottomrule") == 1
    assert len(re.findall(r"^\\textbf\{C\d+\} & ", out, re.MULTILINE)) == len(COMPARISONS)


def test_a_universe_that_was_not_flown_tells_them_too(flown, tmp_path, capsys):
    universe = universes()[-1]
    for folder, own in ((tmp_path / "none", "seeds=6"), (flown, "budget=200")):
        assert main(["multiverse", f"universe={universe.name}", f"results_dir={folder}"]) == 0
        out = re.sub(r"\\\n\s*", "", capsys.readouterr().out)
        assert "no numbers: " in out
        lines = [line.split("infoplan ", 1)[1] for line in out.splitlines() if " run -m" in line]
        wanted = list(universe.lines())
        assert len(lines) == len(wanted)
        for line, words in zip(lines, wanted, strict=True):
            assert set(words.split()) <= set(line.replace("'", "").split())
            assert own in line.split()
            assert f"results_dir={folder}" in line.split()


def test_what_would_be_ignored_is_refused(flown, tmp_path, capsys):
    table = tmp_path / "numbers.parquet"
    write(made_up(by_choice, there=universes()[:2]), table)
    assert main(["multiverse", f"table={table}", "rho=0.1"]) == 2
    assert "rho= chooses among stored runs" in capsys.readouterr().err
    assert main(["multiverse", f"table={table}", "claim=C2", "universe=default"]) == 2
    assert "one at a time" in capsys.readouterr().err
    whole = flown / "multiverse.parquet"
    assert main(["multiverse", "model=gp", f"results_dir={flown}"]) == 0
    before = whole.read_bytes()
    assert main(["multiverse", "scope=batch", "claim=C2", f"results_dir={flown}"]) == 0
    assert whole.read_bytes() == before
    assert "not written as scope= leaves out" in " ".join(capsys.readouterr().err.split())


def test_a_historical_run_that_is_missing_is_no_batch_run(numbers):
    missions = numbers.missions
    gone = (missions["method"] == "PUCT-COPOD") & (missions["scope"] == "historical")
    less = replace(numbers, missions=missions[~gone])
    assert less.numbers[FLOOR].numbers("final", "PUCT-COPOD", 0.1, "historical") is None
    assert less.numbers[FLOOR].numbers("final", "UCT-NONE", 0.1, "historical") is not None
    assert claim_curves(numbers, ["C7"])
    assert not claim_curves(less, ["C7"])


@pytest.mark.parametrize(
    ("learning", "choice", "level"),
    [("lbfgs 5", "learning rate", "0.03"), ("frozen", "noise", "restarted"),
     ("frozen", "optimiser's state", "reset")],
)  # fmt: skip
def test_what_is_without_use_makes_no_difference(learning, choice, level):
    default = {one.name: one.default for one in CHOICES} | {"learning": learning}
    made = []
    for levels in (default, {**default, choice: level}):
        universe = Universe("made up", levels)
        changed = [one for one in universe.changed if one != "learning"]
        assert universe.idle == changed
        words = [f"{name}={value}" for one in CHOICES
                 for name, value in one.levels[levels[one.name]].items()]  # fmt: skip
        config = compose(["planner=uct", "detector=none", *SMALL, *words])
        made.append(infoplan.fly(config).curves["rmse"])
    np.testing.assert_array_equal(*made)


@pytest.mark.parametrize(
    ("method", "pilot", "choice", "level"),
    [("UCT-NONE", "spiky", "pilot", "spiky, judged"), ("UCT-NONE", "clean", "score", "paper"),
     ("UCT-BEST", "clean", "spike draw", "batch")],
)  # fmt: skip
def test_levels_that_are_one_to_a_method_give_it_the_same_missions(method, pilot, choice, level):
    default = {one.name: one.default for one in CHOICES} | {"pilot": pilot}
    made = [Universe("made up", levels) for levels in (default, {**default, choice: level})]
    assert made[0].levels_for(method) == made[1].levels_for(method)
    detector = "none" if method == "UCT-NONE" else "best"
    curves = []
    for universe in made:
        words = [f"{name}={value}" for name, value in universe.options(method).items()]
        config = compose(["planner=uct", f"detector={detector}", *SMALL, *words])
        curves.append(infoplan.fly(config).curves["rmse"])
    np.testing.assert_array_equal(*curves)


@pytest.mark.parametrize("pilot", ["spiky", "spiky, judged"])
def test_levels_that_make_a_difference_are_kept_apart(pilot):
    levels = {one.name: one.default for one in CHOICES} | {"pilot": pilot, "spike draw": "batch"}
    assert Universe("made up", levels).levels_for("UCT-BEST") == {
        **levels, **{one.name: one.default for one in CHOICES if "UCT-BEST" not in one.methods}
    }  # fmt: skip


def test_scripts_are_told_how_claims_fare(tmp_path, capsys):
    table = tmp_path / "numbers.parquet"
    made = made_up(by_choice, there=universes()[:4])
    write(made, table)
    assert main(["multiverse", "--json", f"table={table}", f"results_dir={tmp_path}"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [claim["name"] for claim in told["claims"]] == [f"C{n}" for n in range(1, 13)]
    (curve,) = claim_curves(made, ["C7"])
    points = told["claims"][6]["points"]
    assert [point["verdict"] for point in points] == list(curve.verdicts)
    assert [point["mean"] for point in points] == pytest.approx(curve.means, rel=1e-3)
    assert told["claims"][6]["test"]["one_side"] == 1.0
    assert list(told["universes"]) == list(curve.universes)
    far = told["distances_to_the_clip"]
    assert {one["universe"] for one in far} == set(curve.universes)
    assert [one["mean"] for one in far] == sorted(one["mean"] for one in far)
    assert not (tmp_path / "multiverse.html").exists()
    assert main(["multiverse", "--json", "claim=C7", f"table={table}"]) == 2
    assert "leave universe= and claim= out" in capsys.readouterr().err


def rows_of(text: str) -> dict[str, list[str]]:
    """Cells of all tables, by what stands first in a row, of rows alike the first."""
    rows = [line[2:-2].split(" | ") for line in text.splitlines() if line.startswith("| ")]
    return {row[0]: row for row in reversed(rows)}


def test_documents_are_told_what_every_level_does(tmp_path, capsys):
    table = tmp_path / "numbers.parquet"
    made = made_up(by_choice)
    write(made, table)
    line = ["multiverse", f"table={table}", f"results_dir={tmp_path}"]
    assert main([*line, "--markdown"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("helens, budget 2000, model=gp, 105 universes, 6 seeds")
    rows = rows_of(told)
    (curve,) = claim_curves(made, ["C7"])
    counts = [str(curve.verdicts.count(one)) for one in ("supported", "contradicted", "undecided")]
    assert rows["C7"][2:5] == counts
    assert rows["C7"][-1].startswith("noise ")
    none, best, own, pareto = (float(cell) for cell in rows[FLOOR][1:5])
    expected = [by_choice(made.universes[2], method, 0.1) for method in METHODS]
    assert [none, best, own, pareto] == pytest.approx(expected, abs=10.0)
    assert "C2" in rows[FLOOR][6].split()
    assert re.search(r"^\| noise \| floor 1 \| -4\d\d \[-\d+, -\d+\] \|", told, re.MULTILINE)
    assert not (tmp_path / "multiverse.html").exists()
    assert main([*line, "--markdown", "universe=default"]) == 2
    assert "--markdown is of all claims" in capsys.readouterr().err
    assert main([*line, "--markdown", "--json"]) == 2
    # Of few universes nothing can be said of all choices jointly.
    write(made_up(by_choice, there=universes()[:4]), table)
    assert main([*line, "--markdown"]) == 0
    assert "whatever the other choices are" not in capsys.readouterr().out


def test_what_is_not_there_is_told(flown, tmp_path, capsys):
    assert main(["multiverse", "universe=nosie: floor 1"]) == 2
    assert "did you mean 'noise: floor 1'?" in capsys.readouterr().err
    broken = tmp_path / "other.parquet"
    pd.DataFrame({"a": [1]}).to_parquet(broken)
    assert main(["multiverse", f"table={broken}"]) == 2
    assert "no table that infoplan multiverse has written" in capsys.readouterr().err
    assert main(["multiverse", f"table={tmp_path}"]) == 2
    assert f"{tmp_path} cannot be read" in capsys.readouterr().err
    assert main(["multiverse", f"table={tmp_path / 'none'}"]) == 2
    assert "there is no file" in capsys.readouterr().err
    assert main(["multiverse", f"results_dir={tmp_path}"]) == 2
    assert "experiment=multiverse model=vecchia results_dir=" in capsys.readouterr().err
    assert main(["multiverse", f"results_dir={broken}"]) == 2
    assert "is a file: name a folder" in capsys.readouterr().err
    assert main(["multiverse", f"results_dir={flown}", "planner=uct"]) == 2
    assert "no universe with all four methods" in capsys.readouterr().err


def test_what_the_missions_cannot_tell_is_said(flown, tmp_path, capsys):
    assert main(["multiverse", f"results_dir={flown}"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "C1 rho 0.05: all methods differ negligibly: not judged, a run is missing" in out
    assert "PUCT the lower: not judged, it takes a budget above 1000" in out
    assert "with fewer than six seeds nothing is decided" in out
    assert "clip" not in out  # it is one of helens
    page = (flown / "multiverse.html").read_text()
    assert "not judged, it takes a budget above 1000" in page
    assert "nearest to the clip" not in page.partition("<main>")[2].partition("<script")[0]
    assert main(["multiverse", "--markdown", f"results_dir={flown}"]) == 0
    out = capsys.readouterr().out
    assert "not judged, it takes a budget above 1000  \n" in out
    assert "clip" not in out
    assert main(["multiverse", "claim=c4", f"results_dir={flown}"]) == 2
    assert "can judge C4: it takes a budget above 1000" in capsys.readouterr().err
    table = tmp_path / "numbers.parquet"
    made = made_up(by_choice, there=universes()[:2])
    write(made, table)
    assert main(["multiverse", "--markdown", f"table={table}"]) == 0
    out = capsys.readouterr().out
    assert "supported near the clip" in out
    assert "not judged" not in out
    assert "fewer than six" not in out
    some = made.missions[(made.missions["seed"] < 3) | (made.missions["universe"] == DEFAULT)]
    write(replace(made, missions=some), table)
    assert main(["multiverse", "--markdown", f"table={table}"]) == 0
    assert "2 universes, 3 to 6 seeds" in capsys.readouterr().out


def test_what_cannot_be_written_is_told_after_the_numbers(flown, tmp_path, capsys):
    folder = shutil.copytree(flown, tmp_path / "copy")
    (folder / "multiverse.parquet").unlink(missing_ok=True)
    (folder / "multiverse.parquet").mkdir()
    assert main(["multiverse", f"results_dir={folder}"]) == 1
    told = capsys.readouterr()
    assert "volcano, budget 200, model=gp, 2 universes, 1 seed" in told.out
    assert "multiverse.parquet could not be written" in told.err


def test_all_universes_are_named(capsys):
    assert main(["multiverse", "--list", "claim=C4", "--json"]) == 2
    assert "leave claim=, --json out" in capsys.readouterr().err
    assert main(["multiverse", "--list"]) == 0
    named = capsys.readouterr().out.splitlines()
    assert [line.split(": ")[0] for line in named][:1] == [DEFAULT]
    assert len(named) == len(universes())


def test_every_level_is_an_option_and_no_default():
    """A level of every choice at a time, in one composition."""
    default = compose(["terrain=volcano", "planner=puct", "detector=copod"])
    for place in range(max(len(choice.levels) for choice in CHOICES)):
        levels = {c.name: (list(c.levels) * 6)[place] for c in CHOICES}
        options = Universe("made up", levels).options("PUCT-COPOD")
        words = [f"{name}={value}" for name, value in options.items()]
        assert [renamed(word) for word in words] == words
        config = compose([*words, "terrain=volcano", "planner=puct", "detector=copod"])
        for name in options:
            group, _, option = name.partition(".")
            assert getattr(getattr(config, group), option) != getattr(
                getattr(default, group), option
            )


def test_the_experiment_is_all_universes_the_cheap_ones_first():
    path = Path(__file__).parents[1] / "conf" / "experiment" / "multiverse.yaml"
    text = path.read_text(encoding="utf-8")
    blocks = re.findall(r"^  # (.+)\n((?:  - .+\n)+)", text, re.MULTILINE)
    there = {name: re.findall("  - (.+)", entries) for name, entries in blocks}
    assert there == {one.name: list(one.lines()) for one in universes()}
    assert list(chain(*there.values())) == yaml.safe_load(text)["sweep"]
    levels = {one.name: one.levels for one in universes()}
    joint = [levels[name] for name in there if name.startswith("joint")]
    slow = [("lbfgs 20", "1"), ("adam 20", "1"), ("adam per sample", "1")]
    assert (joint[0]["learning"], joint[0]["actions driven"]) == ("frozen", "all")
    assert {(one["learning"], one["actions driven"]) for one in joint[-6:]} <= set(slow)
    assert next(iter(there)) == DEFAULT
    assert all(name.startswith("joint") for name in list(there)[-len(joint) :])
