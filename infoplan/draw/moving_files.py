"""Files of moving pictures: GIF, and MP4 by ffmpeg."""

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoplan.errors import RunError, UsageError

if TYPE_CHECKING:
    import PIL.Image


Picture = NDArray[np.uint8]

HOLD_SECONDS = 3.0
"""How long the last picture stands."""

COLOURS = 255
"""Colours of a GIF."""


def write_gif(pictures: Sequence[Picture], path: Path, fps: float) -> None:
    """Write an endless GIF whose last picture stands for a while."""
    import PIL.Image

    # One palette for all pictures: only what changes between two is stored.
    palette = _palette(np.concatenate([pictures[0], pictures[len(pictures) // 2], pictures[-1]]))
    frames = [
        PIL.Image.fromarray(picture).quantize(palette=palette, dither=PIL.Image.Dither.NONE)
        for picture in pictures
    ]
    milliseconds = [round(1000 / fps)] * len(frames)
    milliseconds[-1] = max(milliseconds[-1], round(1000 * HOLD_SECONDS))
    frames[0].save(
        path,
        format="GIF",
        save_all=True,
        append_images=frames[1:],
        duration=milliseconds,
        loop=0,
        optimize=True,
    )


def write_mp4(pictures: Sequence[Picture], path: Path, fps: float) -> None:
    """Write an H.264 video by ffmpeg, the last picture standing for a while.

    Raises
    ------
    RunError
        If ffmpeg fails.
    """
    height, width = pictures[0].shape[:2]
    held = [*pictures, *[pictures[-1]] * round(HOLD_SECONDS * fps)]
    raw = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {fps:g} -i -"
    coded = "-r 25 -c:v libx264 -crf 20 -pix_fmt yuv420p -movflags +faststart -f mp4"
    command = [find_ffmpeg(), "-y", "-loglevel", "error", *raw.split(), *coded.split(), str(path)]
    done = subprocess.run(
        command, input=b"".join(picture.tobytes() for picture in held), capture_output=True
    )
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip().splitlines() or ["it does not say why"]
        raise RunError(f"ffmpeg could not write {path} ({words[-1]}): use format=gif instead")


def find_ffmpeg() -> str:
    """Path of ffmpeg.

    Raises
    ------
    UsageError
        If it is not installed.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        raise UsageError(
            "format=mp4 needs ffmpeg, which is not on the path: install it (on Debian and Ubuntu "
            "the package is called ffmpeg), or use format=gif"
        )
    return found


def _palette(picture: Picture) -> "PIL.Image.Image":
    """Choose the colours of a GIF: many for the maps, and some for the few pixels of the marks."""
    import PIL.Image

    # Every shade counts by the root of its area, or small marks would get no colour of their own.
    coarse = (picture >> 3).astype(np.int64) @ (1 << 10, 1 << 5, 1)
    areas = np.bincount(coarse.ravel(), minlength=1 << 15)
    areas[[0, -1]] = 0  # black and white are given
    shades = np.repeat(np.arange(1 << 15), np.sqrt(areas).astype(int))
    swatches = np.stack([shades >> 10, shades >> 5 & 31, shades & 31], axis=-1) * 8 + 4
    found = PIL.Image.fromarray(swatches[None].astype(np.uint8)).quantize(COLOURS - 2)
    colours = [*(found.getpalette() or [])[: 3 * (COLOURS - 2)], 0, 0, 0, 255, 255, 255]
    palette = PIL.Image.new("P", (1, 1))
    palette.putpalette(colours)
    return palette
