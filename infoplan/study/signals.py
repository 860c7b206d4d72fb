"""Ctrl-C and a batch system's signals: when they count, when they wait, when they are ignored."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

STOPPING = [signal.SIGINT, signal.SIGTERM] + [
    getattr(signal, name) for name in ("SIGHUP",) if hasattr(signal, name)
]
"""Signals by which a user or a batch system ends a study."""

Handler = Callable[[int, Any], Any] | signal.Handlers


@contextmanager
def stoppable() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end a study as Ctrl-C does: workers ended, finished missions kept."""

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    # Whatever the user has chosen to ignore (nohup) stays ignored.
    untouched = [number for number in STOPPING if signal.getsignal(number) == signal.SIG_DFL]
    with _handled_by(interrupt, untouched):
        yield


@contextmanager
def postponed() -> Iterator[None]:
    """Let signals wait until the end of the block, which is not to be left half done."""
    heard: list[int] = []
    with _handled_by(lambda number, frame: heard.append(number), STOPPING):
        yield
    for number in heard:
        signal.raise_signal(number)


@contextmanager
def ignored() -> Iterator[None]:
    """Let nothing interrupt the end: a second Ctrl-C would leave workers behind."""
    with _handled_by(signal.SIG_IGN, STOPPING):
        yield


@contextmanager
def _handled_by(handler: Handler, numbers: list[signal.Signals]) -> Iterator[None]:
    """Put a handler in place for some signals, in the main thread: others cannot."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, signal.SIG_DFL if former is None else former)
