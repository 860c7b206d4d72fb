"""Whatever a configuration fails by ends with status 2 and one sentence that names the thing."""

import pytest

from infoplan.cli import main

EXPERIMENTS = {
    "bad": ("a: [1\nb: {", "bad.yaml, line 3, column 2 is no YAML"),
    "wrongkey": (
        "rhoo: 0.2",
        "experiment=wrongkey: there is no option 'rhoo' (did you mean 'rho'?",
    ),
    "deeper": ("planner: {itterations: 3}", "(did you mean 'planner.iterations'"),
    "wrongtype": ("budget: lots", "experiment=wrongtype: budget=lots is not possible"),
    "listed": ("rho: [1, 2]", "rho must be a number"),
    "group": ("planner: uct", "override /planner: uct"),
    "circle": ("rho: ${rho}", "rho refers with ${...}"),
    "nowhere": ("rho: ${nothing.there}", "rho refers with ${...}"),
    "unquoted": ("results_dir: 2024_11_25", "results_dir is text, but YAML reads"),
    "nested": ("sweep: ['experiment=smoke']", "the entry 'experiment=smoke' of sweep"),
    "mapped": ("sweep: [{rho: 1}]", "of sweep cannot be read"),
    "code": ("rho: !!python/object/apply:os.abort []", "code.yaml, line 2, column 6 is no YAML"),
    "itself": ("a: &a [*a]", "nested too deep"),
    "defaults": ("defaults: 3", "`defaults:` must be a list"),
}


def said(words: list[str], capfd: pytest.CaptureFixture[str]) -> str:
    """What a command line is refused with: status 2, and one line that names no internals."""
    assert main(["run", *words]) == 2
    told = capfd.readouterr()
    assert told.out == ""
    assert len(told.err.strip().splitlines()) == 1, told.err
    for internal in ("unexpected", "OmegaConf", "full_key", "Config'", "Traceback", "lexer"):
        assert internal not in told.err
    return told.err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("model=itgp model.noise_start=restarted", "has no option 'model.noise_start'"),
        ("model.noise_start=restarted model.iterations=0", "leave model.noise_start=carried"),
        ("model.optimizer_state=reset model.iterations=0", "leave model.optimizer_state=carried"),
        ("model.noise_start=floor", "use carried or restarted"),
        ("planner.average=all", "use driven or planned"),
        ("planner.border=zero", "use struck, visit or terminal"),
        ("planner.rollout_step=metre", "use action or sample"),
        ("fault.draw=mission", "use spike or batch"),
        ("detector.judge_pilot=maybe", "detector.judge_pilot must be true or false"),
        ("pilot.outliers=2", "pilot.outliers must be true or false"),
        ("pilot.outliers=-1", "pilot.outliers must be true or false"),
        ("planner=greedy planner.average=planned", "has no option 'planner.average'"),
    ],
)
def test_a_reading_that_there_is_not_is_named(line, words, capfd):
    assert words in said(line.split(), capfd)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_a_wrong_experiment_is_named(name, tmp_path, capfd, monkeypatch):
    monkeypatch.delenv("HYDRA_FULL_ERROR", raising=False)
    content, words = EXPERIMENTS[name]
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / f"{name}.yaml").write_text(f"# @package _global_\n{content}\n")
    assert words in said(["-cd", str(tmp_path), f"experiment={name}"], capfd)


