"""Sizes that nobody meant are refused before anything is flown; what is merely large is not."""

import subprocess
import sys
from dataclasses import replace

import pytest
from studies import OPTIONS, curves, quick

import infoplan
from infoplan import machine as this_machine
from infoplan import mission_cost
from infoplan.cli import main
from infoplan.config import GpConfig, StudentTConfig, seed_list
from infoplan.errors import UsageError
from infoplan.study import limits

GB = 1e9


@pytest.fixture
def machine(monkeypatch):
    """Let the machine have 16 GB, all of them free, and 1024 open files."""
    for module in (limits, mission_cost):
        monkeypatch.setattr(module, "machine_memory", lambda: 16 * GB)
    monkeypatch.setattr(limits, "free_memory", lambda: 16 * GB)
    monkeypatch.setattr(limits.resource, "getrlimit", lambda what: (1024, 4096))


@pytest.mark.parametrize(
    ("option", "named"),
    [
        ("budget=1000000000", "budget=1000000000 needs about 8.00 EB of memory"),
        ("seeds=1000000000", "seeds=1000000000 makes a study of 1.00e+09 missions"),
        ("grid=[80000,8000]", "grid=[80000, 8000] needs about"),
        ("planner.iterations=1000000000", "planner.iterations=1000000000 needs about 104 GB"),
        ("robot.steering_angles=1000000000", "robot.steering_angles=1000000000"),
    ],
)
def test_what_cannot_fit_is_refused_with_the_option_to_lower(
    option, named, machine, capfd, tmp_path
):
    assert main(["run", *OPTIONS, option, f"results_dir={tmp_path}"]) == 2
    said = capfd.readouterr().err
    assert said.startswith(f"infoplan: {named}")
    assert "16.0 GB" in said
    assert len(said.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_long_pilot_is_refused_before_its_path_is_made(machine, capfd, tmp_path):
    options = [*OPTIONS, "model=own", "model.function=own_methods.Smooth", "budget=2000000000"]
    options += ["pilot.samples=1000000000", f"results_dir={tmp_path}"]
    assert main(["run", *options]) == 2
    assert "pilot.samples=1000000000" in capfd.readouterr().err


@pytest.mark.parametrize(
    "changes",
    [
        {"budget": 5000, "grid": [200, 200]},
        {"budget": 20_000},
        {"budget": 20_000, "model": GpConfig(dtype="float32")},
        {"budget": 5000, "model": StudentTConfig()},
        {"grid": [2, 100_000]},
        {"grid": [1000, 1000]},
    ],
)
def test_what_users_mean_is_not_refused(changes, machine):
    mission_cost.check_mission(replace(quick(), **changes))


def test_single_precision_takes_half():
    double, single = (replace(quick(), budget=30_000, model=GpConfig(dtype=dtype))
                      for dtype in ("float64", "float32"))  # fmt: skip
    assert mission_cost.memory_of(double) == pytest.approx(8 * 30_000**2, rel=0.05)
    assert mission_cost.memory_of(single) == pytest.approx(4 * 30_000**2, rel=0.05)


def test_a_sweep_of_a_million_is_refused_before_it_is_composed(machine, capfd, tmp_path):
    sweep = [
        "sensor.noise_std=range(0,1000)",
        "rho=" + ",".join(f"{k / 1000}" for k in range(1000)),
    ]
    assert main(["run", "-m", *OPTIONS, *sweep, f"results_dir={tmp_path}"]) == 2
    said = capfd.readouterr().err
    assert said.startswith("infoplan: this sweep has 1000000 configurations, which take 90.0 GB")


HUGE = {
    "sweep: ['sensor.noise_std=range(0,100000) budget=range(200,10200)']": "1.00e+09",
    "sweep: ['rho=range(0,1,0.01) sensor.noise_std=range(0,1000000)', 'rho=0.1']": "1.00e+08",
    "hydra: {sweeper: {params: {sensor.noise_std: 'range(0,100000)', budget: 'range(200,10200)'}}}":
        "1.00e+09",
    "hydra: {sweeper: {params: {rho: 'range(0,1,0.000000001)'}}}": "1.00e+09",
}  # fmt: skip
"""Experiments and how many configurations they are."""


@pytest.mark.parametrize("content", HUGE)
def test_an_experiment_of_too_many_is_refused_before_it_is_expanded(
    content, machine, capfd, tmp_path
):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "huge.yaml").write_text(f"# @package _global_\n{content}\n")
    multirun = ["-m"] if "hydra" in content else []
    assert main(["run", *multirun, "-cd", str(tmp_path), "experiment=huge", "terrain=volcano"]) == 2
    said = capfd.readouterr().err
    assert said.startswith(f"infoplan: this sweep has {HUGE[content]} configurations, which take")
    assert len(said.splitlines()) == 1


def test_the_studies_of_an_experiment_are_counted_over_all_jobs(machine, capfd, tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "many.yaml").write_text(
        "# @package _global_\nsweep: ['sensor.noise_std=range(0,100000)']\n"
    )
    line = ["run", "-cd", str(tmp_path), "experiment=many", "terrain=volcano", "-m", "rho=0.1,0.2"]
    assert main(line) == 2
    assert "this sweep has 200000 configurations" in capfd.readouterr().err


def test_a_mission_from_python_is_refused_too(machine, volcano):
    with pytest.raises(UsageError, match=r"budget=100000000 needs about"):
        infoplan.fly(replace(quick(), budget=100_000_000), terrain=volcano)


