"""One thread a mission: the last bits of a product depend on how many share it."""

from contextlib import AbstractContextManager
from functools import cache
from typing import Any


def one_thread() -> AbstractContextManager[Any]:
    """Hold the numerical libraries of this process to one thread, inside a ``with``."""
    return _controller().limit(limits=1)


def look_again() -> None:
    """Notice libraries that were loaded since; finding them takes a while, so it is done rarely."""
    _controller.cache_clear()


@cache
def _controller() -> Any:
    import scipy.linalg  # noqa: F401 - a library that is loaded later would not be held
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
