"""Several logs of one place are one survey, and the later ones judge what the earlier flagged."""

import re

import numpy as np
import pandas as pd
import pytest
from survey_logs import FOOT, LONELY, QUICK, ROCK, SPIKE, first_log, second_log, write

from infoplan.analyse.audit.detector import replay_detector
from infoplan.analyse.audit.logs import check_later_logs
from infoplan.analyse.audit.stored import FaultError, read_mission
from infoplan.cli import main
from infoplan.errors import UsageError
from infoplan.later_logs import Origins, verdicts
from infoplan.samples import Samples
from infoplan.study.surveys import batches
from infoplan.survey import read_logs


def table(folder, name, run):
    return pd.read_parquet(folder / "results" / name / f"run={run}" / "seed=0.parquet")


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A folder with a survey of two logs, its run, and what was printed."""
    folder = tmp_path_factory.mktemp("several")
    logs = [first_log(folder / "may.csv"), second_log(folder / "june.csv")]
    words = [*map(str, logs), f"results_dir={folder / 'results'}", *QUICK, "detector=local"]
    assert main(["survey", *words]) == 0
    return folder, next((folder / "results" / "runs").glob("*.yaml")).stem


def test_a_later_log_confirms_clears_or_does_not_come_near(done, capsys):
    folder, run = done
    assert run.startswith("survey-may-june-local-historical-")
    samples, origins = table(folder, "samples", run), table(folder, "origins", run)
    assert origins["log"].tolist() == ["may"] * 100 + ["june"] * 42
    assert origins["row"].tolist() == [*range(100), *range(42)]
    verdict = origins["verdict"]
    assert [verdict[i] for i in (SPIKE, ROCK, LONELY)] == ["confirmed", "cleared", "untested"]
    assert origins["flagged_first"][[SPIKE, ROCK, LONELY]].all()
    assert samples["flagged"][[SPIKE, ROCK, LONELY]].tolist() == [True, False, True]
    assert (
        verdict.notna().tolist() == (origins["flagged_first"] & (origins["log"] == "may")).tolist()
    )
    # The second log counts in feet, the first in metres.
    june = pd.read_csv(folder / "june.csv")["Sounding depth (ft)"]
    assert samples["measured"][100:].to_numpy() == pytest.approx(FOOT * june.to_numpy())
    flags = origins["flagged_first"][:100].sum()
    for command in (["show", run], ["report", f"run={run}"]):
        assert main([*command, f"results_dir={folder / 'results'}"]) == 0
    told = capsys.readouterr().out
    row = next(line.split() for line in told.splitlines() if line.split()[:1] == ["may"])
    since = (samples["flagged"] & ~origins["flagged_first"])[:100].sum()
    counts = [int((verdict == name).sum()) for name in ("confirmed", "cleared", "untested")]
    assert row == ["may", *map(str, [100, flags, *counts, since])]
    page = (folder / "results" / "report.html").read_text()
    assert f"these confirm {counts[0]}, clear {counts[1]}, and do not come near {counts[2]}" in page


def test_each_log_comes_back_as_it_was(done):
    folder, run = done
    for name, rows in (("may", slice(0, 100)), ("june", slice(100, None))):
        clean = folder / "results" / "surveys" / run / f"clean-{name}.csv"
        before, after = (
            pd.read_csv(path, dtype=str, keep_default_na=False)
            for path in (folder / f"{name}.csv", clean)
        )
        pd.testing.assert_frame_equal(after[before.columns], before)
        flagged = table(folder, "samples", run)["flagged"][rows].tolist()
        assert (after["flagged"] == "true").tolist() == flagged
    why = pd.read_csv(clean.with_name("clean-may.csv"), keep_default_na=False)["why"]
    assert why[SPIKE].endswith(", above 3.5; confirmed: a later log has been near")
    assert why[ROCK] == "flagged no more; cleared: a later log has been near"
    assert why[LONELY].endswith("untested: no later log has been near")


def test_audit_and_replay_know_the_logs(done, capsys):
    folder, run = done
    there = f"results_dir={folder / 'results'}"
    assert main(["replay", run, there, "backend=sequential"]) == 0
    replayed = next(path.stem for path in (folder / "results/runs").glob("replay-*"))
    pd.testing.assert_frame_equal(table(folder, "origins", run), table(folder, "origins", replayed))
    capsys.readouterr()
    assert main(["audit", run, there]) == 0
    assert "later logs        holds" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("column", "row", "value", "sentence"),
    [
        ("verdict", SPIKE, "cleared", "is called cleared, its neighbours make it confirmed"),
        ("verdict", 120, "untested", "sample 120 is called untested, its neighbours make it None"),
        ("flagged_first", ROCK, False, f"sample {ROCK} has flagged_first False, judged again True"),
        ("row", 4, 5, "sample 5 is told twice"),
        ("log", 20, "june", "sample 21 is of a log that had ended"),
    ],
)
def test_a_forged_origin_is_found(done, column, row, value, sentence):
    folder, run = done
    mission = read_mission(folder / "results", run, 0, {}, None, replay_detector)
    mission.tables["origins"].loc[row, column] = value
    with pytest.raises(FaultError, match=re.escape(sentence)):
        check_later_logs(mission)


def test_logs_are_put_in_order_of_time_and_each_begins_batches_of_its_own(tmp_path):
    first, second = first_log(tmp_path / "a.csv"), second_log(tmp_path / "b.csv")
    log = read_logs([second, first])
    assert [part.name for part in log.parts] == ["a", "b"]
    assert log.remarks == ["in order of time the logs are a.csv, b.csv"]
    assert log.unit == "ft"
    assert log.value[:100] == pytest.approx(pd.read_csv(first)["depth (m)"].to_numpy() / FOOT)
    assert batches(log, None).tolist() == [0] * 99 + [1] + [2] * 42
    assert np.bincount(batches(log, "30")).tolist() == [30, 30, 30, 10, 30, 12]
    assert np.bincount(batches(log, "60s")).tolist() == [60, 40, 42]
    clock = first_log(tmp_path / "c.csv", start=0.0)
    in_order = read_logs([second, clock])
    assert [part.name for part in in_order.parts] == ["b", "c"]
    assert "order given" in in_order.remarks[0]


def test_rows_that_two_logs_hold_are_samples_once(tmp_path):
    first = first_log(tmp_path / "a.csv")
    rows = first.read_text().splitlines()
    more = second_log(tmp_path / "b.csv")
    swapped = pd.read_csv(more).rename(
        columns={"Easting": "x", "Northing": "y", "timestamp": "time"}
    )
    swapped["depth (m)"] = FOOT * swapped["Sounding depth (ft)"]
    own = swapped[["time", "x", "y", "depth (m)"]].to_csv(index=False).splitlines()[1:]
    longer = tmp_path / "longer.csv"
    longer.write_text("\n".join([rows[0], *rows[61:], *own]) + "\n")
    log = read_logs([first, longer])
    assert [len(part) for part in log.parts] == [100, 42]
    assert log.parts[1].remarks == ["40 samples left out: other logs hold them, too"]
    assert str(log.parts[1].refused[0]) == "the same as a row of a.csv"
    untimed = [path.with_name(f"untimed-{path.name}") for path in (first, longer)]
    for path, bare in zip((first, longer), untimed, strict=True):
        pd.read_csv(path).drop(columns="time").to_csv(bare, index=False)
    assert [len(part) for part in read_logs(untimed).parts] == [100, 42]
    inside = tmp_path / "inside.csv"
    inside.write_text("\n".join([rows[0], *rows[31:91]]) + "\n")
    with pytest.raises(
        UsageError, match=r"inside\.csv holds no row that the other logs do not hold"
    ):
        read_logs([first, inside])


def moved(path, source, **changes):
    columns = pd.read_csv(source)
    return write(path, {name: changes.get(name, columns[name]) for name in columns})


def test_logs_that_do_not_go_together_get_one_sentence(tmp_path):
    first = first_log(tmp_path / "a.csv")
    columns = pd.read_csv(first)
    same = tmp_path / "same.csv"
    same.write_bytes(first.read_bytes())
    far = moved(tmp_path / "far.csv", first, x=columns["x"] + 1e5)
    bare = write(tmp_path / "bare.csv", columns.rename(columns={"depth (m)": "depth"}) + 0.5)
    warm = write(tmp_path / "warm.csv", columns.rename(columns={"depth (m)": "depth (degC)"}) + 0.5)
    degrees = write(
        tmp_path / "degrees.csv",
        {"lat": 52 + columns["y"] / 1e5, "lon": 13 + columns["x"] / 1e5, "z (m)": columns["x"]},
    )
    for other, sentence in (
        (same, "a.csv and same.csv are the same log: give it once"),
        (far, "a.csv lies 1e+05 m from the other logs, and the longest of them spans 28.5 m"),
        (bare, "a.csv is in m and bare.csv in no known unit"),
        (warm, "a.csv is in m and warm.csv in degC"),
        (degrees, "one of a.csv and degrees.csv is in degrees, the other in metres on a plane"),
    ):
        with pytest.raises(UsageError) as refused:
            read_logs([first, other])
        assert sentence in str(refused.value)
        assert "\n" not in str(refused.value)
    assert read_logs([first, bare], unit="m").unit == "m"
    with pytest.raises(UsageError, match="is a column of none of the logs"):
        read_logs([first, second_log(tmp_path / "b.csv")], columns={"value": "dept"})


def test_logs_of_one_name_and_columns_that_one_has(tmp_path):
    (tmp_path / "late").mkdir()
    first, second = first_log(tmp_path / "a.csv"), second_log(tmp_path / "late" / "a.csv")
    log = read_logs([first, second], columns={"value": "Sounding depth (ft)"})
    assert [part.name for part in log.parts] == ["a", "a-2"]
    assert log.roles["a-2 value"] == "Sounding depth (ft)"
    assert log.roles["a value"] == "depth (m)"


@pytest.mark.parametrize(("away", "expected"), [(1.9, "confirmed"), (2.1, "untested")])
def test_near_is_half_a_lengthscale(away, expected):
    x = np.array([[0, 0], [1, 1], [20, 10], [10 + away, 5], [5, 900.0]])
    n = len(x)
    samples = Samples(
        np.array([0, 0, 0, 1, 1]), x, np.zeros(n), np.full(n, np.nan), np.ones(n),
        np.zeros(n, bool), np.zeros(n, bool), np.ones(n),
    )  # fmt: skip
    samples.x[1] = [10, 5]
    samples.flagged[1] = True
    origins = Origins(("a", "b"), np.array([0, 0, 0, 1, 1]), np.arange(n))
    first = samples.flagged.copy()
    # Steps are 11 apart: the reach is that at least, but for lengthscales that are longer.
    usual = verdicts(origins, first, samples, np.array([0.1, 0.1]))
    assert usual == [None, "confirmed", None, None, None]
    samples.x[3] = [10 + 10 * away, 5]
    assert verdicts(origins, first, samples, np.array([4.0, 4.0]))[1] == expected
