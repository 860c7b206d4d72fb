"""The paper's grid of Mount St. Helens: a copy of the user's, a cached one, or a download.

A published 100 x 100 grid of the mountain after 1980 by the paper's authors (MIT licence,
W. Chen), in feet. Its row 0 is the mountain's north side and, as in their experiment, the y minimum
of the workspace: on a map with y upwards the crater opens downwards.
"""

import hashlib
import io
import os
import tempfile
import threading
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from infoplan.caches import kept_file
from infoplan.errors import RunError, UsageError
from infoplan.files import read_regular, user_path
from infoplan.text_options import as_override
from infoplan.wording import harmless

FILE = "helens.npy"
URL = (
    "https://raw.githubusercontent.com/Weizhe-Chen/attentive_kernels/main/"
    "data/volcano/preprocessed/helens.npy"
)
SHA256 = "d252e96a57705fa1f7217047f777950cafafff4272356210ad6771423198cd26"
UNIT = "ft"
MAX_BYTES = 2**24
"""Largest file that is looked at, far more than the grid has."""
PATIENCE = 8.0
"""Seconds a download may take in all."""


def find_helens(path: Path | None = None) -> Path | None:
    """Look for the paper's grid on this machine; nothing is downloaded.

    Parameters
    ----------
    path
        The file, or a folder that holds it; None: ``$INFOPLAN_DATA``, then the user's cache.

    Returns
    -------
    Path or None
        A file with the right bytes; None if there is none.

    Raises
    ------
    UsageError
        If `path` does not lead to the grid, or `path` or ``$INFOPLAN_DATA`` lead to other bytes.
    """
    if path is not None:
        file = _in_folder(path)
        if not os.path.isfile(file):  # no error of a long name or a closed folder
            raise UsageError(
                f"terrain.path={harmless(path)} leads to no {FILE}: give the file or a folder that "
                "holds it, or leave terrain.path out to have it downloaded"
            )
        return _checked(file, "terrain.path")
    data = os.environ.get("INFOPLAN_DATA")
    if data and os.path.isfile(file := _in_folder(user_path(data))):
        return _checked(file, "INFOPLAN_DATA")
    cached = kept_file(FILE)
    return cached if cached and _is_whole(cached) else None


def fetch_helens(patience: float = PATIENCE) -> Path:
    """Have the paper's grid in the user's cache: download it unless it is there.

    Parameters
    ----------
    patience
        Seconds that a download may take in all.

    Returns
    -------
    Path
        The cached file, its bytes checked.

    Raises
    ------
    RunError
        If it can be neither downloaded nor kept.
    """
    cached = kept_file(FILE)
    if cached is None:
        raise RunError(
            f"{FILE} can be kept nowhere: neither the user's cache nor a temporary folder can be "
            "written; set XDG_CACHE_HOME to a folder that can"
        )
    if _is_whole(cached):
        return cached
    content = _download(patience)
    try:
        cached.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cached.parent, prefix=".") as folder:
            whole = Path(folder) / FILE
            whole.write_bytes(content)
            whole.replace(cached)
    except OSError as error:
        raise RunError(f"{FILE} cannot be kept in {cached.parent}: {error.strerror}") from error
    return cached


def read_helens(file: Path) -> NDArray[np.float64]:
    """Elevations of a file that `find_helens` or `fetch_helens` gave, feet, shape (100, 100).

    Raises
    ------
    UsageError
        If it has other bytes by now, or cannot be read.
    """
    content = _content(file)
    if hashlib.sha256(content).hexdigest() != SHA256:
        raise UsageError(f"{harmless(file)} changed while it was read: try again")
    return np.load(io.BytesIO(content), allow_pickle=False)


def _in_folder(path: Path) -> Path:
    return path / FILE if os.path.isdir(path) else path


def _checked(file: Path, source: str) -> Path:
    digest = _digest(file)
    if digest != SHA256:
        raise UsageError(
            f"{harmless(file)} (from {source}) is not the paper's grid: its SHA-256 is {digest}, "
            f"not {SHA256}; replace it, or use it as a map of your own with terrain=file "
            f"{as_override('terrain.path', file)}"
        )
    return file


def _is_whole(cached: Path) -> bool:
    return cached.is_file() and _digest(cached) == SHA256


def _digest(file: Path) -> str:
    return hashlib.sha256(_content(file)).hexdigest()


def _content(file: Path) -> bytes:
    try:
        return read_regular(file, MAX_BYTES)
    except OSError as error:
        raise UsageError(
            f"{harmless(file)} cannot be read: {error.strerror}; make it readable"
        ) from error


def _download(patience: float) -> bytes:
    """Return the grid's bytes, whole and checked, or raise a `RunError` when patience ends.

    In a thread, because neither the look-up of a host's name nor a server that sends a byte now and
    then ends by a socket's time-out; outside the cache, because an abandoned thread may leave half
    a file behind.
    """
    import pooch

    # Its notes on every download would cut into a progress display.
    pooch.get_logger().setLevel("WARNING")
    received: list[bytes] = []
    failed: list[Exception] = []

    def retrieve() -> None:
        try:
            with tempfile.TemporaryDirectory(prefix="infoplan-") as folder:
                file = pooch.retrieve(
                    URL,
                    known_hash=f"sha256:{SHA256}",
                    fname=FILE,
                    path=folder,
                    downloader=pooch.HTTPDownloader(timeout=patience),
                )
                received.append(Path(file).read_bytes())
        except Exception as error:  # any failure means: no file; told in the caller's thread
            failed.append(error)

    thread = threading.Thread(target=retrieve, name="infoplan-download", daemon=True)
    thread.start()
    thread.join(patience)
    if received:
        return received[0]
    reason = _reason(failed[0]) if failed else f"it did not arrive within {patience:g} s"
    raise RunError(f"{FILE} cannot be downloaded from {URL}: {reason}")


def _reason(error: Exception) -> str:
    """Say in a few words why a download failed; the libraries say it in several lines."""
    import requests

    if isinstance(error, requests.Timeout):
        return "the server is silent"
    if isinstance(error, requests.HTTPError) and error.response is not None:
        return f"the server answers {error.response.status_code}"
    if isinstance(error, requests.RequestException):
        return "the connection fails"
    if isinstance(error, ValueError):
        return "what arrives has another SHA-256"
    return str(error)
