"""Missions from Python: the same numbers as the command line; ask and tell on unknown terrain."""

import ast
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command import SMALL
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel

import infoplan
from infoplan import config as config_module
from infoplan.cli import main
from infoplan.config import GROUPS, DetectorConfig

CLOCKS = ["plan_seconds", "fit_seconds", "predict_seconds", "detect_seconds"]
SHORT = [option for option in SMALL if not option.startswith(("seeds", "n_jobs"))]


def test_a_mission_in_python_has_the_tables_of_the_command_line(tmp_path):
    words = [*SMALL, "seeds=[3]", "rho=0.2", "backend=sequential"]
    assert main(["run", *words, f"results_dir={tmp_path}"]) == 0
    (path,) = (tmp_path / "runs").glob("*.yaml")
    assert path.name.startswith("puct-copod-volcano-rho0.2-batch-")
    frames = infoplan.fly(infoplan.configure(*SHORT, rho=0.2), seed=3)
    for name in ("curves", "samples", "maps"):
        (path,) = (tmp_path / name).rglob("*.parquet")
        stored = pd.read_parquet(path, partitioning=None)
        pd.testing.assert_frame_equal(
            getattr(frames, name).drop(columns=CLOCKS, errors="ignore"),
            stored.drop(columns=CLOCKS, errors="ignore"),
            check_exact=True,
        )


def test_a_mission_stepped_by_hand_is_the_mission_that_runs(small, volcano):
    expected = infoplan.fly(small, seed=1, terrain=volcano)
    mission = infoplan.Mission(small, volcano, seed=1)
    mission.start(mission.sample(mission.pilot_path()))
    rows = [mission.evaluate()]
    while mission.collected < small.budget:
        taken = mission.sample(mission.plan())
        # Told as arrays, as if they came from elsewhere.
        mission.observe(
            infoplan.as_samples(mission, taken.x, taken.measured, heading=taken.heading,
                                is_outlier=taken.is_outlier)
        )  # fmt: skip
        rows.append(mission.evaluate())
    frames = infoplan.frames(mission, rows)
    for name in ("curves", "samples", "maps"):
        pd.testing.assert_frame_equal(
            getattr(frames, name).drop(columns=CLOCKS, errors="ignore"),
            getattr(expected, name).drop(columns=CLOCKS, errors="ignore"),
            check_exact=True,
        )


def test_values_in_python_are_the_options_of_the_command_line():
    config = infoplan.configure(
        "planner=uct", rho=np.float64(0.05), grid=[10, 12], budget=150,
        **{"planner.execute_actions": None, "planner.noisy_std": True, "detector.score": "paper",
           "terrain.path": "/a b/it's=here.npy", "model.iterations": "per_sample",
           "terrain.extent": (0, 20.5, -1, 40)},
    )  # fmt: skip
    assert (config.rho, config.grid, config.budget) == (0.05, [10, 12], 150)
    assert (config.planner.name, config.planner.noisy_std) == ("uct", True)
    assert config.planner.execute_actions is None
    assert config.detector.score == "paper"
    assert config.terrain.path == "/a b/it's=here.npy"
    assert config.terrain.extent == [0, 20.5, -1, 40]
    assert config.model.iterations == "per_sample"


def test_a_mapping_of_options_is_one_value():
    params = {"n_neighbors": 5, "method": "mean"}
    config = infoplan.configure(
        "detector=pyod", **{"detector.model": "KNN", "detector.params": params}
    )
    assert config.detector.params == params
    config = infoplan.configure("detector=pyod", "detector.params={n_neighbors: 7}")
    assert config.detector.params == {"n_neighbors": 7}
    with pytest.raises(infoplan.UsageError, match="params"):
        infoplan.configure("detector=copod", "detector.params={n_neighbors: 7}")


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("rho=2", "at most 1"),
        ("rhoo=1", "did you mean 'rho'"),
        ("planner=uctt", "did you mean 'uct'"),
        ("seeds=3", "no option of a single mission"),
        ("experiment=fig5", "several configurations"),
        ("detector=none,best", "planner=|one|cannot be read"),
    ],
)
def test_what_cannot_be_configured_is_a_usage_error(override, words):
    with pytest.raises(infoplan.UsageError, match=words):
        infoplan.configure(override)


def hill(x: np.ndarray) -> np.ndarray:
    return 40 * np.exp(-((x[:, 0] - 12) ** 2 + (x[:, 1] - 3) ** 2) / 40)


