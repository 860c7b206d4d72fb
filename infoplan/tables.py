"""The tables of a mission: what each column is, and the sizes within which files are read.

Columns and tables are added, never moved or given another meaning: older results stay readable.
What `FIRST` wrote is in every file; a column of later may be missing, and reads as null; a table
of later may be missing; a column of a version to come is read as it is. Curves and refits have
besides a column for each hyperparameter of the kernel that has none here, under the name that the
kernel gives it, in scaled units.
"""

import math
from dataclasses import dataclass

import pyarrow as pa

FIRST = "0.1.0"
"""The version that wrote the first results."""

SCHEMA_VERSION = 1
"""Raised by hand when a column goes or changes its meaning; a column more needs none."""

KINDS = {
    "text": pa.string(),
    "integer": pa.int64(),
    "double": pa.float64(),
    "boolean": pa.bool_(),
}
"""Kinds of columns, and the type that each is written with."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    name
        In the file.
    kind
        A key of `KINDS`.
    doc
        What a value is, for a person.
    unit
        Of the values, empty where they have none.
    at_least, at_most
        Bounds of a possible value.
    told_by
        Group of methods (``model``, ``detector``) that tells it: where that method is the user's
        own, it may be NaN.
    gaps
        Whether any value may be missing, null or NaN.
    since
        The version that wrote it first.
    of_truth
        Whether it needs the truth: of a survey, whose truth nobody knows, all is null or NaN.
    """

    name: str
    kind: str
    doc: str
    unit: str = ""
    at_least: float = -math.inf
    at_most: float = math.inf
    told_by: str = ""
    gaps: bool = False
    since: str = FIRST
    of_truth: bool = False

    @property
    def may_be_missing(self) -> bool:
        """Whether there are files without it."""
        return self.since != FIRST

    @property
    def nullable(self) -> bool:
        """Whether a value may be null."""
        return self.gaps or self.may_be_missing

    @property
    def field(self) -> pa.Field:
        """Arrow's field, which tells what the column is wherever the file goes."""
        told = {"doc": self.doc, "unit": self.unit}
        return pa.field(self.name, KINDS[self.kind], metadata={k: v for k, v in told.items() if v})


@dataclass(frozen=True)
class Table:
    """A table of a mission.

    Attributes
    ----------
    doc
        What a row is, for a person.
    columns
        By name, in order.
    since
        The version that wrote it first.
    derived
        Whether it is computed later, from the mission's other tables: it is no part of what makes
        the mission whole, and is computed again where it is damaged or of an earlier flight.
    """

    doc: str
    columns: dict[str, Column]
    since: str = FIRST
    derived: bool = False

    @property
    def may_be_missing(self) -> bool:
        """Whether there are missions without it."""
        return self.since != FIRST

    def in_unit(self, unit: str) -> list[str]:
        """Names of the columns in a unit."""
        return [column.name for column in self.columns.values() if column.unit == unit]


def _table(doc: str, *columns: Column, since: str = FIRST, derived: bool = False) -> Table:
    return Table(doc, {column.name: column for column in columns}, since, derived)


ELEVATION = "the terrain's unit"
LENGTH = "workspace units"
SCALED = "scaled units"
SECONDS = "s"

