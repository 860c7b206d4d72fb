"""Commands that make what is missing."""

import shlex

import made_tables
import pytest
import yaml
from command import infoplan
from studies import quick, study

from infoplan.analyse import find_study
from infoplan.analyse.commands import commands, run_command, study_command
from infoplan.analyse.configurations import flatten
from infoplan.config import VecchiaConfig


def words(command: str) -> set[str]:
    return set(shlex.split(command))


def test_the_command_makes_the_missing_run(tmp_path):
    options = {
        "planner__exploration": 0.5,
        "planner__execute_actions": 2,
        "model__iterations": "per_sample",
        "pilot__outliers": True,
        "detector__contamination": 0.2,
    }
    made_tables.store(tmp_path, "uct-copod", scope="historical", collected=[100, 900], **options)
    study = find_study(tmp_path)
    command = run_command(study, "PUCT-COPOD", 0.15, "historical")
    shown = infoplan(*shlex.split(command)[1:], "--cfg", "job").stdout
    composed = flatten(yaml.safe_load(shown))
    (stored,) = study.options.values()
    for name, value in stored.items():
        if name not in (
            "planner.name",
            "rho",
            "terrain.unit",
            "terrain.sha256",
            "numerics_version",
        ):
            assert composed[name] == value, name
    assert (composed["planner.name"], composed["rho"]) == ("puct", 0.15)
    assert (composed["seeds"], composed["results_dir"]) == (1, str(tmp_path))


def test_the_command_takes_the_model_of_the_others(tmp_path):
    config = quick()
    config.model = VecchiaConfig(pilot_iterations=20, iterations=2, neighbours=20)
    study(config, tmp_path, seeds=1, backend="sequential")
    stored = find_study(tmp_path)
    command = run_command(stored, "UCT-BEST", 0.1)
    assert words(command) >= {"model=vecchia", "model.neighbours=20", "model.iterations=2"}
    shown = infoplan(*shlex.split(command)[1:], "--cfg", "job").stdout
    composed = flatten(yaml.safe_load(shown))
    (options,) = stored.options.values()
    of_model = {name: value for name, value in options.items() if name.startswith("model.")}
    assert {name: composed[name] for name in of_model} == of_model


def test_other_detectors_take_no_options_of_copod(tmp_path):
    made_tables.store(tmp_path, "uct-copod", scope="historical", detector__contamination=0.2)
    command = run_command(find_study(tmp_path), "UCT-NONE", 0.1, "historical")
    assert words(command) == {
        *("infoplan", "run", "planner=uct", "detector=none", "rho=0.1", "grid=[26,26]", "seeds=1"),
        f"results_dir={tmp_path}",
    }


@pytest.mark.parametrize(
    ("seeds", "word"), [(range(10), None), (range(3), "seeds=3"), ([2, 5], "seeds=[2,5]")]
)
def test_the_seeds_are_those_of_the_others(tmp_path, seeds, word):
    for seed in seeds:
        made_tables.store(tmp_path, "uct-none", seed=seed)
    found = [
        w
        for w in words(run_command(find_study(tmp_path), "UCT-BEST", 0.1))
        if w.startswith("seeds=")
    ]
    assert found == ([word] if word else [])


@pytest.mark.parametrize(
    ("terrain", "expected"),
    [
        ("volcano", {"terrain=volcano"}),
        ("file-hills", {"terrain=file", "terrain.path=hills.npy", "terrain.unit=ft"}),
        ("helens", set()),
    ],
)
def test_the_terrain_is_that_of_the_others(tmp_path, terrain, expected):
    made_tables.store(tmp_path, "uct-none", terrain=terrain)
    command = study_command(find_study(tmp_path))
    assert {word for word in words(command) if word.startswith("terrain")} == expected
    assert command.startswith("infoplan run -m experiment=fig5 ")


@pytest.mark.parametrize(
    ("name", "options", "expected"),
    [
        ("volcano-turned3", {"orientation": 3}, {"terrain=volcano", "terrain.orientation=3"}),
        ("jacksboro-ft", {}, {"terrain=jacksboro", "terrain.unit=ft"}),
        (
            "random_field-seed4",
            {"seed": 4, "lengthscale": [9.0, 6.0], "amplitude": 300.0, "unit": "m"},
            {"terrain=random_field", "terrain.seed=4", "terrain.lengthscale=[9,6]"},
        ),
        (
            "file-hills-ft-turned5",
            {"orientation": 5, "crop": [1, 9, 0, 8], "shape": None, "nodata": "refuse"},
            {"terrain=file", "terrain.path=hills.npy", "terrain.unit=ft", "terrain.orientation=5",
             "terrain.crop=[1,9,0,8]"},
        ),
        (
            "own-ridges",
            {"function": "mine.ridges", "options": {"height": 3.0}, "unit": "m"},
            {"terrain=own", "terrain.function=mine.ridges", "terrain.options.height=3.0"},
        ),
    ],
)  # fmt: skip
def test_the_terrain_s_own_options_are_those_of_the_others(tmp_path, name, options, expected):
    changes = {f"terrain__{option}": value for option, value in options.items()}
    made_tables.store(tmp_path, "uct-none", terrain=name, **changes)
    command = study_command(find_study(tmp_path))
    assert {word for word in words(command) if word.startswith("terrain")} == expected


def test_one_missing_run_has_its_command_and_several_the_study(tmp_path):
    made_tables.store(tmp_path, "uct-none")
    study = find_study(tmp_path)
    wanted = ("UCT-BEST", 0.1, "batch")
    assert commands(study, []) == ()
    assert commands(study, [wanted, wanted]) == (run_command(study, *wanted),)
    assert commands(study, [wanted, ("UCT-COPOD", 0.1, "batch")]) == (study_command(study),)
