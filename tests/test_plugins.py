"""Every planner, detector and model, and the examples of own ones, from the command line."""

import os
import re
import subprocess
import sys
import sysconfig
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pandas as pd
import pytest
import yaml
from command import SMALL
from flown import tables_of

from infoplan.analyse.audit import audit
from infoplan.cli import main
from infoplan.config import METHODS
from infoplan.study.identity import identify
from infoplan.study.store import save_mission

EXAMPLES = Path(__file__).parent.parent / "examples"
TINY = [
    "terrain=volcano", "budget=150", "grid=[10,10]", "seeds=1", "n_jobs=1", "backend=sequential",
    "model.pilot_iterations=8", "model.iterations=1",
]  # fmt: skip
OWN = {
    "planner": ["planner.function=own_planner.farthest"],
    "detector": ["detector.function=own_detector.jumps"],
    "model": ["model.function=own_model.Matern"],
    "fault": ["fault.function=own_fault.echo"],
}


@pytest.fixture
def in_examples(monkeypatch):
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setattr(sys, "path", list(sys.path))


def test_the_help_lists_the_choices_of_every_group(capfd):
    assert main(["run", "--help"]) == 0
    page = re.sub(r"\|\n +", "|", capfd.readouterr().out)
    listed = dict(re.findall(r"^ +(\w+)=([\w|]+)$", page, re.MULTILINE))
    assert set(listed) == {"planner", "fault", "detector", "terrain", "model", "experiment"}
    for group, choices in listed.items():
        names = [entry.name for entry in resources.files("infoplan.conf").joinpath(group).iterdir()]
        stems = {name.removesuffix(".yaml") for name in names if name.endswith(".yaml")}
        assert set(choices.split("|")) == stems, group


@pytest.mark.parametrize(
    ("planner", "detector", "model", "fault"),
    [
        tuple(choices[i % len(choices)] for choices in map(list, METHODS.values()))
        for i in range(max(map(len, METHODS.values())))
    ],
)
def test_every_choice_runs_and_stands_the_audit(
    planner, detector, model, fault, in_examples, tmp_path
):
    chosen = {"planner": planner, "detector": detector, "model": model, "fault": fault}
    words = [f"{group}={name}" for group, name in chosen.items()]
    words += [word for group, name in chosen.items() if name == "own" for word in OWN[group]]
    assert main(["run", *TINY, *words, f"results_dir={tmp_path}"]) == 0
    curves = pd.read_parquet(tmp_path / "curves")
    assert curves["collected"].max() == 150
    names = {"own": "farthest"}
    assert set(curves["planner"]) == {names.get(planner, planner)}
    names = {"own": "jumps", "pyod": "pyod_ecod"}
    assert set(curves["detector"]) == {names.get(detector, detector)}
    findings = list(audit(tmp_path))
    assert len(findings) > 15
    assert not [finding for finding in findings if not finding.holds]


PAIRS = [
    (detector, model)
    for detector in METHODS["detector"]
    for model in METHODS["model"]
    if (detector, model) != ("gp_residual", "own")
]


@pytest.mark.parametrize("scope", ["batch", pytest.param("historical", marks=pytest.mark.long)])
@pytest.mark.parametrize(("detector", "model"), PAIRS)
def test_every_detector_goes_with_every_model(
    detector, model, scope, in_examples, small, volcano, tmp_path
):
    small.detector = replace(METHODS["detector"][detector], scope=scope)
    small.model = replace(METHODS["model"][model], pilot_iterations=20, iterations=2)
    small.planner = METHODS["planner"]["greedy"]
    for options in (small.detector, small.model):
        if options.name == "own":
            is_model = options is small.model
            options.function = "own_model.Matern" if is_model else "own_detector.jumps"
    run = identify(small, volcano)
    save_mission(tmp_path, run, 1, tables_of(run, 1), {})
    assert not [finding for finding in audit(tmp_path) if not finding.holds]


@pytest.mark.parametrize(
    ("example", "label", "changed"),
    [
        ("own_detector.py", "puct-jumps-volcano", "threshold: 6.0"),
        pytest.param(
            "own_fault.py", "puct-copod-echo-volcano", "delay: 30", marks=pytest.mark.long
        ),
        # The same by the commands of the documents: tests/test_documents.py.
        pytest.param(
            "own_planner.py", "farthest-copod-volcano", "actions: 3", marks=pytest.mark.long
        ),
        pytest.param(
            "own_model.py", "puct-copod-Matern-volcano", "nu: 2.5", marks=pytest.mark.long
        ),
    ],
)
def test_the_command_in_an_example_runs(example, label, changed, tmp_path):
    """Through the installed command, whose path does not hold the current folder, and workers."""
    text = (EXAMPLES / example).read_text()
    assert len(text.splitlines()) < 40
    command = next(line.split() for line in text.splitlines() if " infoplan run " in line)
    small = [o for o in SMALL if not (o.startswith("planner.") and "planner=own" in command)]
    program = Path(sysconfig.get_path("scripts")) / "infoplan"
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [program, *command[1:], *small, "n_jobs=2", f"results_dir={tmp_path}"],
        cwd=EXAMPLES, env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    (stored,) = (tmp_path / "runs").iterdir()
    assert stored.name.startswith(f"{label}-rho0.1-batch-")
    assert changed in stored.read_text()
    assert len(yaml.safe_load(stored.read_text())["pilot"]) == 3
    assert pd.read_parquet(tmp_path / "curves")["collected"].max() == 160


def test_a_failing_function_is_a_failed_mission(tmp_path, monkeypatch, capfd):
    (tmp_path / "sour.py").write_text("def grapes(samples, model, rng):\n    return samples.x, 1\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert main(["run", *TINY, "detector=own", "detector.function=sour.grapes"]) == 1
    said = capfd.readouterr().out
    assert "FAILED: the detector grapes gave flags of shape" in said
    assert not list(tmp_path.rglob("*.parquet"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("detector=own detector.function=own_detector.jumps detector.options.tresh=1", "threshold"),
        (
            "detector=own detector.function=own_detector.jumps detector.options.reach=x",
            "a whole nu",
        ),
        ("planner=own planner.function=own_planner", "is no dotted path"),
        ("model=own model.function=absent.Model", "there is no module 'absent'"),
        ("detector=pyod detector.features=[z]", "one or several of x1, x2, y"),
        ("detector=pyod detector.features=[y,y]", "each once"),
        ("detector=pyod detector.params.n_bins=3", "PyOD's ECOD has no parameter 'n_bins'"),
        ("detector.tresh=1", "there is no option 'detector.tresh' (did you mean"),
        ("detector.neighbours=3", "the chosen detector has no option 'detector.neighbours'"),
        ("planner=random planner.rollouts=3", "the chosen planner has no option"),
        (
            "planner=lawnmower planner.spacing=1e-9",
            "planner.spacing=1e-09 is too narrow: it must be at least robot.speed=0.7",
        ),
        ("model=student_t model.dof=2", "model.dof=2.0 is out of bounds: it must be above 2"),
    ],
)
def test_mistakes_are_one_sentence(arguments, words, in_examples, tmp_path, capfd):
    assert main(["run", *TINY, *arguments.split(), f"results_dir={tmp_path}"]) == 2
    said = capfd.readouterr().err
    assert words in said
    assert len(said.strip().splitlines()) == 1
    assert not list(tmp_path.rglob("*.parquet"))
