"""A study whose output is closed or full goes on, stores its tables, and says what it lost."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from studies import OPTIONS, curves

from infoplan.output import Output


def run(folder: Path, redirections: str, *options: str) -> subprocess.CompletedProcess:
    words = " ".join(f"'{word}'" for word in [*OPTIONS, *options, f"results_dir={folder}"])
    line = f"'{sys.executable}' -m infoplan.cli run {words} {redirections}"
    return subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("backend", ["loky", pytest.param("sequential", marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("redirections", "reason"),
    [
        (">&-", "cannot be written (it is closed): what"),
        (">/dev/full", "cannot be written (No space left on device): what"),
        pytest.param(
            "| head -c 1", "cannot be written (Broken pipe): what", marks=pytest.mark.long
        ),
    ],
)
def test_a_study_outlives_its_output(redirections, reason, backend, tmp_path):
    if "full" in redirections and not os.path.exists("/dev/full"):
        pytest.skip("this system has no full device")
    done = run(tmp_path, redirections, "seeds=2", "n_jobs=1", f"backend={backend}")
    assert len(curves(tmp_path)) == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"infoplan: standard output {reason} it should show is lost")
    if "|" not in redirections:  # else the status is that of head
        assert done.returncode == 1


@pytest.mark.parametrize(
    "redirections",
    [
        "<&- >&- 2>&-",
        pytest.param("2>/dev/full", marks=pytest.mark.long),
        pytest.param("2>&-", marks=pytest.mark.long),
    ],
)
def test_a_study_needs_no_standard_error(redirections, tmp_path):
    done = run(tmp_path, redirections, "seeds=1", "n_jobs=1")
    assert done.returncode == (1 if " >&-" in redirections else 0)
    assert len(curves(tmp_path)) == 1


def test_letters_that_a_terminal_does_not_have_become_escapes(tmp_path):
    with open(tmp_path / "latin", "w", encoding="latin-1") as stream:
        output = Output(stream)
        output.write("süß ⠉ α\n")
        output.flush()
        assert not output.lost
    assert (tmp_path / "latin").read_bytes() == "süß \\u2809 \\u03b1\n".encode("latin-1")
