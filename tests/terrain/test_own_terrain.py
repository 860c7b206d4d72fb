"""Terrains of the user's own: the example, and functions that return no map."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from command import SMALL, infoplan

from infoplan.cli import main
from infoplan.errors import UsageError
from infoplan.terrain import load_terrain

EXAMPLES = Path(__file__).parents[2] / "examples"
OWN = ["terrain=own", "terrain.function=own_terrain.ridges"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "modules", dict(sys.modules))
    return tmp_path


def test_the_example_is_short():
    assert len((EXAMPLES / "own_terrain.py").read_text().splitlines()) < 40


def test_the_example_runs_from_the_command_line(tmp_path, monkeypatch, capfd):
    small = [*(word for word in SMALL if word != "terrain=volcano"), "backend=sequential"]
    # A process of its own, where nothing but the current directory leads to the module.
    infoplan(
        "run", "-m", *OWN, "terrain.options.count=3", "terrain.options.height=300,200", *small,
        f"results_dir={tmp_path}", cwd=EXAMPLES,
    )  # fmt: skip
    curves = pd.read_parquet(tmp_path / "curves")
    assert set(curves["terrain"]) == {"own-ridges"}
    heights = set()
    for stored in (tmp_path / "runs").glob("*.yaml"):
        science = yaml.safe_load(stored.read_text())["terrain"]
        assert science["function"] == "own_terrain.ridges"
        height = science["options"].pop("height")
        assert science["options"] == {"count": 3, "nodes": 80, "angle": 30.0}
        heights.add(height)
        maps = pd.read_parquet(tmp_path / "maps" / f"run={stored.stem}")
        y, x = maps["x2"] / 50, maps["x1"] / 50
        across = x * np.cos(np.radians(30)) + y * np.sin(np.radians(30))
        expected = 500 + 200 * x + height / 2 * np.cos(6 * np.pi * across)
        # Linear between nodes, so off by a little.
        np.testing.assert_allclose(maps["truth"], expected, atol=2.0)
    assert heights == {300.0, 200.0}
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert main(["audit", f"results_dir={tmp_path}"]) == 0
    told = capfd.readouterr().out
    assert "truth within" not in told  # no function that a results folder names is called
    assert "the truth, taken from the tables" in " ".join(told.split())
    show = ["terrain", "show", *OWN, "terrain.options.height=250", f"results_dir={tmp_path}"]
    assert main(show) == 0
    assert "own-ridges" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["terrain.options.hight=3"], "no option terrain.options.hight (did you mean 'height'?)"),
        (["terrain.options.height=high"], "terrain.options.height=high does not fit ridges"),
        (["terrain.options.count=1.5"], "it must be a whole number"),
        (["terrain.function=own_terrain.ridge"], "did you mean 'ridges'"),
        (["terrain.function=own_terain.ridges"], "there is no module 'own_terain'"),
        (["terrain.function=null"], "terrain=own needs terrain.function"),
    ],
)
def test_mistakes_are_one_sentence_and_status_2(overrides, words, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(EXAMPLES)
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert main(["run", *OWN, *overrides, f"results_dir={tmp_path}"]) == 2
    said = capfd.readouterr().err
    assert words in said
    assert len(said.splitlines()) == 1


def test_an_array_alone_is_in_metres_unless_another_unit_is_given(folder):
    (folder / "flat_lands.py").write_text("def hill():\n    return [[1, 2], [3, 5]]\n")
    terrain = load_terrain("own", function="flat_lands.hill")
    assert (terrain.name, terrain.unit) == ("own-hill", "m")
    assert terrain.elevation.tolist() == [[1, 2], [3, 5]]
    assert load_terrain("own", function="flat_lands.hill", unit="ft").elevation[0, 0] == 1


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("return None", "returns elevations of type object"),
        ("return [1, 2, 3]", "it must have two dimensions"),
        ("return [[1, 2]]", "at least 2 rows"),
        ("return [['a', 'b'], ['c', 'd']]", "returns elevations of type <U1"),
        ("return [[1, 2], [3, float('nan')]]", "has 1 nodes that are missing"),
        ("return [[1, 1], [1, 1]]", "is 1 everywhere"),
        ("return [[1, 2], [3, 4]], 7", "returns a int as the unit"),
        ("return [[1, 2], [3]]", "failed, ValueError: setting an array element"),
        ("raise KeyError('lost')", "failed, KeyError: 'lost'"),
        ("return 1 / 0", "failed, ZeroDivisionError"),
    ],
)
def test_functions_that_make_no_map(body, words, folder):
    (folder / "bad_lands.py").write_text(f"def hill():\n    {body}\n")
    with pytest.raises(UsageError) as caught:
        load_terrain("own", function="bad_lands.hill")
    assert words in str(caught.value)
    assert "bad_lands.hill" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_function_that_wants_arguments(folder):
    (folder / "bad_lands.py").write_text("def hill(height):\n    return [[1, 2], [3, height]]\n")
    with pytest.raises(UsageError, match=r"TypeError: .*'height'"):
        load_terrain("own", function="bad_lands.hill")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("import sys; sys.exit()", "failed, SystemExit"),
        ("import sys; sys.exit(0)", "failed, SystemExit: 0"),
        ("raise BaseException('gone')", "failed, BaseException: gone"),
        ("raise GeneratorExit", "failed, GeneratorExit"),
        ("raise type('Odd', (BaseException,), {'__str__': lambda self: 1 / 0})", "failed, Odd"),
        ("raise ValueError('x' * 10**6)", "failed, ValueError: xxx"),
        ("raise ValueError('\\x1b[31m')", r"failed, ValueError: \x1b[31m"),
        ("return [[1j, 2], [3, 4]]", "returns elevations of type complex128"),
        ("return [[1, 'a'], [2, 3]]", "returns elevations of type <U"),
        ("return [[None, 1], [2, 3]]", "returns elevations of type object"),
        ("return [[float('inf'), 1], [2, 3]]", "has 1 nodes that are missing"),
        ("return [[1e300, 1], [2, 3]]", "beyond 1e+100"),
        ("import numpy as np; return np.array([[1, 2], [3, 4]], dtype='M8[s]')", "datetime64"),
        ("import numpy as np; return np.ma.masked_equal([[1, 2], [3, -9]], -9)", "has 1 nodes"),
        ("import numpy as np; return np.ma.masked_equal([[1.5, 2], [3, 2]], 2)", "has 2 nodes"),
        ("import pandas; return pandas.DataFrame({'a': ['x', 'y'], 'b': [1, 2]})", "type object"),
        ("return [[1, 2], [3, 4]], b'm'", "returns a bytes as the unit"),
        ("return (i for i in range(9))", "returns elevations of type object"),
        ("return {}", "returns elevations of type object"),
        ("return hill()", "failed, RecursionError"),
    ],
)  # fmt: skip
def test_whatever_a_function_does_is_one_sentence(body, words, folder):
    (folder / "bad_lands.py").write_text(f"def hill():\n    {body}\n")
    with pytest.raises(UsageError) as caught:
        load_terrain("own", function="bad_lands.hill")
    assert words in str(caught.value)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 600


def test_ctrl_c_in_a_function_is_one(folder):
    (folder / "bad_lands.py").write_text("def hill():\n    raise KeyboardInterrupt\n")
    with pytest.raises(KeyboardInterrupt):
        load_terrain("own", function="bad_lands.hill")


def test_a_frame_of_numbers_is_a_map(folder):
    (folder / "flat_lands.py").write_text(
        "import pandas\ndef hill():\n    return pandas.DataFrame([[1, 2], [3, 5]])\n"
    )
    assert load_terrain("own", function="flat_lands.hill").elevation.tolist() == [[1, 2], [3, 5]]
