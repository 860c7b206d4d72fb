"""What is published: a source distribution with its tests, a wheel with its data."""

import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest
from setuptools.command.egg_info import FileList

ROOT = Path(__file__).parents[1]
DATA = {".py", ".yaml", ".json", ".html", ".css", ".js", ".png", ".gif", ".ipynb", ".md", ".csv"}


def wanted() -> set[str]:
    """Files that the tests, the README and make need, as they lie in the tree."""
    needed = {"README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE", "Makefile", "pyproject.toml",
              "constraints.txt", "infoplan/py.typed", "CONTRIBUTING.md", ".pre-commit-config.yaml",
              ".ci/run", ".github/workflows/ci.yml"}  # fmt: skip
    for folder in ("infoplan", "conf", "tests", "benchmarks", "examples", "docs", "scripts"):
        for file in (ROOT / folder).rglob("*"):
            if file.suffix in DATA and not {"__pycache__", "_build"} & set(file.parts):
                needed.add(file.relative_to(ROOT).as_posix())
    return needed


def test_the_source_distribution_holds_its_tests(monkeypatch):
    monkeypatch.chdir(ROOT)
    files = FileList()
    for line in (ROOT / "MANIFEST.in").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            files.process_template_line(line)
    listed = {Path(name).as_posix() for name in files.files}
    # What setuptools adds by itself: packages and their data, licence, README, pyproject.toml.
    by_itself = {name for name in wanted() if name.startswith("infoplan/")}
    assert not wanted() - listed - by_itself - {"README.md", "LICENSE", "pyproject.toml"}
    assert not {name for name in listed if "__pycache__" in name}


def test_every_package_is_listed():
    """The list in pyproject.toml is explicit; a package that is forgotten is in no wheel."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = set(settings["tool"]["setuptools"]["packages"])
    there = {
        ".".join(file.parent.relative_to(ROOT).parts)
        for file in (ROOT / "infoplan").rglob("__init__.py")
    }
    assert listed == there | {"infoplan.conf"}


@pytest.mark.long
@pytest.mark.skipif(find_spec("build") is None, reason="needs the package build")
def test_what_is_built(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "build", "--outdir", str(tmp_path), str(ROOT)], check=True
    )
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert not wanted() - names
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as archive:
        names = set(archive.namelist())
    expected = {
        name.replace("conf/", "infoplan/conf/", 1) if name.startswith("conf/") else name
        for name in wanted()
        if name.startswith(("infoplan/", "conf/"))
    }
    assert not expected - names
    assert not {name for name in names if name.startswith(("tests", "benchmarks"))}