TABLES: dict[str, Table] = {
    "curves": _table(
        "a decision epoch",
        Column("planner", "text", "the planner"),
        Column("detector", "text", "the detector"),
        Column("scope", "text", "what it judges: batch or historical"),
        Column("rho", "double", "share of a batch that becomes outliers", at_least=0, at_most=1),
        Column("terrain", "text", "the map"),
        Column("seed", "integer", "seed of the mission", at_least=0),
        Column("epoch", "integer", "decision epoch; 0: after the pilot", at_least=0),
        Column("collected", "integer", "samples so far, the pilot's included", at_least=1),
        Column("accepted", "integer", "samples in the model", at_least=0),
        Column(
            "rmse",
            "double",
            "root mean square error of the latent mean on the query grid",
            ELEVATION,
            at_least=0,
            of_truth=True,
        ),
        Column("mae", "double", "mean absolute error likewise", ELEVATION, at_least=0,
               of_truth=True),
        Column("nlpd", "double", "mean negative log density of the truth, latent mean and std",
               of_truth=True),
        Column(
            "coverage95",
            "double",
            "share of the nodes whose truth lies in the central 95 % interval",
            at_least=0,
            at_most=1,
            of_truth=True,
        ),
        Column("tp", "integer", "outliers flagged, of the samples judged", at_least=0,
               of_truth=True),
        Column("fp", "integer", "others flagged", at_least=0, of_truth=True),
        Column("fn", "integer", "outliers kept", at_least=0, of_truth=True),
        Column("tn", "integer", "others kept", at_least=0, of_truth=True),
        Column("amplitude", "double", "of the kernel", SCALED, told_by="model"),
        Column("lengthscale_1", "double", "of the kernel along x1", SCALED, told_by="model",
               gaps=True),
        Column("lengthscale_2", "double", "of the kernel along x2", SCALED, told_by="model",
               gaps=True),
        Column("noise_std", "double", "deviation of the learned noise", SCALED, told_by="model"),
        Column("jitter", "double", "added to the covariance's diagonal", SCALED, told_by="model"),
        Column("lml", "double", "log marginal likelihood of the data", told_by="model"),
        Column("plan_seconds", "double", "time of planning", SECONDS, at_least=0),
        Column("fit_seconds", "double", "time of learning", SECONDS, at_least=0),
        Column("predict_seconds", "double", "time of predicting the query grid", SECONDS,
               at_least=0),
        Column("detect_seconds", "double", "time of judging samples", SECONDS, at_least=0),
        Column("crps", "double", "mean continuous ranked probability score of the truth, latent "
               "mean and std", ELEVATION, at_least=0, since="0.2.0", of_truth=True),
        Column("smse", "double", "mean square error over the variance of the truth; flat: NaN",
               at_least=0, gaps=True, since="0.2.0", of_truth=True),
        Column("msll", "double", "nlpd less that of the mean and variance of the samples in the "
               "model; all equal: NaN", gaps=True, since="0.2.0", of_truth=True),
        Column("rmse_flat", "double", "rmse in the third of the nodes with the least local relief",
               ELEVATION, at_least=0, since="0.2.0", of_truth=True),
        Column("rmse_middle", "double", "likewise in the middle third", ELEVATION, at_least=0,
               since="0.2.0", of_truth=True),
        Column("rmse_rugged", "double", "likewise in the third with the most", ELEVATION,
               at_least=0, since="0.2.0", of_truth=True),
        Column("path_length", "double", "way from sample to sample so far, the pilot's included",
               LENGTH, at_least=0, since="0.2.0"),
        Column(
            "collapsed",
            "boolean",
            "whether the smaller lengthscale is below the distance of two samples; none: null",
            gaps=True,
            since="0.2.0",
        ),
        Column(
            "rate_limited",
            "boolean",
            "whether an iteration of the epoch moved a hyperparameter's logarithm by half of "
            "Adam's learning rate or more, on average; of L-BFGS, restarts or no iteration, and of "
            "models but gp, student_t and vecchia: null",
            gaps=True,
            since="0.2.0",
        ),
    ),
    "samples": _table(
        "a sample, in order of collection",
        Column("seed", "integer", "seed of the mission", at_least=0),
        Column("epoch", "integer", "decision epoch that collected it; 0: the pilot", at_least=0),
        Column("x1", "double", "position", LENGTH),
        Column("x2", "double", "position", LENGTH),
        Column("heading", "double", "after the turn", "rad", at_least=0, at_most=2 * math.pi),
        Column("truth", "double", "elevation", ELEVATION, of_truth=True),
        Column("measured", "double", "what the sensor said; nothing: NaN", ELEVATION),
        Column("score", "double", "the detector's last; none: NaN", told_by="detector", gaps=True),
        Column("is_outlier", "boolean", "whether it was corrupted", of_truth=True),
        Column("flagged", "boolean", "whether the detector calls it an outlier, at the end"),
        Column("used", "boolean", "whether it is in the model, at the end"),
    ),
    "maps": _table(
        "a node of the query grid, row-major, at the end",
        Column("seed", "integer", "seed of the mission", at_least=0),
        Column("x1", "double", "position", LENGTH),
        Column("x2", "double", "position", LENGTH),
        Column("truth", "double", "elevation", ELEVATION, of_truth=True),
        Column("mean", "double", "latent mean", ELEVATION),
        Column("std", "double", "latent standard deviation", ELEVATION, at_least=0),
        Column("outlier_density", "double", "smoothed count of flagged samples", at_least=0),
    ),
    "stretches": _table(
        "of a survey, a stretch of the track after an epoch, predicted without its samples",
        Column("seed", "integer", "seed of the mission", at_least=0),
        Column("epoch", "integer", "epoch", at_least=0),
        Column("stretch", "integer", "which, counted from 0 along the track", at_least=0),
        Column("samples", "integer", "samples of it in the model", at_least=0),
        Column("rmse", "double", "root mean square error at them, predicted from those in the "
               "model of the other stretches", ELEVATION, at_least=0, gaps=True),
        Column("rmse_unfiltered", "double", "likewise, from those that were flagged, too",
               ELEVATION, at_least=0, gaps=True),
        Column("loo_rmse", "double", "likewise, each from all others in the model", ELEVATION,
               at_least=0, gaps=True),
        since="0.2.0",
    ),
    "origins": _table(
        "of a survey of several logs, a sample, in order of collection",
        Column("seed", "integer", "seed of the mission", at_least=0),
        Column("log", "text", "the log that it comes from"),
        Column("row", "integer", "its row there, counted from 0 without the header", at_least=0),
        Column("flagged_first", "boolean", "whether it was flagged when its log was the last"),
        Column("verdict", "text", "what the later logs say of that: confirmed, cleared or "
               "untested; else null", gaps=True),
        since="0.2.0",
    ),
    "refits": _table(
        "a refit: hyperparameters at the likelihood's optimum on some of the mission's samples, as "
        "`infoplan explain` computes them",
        Column("seed", "integer", "seed of the mission", at_least=0),
        Column("data", "text", "which samples: used, without_spikes (those used less the outliers "
               "among them), with_lost (those used and the others that were flagged), clean (all "
               "but the outliers)"),
        Column("accepted", "integer", "how many they are", at_least=0),
        Column("rmse", "double", "as of the curves", ELEVATION, at_least=0, of_truth=True),
        Column("lml", "double", "log marginal likelihood of the samples"),
        Column("gain", "double", "by how much what the model maximises is above its value under "
               "the mission's last hyperparameters, nats"),
        Column("slope", "double", "largest derivative by a logarithm there, nats", at_least=0),
        Column("converged", "boolean", "whether that is at most 0.1"),
        Column("agreeing", "integer", "starts that led there", at_least=1),
        Column("starts", "integer", "of how many", at_least=1),
        Column("amplitude", "double", "of the kernel", SCALED),
        Column("lengthscale_1", "double", "of the kernel along x1", SCALED, gaps=True),
        Column("lengthscale_2", "double", "of the kernel along x2", SCALED, gaps=True),
        Column("noise_std", "double", "deviation of the noise", SCALED),
        since="0.2.0",
        derived=True,
    ),
}  # fmt: skip
"""Tables and columns, in order."""

DURATIONS = TABLES["curves"].in_unit(SECONDS)
"""Columns of the curve that tell how long a part of an epoch took."""

MAX_ROWS = 1 << 24
"""Rows that a table has at most: more could not be modelled."""

MAX_COLUMNS = 64
"""Columns that a table has at most."""

MAX_BYTES = 1 << 30
"""Size of a table's file, at most."""

MAX_DOCUMENT = 1 << 18
"""Size of a footer or of a run's YAML, at most."""

MAX_SEED_DIGITS = 18
"""Digits of a seed in a file's name, at most: it fits into 64 bits."""
