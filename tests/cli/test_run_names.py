"""A run is named the same way in every command: by its name, its hash, the beginning of either."""

import json
import shutil

import pytest
from flown import short_mission, store

from infoplan.cli import main
from infoplan.errors import UsageError
from infoplan.study.run_names import choose_run, find_run, stored_runs

RUNS = ("puct-copod-helens-rho0.1-batch-1a2b3c4d", "puct-copod-helens-rho0.15-batch-1a2bffff",
        "uct-none-helens-rho0.1-batch-00001111")  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory, volcano):
    folder = tmp_path_factory.mktemp("named")
    for planner in ("uct", "puct"):
        store(folder, short_mission(planner), volcano)
    return folder


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (RUNS[0], 0),
        ("1a2b3c4d", 0),
        ("1a2b3", 0),
        ("1a2bf", 1),
        ("0000", 2),
        ("u", 2),
        ("uct-none-helens-rho0.1-batch", 2),
        ("puct-copod-helens-rho0.15", 1),
    ],
)
def test_what_names_a_run(text, expected):
    assert choose_run(text, RUNS, "here") == RUNS[expected]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1a2b", "stands for 2 runs in here: .*rho0.1-batch-1a2b3c4d or .*1a2bffff"),
        ("puct-copod-helens-rho0.1", "stands for 2 runs"),
        ("000", "not stored in here"),
        ("1a2b3c4e", "not stored in here .did you mean '1a2b3c4d'"),
        ("uct-nome-helens-rho0.1-batch", "not stored in here .did you mean '.*uct-none"),
        ("", "not stored in here"),
    ],
)
def test_what_names_none_or_several(text, message):
    with pytest.raises(UsageError, match=message):
        choose_run(text, RUNS, "here")


def test_a_whole_hash_or_name_is_no_beginning():
    runs = ("uct-a-11112222", "uct-a-11112222-x-33334444")
    assert choose_run("uct-a-11112222", runs, "here") == runs[0]
    assert choose_run("11112222", runs, "here") == runs[0]


def test_a_message_names_a_few_of_many():
    runs = [f"uct-none-{k:08d}" for k in range(40)]
    with pytest.raises(UsageError, match="or 34 others") as raised:
        choose_run("uct", runs, "here")
    assert len(str(raised.value)) < 400


def test_nothing_is_stored(tmp_path):
    with pytest.raises(UsageError, match="holds no finished mission"):
        find_run(tmp_path, "uct")


@pytest.mark.parametrize("form", ["positional", "named"])
@pytest.mark.parametrize("name", ["whole", "hash", "digits", "beginning"])
@pytest.mark.parametrize(
    "command", ["show", "status", "replay", pytest.param("audit", marks=pytest.mark.long)]
)
def test_every_command_takes_every_name(command, name, form, folder, tmp_path, capfd):
    run = next(run for run in stored_runs(folder) if run.startswith("puct"))
    end = run.rpartition("-")[2]
    text = {"whole": run, "hash": end, "digits": end[:5], "beginning": "puct-cop"}[name]
    word = text if form == "positional" else f"run={text}"
    more = ["--json"] if command == "status" else []
    if command == "replay":  # which stores a run of its own
        folder = shutil.copytree(folder, tmp_path / "copy")
        more += ["seeds=1", "backend=sequential"]
    assert main([command, word, f"results_dir={folder}", *more]) == 0
    said = capfd.readouterr().out
    assert run in said or command == "audit"
    if command == "status":
        assert [found["run"] for found in json.loads(said)["runs"]] == [run]
    assert "uct-copod-volcano" not in said.replace("puct-copod-volcano", "")


@pytest.mark.parametrize("command", ["show", "audit", "status", "replay", "animate", "figures",
                                     "claims", "report", "leaderboard"])  # fmt: skip
def test_no_command_takes_another_name(command, folder, capfd):
    assert main([command, "run=nobody", f"results_dir={folder}"]) == 2
    said = capfd.readouterr().err
    assert "run=nobody is not stored in" in said
    assert "uct-copod-volcano" in said
    assert len(said.splitlines()) == 1


def test_runs_are_filters_of_studies(folder, capfd):
    whole = main(["claims", "run=[puct,uct]", f"results_dir={folder}", "--json"])
    both = json.loads(capfd.readouterr().out)
    assert whole == 0
    assert main(["claims", f"results_dir={folder}", "--json"]) == 0
    assert json.loads(capfd.readouterr().out) == both
    assert main(["claims", "run=puct", f"results_dir={folder}", "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["claims"] != both["claims"]
    assert main(["figures", "fig5", "planner=puct", f"results_dir={folder}"]) == 1
    assert "fig5 lacks" in capfd.readouterr().err


@pytest.mark.parametrize("word", ["model.jitter=1e-6", "rho=[0.1,0.2]", "planner=[puct,uct]",
                                  "terrain.unit=null", "terrain=volcano", "model=gp",
                                  "grid=[12,14]", "method=puct-copod"])  # fmt: skip
def test_filters_are_read_as_their_options_are(word, folder, capfd):
    status = main(["claims", word, f"results_dir={folder}", "--json"])
    expected = 2 if word == "terrain.unit=null" else 0
    assert status == expected, capfd.readouterr().err


def test_replays_are_chosen_by_any_name_of_the_run_that_was_flown(folder, tmp_path, capfd):
    copy = shutil.copytree(folder, tmp_path / "copy")
    assert (
        main(["replay", "uct", "detector=none", f"results_dir={copy}", "backend=sequential"]) == 0
    )
    capfd.readouterr()
    flown = next(run for run in stored_runs(copy) if run.startswith("uct"))
    for word in ("replay=uct", f"replay={flown}", f"replay={flown[-8:]}", "replay=true"):
        assert main(["claims", word, "--json", f"results_dir={copy}"]) == 0
        claims = json.loads(capfd.readouterr().out)["claims"]
        assert {claim["verdict"] for claim in claims} == {"missing"}
    assert main(["claims", "replay=nobody", f"results_dir={copy}"]) == 2
    assert "run=nobody is not stored" in capfd.readouterr().err
