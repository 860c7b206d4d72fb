"""One thread a mission: the last bits of a product depend on how many share it."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_lock = threading.RLock()
_holders = 0
_limits: list[Any] = []
"""Limits in force, each with what to restore: set by the first holder, lifted by the last."""
_controller: Any = None


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold the numerical libraries of this process to one thread, inside a ``with``.

    BLAS has one number for the whole process: while several threads are inside, the first to enter
    has set it, and the last to leave restores what was there before. OpenMP and BLIS have one for
    each thread.
    """
    global _holders
    # Outermost, because an OpenBLAS built with OpenMP follows it.
    with _loaded().select(user_api="openmp", internal_api="blis").limit(limits=1):
        with _lock:
            if not _holders:
                _limit()
            _holders += 1
        try:
            yield
        finally:
            with _lock:
                _holders -= 1
                if not _holders:
                    _restore()


def look_again() -> None:
    """Notice libraries that were loaded since; finding them takes a while, so it is done rarely."""
    global _controller
    with _lock:
        _controller = None
        if _holders:
            _limit()


def _limit() -> None:
    _take_control()
    _limits.append(_loaded().select(user_api="blas").limit(limits=1))


def _restore() -> None:
    _take_control()
    while _limits:
        _limits.pop().restore_original_limits()
    _take_control()


def _take_control() -> None:
    """Let whoever comes next set the number of OpenBLAS: this thread, or after it any other.

    Newer versions of threadpoolctl listen to one thread alone, and quietly ignore the others.
    """
    from threadpoolctl import OpenBLASController

    if hasattr(OpenBLASController, "clear_controlling_thread"):
        OpenBLASController.clear_controlling_thread(force=True)


def _loaded() -> Any:
    """Return the controller of the libraries that are loaded by now."""
    global _controller
    with _lock:
        if _controller is None:
            import scipy.linalg  # noqa: F401 - a library that is loaded later would not be held
            from threadpoolctl import ThreadpoolController

            _controller = ThreadpoolController()
        return _controller
