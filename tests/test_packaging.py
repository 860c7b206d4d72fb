"""What is published: a source distribution with its tests, a wheel with its data."""

import json
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from setuptools.command.egg_info import FileList

from infoplan.tables import TABLES

ROOT = Path(__file__).parents[1]
DATA = {".py", ".yaml", ".json", ".html", ".css", ".js", ".png", ".gif", ".ipynb", ".md", ".csv"}


def wanted() -> set[str]:
    """Files that the tests, the README and make need, as they lie in the tree."""
    needed = {"README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE", "Makefile", "pyproject.toml",
              "constraints.txt", "constraints-oldest.txt", "infoplan/py.typed", "CONTRIBUTING.md",
              ".pre-commit-config.yaml", ".ci/run", ".github/workflows/ci.yml", "Dockerfile",
              ".dockerignore"}  # fmt: skip
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


def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_one_version_everywhere():
    version = project()["version"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == version
    newest = {column.since for table in TABLES.values() for column in table.columns.values()}
    assert version in newest


def test_every_classifier_s_python_is_allowed_and_tested():
    told = [one.rpartition(" :: ")[2] for one in project()["classifiers"] if " :: 3." in one]
    allowed = SpecifierSet(project()["requires-python"])
    assert told == [f"3.{minor}" for minor in range(30) if allowed.contains(f"3.{minor}")]
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    assert [python for python in told if f'"{python}"' not in workflow] == []


def test_the_oldest_versions_are_allowed_and_have_no_older():
    """Constraints of pip: each is a bound of pyproject.toml, and none of what is needed lacks."""
    lines = (ROOT / "constraints-oldest.txt").read_text(encoding="utf-8").splitlines()[1:]
    pins = dict(line.split("==") for line in lines)
    needed = [Requirement(text) for text in project()["dependencies"]]
    assert {one.name for one in needed} <= set(pins)
    needed += [
        Requirement(t) for group in project()["optional-dependencies"].values() for t in group
    ]
    for one in needed:
        if one.name in pins:
            assert one.specifier.contains(pins[one.name])
            bounds = [bound.version for bound in one.specifier if bound.operator == ">="]
            assert bounds == [pins[one.name]]


def test_everything_that_is_needed_is_pinned():
    """What the figures were made with, for who wants the same."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()[1:]
    pins = {canonicalize_name(name): version for name, version in (x.split("==") for x in lines)}
    for one in (Requirement(text) for text in project()["dependencies"]):
        assert one.specifier.contains(pins[canonicalize_name(one.name)]), one


def test_the_container_copies_what_is_there_and_is_sent_no_more():
    """All that is copied passes .dockerignore, which lets nothing else through."""
    recipe = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    copied = {name for line in re.findall(r"^COPY (.+) \S+$", recipe, re.MULTILINE)
              for name in line.split()}  # fmt: skip
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert {line[1:] for line in ignored if line.startswith("!")} == copied
    assert "*" in ignored
    assert [name for name in copied if not (ROOT / name).exists()] == []
    (command,) = re.findall(r"^CMD (.+)$", recipe, re.MULTILINE)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert f"infoplan {' '.join(json.loads(command))} $(ARGS)" in makefile


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
