"""Ctrl-C and a batch system's signals: when they count, when they wait, when they are ignored."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

STOPPING = [signal.SIGINT, signal.SIGTERM] + [
    getattr(signal, name) for name in ("SIGHUP",) if hasattr(signal, name)
]
"""Signals by which a user or a batch system ends a study."""

PATIENCE_SECONDS = 2.0
"""For so long after one signal others change nothing: the end is under way."""

Handler = Callable[[int, Any], Any] | signal.Handlers


class Interrupted(KeyboardInterrupt):
    """A signal has come; a plain KeyboardInterrupt may also be the doing of a user's method."""


@contextmanager
def stoppable(for_good: bool = False) -> Iterator[None]:
    """Let SIGTERM and SIGHUP end a study as Ctrl-C does: workers ended, finished missions kept.

    Parameters
    ----------
    for_good
        Of a process that ends after the block: what has been interrupted stays deaf, so that
        impatience cannot spoil the interpreter's own end.
    """
    heard: list[float] = []

    def interrupt(number: int, frame: object) -> None:
        if not heard or time.monotonic() - heard[-1] >= PATIENCE_SECONDS:
            heard.append(time.monotonic())
            raise Interrupted

    # Whatever the user has chosen to ignore (nohup) stays ignored.
    defaults = (signal.SIG_DFL, signal.default_int_handler)
    untouched = [number for number in STOPPING if signal.getsignal(number) in defaults]
    with _handled_by(interrupt, untouched) as before:
        try:
            yield
        finally:
            if heard and for_good:
                before |= dict.fromkeys(before, signal.SIG_IGN)


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
def _handled_by(handler: Handler, numbers: list[signal.Signals]) -> Iterator[dict[int, Any]]:
    """Put a handler in place for some signals, in the main thread: others cannot.

    Yields
    ------
    dict
        What will handle them after the block.
    """
    if threading.current_thread() is not threading.main_thread():
        yield {}
        return
    after: dict[int, Any] = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield after
    finally:
        for number, former in after.items():
            signal.signal(number, signal.SIG_DFL if former is None else former)
