"""Compiled functions are kept between processes, and never outlive what they were compiled from."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import infoplan
from infoplan import compiled
from infoplan.compiled import SOURCES, kernel

PACKAGE = Path(infoplan.__file__).parent

SEARCH = """
import numpy as np
from infoplan.plan import search
from infoplan.plan.tree_search import _grow

tree = search(
    (50.0, 50.0, 0.0), np.ones((1, 5, 5)), (0.0, 100.0, 0.0, 100.0), speed=1.0,
    samples_per_action=3, steering=[0.0], iterations=2, rollouts=0, exploration=0.3,
    pareto=False, rng=np.random.default_rng(0),
)
print(*tree.pose[1], sum(_grow.stats.cache_hits.values()))
"""

KERNEL = """
import numpy as np
from infoplan.model.covariance import passes_of
from infoplan.model.kernels import as_kernel

for name in ("squared_exponential", "wider"):
    passes = passes_of(as_kernel(name))
    out = np.empty((1, 1))
    passes.fill_cross(np.zeros((2, 1)), np.ones((2, 1)), (0.25, 0.25), 1.0, out)
    print(out[0, 0], sum(passes.fill_cross.stats.cache_hits.values()))
"""

CLOSURES = """
from infoplan.compiled import kernel

def sum_of(value):
    @kernel()
    def part(n):  # long enough to be called, not to become a part of its callers
        total = 0.0
        for i in range(n):
            for j in range(i):
                if (i * j) % 3 == 0:
                    total += value()
                elif i % 5 == 1:
                    total -= value() * j
                elif i % 7 == 1:
                    total -= value() / i
        return total

    @kernel()
    def whole(n):
        return part(n) + part(n + 1) + part(n + 2)

    return whole

def constant(number):
    @kernel()
    def value():
        return number

    return value
"""
"""A module of the package with a compiled function that calls one that calls one."""

CONSTANTS = """
from infoplan.closures import constant, sum_of

for number in NUMBERS:
    whole = sum_of(constant(number))
    print(whole(10) / 63.125, sum(whole.stats.cache_hits.values()))
"""

FOREIGN = """
import numba
from infoplan.closures import sum_of

whole = sum_of(numba.njit(lambda: VALUE))
print(whole(10) / 63.125, sum(whole.stats.cache_hits.values()))
"""

WRAP = """
from infoplan.robot import wrap
print(wrap(7.0), sum(wrap.stats.cache_hits.values()))
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A copy of the package, as an installation has it."""
    folder = tmp_path / "site"
    shutil.copytree(PACKAGE, folder / "infoplan", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def python(site: Path, code: str, **environment: str) -> list[float]:
    """Run code with the package of a site; returns the numbers that it prints."""
    env = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**env, "PYTHONPATH": str(site), **environment},
        cwd=site,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert not done.returncode, done.stderr
    return [float(word) for word in done.stdout.split()]


def kept(folder: Path) -> list[Path]:
    return sorted(folder.rglob("infoplan-kernels/*/*.bin"))


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1
    file.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.long  # the kernels below are compiled sooner, and lie in other files, too
def test_a_search_drives_the_car_of_the_present_source(site):
    # Straight ahead, three samples of length 1.
    assert python(site, SEARCH) == [53.0, 50.0, 0.0, 0]
    assert python(site, SEARCH) == [53.0, 50.0, 0.0, 1]  # from the cache
    # Another car, in another file than the search: twice as fast.
    edit(site / "infoplan/robot.py", "x + speed * math.cos", "x + 2 * speed * math.cos")
    assert python(site, SEARCH) == [56.0, 50.0, 0.0, 0]


def test_each_kernel_has_passes_of_its_own(site):
    folder = site / "infoplan/model/kernels"
    shutil.copy(folder / "squared_exponential.py", folder / "wider.py")
    edit(folder / "wider.py", "exponential(-(rates[0]", "exponential(-0.5 * (rates[0]")
    expected = [pytest.approx(np.exp(-0.5)), 0, pytest.approx(np.exp(-0.25)), 0]
    assert python(site, KERNEL) == expected
    assert python(site, KERNEL) == [expected[0], 1, expected[2], 1]  # from the cache
    edit(folder / "wider.py", "exponential(-0.5 *", "exponential(-2.0 *")
    assert python(site, KERNEL) == [expected[0], 0, pytest.approx(np.exp(-1.0)), 0]


def test_functions_of_several_processes_are_not_mixed_up(site):
    """Numba's names hold a count that starts anew in each process."""
    (site / "infoplan/closures.py").write_text(CLOSURES, encoding="utf-8")
    for numbers, expected in (
        ([1.0], [1, 0]),
        ([2.0], [2, 0]),
        ([1.0, 2.0], [1, 1, 2, 1]),
        ([2.0, 1.0], [2, 1, 1, 1]),
    ):
        found = python(site, CONSTANTS.replace("NUMBERS", repr(numbers)))
        assert found == pytest.approx(expected)


