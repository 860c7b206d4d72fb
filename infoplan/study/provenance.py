"""Where numbers come from: versions, machine and command, for the footers of the tables."""

import os
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

LIBRARIES = (
    "infoplan",
    "numpy",
    "scipy",
    "scikit-learn",
    "pyod",
    "numba",
    "llvmlite",
    "pandas",
    "pyarrow",
    "joblib",
    "hydra-core",
    "omegaconf",
)


def provenance() -> dict[str, Any]:
    """Describe this process: versions of Python and the libraries, BLAS, processor, system."""
    # The threads of a BLAS are those of the moment; the rest stays.
    return _fixed() | {"blas": blas_libraries()}


@cache
def _fixed() -> dict[str, Any]:
    return {
        "python": platform.python_version(),
        "libraries": {name: _version(name) for name in LIBRARIES},
        "cpu": cpu_model(),
        "platform": platform.platform(),
    }


def blas_libraries() -> list[dict[str, Any]]:
    """BLAS libraries loaded in this process: name, version, architecture and threads."""
    import scipy.linalg  # noqa: F401 - loads the BLAS that is described
    from threadpoolctl import threadpool_info

    keys = ("internal_api", "version", "architecture", "num_threads")
    found = [info for info in threadpool_info() if info.get("user_api") == "blas"]
    described = [{key: info.get(key) for key in keys} for info in found]
    return sorted(described, key=lambda info: str(info["version"]))


def cpu_model() -> str:
    """Model name of the processor, as far as the system tells."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


@cache
def git_state() -> dict[str, Any] | None:
    """Commit and dirty flag of the repository this code runs from; None where there is none."""
    folder = Path(__file__).parent

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "LC_ALL": "C"},
        ).stdout.strip()

    try:
        # An installed copy may lie inside somebody else's repository: its commit says nothing.
        if git("ls-files", "--error-unmatch", __file__):
            return {"commit": git("rev-parse", "HEAD"), "dirty": bool(git("status", "--porcelain"))}
    except (OSError, subprocess.CalledProcessError):
        pass
    return None


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
