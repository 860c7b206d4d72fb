"""Files that users name: read only if regular and not too large; why one cannot be written."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from infoplan.errors import RunError, UsageError
from infoplan.wording import harmless


def user_path(text: str | Path) -> Path:
    """Return a path as a user wrote it, a ``~`` at its start their home.

    A ``~name`` of which there is no such user stays what it is, as in a shell.
    """
    try:
        return Path(text).expanduser()
    except RuntimeError:
        return Path(text)


def open_regular(path: Path) -> BinaryIO:
    """Open a file that must be a regular one; links are followed, nothing is waited for.

    Raises
    ------
    OSError
        If it cannot be opened.
    UsageError
        If it is a folder, pipe, socket or device.
    """
    # Opening a pipe waits for a writer, unless told not to.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    descriptor = os.open(path, flags)
    mode = os.fstat(descriptor).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    raise UsageError(f"{path} is {_kind(mode)}: name a file")


def read_regular(path: Path, limit: int) -> bytes:
    """Read a whole file that must be a regular one.

    Parameters
    ----------
    path
        The file; links are followed.
    limit
        Largest size, in bytes.

    Returns
    -------
    bytes

    Raises
    ------
    OSError
        If it cannot be opened or read.
    UsageError
        If it is a folder, pipe, socket or device, or larger than `limit`. Nothing of it is read
        then, and nothing waited for.
    """
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > limit:
            raise UsageError(f"{path} has {size} bytes, more than the {limit} that it may have")
        content = read_up_to(stream, size, limit)
    if len(content) > limit:  # it has grown meanwhile, or never told its size, as under /proc
        raise UsageError(f"{path} has more than the {limit} bytes that it may have")
    return content


def read_up_to(stream: BinaryIO, size: int, limit: int) -> bytes:
    """Read what a stream holds, about `size` bytes; of more than `limit`, a few more than that."""
    content = stream.read(size)
    # No more memory is taken than is there.
    while len(content) <= limit and (more := stream.read(2**20)):
        content += more
    return content


@contextmanager
def writing(path: Path, then: str = "") -> Iterator[None]:
    """Turn a failure to write a file into one sentence about it and what to do.

    Parameters
    ----------
    path
        The file that is meant, whatever is written on the way.
    then
        What to do afterwards.

    Raises
    ------
    RunError
        If the file system refuses.
    """
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise RunError(
            harmless(f"{path} could not be written ({reason}): {remedy(error)}{then}")
        ) from error


def remedy(error: OSError) -> str:
    """Say what to do about a failure to write."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return "make room or name another results_dir"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return "name a results_dir that you may write to"
    if error.errno in (errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ENOTEMPTY, errno.ELOOP):
        return "move what is in the way elsewhere or name another results_dir"
    if error.errno == errno.ENAMETOOLONG:
        return "name a shorter results_dir"
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return "allow more open files (ulimit -n) or close some"
    return "look after the disk or name another results_dir"


def _kind(mode: int) -> str:
    kinds = {
        stat.S_IFDIR: "a folder",
        stat.S_IFIFO: "a named pipe",
        stat.S_IFSOCK: "a socket",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
    }
    return kinds.get(stat.S_IFMT(mode), "no regular file")
