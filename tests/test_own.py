"""Functions by dotted path, and their options."""

import sys
from typing import Optional

import pytest

from infoplan.errors import UsageError
from infoplan.own import load, resolve_options


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "modules", dict(sys.modules))
    return tmp_path


def refusal(call, *arguments) -> str:
    with pytest.raises(UsageError) as caught:
        call(*arguments)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_a_module_in_the_current_directory_is_found(folder):
    (folder / "my_hills.py").write_text("def hill():\n    return 7\n")
    assert load("my_hills.hill")() == 7


def test_a_module_in_a_package_and_a_class_are_found(folder):
    (folder / "my_package").mkdir()
    (folder / "my_package" / "__init__.py").touch()
    (folder / "my_package" / "things.py").write_text("class Thing:\n    size = 3\n")
    assert load("my_package.things.Thing")().size == 3


def test_an_installed_module_is_found():
    assert load("math.hypot")(3, 4) == 5


@pytest.mark.parametrize(
    "path", ["", "hill", "hill.", ".hill", "my hills.hill", "a/b.hill", "a-b.c"]
)
def test_no_dotted_path(path):
    assert f"terrain.function={path} is no dotted path" in refusal(load, path, "terrain.function")


def test_no_module(folder):
    message = refusal(load, "nowhere_at_all.hill")
    assert "there is no module 'nowhere_at_all'" in message
    assert str(folder) in message


def test_no_module_in_a_package(folder):
    assert "there is no module 'json.nothing'" in refusal(load, "json.nothing.hill")


def test_a_module_that_misses_another_is_told_apart(folder):
    (folder / "needy.py").write_text("import nowhere_at_all\n")
    message = refusal(load, "needy.hill")
    assert "needy cannot be imported: No module named 'nowhere_at_all'" in message


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("def hill(:", "SyntaxError"),
        ("raise ValueError('two\\nlines')", "ValueError: two lines"),
        ("import sys; sys.exit(3)", "SystemExit: 3"),
    ],
)
def test_a_module_that_fails(text, reason, folder):
    (folder / "broken.py").write_text(text)
    message = refusal(load, "broken.hill")
    assert "broken cannot be imported" in message
    assert reason in message


def test_no_such_function(folder):
    (folder / "hills.py").write_text("def hill(): pass\nheight = 3\n")
    message = refusal(load, "hills.hil")
    assert "has no 'hil' (did you mean 'hill'?)" in message
    assert str(folder / "hills.py") in message
    assert "is a int and cannot be called" in refusal(load, "hills.height")


def example(
    first,
    *,
    count: int = 3,
    height: float = 2,
    sharp: bool = False,
    title: str = "hill",
    widths: list[float] = [1, 2.5],  # noqa: B006
    weights: dict[str, float] | None = None,
    seed: Optional[int] = None,  # noqa: UP045
    anything: list | str = "x",
):
    """Has an option of every kind."""


DEFAULTS = {
    "count": 3,
    "height": 2.0,
    "sharp": False,
    "title": "hill",
    "widths": [1.0, 2.5],
    "weights": None,
    "seed": None,
    "anything": "x",
}


def test_defaults_are_filled_in_and_floats_are_floats():
    resolved = resolve_options(example, {})
    assert resolved == DEFAULTS
    assert list(resolved) == list(DEFAULTS)
    assert type(resolved["height"]) is float
    assert [type(width) for width in resolved["widths"]] == [float, float]


def test_given_values_replace_them():
    given = {
        "count": -1,
        "height": 7,
        "widths": [],
        "weights": {"a": 1},
        "seed": 4,
        "anything": [1],
    }
    resolved = resolve_options(example, given)
    assert resolved == DEFAULTS | given
    assert type(resolved["weights"]["a"]) is float


def test_lists_are_copies():
    given = {"widths": [3.0]}
    resolve_options(example, given)["widths"].append(4.0)
    resolve_options(example, {})["widths"].append(4.0)
    assert given == {"widths": [3.0]}
    assert resolve_options(example, {}) == DEFAULTS


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("count", 1.0, "a whole number"),
        ("count", True, "a whole number"),
        ("count", None, "a whole number"),
        ("height", "high", "a finite number"),
        ("height", float("nan"), "a finite number"),
        ("height", False, "a finite number"),
        ("sharp", 1, "true or false"),
        ("title", 1, "text"),
        ("widths", 1.0, "a list of which each is a finite number"),
        ("widths", ["x"], "a list of which each is a finite number"),
        ("weights", {"a": "b"}, "a mapping of which each is a finite number or null"),
        ("weights", {1: 1.0}, "a mapping"),
        ("seed", "one", "a whole number or null"),
        ("anything", 1, "a list or text"),
    ],
)
def test_a_value_of_another_type(name, value, words):
    message = refusal(resolve_options, example, {name: value}, "terrain.options")
    assert f"terrain.options.{name}={value} does not fit example: it must be {words}" in message


def test_an_unknown_option():
    message = refusal(resolve_options, example, {"hight": 1.0}, "terrain.options")
    assert "example has no option terrain.options.hight (did you mean 'height'?)" in message
    assert "count, height" in message


def test_positional_parameters_are_no_options():
    assert "has no option options.first" in refusal(resolve_options, example, {"first": 1})
    assert "it takes none" in refusal(resolve_options, lambda first: None, {"first": 1})


def test_a_missing_option():
    def hill(*, height: float):
        """Needs a height."""

    assert "needs options.height: give a finite number" in refusal(resolve_options, hill, {})


def test_annotations_may_be_strings():
    def hill(*, height: "float" = 1):
        """Is annotated late."""

    assert resolve_options(hill, {}) == {"height": 1.0}


def test_an_annotation_that_cannot_be_evaluated():
    def hill(*, height: "Nowhere" = 1):  # noqa: F821
        """Is annotated wrongly."""

    assert "cannot be read (name 'Nowhere' is not defined)" in refusal(resolve_options, hill, {})


def test_a_parameter_that_no_configuration_can_hold():
    def bare(*, height=1):
        """Has no annotation."""

    def strange(*, height: complex = 1j):
        """Has a type that YAML lacks."""

    def wrong(*, height: float = "high"):
        """Has a default of another type."""

    assert "'height' of" in refusal(resolve_options, bare, {})
    assert "has no annotation" in refusal(resolve_options, bare, {})
    assert "annotate it as int, float" in refusal(resolve_options, strange, {})
    assert "the default 'high' of height does not fit" in refusal(resolve_options, wrong, {})


def test_a_class_has_the_options_of_its_constructor():
    class Detector:
        def __init__(self, *, width: int = 3):
            self.width = width

    assert resolve_options(Detector, {"width": 4}) == {"width": 4}
