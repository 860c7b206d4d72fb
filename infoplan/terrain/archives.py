"""Maps in .zip archives."""

import errno
import shutil
import stat
import tempfile
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import PurePosixPath, PureWindowsPath
from typing import BinaryIO

from infoplan.errors import UsageError
from infoplan.wording import harmless, suggest

MAX_BYTES = 2**30
"""Largest file that is unpacked."""
IN_MEMORY = 2**28
"""Largest file that is unpacked into memory, and not to a temporary file, bytes."""


@contextmanager
def unpacked(
    archive: BinaryIO, what: str, member: str | None, endings: Collection[str]
) -> Iterator[tuple[str, BinaryIO]]:
    """Unpack one map, into memory or a temporary file that lives as long as the context.

    Parameters
    ----------
    archive
        A ``.zip`` file.
    what
        What it is called in a message.
    member
        The map's name in it; None: the only file with one of the `endings`.
    endings
        How the names of maps end, in lower case.

    Yields
    ------
    name : str
        The map's own name, without folders.
    file : binary file
        The map.

    Raises
    ------
    UsageError
        If the archive is damaged, encrypted or booby-trapped, or does not hold the map.
    """
    with tempfile.SpooledTemporaryFile(IN_MEMORY, prefix="infoplan-") as file:
        try:
            with zipfile.ZipFile(archive) as opened:
                entry = _entry(opened.infolist(), member, endings, what)
                # A stream ends at the size that was claimed, and checked, whatever follows.
                with opened.open(entry) as packed:
                    shutil.copyfileobj(packed, file, 2**20)
        except (UsageError, MemoryError):
            raise
        except Exception as error:  # a mangled archive fails in many ways
            reason = "it is damaged: get it again"
            if "encrypted" in str(error):
                reason = "it is encrypted: unpack it yourself"
            if getattr(error, "errno", None) in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
                reason = (
                    f"the temporary folder is full ({tempfile.gettempdir()}): make room, or set "
                    "TMPDIR to a folder that has it"
                )
            raise UsageError(f"{what} cannot be unpacked, {reason}") from error
        file.seek(0)
        yield PurePosixPath(entry.filename).name, file  # type: ignore[misc]


def _entry(
    entries: list[zipfile.ZipInfo], member: str | None, endings: Collection[str], archive: str
) -> zipfile.ZipInfo:
    for entry in entries:
        _check_name(entry, archive)
    maps = {entry.filename: entry for entry in entries if _is_map(entry, endings)}
    listed = harmless(", ".join(list(maps)[:9]))
    if not maps:
        raise UsageError(f"{archive} holds no map: a map's name ends in {', '.join(endings)}")
    if member is None:
        if len(maps) > 1:
            raise UsageError(
                f"{archive} holds {len(maps)} maps: choose one with terrain.member= ({listed})"
            )
        member = next(iter(maps))
    if member not in maps:
        raise UsageError(
            f"{archive} holds no map {member!r}{suggest(member, maps)}: "
            f"terrain.member= takes {listed}"
        )
    entry = maps[member]
    if entry.file_size > MAX_BYTES:
        raise UsageError(
            f"{harmless(member)} in {archive} unpacks to {entry.file_size} bytes, more than the "
            f"{MAX_BYTES} that are unpacked: unpack it yourself if you trust it"
        )
    return entry


def _check_name(entry: zipfile.ZipInfo, archive: str) -> None:
    """Refuse an archive that could write outside the folder it is unpacked to."""
    # Archives made under Windows may have its separators and drives.
    path = PureWindowsPath(entry.filename)
    if path.is_absolute() or path.drive or path.root or ".." in path.parts:
        raise UsageError(
            f"{archive} holds the path {entry.filename!r}, which leads out of it: such an archive "
            "is not opened"
        )
    if stat.S_ISLNK(entry.external_attr >> 16):
        raise UsageError(
            f"{archive} holds the link {entry.filename!r}: such an archive is not opened"
        )


def _is_map(entry: zipfile.ZipInfo, endings: Collection[str]) -> bool:
    path = PurePosixPath(entry.filename)
    hidden = any(part.startswith((".", "__MACOSX")) for part in path.parts)
    return not entry.is_dir() and not hidden and path.suffix.lower() in endings
