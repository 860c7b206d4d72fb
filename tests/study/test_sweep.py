"""From command lines to the configurations of a study."""

import re
import subprocess
import sys
from dataclasses import asdict, replace
from functools import partial

import pytest
from hydra import compose as hydra_compose
from hydra.errors import HydraException
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from studies import OPTIONS, assert_same_numbers, quick, study

from infoplan.cli import main
from infoplan.config import Config, DetectorConfig, HelensConfig, MissionConfig
from infoplan.errors import UsageError
from infoplan.hydra_front.compose import Composer
from infoplan.hydra_front.explain import explain
from infoplan.hydra_front.front import compose_and
from infoplan.hydra_front.overrides import sweep_jobs
from infoplan.study.identity import identify
from infoplan.study.runner import merge_runs
from infoplan.study.terms import as_meant

PAPER = {
    *((f"uct-{detector}", rho, "batch") for detector in ("none", "best", "copod")
      for rho in (0.05, 0.1, 0.15)),
    *(("puct-copod", rho, "batch") for rho in (0.05, 0.1, 0.15)),
    ("uct-copod", 0.1, "historical"),
    ("puct-copod", 0.1, "historical"),
}  # fmt: skip
"""Method, rho and scope of the curves in the paper's Fig. 5."""


def composed(*arguments: str) -> list[Config]:
    """Configurations that a command line stands for."""
    seen: list[Config] = []

    def act(configs):
        seen.extend(configs)
        return 0, [0.0] * len(configs)

    assert compose_and(act, list(arguments)) == 0
    return seen


def curve_of(config: Config) -> tuple[str, float, str]:
    method = f"{config.planner.name}-{config.detector.name}"
    return method, config.rho, config.detector.scope


@pytest.mark.parametrize("flags", [["-m"], []], ids=["multirun", "single"])
def test_fig5_is_the_papers_fourteen_curves(flags):
    configs = composed(*flags, "experiment=fig5")
    assert len(configs) == 14
    assert {curve_of(config) for config in configs} == PAPER
    default = Config()
    for config in configs:
        assert (config.budget, config.seeds) == (default.budget, default.seeds)
        assert config.model == default.model
        assert config.terrain == default.terrain


def test_options_beside_a_sweep_replace_its_own(volcano):
    configs = composed("-m", "experiment=fig5", "rho=0.1,0.2", "seeds=2", "budget=400",
                       "terrain=volcano", "planner.iterations=7")  # fmt: skip
    assert {config.rho for config in configs} == {0.1, 0.2}
    assert {(config.seeds, config.budget) for config in configs} == {(2, 400)}
    assert {config.planner.iterations for config in configs} == {7}
    runs = merge_runs([identify(config, volcano) for config in configs], [[0]] * len(configs))
    assert len(runs) == 12
    one_planner = composed("experiment=fig5", "planner=uct", "detector.scope=batch", "rho=0.3")
    assert {curve_of(config) for config in one_planner} == {
        (f"uct-{detector}", 0.3, "batch") for detector in ("none", "best", "copod")
    }


def test_a_sweep_can_be_given_on_the_command_line():
    lines = "sweep=['planner=uct rho=0.1,0.2','detector=best budget=300']"
    configs = composed(lines, "seeds=1")
    assert [(c.planner.name, c.detector.name, c.rho, c.budget) for c in configs] == [
        ("uct", "copod", 0.1, 2000), ("uct", "copod", 0.2, 2000), ("puct", "best", 0.1, 300)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("sweep=['planner=uct rhoo=0.1']", "did you mean 'rho'"),
        ("sweep=['planner=[uct']", "cannot be read"),
        ("sweep=['rho=interval(0,1)']", "cannot be read"),
        ("sweep=['planner=foo']", "there is no planner 'foo'"),
        ("sweep=['n_jobs=1,2']", "n_jobs=1,2 cannot be swept"),
        ("sweep=['rho=abc']", "rho must be a number"),
        ("rho=0.1,0.2", "add -m"),
        ("scheduler=tcp://localhost:1", "give backend=dask, too"),
        ("backend=ray", "loky, dask or sequential"),
        ("on_error=panic", "continue or stop"),
    ],
)
def test_a_wrong_study_is_one_sentence(line, words, tmp_path, capfd, monkeypatch):
    monkeypatch.delenv("HYDRA_FULL_ERROR", raising=False)
    assert main(["run", *OPTIONS, line, f"results_dir={tmp_path / 'results'}"]) == 2
    said = capfd.readouterr()
    assert words in said.err
    assert len(said.err.strip().splitlines()) == 1
    assert not list(tmp_path.rglob("*.parquet"))