def test_ask_and_tell_on_a_workspace_of_unknown_elevation():
    config = infoplan.configure(*SHORT, "detector=none", **{"robot.speed": 0.2})
    field = infoplan.workspace([0, 20, 0, 10], unit="cm", name="meadow")
    mission = infoplan.Mission(config, field, seed=4)
    pilot = mission.pilot_path()[:, :2]
    mission.start(infoplan.as_samples(mission, pilot, hill(pilot)))
    rows = [mission.evaluate()]
    while mission.collected < config.budget:
        asked = mission.plan()
        assert asked[:, 0].min() >= 0
        assert asked[:, 0].max() <= 20
        mission.observe(infoplan.as_samples(mission, asked[:, :2], hill(asked)))
        # Where no heading is told, it is the direction of the last step.
        step = np.diff(mission.samples.x[-2:], axis=0)[0]
        assert mission.samples.heading[-1] == pytest.approx(
            np.arctan2(step[1], step[0]) % (2 * np.pi)
        )
        rows.append(mission.evaluate())
    frames = infoplan.frames(mission, rows)
    assert frames.samples["truth"].isna().all()
    assert not frames.samples["is_outlier"].any()
    assert frames.curves[["rmse", "mae", "nlpd", "coverage95"]].isna().all(axis=None)
    assert set(frames.curves["terrain"]) == {"meadow"}
    assert frames.curves["collected"].iloc[-1] == config.budget == len(frames.samples)
    assert frames.samples["epoch"].is_monotonic_increasing
    # What was learned is the process that scikit-learn fits to the samples that were told.
    last, x, y = frames.curves.iloc[-1], mission.samples.x, mission.samples.measured
    low, high = x[:100].min(axis=0), x[:100].max(axis=0)
    kernel = ConstantKernel(last["amplitude"] ** 2) * RBF(
        [last["lengthscale_1"], last["lengthscale_2"]]
    )
    process = GaussianProcessRegressor(
        kernel, alpha=last["noise_std"] ** 2 + last["jitter"], optimizer=None
    )
    mean, deviation = y[:100].mean(), y[:100].std()
    process.fit(2 * (x - low) / (high - low) - 1, (y - mean) / deviation)
    nodes = frames.maps[["x1", "x2"]].to_numpy()
    expected = process.predict(2 * (nodes - low) / (high - low) - 1) * deviation + mean
    np.testing.assert_allclose(frames.maps["mean"], expected, atol=1e-5 * deviation)


def told(mission, **changed):
    x = np.column_stack([np.linspace(1, 9, 30), np.linspace(2, 8, 30) ** 2 / 8])
    given = {"x": x, "measured": np.sin(x[:, 0])} | changed
    return infoplan.as_samples(mission, given.pop("x"), given.pop("measured"), **given)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"x": np.zeros((30, 3))}, "x has shape"),
        ({"x": np.zeros((0, 2)), "measured": np.zeros(0)}, "x has shape"),
        ({"x": np.full((30, 2), np.nan)}, "x holds a number that is not finite"),
        ({"x": np.full((30, 2), 11.0)}, "outside of the workspace"),
        ({"measured": np.zeros(29)}, "measured has shape"),
        ({"measured": np.full(30, np.inf)}, "measured holds a number"),
        ({"heading": np.zeros((30, 1))}, "heading has shape"),
        ({"is_outlier": [True]}, "is_outlier has shape"),
        ({"x": np.ones((200, 2)), "measured": np.ones(200)}, "200 samples are more than the 160"),
    ],
)
def test_samples_that_cannot_be(small, changed, words):
    mission = infoplan.Mission(small, infoplan.workspace([0, 10, 0, 10]), seed=0)
    assert len(told(mission)) == 30
    with pytest.raises(infoplan.UsageError, match=words):
        told(mission, **changed)


def test_samples_count_against_what_is_left_of_the_budget(small):
    mission = infoplan.Mission(small, infoplan.workspace([0, 10, 0, 10]), seed=0)
    mission.start(told(mission))
    with pytest.raises(infoplan.UsageError, match="131 samples are more than the 130"):
        told(mission, x=np.ones((131, 2)), measured=np.ones(131))


def test_steps_out_of_turn_are_refused(small):
    mission = infoplan.Mission(small, infoplan.workspace([0, 10, 0, 10]), seed=0)
    for step in (mission.plan, mission.evaluate, lambda: mission.observe(told(mission))):
        with pytest.raises(infoplan.UsageError, match="no samples yet: give start"):
            step()
    mission.start(told(mission))
    with pytest.raises(infoplan.UsageError, match="has been started"):
        mission.start(told(mission))


def test_the_perfect_detector_asks_for_labels(small):
    small.detector = DetectorConfig(name="best")
    for labels, words in ((None, "best needs the true labels"), (np.zeros(30, dtype=bool), "")):
        mission = infoplan.Mission(small, infoplan.workspace([0, 10, 0, 10]), seed=0)
        mission.start(told(mission, is_outlier=labels))
        with pytest.raises(infoplan.RunError, match=words) if words else nullcontext():
            mission.observe(told(mission, is_outlier=labels))


def test_a_workspace_is_a_rectangle():
    with pytest.raises(infoplan.UsageError, match="workspace"):
        infoplan.workspace([0, 0, 0, 10])


def test_importing_the_package_loads_next_to_nothing():
    code = (
        "import sys, infoplan; heavy = {'numpy', 'hydra', 'pandas', 'numba'} & set(sys.modules); "
        "assert 'Mission' in dir(infoplan); sys.exit(','.join(heavy) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert all(getattr(infoplan, name) for name in infoplan.__all__)
    with pytest.raises(AttributeError, match="Missoin"):
        _ = infoplan.Missoin


OUTER = """
import threading
import hydra, infoplan
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig

def state():
    return id(GlobalHydra.instance().hydra), HydraConfig.get().job.name, hydra.version.getbase()

@hydra.main(version_base=None, config_path=None)
def app(config):
    before, found = state(), []
    def one(rho):
        found.append(infoplan.configure("planner=uct", rho=rho).rho)
    threads = [threading.Thread(target=one, args=(share,)) for share in (0.05, 0.1, 0.2)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    try:
        infoplan.configure("planner=foo")
    except infoplan.UsageError:
        found.append("refused")
    from infoplan.cli import main
    assert main(["run", "--cfg", "job", "terrain=volcano"]) == 0
    assert state() == before, (state(), before)
    print("found", sorted(map(str, found)))

app()
"""


def test_an_outer_hydra_application_keeps_its_state(tmp_path):
    (tmp_path / "app.py").write_text(OUTER)
    done = subprocess.run(
        [sys.executable, "app.py", "hydra.run.dir=.", "hydra.output_subdir=null"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "found ['0.05', '0.1', '0.2', 'refused']" in done.stdout


def test_configuring_inside_of_initialize():
    from hydra import initialize
    from hydra.core.config_store import ConfigStore
    from hydra.core.global_hydra import GlobalHydra

    ConfigStore.instance().store(name="base_config", node={"mine": 1})
    with initialize(version_base=None, config_path=None):
        before = GlobalHydra.instance().hydra
        assert infoplan.configure(rho=0.2).rho == 0.2
        assert GlobalHydra.instance().hydra is before
    assert ConfigStore.instance().load("base_config.yaml").node == {"mine": 1}


USER = """
import infoplan
from infoplan.config import CopodConfig, FileConfig, TreeSearchConfig


def iterations(config: infoplan.MissionConfig) -> int:
    return config.planner.iterations


config = infoplan.configure("planner=uct", rho=0.1)
config.planner.exploration = 0.5
share: float = config.detector.contamination
unit: str | None = config.terrain.unit
number: int = config.terrain.seed
total: float = config.planner.weight + config.detector.threshold
config.terrain = FileConfig(path="hills.asc")
dof: float = config.model.dof
if isinstance(config.planner, TreeSearchConfig):
    rollouts: int = config.planner.rollouts
config.detector = CopodConfig(contamination=share / 2)
curves = infoplan.fly(config, seed=1).curves
"""


@pytest.mark.parametrize("tool", [pytest.param("mypy", marks=pytest.mark.long), "pyright"])
def test_a_users_script_is_typed(tool, tmp_path):
    pytest.importorskip(tool)
    root = str(Path(infoplan.__file__).parent.parent)
    command = {
        "mypy": ["mypy", "--strict", "--follow-imports=silent", f"--cache-dir={tmp_path}"],
        "pyright": ["pyright", "--pythonpath", sys.executable],
    }[tool]
    for line, status in [("", 0), ("config.planner.itterations", 1)]:
        (tmp_path / "user.py").write_text(USER + line)
        done = subprocess.run(
            [sys.executable, "-m", *command, "user.py"],
            cwd=tmp_path, capture_output=True, text=True, timeout=600,
            env={**os.environ, "MYPYPATH": root, "PYTHONPATH": root},
        )  # fmt: skip
        assert done.returncode == status, done.stdout
        assert ("itterations" in done.stdout) == bool(status)


def test_a_type_checker_knows_the_schemas_of_all_choices():
    """What type checkers read of a group has every schema among its bases."""
    tree = ast.parse(Path(config_module.__file__).read_text(encoding="utf-8"))
    bases = {
        node.name: {ast.unparse(base) for base in node.bases}
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    }
    for group, choices in GROUPS.items():
        known, more = set(), {f"Any{group.capitalize()}"}
        while more:
            known |= more
            more = {base for name in more for base in bases.get(name, ())}
        assert {type(schema).__name__ for schema in choices.values()} <= known, group
