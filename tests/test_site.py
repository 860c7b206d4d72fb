"""The site of the documents: all pages are in its side bar, all public names in its reference."""

import re
import runpy
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def conf():
    return runpy.run_path(str(DOCS / "conf.py"))


def test_every_page_is_in_the_side_bar_once(conf):
    front = (DOCS / "index.md").read_text(encoding="utf-8")
    trees = conf["navigation"](front).removeprefix(front)
    entries = re.findall(r"^(\w+)$", trees, re.MULTILINE)
    pages = {page.stem for page in DOCS.glob("*.md")} - {"index"}
    assert sorted(entries) == sorted(pages)
    captions = re.findall(r"^:caption: (.+)$", trees, re.MULTILINE)
    assert captions == re.findall(r"^## (.+)$", front, re.MULTILINE)


def test_no_page_has_the_name_of_one_of_the_site():
    assert not {page.stem for page in DOCS.glob("*.md")} & {"search", "genindex", "py-modindex"}


def test_every_public_name_is_in_the_reference(conf):
    page = (DOCS / "reference.md").read_text(encoding="utf-8")
    written = conf["reference"](page)
    documented = re.findall(r"^\.\. auto(class|function):: (\S+)$", written, re.MULTILINE)
    names = [name for _, name in documented]
    assert len(names) == len(set(names)) > 60
    for kind, name in documented:
        module, _, attribute = name.rpartition(".")
        assert isinstance(getattr(import_module(module), attribute), type) == (kind == "class")
    for attribute in import_module("infoplan").__all__:
        assert f"infoplan.{attribute}" in names
    assert re.sub(r"\n```\{eval-rst\}.*?```\n\n", "", written, flags=re.DOTALL) == page


def test_a_page_that_holds_a_file_has_all_of_it(conf):
    for name in ("changelog", "contributing"):
        text = conf["whole"]((DOCS / f"{name}.md").read_text(encoding="utf-8"))
        assert text.startswith(f"# {name.capitalize()}\n\n```{{include}} ../{name.upper()}.md\n")
        file = (DOCS.parent / f"{name.upper()}.md").read_text(encoding="utf-8")
        assert file.startswith(f"# {name.capitalize()}\n")


@pytest.mark.long
def test_the_site_fetches_nothing(tmp_path):
    pytest.importorskip("sphinx")
    pytest.importorskip("furo")
    build = [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", str(DOCS), str(tmp_path)]
    subprocess.run(build, check=True)
    pages = list(tmp_path.glob("*.html"))
    assert len(pages) > 30
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert re.findall(r"<(?:script|img|iframe)[^>]+src=.(?:https?:)?//", text) == []
        assert re.findall(r"<link[^>]+href=.(?:https?:)?//", text) == []
        for target in re.findall(r'<img[^>]+src="([^"]+)"', text):
            assert (page.parent / target).is_file()
    for sheet in tmp_path.rglob("*.css"):
        assert not re.search(r"(?:url\(|@import)\s*.?(?:https?:)?//", sheet.read_text("utf-8"))
