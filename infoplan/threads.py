"""One thread a mission: the last bits of a product depend on how many share it."""

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold the numerical libraries of this process to one thread."""
    import scipy.linalg  # noqa: F401 - a library that is loaded later would not be held
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield
