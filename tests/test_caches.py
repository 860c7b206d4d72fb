"""Installations that cannot be written, and no home: containers."""

import ctypes
import os
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from command import SMALL

import infoplan
from infoplan import caches

PACKAGE = Path(infoplan.__file__).parent
RANDOM = [*(option for option in SMALL if "planner" not in option), "planner=random"]
CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH, PR_CAPBSET_DROP = 1, 2, 24


def as_anybody() -> None:
    """Let permissions hold for root, too: in a process that is about to be another program."""
    if os.geteuid() == 0:
        for capability in (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH):
            ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)


@pytest.fixture
def container(tmp_path: Path) -> Path:
    """A read-only installation in ``site``, a read-only home, an empty ``tmp`` and ``work``."""
    site = tmp_path / "site"
    shutil.copytree(PACKAGE, site / "infoplan", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(
        PACKAGE.parent / "conf", site / "infoplan/conf", dirs_exist_ok=True,
        ignore=shutil.ignore_patterns("__pycache__"),
    )  # fmt: skip
    for name in ("home", "work", "tmp"):
        (tmp_path / name).mkdir()
    locked = [tmp_path / "home", site, *(path for path in site.rglob("*") if path.is_dir())]
    for folder in locked:
        folder.chmod(0o555)
    yield tmp_path
    for folder in locked:
        folder.chmod(0o755)


def run(container: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    private = ("HOME", "NUMBA_CACHE_DIR", "MPLCONFIGDIR", "INFOPLAN_DATA")
    env = {
        name: value
        for name, value in os.environ.items()
        if name not in private and not name.startswith("XDG_")
    }
    env |= {
        "PYTHONPATH": str(container / "site"),
        "HOME": str(container / "home"),
        "TMPDIR": str(container / "tmp"),
    }
    main = "import sys; from infoplan.cli import main; sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-c", main, *arguments],
        env=env | environment,
        cwd=container / "work",
        preexec_fn=as_anybody,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert "Traceback" not in done.stderr + done.stdout
    assert "unexpected" not in done.stderr + done.stdout
    return done


def said(done: subprocess.CompletedProcess[str]) -> str:
    return done.stdout + done.stderr


@pytest.mark.long
@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="permissions of POSIX")
def test_kernels_go_to_a_temporary_folder_of_ones_own_and_one_line_says_so(container):
    # PyOD imports Matplotlib; a random walk has less to compile.
    mission = [*RANDOM, "seeds=2", "n_jobs=2", "detector=pyod"]
    done = run(container, "run", *mission)
    assert done.returncode == 0, said(done)
    assert said(done).count("compiled kernels are kept in") == 1
    assert "atplotlib" not in said(done)
    [folder] = (container / "tmp").iterdir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert list(folder.glob("infoplan-kernels/*/*.bin"))
    # The next process uses what is there.
    before = sorted(folder.rglob("*.bin"))
    run(container, "run", *mission, "resume=false")
    assert sorted(folder.rglob("*.bin")) == before
    assert list((container / "tmp").iterdir()) == [folder]


@pytest.mark.long
def test_without_any_cache_it_still_runs(container):
    # A file in the place of every folder.
    (container / "file").touch()
    (container / "work/sitecustomize.py").write_text(
        "import tempfile\n"
        "real = tempfile.mkdtemp\n"
        "def mkdtemp(suffix=None, prefix=None, dir=None):\n"
        "    if prefix == 'infoplan-cache-':\n"
        "        raise PermissionError(13, 'Permission denied')\n"
        "    return real(suffix, prefix, dir)\n"
        "tempfile.mkdtemp = mkdtemp\n"
    )
    done = run(
        container, "run", *RANDOM,
        HOME=str(container / "file"), NUMBA_CACHE_DIR=str(container / "file"),
        PYTHONPATH=f"{container / 'site'}{os.pathsep}{container / 'work'}",
    )  # fmt: skip
    assert done.returncode == 0, said(done)
    assert said(done).count("compiled kernels can be kept nowhere") == 1


def test_no_temporary_folder_at_all_is_one_sentence(container):
    (container / "work/sitecustomize.py").write_text(
        "import tempfile\ntempfile._candidate_tempdir_list = lambda: []\n"
    )
    path = f"{container / 'site'}{os.pathsep}{container / 'work'}"
    done = run(container, "run", *SMALL, PYTHONPATH=path)
    assert done.returncode == 1
    assert "set TMPDIR" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_unusable_numba_cache_dir_is_named(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setattr(caches, "_told", False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    assert "NUMBA_CACHE_DIR" in caches.kernel_note()
    assert caches.kernel_note() is None  # said once


def test_nothing_is_said_where_all_is_as_usual(monkeypatch, tmp_path):
    monkeypatch.setattr(caches, "_told", False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "new"))
    assert caches.kernel_note() is None


@pytest.fixture
def temporary(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    caches.temporary_folder.cache_clear()
    yield tmp_path
    caches.temporary_folder.cache_clear()


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners of POSIX")
def test_a_folder_that_others_could_write_or_swap_is_not_taken(temporary):
    (temporary / "infoplan-cache-open").mkdir(mode=0o777)
    (temporary / "infoplan-cache-open").chmod(0o777)
    (temporary / "elsewhere").mkdir(mode=0o700)
    (temporary / "infoplan-cache-link").symlink_to(temporary / "elsewhere")
    (temporary / "infoplan-cache-file").touch(mode=0o700)
    if os.getuid() == 0:
        (temporary / "infoplan-cache-foreign").mkdir(mode=0o700)
        os.chown(temporary / "infoplan-cache-foreign", 65534, 65534)
    taken = caches.temporary_folder()
    assert taken.name.removeprefix("infoplan-cache-") not in ("open", "link", "file", "foreign")
    caches.temporary_folder.cache_clear()
    assert caches.temporary_folder() == taken  # and found again


def test_without_a_home_nothing_is_kept_in_a_folder_called_tilde(monkeypatch, tmp_path, temporary):
    import pwd

    def nobody(uid):
        raise KeyError(uid)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "MPLCONFIGDIR"):
        monkeypatch.delenv(name, raising=False)
    assert caches.user_cache() is None
    assert caches.kept_file("map.npy") == caches.temporary_folder() / "map.npy"
    caches.prepare_matplotlib()
    assert os.environ["MPLCONFIGDIR"] == str(caches.temporary_folder() / "matplotlib")
    monkeypatch.undo()


def test_matplotlib_keeps_a_folder_that_it_can_write(monkeypatch, tmp_path):
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path / "new"))
    caches.prepare_matplotlib()
    assert os.environ["MPLCONFIGDIR"] == str(tmp_path / "new")
    assert not (tmp_path / "new").exists()
