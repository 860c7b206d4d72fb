"""A stored mission as an animation."""

import stat
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from flown import short_mission, store
from PIL import Image
from rich.console import Console

from infoplan.cli import main
from infoplan.draw.animate import animate, thinned
from infoplan.draw.moving_files import find_ffmpeg, write_gif, write_mp4
from infoplan.draw.recording import difference_from_curve, read_recording, replay, run_to_show
from infoplan.draw.scene import draw_pictures
from infoplan.errors import RunError, UsageError
from infoplan.study.store import table_path


@pytest.fixture(scope="module")
def results(tmp_path_factory, volcano) -> Path:
    folder = tmp_path_factory.mktemp("animated")
    store(folder, short_mission(), volcano, seeds=[0, 3])
    return folder


@pytest.fixture(scope="module")
def name(results) -> str:
    return run_to_show(results, None)


@pytest.fixture(scope="module")
def recording(results, name):
    return read_recording(results, name, 0)


@pytest.fixture(scope="module")
def states(recording):
    return list(replay(recording))


def console() -> Console:
    return Console(width=120, force_terminal=False)


@pytest.mark.parametrize(
    ("planner", "detector", "scope"),
    [("puct", "copod", "historical"), ("uct", "best", "batch"), ("uct", "none", "batch")],
)
def test_a_replay_gives_the_stored_mission(planner, detector, scope, volcano, tmp_path):
    run = store(tmp_path, short_mission(planner, detector, scope, rho=0.2), volcano, seeds=[5])
    recording = read_recording(tmp_path, run, 5)
    states = list(replay(recording))
    assert difference_from_curve(states, recording) == ""
    for column in ("epoch", "collected", "accepted", "tp", "fp", "fn", "tn"):
        stored = recording.curve[column].tolist()
        assert [getattr(state.row, column) for state in states] == stored
    last = states[-1]
    np.testing.assert_array_equal(last.samples.flagged, recording.samples["flagged"])
    maps = pd.read_parquet(table_path(tmp_path, "maps", run, 5))
    for column, values in (
        ("mean", last.maps.mean),
        ("std", last.maps.std),
        ("outlier_density", last.maps.outlier_density),
    ):
        np.testing.assert_allclose(values, maps[column], rtol=1e-9, atol=1e-12)


def test_the_replay_keeps_what_each_epoch_knew(states, recording):
    for state in states:
        rows = recording.samples[recording.samples["epoch"] <= state.row.epoch]
        np.testing.assert_array_equal(state.samples.x, rows[["x1", "x2"]])
        error = state.maps.mean - recording.truth.ravel()
        assert np.sqrt(np.mean(error**2)) == pytest.approx(state.row.rmse)


def test_a_curve_that_is_not_the_missions_is_noticed(states, recording):
    other = recording.curve.copy()
    other.loc[1, "rmse"] += 50.0
    message = difference_from_curve(states, replace(recording, curve=other))
    assert "epoch 1" in message
    assert f"{recording.curve['rmse'][1]:.4g} instead of {other['rmse'][1]:.4g}" in message


def test_pictures_show_a_false_alarm_where_it_is(states, recording):
    last = states[-1]
    without = type(last)(
        **{**vars(last), "samples": last.samples[np.arange(len(last.samples)) >= 0]}
    )
    clean = int(np.flatnonzero(~last.samples.is_outlier & ~last.samples.flagged)[50])
    without.samples.flagged[clean] = True
    plain, marked = draw_pictures([last, without], recording)
    assert plain.shape == marked.shape
    rows, columns = np.nonzero((plain != marked).any(axis=2))
    assert 4 < np.ptp(rows) < 20
    assert 4 < np.ptp(columns) < 20
    # The terrain fills a square of 396 pixels, 36 from the left, its lower border 186 from below.
    x, y = last.samples.x[clean] / 50.0 * 396.0
    assert columns.mean() == pytest.approx(36 + x, abs=2.5)
    assert rows.mean() == pytest.approx(plain.shape[0] - 186 - y, abs=2.5)


def test_every_picture_tells_the_epoch(states, recording):
    pictures = list(draw_pictures(states, recording))
    assert len(pictures) == len(recording.curve)
    assert all((a != b).any() for a, b in pairwise(pictures))


def test_the_gif_holds_every_epoch_and_starts_over(results, name, recording):
    path = animate(results, console(), seed=0, fps=5)
    assert path == results / "figures" / f"{name}-seed0.gif"
    with Image.open(path) as gif:
        durations = []
        for frame in range(gif.n_frames):
            gif.seek(frame)
            durations.append(gif.info["duration"])
        assert gif.n_frames == len(recording.curve)
        assert durations == [200] * (gif.n_frames - 1) + [3000]
        assert gif.info["loop"] == 0
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_a_gif_keeps_the_colours(tmp_path):
    picture = np.full((60, 60, 3), 255, dtype=np.uint8)
    picture[10:20, 10:20] = (0, 114, 178)
    picture[30:33, 30:33] = (255, 106, 0)
    other = picture.copy()
    other[30:33, 30:33] = 0
    write_gif([picture, other], tmp_path / "a.gif", 4)
    with Image.open(tmp_path / "a.gif") as gif:
        first = np.asarray(gif.convert("RGB")).astype(int)
        gif.seek(1)
        second = np.asarray(gif.convert("RGB")).astype(int)
    assert np.abs(first - picture).max() <= 8
    assert np.abs(second - other).max() <= 8
    assert (first[0, 0] == 255).all()


