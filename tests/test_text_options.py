"""Text is taken as typed, whatever it contains; a value that is suggested means that very value."""

import shlex
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import infoplan
from infoplan.cli import main
from infoplan.errors import UsageError
from infoplan.hydra_front.compose import compose, without_rounding
from infoplan.hydra_front.front import compose_and
from infoplan.hydra_front.overrides import readable
from infoplan.text_options import (
    as_override,
    as_value,
    decimal,
    for_hydra,
    text_options,
    typed_text,
    typed_texts,
)

AWKWARD = [
    "2024_11_25", "1.10", "010", "1e3", "true", "False", "inf", "~/f.npy", "dem (1).npy",
    "Gelände/größe.npy", "地形/图.npy", "it's", 'say "hi"', "a=b", "#1", "$HOME", "${HOME}",
    "\\${HOME}", "a${x}b\\${y}", "{a", "b}", "[a]", "C:\\dem\\", "\\", "\\\\'", " leading",
    "trailing ", "50%", "run-12:30", "a,b", "choice(a,b)", "glob(*)", "${", "\t", "a\nb", "''x''",
    "null x", "NULL", "@x", "!y", "a'b\"c", "'", '"', "-", "*", "0x10", "+5", "`ls`",
]  # fmt: skip


def composed(*arguments: str) -> list[infoplan.MissionConfig]:
    """Configurations that a command line stands for."""
    seen: list[infoplan.MissionConfig] = []

    def act(configs):
        seen.extend(configs)
        return 0, [0.0] * len(configs)

    assert compose_and(act, list(arguments)) == 0
    return seen


@pytest.mark.parametrize("text", AWKWARD)
def test_text_is_taken_as_typed(text):
    given = as_value("terrain.array", text)  # what `configure` writes
    config = compose(
        ["terrain=file", f"results_dir={text}", f"terrain.path={text}", f"terrain.array={given}"]
    )
    assert (config.results_dir, config.terrain.path, config.terrain.array) == (text, text, text)


def test_text_is_taken_as_typed_by_the_command_and_by_sweeps():
    for text in AWKWARD[::18]:
        (config,) = composed(f"results_dir={text}")
        assert config.results_dir == text
        (config,) = composed("-m", f"results_dir={for_hydra(text)}")
        assert config.results_dir == text
    line = for_hydra(shlex.join(["terrain=file", "terrain.path=größe 1.10.npy,b c.npy"]))
    paths = [config.terrain.path for config in composed(f"sweep=[{line}]")]
    assert paths == ["größe 1.10.npy", "b c.npy"]


def test_quotes_around_the_whole_and_null():
    for word, text in [
        ("'a b'", "a b"),
        ('"1.10"', "1.10"),
        (r"'it\'s'", "it's"),
        ("'null'", "null"),
        (r"'\${x}'", "${x}"),
        ("'${x}'", "${x}"),
    ]:
        assert typed_text("terrain.path", word) == text
    assert compose(["terrain=file", "terrain.path=null"]).terrain.path is None
    assert compose(["results_dir=null"]).results_dir == "null"
    path = Path("a, b") / "it's=here.npy"
    config = infoplan.configure("terrain=file", **{"terrain.path": path, "terrain.unit": None})
    assert (config.terrain.path, config.terrain.unit) == (str(path), None)


SEPARATED = {
    "1.10,1.20": ["1.10", "1.20"],
    "'a, b',c": ["a, b", "c"],
    r"a\,b,c": ["a,b", "c"],
    "dem (1,2).npy, x": ["dem (1,2).npy", "x"],
    "it's,null": ["it's", None],
    "str(1.10)": ["str(1.10)"],
    "ä(b,c": ["ä(b", "c"],
}


@pytest.mark.parametrize("typed", SEPARATED)
def test_commas_separate_values(typed):
    assert typed_texts("terrain.path", typed) == SEPARATED[typed]


def test_commas_separate_values_in_a_multirun():
    some = {typed: SEPARATED[typed] for typed in ("'a, b',c", "ä(b,c")}
    for typed, texts in {**some, "choice(1.10,b)": ["1.10", "b"]}.items():
        found = [c.terrain.path for c in composed("-m", "terrain=file", f"terrain.path={typed}")]
        assert found == texts, typed
    assert [c.detector.scope for c in composed("-m", "detector.scope=batch,historical")] == [
        "batch", "historical",
    ]  # fmt: skip


@pytest.mark.parametrize("word", ["results_dir=", "results_dir=''", "results_dir=???"])
def test_no_text_is_refused(word, capfd):
    assert main(["run", "terrain=file", word]) == 2
    said = capfd.readouterr().err
    assert word.partition("=")[0] in said
    assert len(said.splitlines()) == 1
    for empty in ("a,,b", "a,"):
        with pytest.raises(UsageError, match="is empty"):
            typed_texts("terrain.path", empty)


