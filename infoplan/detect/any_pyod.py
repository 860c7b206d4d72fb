"""Any detector of PyOD, by the name of its class."""

import importlib
import importlib.util
import inspect
import pkgutil
import re
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoplan.backend import load_matplotlib
from infoplan.detect.evidence import Evidence, Judgement
from infoplan.errors import UsageError
from infoplan.wording import suggest

SET_ELSEWHERE = {
    "contamination": "set detector.contamination",
    "random_state": "it follows from the mission's seed",
}
"""Parameters of PyOD's classes that are not for detector.params."""

_global_generator = threading.Lock()


def pyod(
    samples: Evidence,
    process: Any,
    rng: np.random.Generator,
    *,
    model: str = "ECOD",
    features: Sequence[str] = ("y",),
    contamination: float = 0.1,
    params: Mapping[str, Any] | None = None,
) -> Judgement:
    """Fit a detector of PyOD on all samples collected so far, and take its labels and scores.

    Parameters
    ----------
    samples
        What it is fitted on, and judges.
    process
        The mission's model, as for any detector; unused.
    rng
        Seeds the class' ``random_state``, and NumPy's global generator while it works, for those
        that draw from that.
    model
        The class, like ``ECOD``, ``IForest`` or ``LOF``.
    features
        What it sees, of ``x1``, ``x2`` and ``y``; see `feature_matrix`.
    contamination
        Share of the data above the threshold, in (0, 0.5].
    params
        Further parameters of the class.

    Returns
    -------
    flagged : ndarray of bool, shape (n,)
    score : ndarray, shape (n,)
        Higher for outliers.
    """
    seed = int(rng.integers(2**31 - 1))
    detector = build(model, contamination, params or {}, seed)
    with _global_generator_seeded(seed):
        detector.fit(feature_matrix(samples, features))
    return detector.labels_ == 1, np.asarray(detector.decision_scores_, dtype=np.float64)


def feature_matrix(samples: Evidence, features: Sequence[str]) -> NDArray[np.float64]:
    """Gather features, each shifted and scaled to zero mean and unit standard deviation.

    Parameters
    ----------
    samples
        The samples, whose mean and (population) standard deviation count.
    features
        Names out of ``x1``, ``x2``, ``y``.

    Returns
    -------
    ndarray, shape (n, len(features))
        A feature that is constant is zero.
    """
    columns = {"x1": samples.x[:, 0], "x2": samples.x[:, 1], "y": samples.measured}
    chosen = np.column_stack([columns[name] for name in features])
    centred = chosen - chosen.mean(axis=0)
    deviation = centred.std(axis=0)
    varies = deviation > np.finfo(float).eps * np.abs(chosen).max(axis=0)
    return np.where(varies, centred, 0.0) / np.where(varies, deviation, 1.0)


def build(name: str, contamination: float, params: Mapping[str, Any], seed: int) -> Any:
    """Construct a detector of PyOD.

    Parameters
    ----------
    name
        Its class.
    contamination
        Share of the data above the threshold.
    params
        Further parameters.
    seed
        The ``random_state``, where the class takes one.

    Returns
    -------
    pyod.models.base.BaseDetector

    Raises
    ------
    UsageError
        If PyOD has no such detector, it needs a package that is missing, or does not take these
        parameters.
    """
    modules = _modules()
    if name not in modules:
        # Most mistakes are of upper and lower case.
        spelled = {known.lower(): known for known in modules}.get(name.lower(), name)
        raise UsageError(
            f"detector.model={name} is no detector of PyOD{suggest(spelled, modules)}: "
            f"use one of {', '.join(sorted(modules))}"
        )
    load_matplotlib()  # as PyOD does
    try:
        kind = getattr(importlib.import_module(f"pyod.models.{modules[name]}"), name)
    except ImportError as error:
        raise UsageError(
            f"detector.model={name} cannot be imported ({error}): install what it needs, "
            "or use another model"
        ) from error
    known = inspect.signature(kind).parameters
    for key in params:
        if key in SET_ELSEWHERE:
            raise UsageError(f"detector.params.{key} is not to be given: {SET_ELSEWHERE[key]}")
        if key not in known:
            raise UsageError(
                f"PyOD's {name} has no parameter {key!r}{suggest(str(key), known)}: "
                f"detector.params takes {', '.join(k for k in known if k not in SET_ELSEWHERE)}"
            )
    arguments = {"contamination": contamination, "random_state": seed}
    arguments = {key: value for key, value in arguments.items() if key in known}
    try:
        return kind(**arguments, **params)
    except Exception as error:  # whatever a class of PyOD's has against its parameters
        raise UsageError(
            f"PyOD's {name} refuses detector.params={dict(params)} "
            f"({type(error).__name__}: {' '.join(str(error).split())}): give it what it takes"
        ) from error


@cache
def _modules() -> dict[str, str]:
    """Map the classes of PyOD to their modules, by reading: importing all takes long, or fails."""
    spec = importlib.util.find_spec("pyod.models")
    folders = list(spec.submodule_search_locations or []) if spec else []
    classes = re.compile(r"^class ([A-Za-z]\w*)\(Base(?:DeepLearning)?Detector\)", re.MULTILINE)
    found: dict[str, str] = {}
    for item in pkgutil.iter_modules(folders):
        text = Path(folders[0], f"{item.name}.py").read_text(encoding="utf-8")
        for name in classes.findall(text):
            # The first of two modules that share a name: the other is an alternative.
            if not name.startswith("Base"):
                found.setdefault(name, item.name)
    return found


@contextmanager
def _global_generator_seeded(seed: int) -> Iterator[None]:
    """Give NumPy's global generator a seed for a while, to one thread at a time."""
    with _global_generator:
        state = np.random.get_state()  # noqa: NPY002 - what scikit-learn falls back on
        np.random.seed(seed)  # noqa: NPY002
        try:
            yield
        finally:
            np.random.set_state(state)  # noqa: NPY002