@pytest.mark.parametrize(("count", "most", "kept"), [(5, 60, [0, 1, 2, 3, 4]), (9, 3, [0, 4, 8]),
                                                     (100, 2, [0, 99]), (1, 60, [0])])  # fmt: skip
def test_long_missions_skip_epochs(count, most, kept):
    assert thinned(list(range(count)), most) == kept


def test_the_only_run_is_taken_else_the_papers(results, name, volcano, tmp_path):
    assert run_to_show(results, name) == name
    assert run_to_show(results, name.rsplit("-", 1)[1]) == name
    uct = store(tmp_path, short_mission("uct", "none"), volcano)
    best = store(tmp_path, short_mission("uct", "best"), volcano)
    with pytest.raises(UsageError, match=f"run={best} or run={uct}"):
        run_to_show(tmp_path, None)
    paper = store(tmp_path, short_mission(), volcano)
    assert run_to_show(tmp_path, None) == paper
    twin = store(tmp_path, short_mission(budget=180), volcano)
    with pytest.raises(UsageError, match="say which") as raised:
        run_to_show(tmp_path, None)
    assert paper in str(raised.value)
    assert twin in str(raised.value)
    assert uct not in str(raised.value)


def test_what_is_not_stored_is_named(results, name, tmp_path):
    with pytest.raises(UsageError, match="no finished mission"):
        run_to_show(tmp_path, None)
    with pytest.raises(UsageError, match=f"run=uct is not stored.*{name}"):
        run_to_show(results, "uct")
    with pytest.raises(UsageError, match=r"no mission with seed=1: there is 0 .*3"):
        read_recording(results, name, 1)


def test_a_damaged_table_is_named(volcano, tmp_path):
    run = store(tmp_path, short_mission("uct", "none"), volcano)
    path = table_path(tmp_path, "samples", run, 0)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(RunError, match=r"samples.*seed=0"):
        read_recording(tmp_path, run, 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"file_format": "avi"}, "format=avi is not a choice: use gif or mp4"),
        ({"fps": 0}, "fps=0 must be"),
        ({"fps": 51}, "fps=51 must be"),
        ({"fps": "fast"}, "fps=fast must be"),
        ({"fps": float("nan")}, "fps=nan must be"),
    ],
)
def test_wrong_options_are_one_sentence(options, message, results):
    with pytest.raises(UsageError, match=message):
        animate(results, console(), **options)


def test_without_ffmpeg_a_video_is_refused_before_any_work(results, monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(UsageError, match=r"install it .* or use format=gif"):
        animate(results, console(), file_format="mp4")


def fake_ffmpeg(folder: Path, body: str, monkeypatch: pytest.MonkeyPatch) -> None:
    script = folder / "ffmpeg"
    script.write_text(f"#!/bin/sh\n{body}\n")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", str(folder), prepend=":")


def test_ffmpeg_gets_raw_pictures_and_their_size(tmp_path, monkeypatch):
    fake_ffmpeg(tmp_path, 'for last; do :; done; echo "$@" > "$last.args"; cat > "$last"',
                monkeypatch)  # fmt: skip
    assert find_ffmpeg() == str(tmp_path / "ffmpeg")
    pictures = [np.full((4, 6, 3), shade, dtype=np.uint8) for shade in (1, 2)]
    write_mp4(pictures, tmp_path / "a.mp4", 2)
    arguments = (tmp_path / "a.mp4.args").read_text()
    assert "-pix_fmt rgb24 -s 6x4 -r 2 -i -" in arguments
    # The last of two pictures stands three seconds longer: six more at two a second.
    assert (tmp_path / "a.mp4").read_bytes() == b"\1" * 72 + b"\2" * 72 * 7


def test_a_failing_ffmpeg_is_quoted(tmp_path, monkeypatch):
    fake_ffmpeg(tmp_path, "cat > /dev/null; echo Unknown encoder >&2; exit 1", monkeypatch)
    with pytest.raises(RunError, match=r"Unknown encoder.*format=gif"):
        write_mp4([np.zeros((2, 2, 3), dtype=np.uint8)], tmp_path / "a.mp4", 4)


def test_the_command_line_animates_and_says_where(results, name, capsys):
    arguments = ["animate", "seed=3", f"results_dir={results}", f"run={name}"]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert "recomputing epochs: " in out
    assert f"animated to {results / 'figures' / f'{name}-seed3.gif'}" in out
    assert main(["animate", "sed=3"]) == 2
    assert "did you mean 'seed'" in capsys.readouterr().err