OVERRIDES = {
    "planner": ["uct", "puct"],
    "detector": ["none", "best", "copod"],
    "terrain": ["volcano", "helens"],
    "experiment": ["smoke"],
    "rho": ["0.05", "0.2"],
    "planner.iterations": ["7"],
    "detector.scope": ["historical"],
    "grid": ["[12,13]"],
    "budget": ["300"],
    "seeds": ["3", "[4,7]"],
    "model.iterations": ["per_sample", "3"],
    "terrain.path": ["null", "'a, b'"],
    "terrain.extent": ["[0,20,0,30]"],
}


def outcome(compose, overrides):
    try:
        return OmegaConf.to_container(compose(overrides))
    except (HydraException, OmegaConfBaseException) as error:
        return explain(error)


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.lists(
        st.sampled_from(sorted(OVERRIDES)).flatmap(
            lambda name: st.sampled_from([f"{name}={value}" for value in OVERRIDES[name]])
        ),
        min_size=1,
        max_size=5,
        unique_by=lambda override: override.partition("=")[0],
    )
)
def test_composing_fast_gives_what_hydra_gives(overrides):
    found = []

    def act(configs):
        compose = Composer("config")
        # The second from memory.
        found.extend(outcome(compose, overrides) for _ in range(2))
        found.append(outcome(partial(hydra_compose, "config"), overrides))
        return 0, [0.0]

    compose_and(act, [])
    assert found[0] == found[1] == found[2]


def test_the_same_science_is_the_same_run(small, volcano):
    name = identify(small, volcano).name
    same = [
        replace(small, seeds=[3, 5]), replace(small, n_jobs=7), replace(small, results_dir="x"),
        replace(small, backend="dask", scheduler="tcp://a:1"), replace(small, resume=False),
        replace(small, on_error="stop"), replace(small, sweep=["rho=1"]),
    ]  # fmt: skip
    for config in same:
        assert identify(config, volcano).name == name
    helens = HelensConfig(path="/there", on_missing="error")
    fallen_back = [
        identify(replace(small, terrain=terrain), volcano).name
        for terrain in (helens, HelensConfig())
    ]
    assert fallen_back == [name, name]
    other = [
        identify(replace(small, rho=0.2), volcano).name,
        identify(replace(small, budget=161), volcano).name,
        identify(replace(small, planner=replace(small.planner, iterations=31)), volcano).name,
        identify(small, replace(volcano, sha256="0" * 64)).name,
    ]
    assert len({name, *other}) == 5
    for detector in ("none", "best"):
        scopes = [
            identify(replace(small, detector=DetectorConfig(detector, scope)), volcano).name
            for scope in ("batch", "historical")
        ]
        assert scopes[0] == scopes[1]
        assert "batch" in scopes[0]


def test_other_numerics_are_another_run(small, volcano, monkeypatch):
    before = identify(small, volcano).name
    monkeypatch.setattr("infoplan.study.identity.NUMERICS_VERSION", -1)
    assert identify(small, volcano).name != before


def test_a_study_that_grows_computes_only_what_is_new(tmp_path):
    folder = f"results_dir={tmp_path}"
    first = ["run", "-m", *OPTIONS, "backend=sequential", folder]
    assert main([*first, "seeds=2", "rho=0.1"]) == 0
    curves = {path: path.stat().st_mtime_ns for path in tmp_path.glob("curves/*/*")}
    assert len(curves) == 2
    assert main([*first, "seeds=3", "rho=0.1,0.2", "planner=uct,puct"]) == 0
    grown = {path: path.stat().st_mtime_ns for path in tmp_path.glob("curves/*/*")}
    assert len(grown) == 12
    assert curves.items() <= grown.items()
    assert main([*first, "seeds=1", "rho=0.1", "resume=false"]) == 0
    again = {path: path.stat().st_mtime_ns for path in tmp_path.glob("curves/*/*")}
    assert len(again.items() - grown.items()) == 1