def test_ones_own_experiment_is_found(tmp_path, capfd):
    (tmp_path / "experiment").mkdir()
    own = "defaults:\n  - override /planner: uct\nterrain: {path: '${oc.env:X}'}\n"
    (tmp_path / "experiment" / "mine.yaml").write_text(f"# @package _global_\n{own}")
    assert main(["run", "--config-dir", str(tmp_path), "experiment=mine", "--cfg", "job"]) == 0
    shown = capfd.readouterr().out
    assert "name: uct" in shown
    assert "path: ${oc.env:X}" in shown


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("=1", "'=1' is no option=value"),
        ("rho", "rho wants a value: write rho=..., a number, at least 0"),
        ("rho=", "rho= has no value"),
        ("~rho", "give rho=..."),
        ("+x=1", "there is no option 'x'"),
        ("+rho=1", "write rho=... without the +"),
        ("+experiment=smoke", "write experiment=... without the +"),
        ("rho.x=1", "rho has no parts"),
        ("experiment=fig55", "did you mean 'fig5'?"),
        ("detector=mine.far", "detector=own detector.function=mine.far"),
        ("planner=null", "chosen by a name"),
        ("--resolve", "--resolve changes what --cfg shows"),
        ("--cfg", "--cfg terrain=volcano is not a choice: use job, hydra or all"),
        ("--cfg foo", "--cfg foo is not a choice: use job, hydra or all"),
        ("--cfg job --package foo", "--package foo is no part"),
        ("--info=junk", "--info junk is not a choice: use all, config"),
        ("-cd /nowhere/at/all", "is no folder"),
        ("-cn foo", "there is no configuration 'foo'"),
        ("-sc", "install=bash"),
        ("--multirn", "did you mean '--multirun'?"),
        ("-m --cfg job", "do not go together"),
        ("hydra.foo=1", "there is no option 'hydra.foo'"),
        ("hydra/launcher=foo", "there is no hydra/launcher 'foo'"),
        ("hydra.run.dir=/proc/1/x", "/proc/1/x cannot be"),
        ("-m hydra.sweep.dir=/proc/1/x rho=0.1", "/proc/1/x cannot be"),
        ("-m rho=interval(0,1)", "needs a sweeper that searches"),
        ("-m rho=range(0.3,0.1)", "the values of rho are none"),
        ("-m planner=glob(x*)", "the values of planner are none"),
        ("-m rho=range(0,1,nan)", "needs finite numbers and a step other than 0"),
        ("-m rho=range(0,inf,0.1)", "needs finite numbers"),
        ("-m budget=range(1,3,0)", "a step other than 0"),
        ("rho=${rho}", "rho refers with ${...}"),
        ("rho=${budget", "rho must be a number"),
        ("rho=ä", "rho must be a number"),
        ("rho=true", "rho must be a number"),
        ("detector.scope=batch,historical", "add -m to run several"),
        ("grid=[[1,2],3]", "grid must be a list of 2 numbers"),
        ("grid=[10.5,20]", "grid must be a list of 2 numbers"),
        ("grid={a:1}", "grid must be a list of 2 numbers"),
        ("fault.amplitude=[[1,2],[3]]", "fault.amplitude must be a list of 2 numbers"),
        ("fault.amplitude=[1,1e20]", "at most 1e+09"),
        ("pilot.control_points=[1,2]", "pilot.control_points must be a list"),
        ("budget=9223372036854775808", "is too large"),
        ("seeds=[9223372036854775808]", "is too large"),
        ("n_jobs=2147483648", "at most 10000"),
        ("terrain.extent=[0,1e308,0,1e308]", "is no workspace: its sides"),
        ("model.amplitude=1e308", "at most 1e+06"),
        ("planner.exploration=inf", "must be finite"),
        ("detector.params.=3", "cannot be read"),
        ("sweep=['sweep=[a]']", "of sweep cannot be read"),
    ],
)
def test_a_wrong_command_line_is_one_sentence(line, words, capfd, monkeypatch):
    monkeypatch.delenv("HYDRA_FULL_ERROR", raising=False)
    assert words in said([*line.split(" "), "terrain=volcano"], capfd)


def test_a_value_nested_without_end_is_one_sentence(capfd):
    assert "cannot be read" in said(["grid=" + "[" * 2000 + "]" * 2000], capfd)


@pytest.mark.parametrize(
    "extent", ["[0,1e308,0,1e308]", "[0,1e10,0,1e10]", "[50,0,0,50]", "[0,50,0,0]", "[0,1,0,1e9]"]
)
def test_an_extent_is_refused_in_one_sentence_by_every_command(extent, capfd):
    words = ["terrain=volcano", f"terrain.extent={extent}"]
    refused = said(words, capfd)
    assert "is no workspace" in refused
    assert main(["terrain", "show", *words]) == 2
    assert capfd.readouterr().err == refused
