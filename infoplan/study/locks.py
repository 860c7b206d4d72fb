"""One lock a mission, so that several infoplan processes share the work on one results folder.

The operating system holds the lock on an open file and drops it when the process dies, whatever it
dies of. The lock counts between machines as far as their shared file system carries ``flock``.
"""

import errno
import os
import re
from contextlib import suppress
from pathlib import Path

from infoplan.wording import harmless

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

FOLDER = ".locks"

OPEN = os.O_RDWR | getattr(os, "O_NONBLOCK", 0)
"""How a lock's file is opened: whatever stands in its place is not waited for."""

HELD = (errno.EWOULDBLOCK, errno.EAGAIN) if fcntl else (errno.EACCES, errno.EDEADLK)
"""What is answered where another process holds a lock; Windows has its own way to say so."""

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EMFILE, errno.ENFILE, errno.ENAMETOOLONG)
"""What is answered where no lock can be made and no table will be."""


class NoLocksError(OSError):
    """No locks can be had on the file system of the results: work goes on without them."""


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
        If no locks can be had there, whatever the reason.
    OSError
        If there is no room for one.
    """
    path = lock_path(results_dir, run, seed)
    while True:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path, OPEN | os.O_CREAT, 0o666)
        except OSError as error:
            if error.errno in FULL:
                raise
            raise NoLocksError(error.errno, os.strerror(error.errno or errno.EIO)) from error
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


def no_locks(results_dir: Path, error: NoLocksError) -> str:
    """Say that work goes on without locks, and what that means."""
    return harmless(
        f"no locks can be had in {results_dir} ({error.strerror}): do not run a second infoplan "
        "on it"
    )


def list_held(results_dir: Path) -> set[tuple[str, int]]:
    """List the missions that some process is flying now, as (run, seed)."""
    held = set()
    for path in (results_dir / FOLDER).glob("*.seed=*"):
        run, _, digits = path.name.rpartition(".seed=")
        if not re.fullmatch(r"[0-9]{1,18}", digits):
            continue
        try:
            descriptor = os.open(path, OPEN)
        except OSError:  # released just now, or none of ours
            continue
        try:
            if not _lock(descriptor):
                held.add((run, int(digits)))
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
        if error.errno in HELD:
            return False
        raise NoLocksError(error.errno, os.strerror(error.errno or errno.EIO)) from error
    return True


def _is_still(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
