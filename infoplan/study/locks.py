"""One lock a mission, so that several infoplan processes share the work on one results folder.

The operating system holds the lock on an open file and drops it when the process dies, whatever it
dies of. The lock counts between machines as far as their shared file system carries ``flock``.
"""

import errno
import os
from contextlib import suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

FOLDER = ".locks"

UNSUPPORTED = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)
"""What a file system answers that knows no locks."""


class NoLocksError(OSError):
    """The file system of the results knows no locks."""


class Lock:
    """A lock that this process holds until `release` or its end."""

    def __init__(self, path: Path, descriptor: int):
        self.path, self.descriptor = path, descriptor

    def release(self) -> None:
        """Let others have the mission."""
        if fcntl:
            # Gone before it is free: whoever waits for this very file sees that it is another now.
            with suppress(OSError):
                self.path.unlink()
            os.close(self.descriptor)
        else:  # an open file cannot be removed there, and one that others hold neither
            os.close(self.descriptor)
            with suppress(OSError):
                self.path.unlink()


def lock_path(results_dir: Path, run: str, seed: int) -> Path:
    """Path of a mission's lock."""
    return results_dir / FOLDER / f"{run}.seed={seed}"


def acquire(results_dir: Path, run: str, seed: int) -> Lock | None:
    """Take a mission's lock, without waiting.

    Returns
    -------
    Lock or None
        None if another process holds it.

    Raises
    ------
    NoLocksError
        If the file system knows no locks.
    """
    path = lock_path(results_dir, run, seed)
    path.parent.mkdir(parents=True, exist_ok=True)
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _lock(descriptor):
                os.close(descriptor)
                return None
            if _is_still(path, descriptor):
                return Lock(path, descriptor)
        except OSError:
            os.close(descriptor)
            raise
        os.close(descriptor)


def list_held(results_dir: Path) -> set[tuple[str, int]]:
    """List the missions that some process is flying now, as (run, seed)."""
    held = set()
    for path in (results_dir / FOLDER).glob("*.seed=*"):
        run, _, seed = path.name.rpartition(".seed=")
        try:
            descriptor = os.open(path, os.O_RDWR)
        except OSError:  # released just now
            continue
        try:
            if seed.isdigit() and not _lock(descriptor):
                held.add((run, int(seed)))
        except NoLocksError:
            pass
        finally:
            os.close(descriptor)
    return held


def _lock(descriptor: int) -> bool:
    """Lock an open file; False if another has it."""
    try:
        if fcntl:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    except OSError as error:
        if error.errno in UNSUPPORTED:
            raise NoLocksError(error.errno, os.strerror(error.errno)) from error
        return False
    return True


def _is_still(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