@pytest.mark.long
def test_fig5_runs_and_then_has_nothing_to_do(tmp_path, capfd):
    small = [option for option in OPTIONS if option != "detector=none"]
    line = [
        "run",
        "-m",
        "experiment=fig5",
        *small,
        "seeds=1",
        "n_jobs=2",
        f"results_dir={tmp_path}",
    ]
    assert main(line) == 0
    assert "14 missions computed, 0 kept" in capfd.readouterr().out
    assert main(line) == 0
    assert "0 missions computed, 14 kept" in capfd.readouterr().out
    assert len(list(tmp_path.glob("runs/*.yaml"))) == 14


def test_an_experiment_needs_no_more_imports_when_all_is_there(tmp_path):
    """What only missions need is not imported to find that there are none to fly."""
    line = ["run", *OPTIONS, "seeds=1", "backend=sequential", f"results_dir={tmp_path}"]
    assert main(line) == 0
    code = (
        "import sys; from infoplan.cli import main; status = main(sys.argv[1:]); "
        "heavy = {'numba', 'scipy', 'pyod', 'sklearn', 'matplotlib', 'joblib'} & set(sys.modules); "
        "sys.exit(status or ','.join(heavy) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code, *line], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("failing", [False, True])
def test_hydras_own_launcher_runs_single_configurations(failing, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if failing:
        monkeypatch.setattr("infoplan.mission.explore", lambda *_: 1 / 0)
    options = [
        *OPTIONS,
        "backend=sequential",
        "seeds=1",
        "rho=0.1,0.2",
        "results_dir=results",
    ]
    assert main(["run", "-m", "hydra/launcher=basic", *options]) == int(failing)
    said = capfd.readouterr()
    assert len(re.findall("1 mission computed" if not failing else "1 failed", said.out)) == 2
    assert ("infoplan: missions failed" in said.err) == failing


def test_a_launcher_of_other_processes_runs_single_configurations(tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = [*OPTIONS, "backend=sequential", "seeds=1", "results_dir=results"]
    launcher = ["hydra/launcher=joblib", "hydra.launcher.n_jobs=2"]
    assert main(["run", "-m", *launcher, *options, "rho=0.1,0.2"]) == 0
    study(quick(), tmp_path / "here", backend="sequential")
    study(replace(quick(), rho=0.2), tmp_path / "here", backend="sequential")
    assert_same_numbers(tmp_path / "results", tmp_path / "here")


def test_a_sweeper_gets_the_mean_final_rmse(tmp_path, small):
    done, _ = study(small, tmp_path, seeds=2, backend="sequential")
    from infoplan.study.stored_curves import final_rmse, stored_curves

    ((run, seeds),) = done.runs
    finals = [curve["rmse"][-1] for curve in stored_curves(done, run, seeds)]
    assert final_rmse(done) == [pytest.approx(sum(finals) / 2)]


def test_a_run_name_says_what_it_is(small, volcano):
    run = identify(small, volcano)
    assert re.fullmatch(r"puct-copod-volcano-rho0\.1-batch-[0-9a-f]{8}", run.name)
    assert set(as_meant(run.science)) == set(asdict(MissionConfig())) | {"numerics_version"}
    # Spikes are stored as the first version did, so that the run keeps its name.
    assert set(run.science) == set(as_meant(run.science)) - {"fault"} | {"outliers"}


def test_expand_multiplies_each_line_alone():
    jobs: list[list[str]] = []

    def act(configs):
        jobs.extend(sweep_jobs(["a=1,2 b=x", "c=\"'p, q'\" ++d=3"], ["b=y"]))
        with pytest.raises(UsageError, match="cannot be read"):
            sweep_jobs(["a=1,"], [])
        return 0, [0.0]

    compose_and(act, [])
    assert jobs == [["b=y", "a=1"], ["b=y", "a=2"], ["b=y", "c='p, q'", "++d=3"]]
