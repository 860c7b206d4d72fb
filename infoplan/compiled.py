"""Compiled functions, kept between processes for as long as the sources of all of them stay."""

import hashlib
import multiprocessing
import os
import pickle
import shutil
import sys
import uuid
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import numba
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from infoplan.caches import kernel_note, kernel_places

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent

SOURCES = (
    "compiled.py",
    "model/covariance.py",
    "model/exponential.py",
    "model/inference/conditionals.py",
    "model/inference/neighbours.py",
    "model/inference/pursuit.py",
    "model/kernel.py",
    *sorted(f"model/kernels/{file.name}" for file in (_PACKAGE / "model/kernels").glob("*.py")),
    "model/packed.py",
    "model/stationary.py",
    "plan/pareto.py",
    "plan/reward_maps.py",
    "plan/rig_tree.py",
    "plan/tree_search.py",
    "plan/waypoints.py",
    "robot.py",
    "walls.py",
)
"""All modules with kernels: a kernel holds the machine code of those that it calls."""

OLD_VERSIONS = 3
"""So many other states of the sources keep their kernels."""


def kernel(**options: Any) -> Callable[[Function], Function]:
    """Compile a function in Numba's nopython mode, once for all processes.

    Parameters
    ----------
    **options
        Of ``numba.njit``, but ``cache``: Numba's own cache looks at the file of the function
        alone, and would go on with old code of the functions that it calls.

    Returns
    -------
    callable
        Decorator.
    """

    def decorate(function: Function) -> Function:
        names = _names(function)
        if function.__closure__:
            # Numba tells closures apart by a count of the process, which the code of another may
            # have, too: one would then be called in place of the other.
            own_name = _sha256(names)[:16] if names else uuid.uuid4().hex
            function.__qualname__ += f"_{own_name}"
        compiled = numba.njit(**options)(function)
        is_compiled = hasattr(compiled, "py_func")  # not where Numba is switched off
        if is_compiled and names and (digest := _digest()):
            compiled._cache = _Kept(names, digest)
        return compiled

    return decorate


class _Kept(NullCache):
    """Machine code of a function in files, one for each signature and processor.

    A file that is damaged or cannot be read counts as missing, and one that cannot be written is
    not: the function is compiled then.
    """

    def __init__(self, names: list[str], digest: str) -> None:
        self._names, self._digest = names, digest

    @property
    def cache_path(self) -> str | None:
        """Where new code is kept."""
        writable = _places()[1]
        return None if writable is None else str(writable / self._digest)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return the code for a signature, None if there is none."""
        target.refresh()
        name = self._file_name(signature, target.codegen())
        for place in _places()[0]:
            with suppress(Exception):  # whatever damaged code gives
                content = (place / self._digest / name).read_bytes()
                checksum, code = content[:32], content[32:]
                if hashlib.sha256(code).digest() == checksum:
                    return CompileResult._rebuild(target, *pickle.loads(code))
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep the code for a signature."""
        if self.cache_path is None or compiled.library.has_dynamic_globals:
            return
        folder = Path(self.cache_path)
        code = dumps(compiled._reduce())
        path = folder / self._file_name(signature, compiled.codegen)
        written = path.with_name(f"{uuid.uuid4().hex}.tmp")
        with suppress(OSError):
            if not folder.is_dir():
                folder.mkdir(parents=True, exist_ok=True)
                _forget_old(folder)
            try:
                written.write_bytes(hashlib.sha256(code).digest() + code)
                os.replace(written, path)
            finally:
                written.unlink(missing_ok=True)

    def _file_name(self, signature: Any, codegen: Any) -> str:
        key = (signature, codegen.magic_tuple(), self._names[1:])
        return f"{self._names[0]}-{_sha256(key)[:32]}.bin"


def _sha256(value: Any) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()


def _is_ours(function: Callable[..., Any]) -> bool:
    return function.__module__.partition(".")[0] == __name__.partition(".")[0]


def _names(function: Callable[..., Any]) -> list[str]:
    """Name a function, then the values that it closes over; empty if they are not to be known.

    Not to be known are compiled functions of other packages, however deep: an edit of theirs
    would go unnoticed.
    """
    names = [f"{function.__module__}.{function.__qualname__}"]
    for cell in function.__closure__ or ():
        inner = getattr(cell.cell_contents, "py_func", None)
        if inner is None:
            names.append(repr(cell.cell_contents))
        elif _is_ours(inner) and (inner_names := _names(inner)):
            names += inner_names
        else:
            return []
    return names


@cache
def _places() -> tuple[list[Path], Path | None]:
    """Where code is kept, looked for once a process; a note, but not from every worker."""
    if multiprocessing.parent_process() is None and (note := kernel_note()):
        warnings.warn(note, stacklevel=2)
    return kernel_places()


def _digest() -> str | None:
    """SHA-256 of what the machine code follows from; None if that cannot be read."""
    digest = hashlib.sha256()
    versions = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__)
    digest.update(repr(versions).encode())
    for source in SOURCES:
        try:
            content = (_PACKAGE / source).read_bytes()
        except OSError:
            return None
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()


def _forget_old(current: Path) -> None:
    """Remove the code of all but the latest other states of the sources."""
    others = [
        folder for folder in current.parent.iterdir()
        if folder != current and len(folder.name) == len(current.name) and folder.is_dir()
    ]  # fmt: skip
    others.sort(key=lambda folder: folder.stat().st_mtime)
    for folder in others[:-OLD_VERSIONS]:
        shutil.rmtree(folder, ignore_errors=True)
