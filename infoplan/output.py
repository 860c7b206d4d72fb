"""Standard output and error that may be closed, full, or a terminal that is gone."""

import os
import sys
from contextlib import suppress
from typing import Any

BROKEN = (OSError, ValueError, AttributeError)
"""What writing to a stream raises that is full, closed, or None."""

_losses: list[str] = []
"""Why output was lost in this process."""


class Output:
    """Standard output as a console writes to it; a study outlives its loss.

    Attributes
    ----------
    lost
        Why nothing can be written to it any more; empty while it can.
    """

    def __init__(self) -> None:
        self.stream: Any = sys.stdout
        self.lost = ""

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    @property
    def encoding(self) -> str:
        """Of the stream; UTF-8 where there is none."""
        return getattr(self.stream, "encoding", None) or "utf-8"

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        try:
            return bool(self.stream.isatty())
        except BROKEN:
            return False

    def write(self, text: str) -> int:
        """Write a text; what the stream's encoding does not have becomes an escape."""
        if not self.lost:
            known = text.encode(self.encoding, "backslashreplace").decode(self.encoding)
            try:
                self.stream.write(known)
            except BROKEN as error:
                self._lose(error)
        return len(text)

    def flush(self) -> None:
        """Hand what is written to the operating system."""
        if not self.lost:
            try:
                self.stream.flush()
            except BROKEN as error:
                self._lose(error)

    def _lose(self, error: Exception) -> None:
        if self.stream is None:  # whoever has closed it, meant it
            self.lost = "closed"
            complain("infoplan: standard output is closed: what it should show is lost")
            return
        self.lost = getattr(error, "strerror", None) or str(error)
        _losses.append(self.lost)
        complain(
            f"infoplan: standard output cannot be written ({self.lost}): what it should show is "
            "lost; missions go on, and their tables are stored"
        )
        # What the stream still holds would fail again when the interpreter ends.
        with suppress(*BROKEN):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.stream.fileno())
            os.close(nowhere)


def forget_losses() -> bool:
    """Tell whether output was lost since this was asked last."""
    lost = bool(_losses)
    _losses.clear()
    return lost


def complain(text: str) -> None:
    """Write a line to standard error, if that can be written to."""
    with suppress(*BROKEN):
        sys.stderr.write(text.rstrip("\n") + "\n")
        sys.stderr.flush()


def occupy_standard_streams() -> None:
    """Open what is closed of the first three descriptors, lest a worker's pipe become one."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