def test_workers_are_as_many_as_the_memory_holds(machine, monkeypatch):
    missions = [quick(), replace(quick(), budget=20_000)]
    each = mission_cost.WORKER_BYTES + mission_cost.memory_of(missions[1])
    workers, why = limits.affordable_workers(1000, missions)
    assert workers == int(16 * GB / each)
    assert why.startswith(f"{workers} workers instead of 1000: each may take")
    assert "16.0 GB are free" in why
    assert limits.affordable_workers(2, missions) == (2, "")
    monkeypatch.setattr(limits, "free_memory", lambda: 0.0)
    assert limits.affordable_workers(2, missions)[0] == 1


def test_workers_are_as_many_as_there_may_be_open_files(machine, monkeypatch):
    monkeypatch.setattr(limits.resource, "getrlimit", lambda what: (64, 64))
    workers, why = limits.affordable_workers(50, [quick()])
    assert workers == 8
    assert "64 files open (ulimit -n)" in why


def test_few_descriptors_are_enough(tmp_path):
    line = " ".join([*(f"'{option}'" for option in OPTIONS), f"results_dir={tmp_path}"])
    command = f"ulimit -n 32; exec '{sys.executable}' -m infoplan.cli run {line} seeds=3 n_jobs=3"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 worker instead of 3" in done.stdout
    assert len(curves(tmp_path)) == 3


def test_the_limits_of_control_groups_count(monkeypatch, tmp_path):
    both = [("0::/box/inner", "box", "memory.max", "memory.current"),
            ("4:cpu,memory:/box/inner", "memory/box", "memory.limit_in_bytes",
             "memory.usage_in_bytes")]  # fmt: skip
    monkeypatch.setattr(this_machine, "CGROUPS", tmp_path)
    real = this_machine._lines
    for line, folder, limit, usage in both:
        place = tmp_path / folder
        (place / "inner").mkdir(parents=True)
        (place / "inner" / limit).write_text("max\n")
        (place / "inner" / usage).write_text("5\n")
        (place / limit).write_text("3000000000\n")
        (place / usage).write_text("1000000000\n")
        monkeypatch.setattr(
            this_machine, "_lines",
            lambda path, line=line: [line] if path.name == "cgroup" else real(path),
        )  # fmt: skip
        assert this_machine.machine_memory() == 3e9
        assert this_machine.free_memory() <= 2e9


def test_a_day_is_warned_of_and_not_refused():
    assert limits.warning_of_time(3 * 86_400.0, 4) == ""
    assert "about 3.00 days with 1 worker" in limits.warning_of_time(3 * 86_400.0, 1)
    assert mission_cost.seconds_of(quick()) < 60
    slow = replace(quick(), budget=100_000)
    assert mission_cost.seconds_of(slow) > 86_400
    many = replace(quick(), planner=replace(quick().planner, iterations=10**9))
    assert mission_cost.seconds_of(many) > mission_cost.seconds_of(quick()) + 600


def test_a_count_of_seeds_is_no_list():
    assert len(seed_list(10**12)) == 10**12


@pytest.mark.long
@pytest.mark.parametrize(
    "options",
    [
        ["budget=3000"],
        ["budget=3000", "model.dtype=float32"],
        ["budget=1500", "model=student_t"],
        ["budget=1500", "detector=gp_residual", "detector.scope=historical"],
        ["budget=1500", "detector=local", "detector.scope=historical"],
        ["budget=130", "grid=[1000,1000]"],
        ["budget=130", "planner=puct", "planner.iterations=1000000"],
    ],
    ids=" ".join,
)
def test_estimates_are_near_what_missions_take(options):
    """Peak of the memory of a mission, in a process of its own, above that of a small one."""
    code = """
import pickle, resource, sys
from infoplan.api import configure, load_terrain
from infoplan.study import flight as worker
from infoplan.study.identity import identify
from infoplan.mission_cost import memory_of

terrain = load_terrain("volcano")


def fly(*options):
    config = configure("terrain=volcano", "detector=none", "planner=random", "grid=[10,10]",
                       "model.pilot_iterations=1", "model.iterations=1", *options)
    run = identify(config, terrain)
    pickle.dumps(worker.fly(worker.Task(run, 0, 0)).tables)
    return memory_of(config), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


wanted = sys.argv[1:]
large = ("budget", "grid", "planner.iterations")
small = [option for option in wanted if not option.startswith(large)]
_, before = fly("budget=120", *small)
estimate, after = fly(*([] if "planner=puct" in wanted else ["planner.actions=60"]), *wanted)
print(estimate / (1024 * (after - before)))
"""
    done = subprocess.run([sys.executable, "-c", code, *options], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert 0.4 < float(done.stdout) < 1.6


@pytest.mark.parametrize(
    ("options", "measured"),
    [
        ([], 14.2),
        (["model.iterations=20"], 72.2),
        (["model.optimizer=lbfgs"], 11.5),
        (["budget=1000"], 1.24),
        (["model=student_t", "budget=1000"], 6.2),
        (["model=relevance_pursuit", "budget=1000"], 13.2),
        (["model=vecchia"], 1.68),
        (["model=vecchia", "model.iterations=20"], 3.1),
        (["model=vecchia", "planner.execute_actions=1"], 9.7),
    ],
)
def test_a_guess_of_time_is_near_what_such_missions_took_on_a_server(options, measured):
    """Medians of missions on helens, two at a time."""
    guess = mission_cost.seconds_of(infoplan.configure("planner=puct", "detector=copod", *options))
    assert measured / 3 < guess < 3 * measured
