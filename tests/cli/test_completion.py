"""Completion, as bash, zsh and fish ask for it and use the answer."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from command import infoplan

from infoplan.cli import main

RUNS = ("puct-copod-volcano-rho0.1-batch-1a2b3c4d", "uct-none-volcano-rho0.1-batch-9f8e7d6c")

LINES = {
    "infoplan sho": {"show"},
    "infoplan terrain f": {"fetch"},
    "infoplan show puct": {RUNS[0]},
    "infoplan show 9f": {"9f8e7d6c"},
    "infoplan show run=uct": {f"run={RUNS[1]}"},
    "infoplan audit results_dir=elsewhere k": {"kept-0000ffff"},
    "infoplan figures fig": {"fig1", "fig3", "fig4", "fig5", "fig6", "fig7"},
    "infoplan figures fig5 fig": {"fig1", "fig3", "fig4", "fig6", "fig7"},
    "infoplan figures --s": {"--seeds"},
    "infoplan run planner=w": {"planner=weighted"},
    "infoplan run planner.expl": {"planner.exploration="},
    "infoplan run detector=pyod detector.mo": {"detector.model="},
    "infoplan run -m detector=none,cop": {"detector=none,copod"},
    "infoplan status detector=none,cop": {"detector=none,copod"},
    "infoplan run detector=none,cop": set(),
    "infoplan run detector=pyod detector.features=[x1,x": {"detector.features=[x1,x2"},
    "infoplan run model.optimizer=": {"model.optimizer=adam", "model.optimizer=lbfgs"},
    "infoplan run resume=f": {"resume=false"},
    "infoplan run experiment=s": {"experiment=smoke"},
    "infoplan run --cfg j": {"job"},
    "infoplan run --dry": {"--dry-run"},
    "infoplan run terrain=file terrain.path=maps/hi": {"terrain.path=maps/hills.npy"},
    "infoplan run terrain=file terrain.path=ma": {"terrain.path=maps/"},
    "infoplan animate format=m": {"format=mp4"},
    "infoplan replay x detector=b": {"detector=best"},
    "infoplan survey log.csv detector=b": set(),
    "infoplan next puct": {RUNS[0]},
    "infoplan next x planner=l": {"planner=lawnmower"},
    "infoplan next x turn": {"turning_radius="},
    "infoplan help terrain s": {"show"},
    "infoplan nonsense x": set(),
}
"""What a line is completed to: the words that its last one may become."""

SHELLS = ("bash", "zsh", "fish")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("completion")
    for results, run in ((folder / "results", RUNS[0]), (folder / "results", RUNS[1]),
                         (folder / "elsewhere", "kept-0000ffff")):  # fmt: skip
        path = results / "curves" / f"run={run}" / "seed=0.parquet"
        path.parent.mkdir(parents=True)
        path.touch()
    (folder / "maps").mkdir()
    (folder / "maps" / "hills.npy").touch()
    (folder / "maps" / "dem (1).npy").touch()
    (folder / "bin").mkdir()
    command = folder / "bin" / "infoplan"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m infoplan "$@"\n')
    command.chmod(0o755)
    return folder


def ask(shell: str, folder: Path, lines: list[str]) -> dict[str, set[str]]:
    """Let a shell complete lines with the script that it is given."""
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell} here")
    script = folder / f"ask.{shell}"
    script.write_text({"bash": BASH, "zsh": ZSH, "fish": FISH}[shell])
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    env = {**os.environ, "PATH": path, "HOME": str(folder), "FOLDER": str(folder)}
    options = {"bash": ["--norc", "--noprofile"], "zsh": ["-f"], "fish": ["--no-config"]}[shell]
    done = subprocess.run(
        [shell, *options, script, *lines], cwd=folder, env=env, capture_output=True, text=True,
        timeout=240, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    out = (folder / "zsh.out").read_text() if shell == "zsh" else done.stdout
    found: dict[str, set[str]] = {}
    for line in out.splitlines():
        if line.startswith("# "):
            words = found.setdefault(line[2:], set())
        elif line:
            words.add(line)
    assert list(found) == lines, done.stderr
    return found


BASH = """
eval "$(infoplan -sc install=bash)"
for line in "$@"; do
    echo "# $line"
    COMP_LINE=$line COMP_POINT=${#line} COMPREPLY=()
    _infoplan_completion infoplan
    for reply in "${COMPREPLY[@]}"; do echo "$reply"; done
done
"""

ZSH = r"""
zmodload zsh/zpty
rm -f $FOLDER/zsh.out
zpty z zsh -f -i
zpty -w z 'autoload -Uz compinit; compinit -u -d $FOLDER/zcompdump; setopt no_beep'
zpty -w z 'eval "$(infoplan -sc install=zsh)"'
zpty -w z 'compadd() {
    local -a caught; builtin compadd -O caught "$@"; print -rl -- $caught >> $FOLDER/zsh.out
    builtin compadd "$@" }'
zpty -w z 'watched() { _infoplan_completion; touch $FOLDER/done }; compdef watched infoplan'
zpty -w z 'touch $FOLDER/ready'
for k in {1..600}; do [[ -e $FOLDER/ready ]] && break; sleep 0.05; done
for line in "$@"; do
    print -r -- "# $line" >> $FOLDER/zsh.out
    rm -f $FOLDER/done
    zpty -w -n z "$line"$'\t'
    for k in {1..600}; do [[ -e $FOLDER/done ]] && break; sleep 0.05; done
    zpty -w -n z $'\x15'
    while zpty -r -t z skipped; do :; done
