"""One mission as an animation: where it drove, what it believed, and how wrong it was."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from rich.console import Console
from rich.progress import track

from infoplan.draw.moving_files import Picture, find_ffmpeg, write_gif, write_mp4
from infoplan.draw.recording import (
    Recording,
    cannot_replay,
    check_named,
    difference_from_curve,
    from_tables,
    read_recording,
    replay,
    run_to_show,
)
from infoplan.draw.scene import draw_pictures
from infoplan.errors import UsageError
from infoplan.files import writing
from infoplan.palette import TERMINAL
from infoplan.scoring import State
from infoplan.trust import admit

Item = TypeVar("Item")

FORMATS = ("gif", "mp4")

MAX_FPS = 50
"""Browsers show no more pictures of a GIF a second."""

MAX_FRAMES = 60
"""A mission of more epochs skips some, so that the file stays small."""

LINE_SECONDS = 5.0
"""Without a terminal, lines about the progress come this often."""


def animate(
    results_dir: Path,
    console: Console,
    *,
    run: str | None = None,
    seed: int = 0,
    file_format: str = "gif",
    fps: float = 4,
    trust: bool = False,
    named: Mapping[str, str | None] | None = None,
) -> Path:
    """Draw a stored mission as an animation, a picture an epoch.

    The maps between are recomputed from the samples. A detector or model of the user's is imported
    for that only if the caller trusts it; without it the maps of the end are shown, the last that
    the tables hold. A planner is never needed.

    Parameters
    ----------
    results_dir
        The folder of the tables; the animation lands in its ``figures``.
    console
        Where progress and warnings go.
    run
        Name of the run; None: the one that `run_to_show` finds.
    seed
        Which of its missions.
    file_format
        ``gif`` or ``mp4``.
    fps
        Pictures a second, above 0 and at most 50.
    trust
        Whether a detector's or model's function that the stored run names may be imported; else
        those maps alone are drawn that the tables hold.
    named
        Functions that the command line itself names, by group, as ``{"detector": "mine.jumps"}``;
        those of the run may be imported.

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    UsageError
        If the mission is not stored, an option is wrong, or ffmpeg is needed and not there.
    RunError
        If a table cannot be read or the file cannot be written.
    """
    if file_format not in FORMATS:
        raise UsageError(f"format={file_format} is not a choice: use {' or '.join(FORMATS)}")
    if isinstance(fps, bool) or not isinstance(fps, int | float) or not 0 < fps <= MAX_FPS:
        raise UsageError(f"fps={fps} must be a number above 0 and at most {MAX_FPS}")
    write: Callable[[Sequence[Picture], Path, float], None] = write_gif
    if file_format == "mp4":
        write = write_mp4
        find_ffmpeg()
    recording = read_recording(results_dir, run_to_show(results_dir, run), seed)
    states = list(_states(recording, named or {}, trust, console))
    states = thinned(states, MAX_FRAMES)
    pictures = list(
        _tracked(draw_pictures(states, recording), len(states), "drawing pictures", console)
    )
    path = results_dir / "figures" / f"{recording.run}-seed{seed}.{file_format}"
    unfinished = path.with_name(f".{path.name}")
    try:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            write(pictures, unfinished, fps)
            unfinished.replace(path)
    finally:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
    return path


def thinned(states: Sequence[State], most: int) -> list[State]:
    """Keep at most so many states, evenly spread, the first and the last among them."""
    chosen = np.unique(np.linspace(0, len(states) - 1, min(most, len(states))).round().astype(int))
    return [states[i] for i in chosen]


def _states(
    recording: Recording, named: Mapping[str, str | None], trust: bool, console: Console
) -> Iterator[State]:
    """Recompute a mission's states, or take what the tables tell, and say which."""
    tell = partial(console.print, soft_wrap=True, markup=False)
    config, epochs = recording.config, len(recording.curve)
    check_named(recording, named)
    given = {group for group, path in named.items() if path is not None}
    if reason := cannot_replay(config, trust, given):
        tell(f"only the maps of the end are shown: {reason}")
        yield from _tracked(from_tables(recording), epochs, "reading epochs", console)
        return
    admit(config, recording.science, given, trust, tell)
    states = []
    for state in _tracked(replay(recording), epochs, "recomputing epochs", console):
        states.append(state)
        yield state
    if difference := difference_from_curve(states, recording):
        said = f"WARNING: {difference}"
        console.print(said, style=TERMINAL["alarm"], soft_wrap=True, markup=False)


def _tracked(items: Iterator[Item], total: int, what: str, console: Console) -> Iterator[Item]:
    """Pass items on and show how many are done: a bar, or lines where there is no terminal."""
    if console.is_terminal:
        yield from track(items, what, total, console=console, transient=True)
        return
    last = time.monotonic()
    for done, item in enumerate(items, start=1):
        yield item
        if done == total or time.monotonic() - last >= LINE_SECONDS:
            last = time.monotonic()
            console.print(f"{what}: {done} of {total}", soft_wrap=True)
