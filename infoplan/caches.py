"""Where caches are kept, also where the installation is read-only and there is no home."""

import os
import stat
import sys
import tempfile
from functools import cache
from pathlib import Path

from infoplan.errors import RunError

KERNELS = "infoplan-kernels"
"""Folder of compiled kernels, in each place where they may be kept."""

_OWN = "infoplan-cache-"
_told = False


def kernel_places() -> tuple[list[Path], Path | None]:
    """Folders of compiled kernels.

    Returns
    -------
    readable : list of Path
        Where they may be found: what ``NUMBA_CACHE_DIR`` names, beside the package's byte code, the
        user's cache, a temporary folder of one's own. Others cannot write there.
    writable : Path or None
        Where new ones are kept: the first of these that can be written; None if none can.
    """
    readable, writable = [], None
    for place in _places():
        readable.append(place)
        if _can_write(place):
            writable = place
            break
    else:
        if own := temporary_folder():
            writable = own / KERNELS
            readable.append(writable)
    return readable, writable


def kernel_note() -> str | None:
    """Say where kernels are kept if that is not as usual, once in a process; else None."""
    global _told
    if _told:
        return None
    _told = True
    _, writable = kernel_places()
    wanted = os.environ.get("NUMBA_CACHE_DIR")
    ordinary = _places()
    nowhere = f"neither {' nor '.join(str(place.parent) for place in ordinary)}"
    remedy = "set NUMBA_CACHE_DIR to a folder that can be written"
    if writable is None:
        return (
            f"compiled kernels can be kept nowhere, {nowhere} nor a temporary folder can be "
            f"written: every worker compiles its own, which takes some ten seconds; {remedy}"
        )
    if writable not in ordinary:
        return (
            f"compiled kernels are kept in {writable}, a temporary folder, because {nowhere} can "
            f"be written; {remedy}"
        )
    if wanted and writable != ordinary[0]:
        return (
            f"compiled kernels are kept in {writable}: NUMBA_CACHE_DIR={wanted} cannot be written"
        )
    return None


def kept_file(name: str) -> Path | None:
    """Path of a downloaded file: where it is, or else where it may be kept.

    Parameters
    ----------
    name
        Of the file.

    Returns
    -------
    Path or None
        In the user's cache, or where that can neither be read nor written in a temporary folder of
        one's own; None if there is none either. Nothing is created in the user's cache.
    """
    folder = user_cache()
    if folder and (os.path.isfile(folder / name) or _may_become(folder)):
        return folder / name
    own = temporary_folder()
    return own / name if own else None


def user_cache() -> Path | None:
    """Return the user's cache folder, there or not; None without a home."""
    import platformdirs

    try:
        folder = Path(platformdirs.user_cache_dir("infoplan"))
    except RuntimeError:
        return None
    return folder if folder.is_absolute() else None  # older versions leave the "~"


def prepare_matplotlib() -> None:
    """Give Matplotlib a folder for its fonts where its own cannot be written.

    It would make a new one in every process, and say so in each.
    """
    home = os.path.expanduser("~")  # unlike Path.home() it never raises
    if wanted := os.environ.get("MPLCONFIGDIR"):
        folders = [os.path.abspath(wanted)]
    elif sys.platform.startswith(("linux", "freebsd")):
        folders = [
            os.path.join(os.environ.get("XDG_CONFIG_HOME") or f"{home}/.config", "matplotlib"),
            os.path.join(os.environ.get("XDG_CACHE_HOME") or f"{home}/.cache", "matplotlib"),
        ]
    else:
        folders = [os.path.join(home, ".matplotlib")]
    usable = all(os.path.isabs(folder) and _may_become(Path(folder)) for folder in folders)
    if not usable and (own := temporary_folder()):
        os.environ["MPLCONFIGDIR"] = str(own / "matplotlib")


def scratch_folder() -> str:
    """Make a new temporary folder and return its path.

    Raises
    ------
    RunError
        If there can be none.
    """
    try:
        return tempfile.mkdtemp(prefix="infoplan-")
    except OSError as error:
        raise RunError(
            f"no temporary folder can be made ({error.strerror}): set TMPDIR to a folder that can "
            "be written, and has room"
        ) from error


@cache
def temporary_folder() -> Path | None:
    """Return a temporary folder of one's own, the same in all processes; None if there is none.

    Its name cannot be foreseen, and it is known by its owner and permissions: what is in it was
    written by this user.
    """
    try:
        temporary = Path(tempfile.gettempdir())
        for _ in range(2):
            if own := [folder for folder in temporary.glob(f"{_OWN}*") if _is_ones_own(folder)]:
                return min(own)
            tempfile.mkdtemp(prefix=_OWN, dir=temporary)
    except OSError:
        pass
    return None


def _places() -> list[Path]:
    """List where kernels are kept, the temporary folder apart."""
    wanted = os.environ.get("NUMBA_CACHE_DIR")
    folders = [Path(wanted)] if wanted else []
    folders.append(Path(__file__).parent / "__pycache__")
    if folder := user_cache():
        folders.append(folder)
    return [folder.absolute() / KERNELS for folder in folders]


def _can_write(folder: Path) -> bool:
    """Make a folder, and tell whether files can be made in it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _may_become(folder: Path) -> bool:
    """Tell whether a folder can be written, or could be if it were made; makes nothing."""
    try:
        while not os.path.lexists(folder):
            folder = folder.parent
        return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)
    except OSError:
        return False


def _is_ones_own(folder: Path) -> bool:
    """Tell whether this is a folder, no link, of this user, closed to all others."""
    try:
        status = os.lstat(folder)
    except OSError:
        return False
    mine = not hasattr(os, "getuid") or (
        status.st_uid == os.getuid() and not stat.S_IMODE(status.st_mode) & 0o077
    )
    return stat.S_ISDIR(status.st_mode) and mine and os.access(folder, os.W_OK | os.X_OK)