done
zpty -d z
"""

FISH = """
infoplan -sc install=fish | source
for line in $argv
    echo "# $line"
    for reply in (complete -C $line)
        string split -f 1 \\t -- $reply
    end
end
"""


def whole(line: str, reply: str, breaks: str) -> str:
    """Put a reply of bash where bash puts it: after the last character that breaks words."""
    word = line.rpartition(" ")[2]
    start = max(word.rfind(character) for character in breaks) + 1
    return word[:start] + reply.removesuffix(" ")


@pytest.mark.parametrize(
    "shell",
    [shell if shell == "bash" else pytest.param(shell, marks=pytest.mark.long) for shell in SHELLS],
)
def test_a_shell_completes_lines(shell, folder):
    # A bracket that is not quoted is a pattern in zsh.
    asked = {line: line.replace("[", "'[") if shell == "zsh" else line for line in LINES}
    found = ask(shell, folder, list(asked.values()))
    for line, expected in LINES.items():
        words = found[asked[line]]
        if shell == "bash":
            words = {whole(line, word, "=:") for word in words}
        assert words == expected, line


@pytest.mark.parametrize("breaks", ["=:", "=", "@"])
def test_bash_may_break_words_at_other_characters(breaks, folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    for line in ("infoplan run planner=w", "infoplan run terrain.path=maps/hi"):
        monkeypatch.setenv("COMP_WORDBREAKS", " \t\n\"'><;|&(" + breaks)
        monkeypatch.setenv("COMP_LINE", line + "behind-the-cursor")
        monkeypatch.setenv("COMP_POINT", str(len(line)))
        assert main(["-sc", "query=bash"]) == 0
        (reply,) = capfd.readouterr().out.splitlines()
        assert {whole(line, reply, breaks)} == (LINES | {
            "infoplan run terrain.path=maps/hi": {"terrain.path=maps/hills.npy"}
        })[line]  # fmt: skip


@pytest.mark.parametrize(
    ("typed", "reply"),
    [
        ("maps/dem", "terrain.path=maps/dem\\ \\(1\\).npy "),
        ("maps/dem\\ ", "terrain.path=maps/dem\\ \\(1\\).npy "),
        ("'maps/dem ", "maps/dem (1).npy' "),
        ('"maps/d', 'maps/dem (1).npy" '),
    ],
)
def test_bash_gets_its_spaces_quoted(typed, reply, folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    monkeypatch.delenv("COMP_WORDBREAKS", raising=False)
    monkeypatch.setenv("COMP_LINE", f"infoplan run terrain.path={typed}")
    monkeypatch.delenv("COMP_POINT", raising=False)
    assert main(["-sc", "query=bash"]) == 0
    assert capfd.readouterr().out == f"{reply}\n"


def test_show_offers_runs_and_options_and_never_itself(folder):
    said = infoplan("-sc", "query=fish", cwd=folder, env={"COMP_LINE": "infoplan show "}).stdout
    words = [line.split("\t")[0] for line in said.splitlines()]
    assert words == [*RUNS, "1a2b3c4d", "9f8e7d6c", "run=", "results_dir="]


def test_options_that_are_given_are_not_offered_again(folder):
    line = "infoplan replay puct seeds=1 n_jobs=2 "
    said = infoplan("-sc", "query=fish", cwd=folder, env={"COMP_LINE": line}).stdout
    words = {text.split("\t")[0] for text in said.splitlines()}
    assert {"resume=", "detector=", "model.", "results_dir="} <= words
    assert not words & {"seeds=", "n_jobs=", "run=", *RUNS}


def test_hydra_s_own_words():
    line = "infoplan run hydra/launcher=info"
    said = infoplan("-sc", "query=fish", env={"COMP_LINE": line}).stdout
    assert said == "hydra/launcher=infoplan\n"


def test_names_that_would_break_a_line_are_left_out(tmp_path, monkeypatch, capfd):
    for name in ("plain", "two\nlines", "e\x1b[31m"):
        (tmp_path / name).touch()
    monkeypatch.setenv("COMP_LINE", f"infoplan run terrain=file terrain.path={tmp_path}/")
    monkeypatch.delenv("COMP_POINT", raising=False)
    assert main(["-sc", "query=zsh"]) == 0
    assert capfd.readouterr().out == f"plain\tterrain.path={tmp_path}/plain\t\n"


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_can_be_taken_out_again(shell, capfd):
    assert main(["-sc", f"uninstall={shell}"]) == 0
    assert "infoplan" in capfd.readouterr().out
    assert main([f"--shell-completion=install={shell}"]) == 0
    assert f"query={shell}" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-sc"], "-sc"),
        (["-sc", "install=tcsh"], "use install=, uninstall= or query= with bash, zsh, fish"),
        (["-sc", "instal=bash"], "did you mean 'install'?"),
        (["run", "-sc", "install=tcsh"], "with bash, zsh, fish"),
    ],
)
def test_a_wrong_request_is_one_sentence(words, message, capfd):
    assert main(words) == 2
    said = capfd.readouterr().err
    assert message in said
    assert len(said.splitlines()) == 1