def test_functions_from_outside_are_never_those_of_an_earlier_process(site):
    (site / "infoplan/closures.py").write_text(CLOSURES, encoding="utf-8")
    for value in (0.25, 0.5):
        found = python(site, FOREIGN.replace("VALUE", str(value)))
        assert found == pytest.approx([value, 0])
    # Nor mixed up with one that is kept, and compiled as early in its process.
    assert python(site, CONSTANTS.replace("NUMBERS", "[3.0]")) == pytest.approx([3, 0])
    both = CONSTANTS.replace("NUMBERS", "[3.0]") + FOREIGN.replace("VALUE", "0.25")
    assert python(site, both) == pytest.approx([3, 1, 0.25, 0])


@pytest.mark.parametrize(
    "damage", [None, *[pytest.param(bad, marks=pytest.mark.long) for bad in (b"", b"\x00" * 40)]]
)
def test_damaged_code_is_compiled_anew(site, damage):
    expected = 7.0 % (2 * np.pi)
    assert python(site, WRAP) == [pytest.approx(expected), 0]
    [file] = kept(site)
    # Cut in the middle, as by a full disk; the digest at its start no longer fits.
    file.write_bytes(file.read_bytes()[:2000] if damage is None else damage)
    assert python(site, WRAP) == [pytest.approx(expected), 0]
    assert python(site, WRAP) == [pytest.approx(expected), 1]


def test_only_the_latest_states_of_the_sources_keep_their_code(site):
    states = site / "infoplan/__pycache__/infoplan-kernels"
    for day in range(9):
        old = states / f"{day:064x}"
        old.mkdir(parents=True)
        (old / "some.bin").touch()
        os.utime(old, (day * 86400, day * 86400))
    python(site, WRAP)
    names = sorted(folder.name for folder in states.iterdir())
    current = [name for name in names if (states / name / "some.bin").exists() is False]
    assert len(current) == 1
    assert sorted(set(names) - set(current)) == [f"{day:064x}" for day in (6, 7, 8)]


def test_numba_cache_dir_is_where_they_are_kept(site, tmp_path):
    chosen = tmp_path / "chosen"
    python(site, WRAP, NUMBA_CACHE_DIR=str(chosen))
    assert len(kept(chosen)) == 1
    assert not kept(site)


def test_different_types_do_not_share_code(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled, "_places", lambda: ([tmp_path], tmp_path))

    def double(x):
        return x + x

    for _ in range(2):  # compiled, then loaded
        function = kernel()(double)
        assert function(2) == 4
        assert function(2.5) == 5.0
    assert sum(function.stats.cache_hits.values()) == 2


def test_all_modules_with_kernels_are_watched():
    """Else an edit of one would go unnoticed; and kernels use nothing of unwatched modules."""
    watched = {f"infoplan.{name[:-3].replace('/', '.')}" for name in SOURCES}
    harmless = {"infoplan.errors", "infoplan.caches", "infoplan.obstacles"}
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        name = file.relative_to(PACKAGE).as_posix()
        assert "njit" not in text or name == "compiled.py", name
        if "infoplan.compiled import" in text:
            assert name in SOURCES
            imports = {
                line.split()[1] for line in text.splitlines() if line.startswith("from infoplan")
            }
            assert imports <= watched | harmless, name