def test_text_of_ones_own_function_is_taken_as_typed(tmp_path, monkeypatch):
    (tmp_path / "labelled.py").write_text(
        "def low(samples, model, rng, *, label: str = '', share: float | None = None):\n    ...\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    words = ["detector=own", "detector.function=labelled.low", "detector.options.share=0.5"]
    for text in ("1.10", "2024_11_25", "größe (1)"):
        config = infoplan.configure(*words, f"detector.options.label={text}")
        assert config.detector.options == {"share": 0.5, "label": text}
    (first, second) = composed("-m", *words, "detector.options.label=010,1e3")
    assert [c.detector.options["label"] for c in (first, second)] == ["010", "1e3"]


texts = st.text(
    st.characters(exclude_characters="\0", exclude_categories=["Cs"]), min_size=1
).filter(lambda text: text != "???")
numbers = st.floats(allow_nan=False, allow_infinity=False)
keys = st.from_regex(r"[a-z_][a-z0-9_]{0,5}", fullmatch=True).filter(
    lambda key: key not in ("true", "false", "null", "inf", "nan")
)
plain = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | numbers | texts
values = st.recursive(
    plain, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3)
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(texts)
def test_what_is_suggested_for_text_means_that_text(text):
    (word,) = shlex.split(as_override("terrain.path", text))
    name, _, value = word.partition("=")
    assert typed_text(name, value) == text
    assert typed_texts(name, value) == [text]
    # As Hydra itself has it after that.
    ((again),) = readable([word], several=True)
    assert readable([again], several=True) == [again]


@settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(path=texts, amount=st.floats(0, 1), extent=st.lists(numbers, min_size=1, max_size=3),
       params=st.dictionaries(keys, values, max_size=2))  # fmt: skip
def test_what_is_suggested_composes_to_that_very_value(path, amount, extent, params):
    wanted = {"terrain.path": path, "rho": amount, "terrain.extent": extent,
              "detector.params": params}  # fmt: skip
    line = " ".join(as_override(name, value) for name, value in wanted.items())
    config = compose(["terrain=file", "detector=pyod", *shlex.split(line)])
    assert config.terrain.path == path
    assert config.rho == decimal(amount)
    assert config.terrain.extent == [decimal(entry) for entry in extent]
    assert config.detector.params == without_rounding(params)


def test_what_a_file_sweeps_is_read_as_typed(tmp_path):
    (tmp_path / "experiment").mkdir()
    params = "{rho: 'range(0.1,0.4,0.1)', terrain.path: 'größe (1).npy'}"
    (tmp_path / "experiment" / "swept.yaml").write_text(
        f"# @package _global_\nhydra: {{sweeper: {{params: {params}}}}}\n"
    )
    line = ["-m", "-cd", str(tmp_path), "experiment=swept", "terrain=file"]
    made = composed(*line)
    assert [config.rho for config in made] == [0.1, 0.2, 0.3]
    assert {config.terrain.path for config in made} == {"größe (1).npy"}


def test_whole_numbers_are_floats_in_lists_of_lists():
    points = [[0.2, 0.0], [0.0, 1.0], [1.0, 1.0]]
    assert compose(["pilot.control_points=[[0.2,0],[0,1],[1,1]]"]).pilot.control_points == points
    word = shlex.split(as_override("pilot.control_points", points))[0]
    assert compose([word]).pilot.control_points == points


def test_the_rounding_of_steps_makes_no_other_number():
    assert [c.rho for c in composed("-m", "rho=range(0.1,0.4,0.1)")] == [0.1, 0.2, 0.3]
    assert [c.rho for c in composed("-m", "rho=range(0.4,0,-0.15)")] == [0.4, 0.25, 0.1]
    assert [c.rho for c in composed("sweep=['rho=range(0,1,.5)']")] == [0.0, 0.5]
    for written, values in {
        "range(0.1,0.4,step=0.1)": "0.1,0.2,0.3",
        "range(start=0.1,stop=0.4,step=0.1)": "0.1,0.2,0.3",
        "sort(range(0.1,0.4,0.1),reverse=true)": "0.3,0.2,0.1", "tag(x,range(0.1,0.4,.1))":
        "0.1,0.2,0.3", "shuffle(range(0.1,0.4,0.1))": "shuffle(0.1,0.2,0.3)",
    }.items():  # fmt: skip
        assert readable([f"rho={written}"], several=True) == [f"rho={values}"]
    assert infoplan.configure(rho=0.1 * 3).rho == 0.3
    assert infoplan.configure(rho=np.float64(0.1) * 3).rho == 0.3
    assert infoplan.configure(**{"fault.quantiles": [0.1 * 3, 0.7]}).fault.quantiles[0] == 0.3
    assert infoplan.configure("rho=-0.0").rho.hex() == "0x0.0p+0"
    angle = 0.2617993877991494
    assert infoplan.configure(**{"robot.max_steering": angle}).robot.max_steering == angle
    kept = compose(["detector=pyod", "detector.params={a: 0.30000000000000004}"])
    assert kept.detector.params == {"a": 0.3}


@given(st.integers(1, 10**12 - 1), st.integers(-20, 20), st.integers(-3, 3))
def test_a_decimal_of_twelve_digits_survives_rounding(digits, exponent, steps):
    exact = float(f"{digits}e{exponent}")
    near = exact + steps * float(np.spacing(abs(exact)))
    assert decimal(near) == exact


@given(st.floats(1e-3, 1e3))
def test_other_numbers_stay_within_rounding(value):
    assert abs(decimal(value) - value) <= 4e-15 * abs(value)
    assert decimal(decimal(value)) == decimal(value)


def test_what_cannot_be_written_is_a_usage_error():
    for value in (object(), {"größe": 1}, {1: 2}, b"x"):
        with pytest.raises(UsageError, match=r"detector\.params"):
            as_override("detector.params", value)


def test_the_text_options_are_those_annotated_so():
    assert text_options()["terrain.path"]
    assert not text_options()["results_dir"]
    assert "seeds" not in text_options()
    assert "detector.features" not in text_options()
