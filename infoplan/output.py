"""Standard output and error that may be closed, full, or a pipe that nobody reads any more."""

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO

BROKEN = (OSError, ValueError, AttributeError)
"""What writing to a stream raises that is full, closed, or None."""


class Output:
    """Standard output whose loss ends nothing: it is told once, and what follows is thrown away.

    Parameters
    ----------
    stream
        The stream itself; None if it is closed.

    Attributes
    ----------
    lost
        Why nothing can be written to it any more; empty while it can.
    unread
        Whether that is because the reader of a pipe has left, which is told by `tell_unread` alone.
    """

    def __init__(self, stream: TextIO | None):
        self.stream: Any = stream
        self.lost = ""
        self.unread = False

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
        if self.stream is not None and not self.lost:
            try:
                self.stream.flush()
            except BROKEN as error:
                self._lose(error)

    def tell_unread(self) -> None:
        """Tell that the reader of a pipe has left, if it has."""
        if self.unread:
            self._tell()

    def _lose(self, error: Exception) -> None:
        closed = self.stream is None
        self.lost = "it is closed" if closed else getattr(error, "strerror", None) or str(error)
        self.unread = getattr(error, "errno", None) == errno.EPIPE
        if not self.unread:
            self._tell()
        # What the stream still holds would fail again when the interpreter ends.
        with suppress(*BROKEN):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.stream.fileno())
            os.close(nowhere)

    def _tell(self) -> None:
        complain(
            f"infoplan: standard output cannot be written ({self.lost}): what it should show is "
            "lost"
        )


@contextmanager
def standard_streams() -> Iterator[Output]:
    """Give a command streams that it can write to, whatever the caller has closed."""
    for descriptor in range(3):  # lest a worker's pipe become one of them
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    before = sys.stdout, sys.stderr
    output = Output(sys.stdout)
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        sys.stdout, sys.stderr = output, sys.stderr or nowhere
        try:
            yield output
        finally:
            sys.stdout, sys.stderr = before


def complain(text: str) -> None:
    """Write a line to standard error, if that can be written to."""
    with suppress(*BROKEN):
        encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
        known = text.rstrip("\n").encode(encoding, "backslashreplace").decode(encoding)
        sys.stderr.write(known + "\n")
        sys.stderr.flush()
