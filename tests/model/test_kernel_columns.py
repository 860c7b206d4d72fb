"""A kernel of other hyperparameters than the built-in one's: mission, store, load, audit."""

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace

import numba
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from flown import short_mission, store
from sklearn.gaussian_process.kernels import RationalQuadratic

from infoplan.analyse import load_curves
from infoplan.analyse.audit import audit
from infoplan.config import GpConfig
from infoplan.draw.recording import from_tables, read_recording
from infoplan.errors import UsageError
from infoplan.model import Hyperparameter, Kernel
from infoplan.study.columns import values_digest
from infoplan.study.store import inspect, sealed, table_path


@numba.njit
def correlation(constants, a1, a2, b1, b2):
    return (1.0 + constants[0] * ((a1 - b1) ** 2 + (a2 - b2) ** 2) / constants[1]) ** -constants[1]


@numba.njit
def gradient(weight, constants, a1, a2, b1, b2):
    shape = constants[1]
    base = 1.0 + constants[0] * ((a1 - b1) ** 2 + (a2 - b2) ** 2) / shape
    c = weight * base**-shape
    part = shape * (base - 1.0) / base
    return c, 2.0 * c * part, c * (part - shape * math.log(base))


RATIONAL = Kernel(
    hyperparameters=(Hyperparameter("lengthscale"), Hyperparameter("shape", start=2.0)),
    constants=lambda theta: (0.5 * math.exp(-2.0 * theta[0]), math.exp(theta[1])),
    correlation=correlation,
    gradient=gradient,
    reference=lambda h: RationalQuadratic(h["lengthscale"], h["shape"], "fixed", "fixed"),
)


@pytest.fixture
def rational(monkeypatch) -> str:
    """A choice of `model.kernel` for the time of a test."""
    name = "rational_of_a_test"
    module = SimpleNamespace(KERNEL=RATIONAL)
    monkeypatch.setitem(sys.modules, f"infoplan.model.kernels.{name}", module)
    declared = GpConfig.__dataclass_fields__["kernel"]
    choices = {**declared.metadata, "choices": (*declared.metadata["choices"], name)}
    monkeypatch.setattr(declared, "metadata", MappingProxyType(choices))
    return name


@pytest.fixture
def flown(tmp_path, volcano, rational) -> tuple[Path, str]:
    config = short_mission("uct", "none", budget=130)
    return tmp_path, store(
        tmp_path, replace(config, model=replace(config.model, kernel=rational)), volcano
    )


def spoil(path: Path, column: str, value: float) -> None:
    """Change the last value of a column, and its digests with it."""
    table = pq.read_table(path, partitioning=None)
    values = [*table[column].to_pylist()[:-1], value]
    changed = table.set_column(table.column_names.index(column), column, pa.array(values))
    footer = json.loads(table.schema.metadata[b"infoplan"])
    footer["values_sha256"] = values_digest(changed)
    pq.write_table(changed.replace_schema_metadata({b"infoplan": sealed(footer)}), path)


def failed(folder: Path) -> set[str]:
    return {finding.check for finding in audit(folder) if not finding.holds}


def test_its_hyperparameters_are_columns_that_the_audit_checks(flown, volcano):
    folder, run = flown
    assert inspect(folder, run, 0).state == "done"
    curves = load_curves(folder)
    assert (curves[["amplitude", "lengthscale", "shape", "noise_std"]] > 0).all(axis=None)
    assert curves["shape"].nunique() == len(curves)
    assert curves[["lengthscale_1", "lengthscale_2"]].isna().all(axis=None)
    assert failed(folder) == set()
    rows = [state.row for state in from_tables(read_recording(folder, run, 0))]
    assert [row.amplitude for row in rows] == curves["amplitude"].tolist()

    store(folder, short_mission("uct", "none", budget=130), volcano)
    both = load_curves(folder, model=None)
    assert both["shape"].isna().sum() == len(both) - len(curves)
    assert set(both.loc[both["shape"].notna(), "run"]) == {run}


@pytest.mark.parametrize(
    ("column", "value", "checks"),
    [("shape", -1.0, {"hyperparameters"}), ("shape", np.inf, {"hyperparameters"}),
     ("shape", 9.0, {"final model"}), ("lengthscale", None, {"hyperparameters"})],
)  # fmt: skip
def test_the_audit_sees_another_value(flown, column, value, checks):
    folder, run = flown
    spoil(table_path(folder, "curves", run, 0), column, value)
    assert checks <= failed(folder)


@pytest.mark.parametrize("name", ["rmse", "run", "jitter", "shape"])
def test_a_hyperparameter_has_no_other_columns_name(name):
    with pytest.raises(UsageError, match=f"'{name}' cannot have that name"):
        replace(RATIONAL, hyperparameters=(Hyperparameter("shape"), Hyperparameter(name)))
