"""Every option of infoplan: its name, type, default, bounds and unit, defined once.

The dataclasses below are the schemas of the Hydra configuration in ``infoplan.conf`` and the plain
records that the rest of the code reads. `MissionConfig` is the science: what decides a mission's
numbers. `Config` adds what does not: seeds, workers, paths.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from infoplan.errors import UsageError
from infoplan.extent import MAX_COORDINATE, checked_extent
from infoplan.options import check_options, option, plain_number


@dataclass
class TerrainConfig:
    """The ground truth and its workspace; the built-in maps have no further options."""

    name: str = option("volcano", "which map", choices=("volcano", "jacksboro"))
    extent: list[float] = option(
        [0.0, 50.0, 0.0, 50.0], "xmin, xmax, ymin, ymax", unit="workspace units", length=4
    )
    unit: str | None = option(
        None, "unit of the elevations; m, ft and us-ft are converted; null: the map's own"
    )
    orientation: int = option(
        0,
        "quarter turns counter-clockwise; from 4 on mirrored first",
        at_least=0,
        at_most=7,
    )
    obstacles: list[list[list[float]]] = option(
        [],
        "no-go zones: polygons, each a list of its vertices [x,y], which no track touches",
        unit="workspace units",
        at_least=-MAX_COORDINATE,
        at_most=MAX_COORDINATE,
    )
    obstacles_mask: str | None = option(
        None,
        "a map, any that terrain.path takes, spread over the workspace; what it marks, not 0, is "
        "no-go, too; stored as terrain.obstacles",
        science=False,
    )


@dataclass
class HelensConfig(TerrainConfig):
    """The paper's grid of Mount St. Helens."""

    name: str = option("helens", "which map", choices=("helens",))
    path: str | None = option(None, "the grid's file, or a folder that holds it", science=False)
    on_missing: str = option(
        "fallback",
        "where helens can be had nowhere: go on with volcano, or stop",
        choices=("fallback", "error"),
        science=False,
    )


@dataclass
class FileConfig(TerrainConfig):
    """A map in a file; what is done to it, in this order: nodata, shape, crop."""

    name: str = option("file", "which map", choices=("file",))
    path: str | None = option(
        None,
        "the map: .npy, .npz, .csv, .tsv, .txt, .tif, .dem, .hgt, .asc, or a .zip archive of one",
        science=False,
    )
    member: str | None = option(
        None, "the map's name in a .zip archive; null: the only one", science=False
    )
    array: str | None = option(None, "the array's name in a .npz file; null: the only one")
    nodata: Any = option(  # a union would be right, but OmegaConf 2.3 cannot merge one
        "refuse",
        "missing elevations: refuse the map, or fill each from the nearest node; a number marks "
        "those that have it as missing and fills all",
        choices=("refuse", "fill"),
    )
    shape: list[int] | None = option(
        None,
        "rows and columns to resample to, anti-aliased; null: as in the file",
        at_least=2,
        length=2,
    )
    crop: list[int] | None = option(
        None,
        "first row, end row, first column, end column to keep, of the resampled map; row 0 is the "
        "south; from the end if negative; null: all",
        length=4,
    )

    def __post_init__(self) -> None:
        """Make one spelling of a number, -9999 and -9999.0: a run's name depends on it."""
        if isinstance(self.nodata, int) and not isinstance(self.nodata, bool):
            self.nodata = float(self.nodata)


@dataclass
class RandomFieldConfig(TerrainConfig):
    """Gaussian random field with a Gaussian kernel."""

    name: str = option("random_field", "which map", choices=("random_field",))
    seed: int = option(0, "which field of those with these options", at_least=0)
    shape: list[int] = option([100, 100], "rows and columns", at_least=2, length=2)
    lengthscale: list[float] = option(
        [6.0, 6.0],
        "lengthscales along x and y",
        unit="workspace units",
        above=0,
        at_most=1e100,
        length=2,
    )
    amplitude: float = option(300.0, "standard deviation", unit="the terrain's unit", above=0)
    mean: float = option(1000.0, "mean", unit="the terrain's unit")


@dataclass
class OwnTerrainConfig(TerrainConfig):
    """What a function of the user's own returns."""

    name: str = option("own", "which map", choices=("own",))
    function: str | None = option(
        None, "module.function that returns the elevations, or elevations and their unit"
    )
    options: dict[str, Any] = option({}, "the function's keyword-only parameters")


@dataclass
class SurveyedConfig(TerrainConfig):
    """Where a survey was made, of which its log alone is known; nothing can be flown there."""

    name: str = option("survey", "which place", choices=("survey",))
    crs: str | None = option(
        None, "coordinate reference system of the positions; null: a plane of the log's own"
    )
    origin: list[float] = option(
        [0.0, 0.0], "easting and northing where the workspace begins", unit="m", length=2
    )
    columns: dict[str, str] = option({}, "columns of the log by what they were taken for")
    batch: str | None = option(
        None, "how much is judged at a time: samples, or seconds as in 30s; null: all at once"
    )


TERRAIN_SCHEMAS: dict[str, type[TerrainConfig]] = {
    "helens": HelensConfig,
    "volcano": TerrainConfig,
    "jacksboro": TerrainConfig,
    "file": FileConfig,
    "random_field": RandomFieldConfig,
    "own": OwnTerrainConfig,
}
"""Options of each terrain."""

STORED_TERRAINS: dict[str, type[TerrainConfig]] = {**TERRAIN_SCHEMAS, "survey": SurveyedConfig}
"""Options of all that runs are stored of, among them what cannot be chosen."""


def terrain_kind(name: str) -> str:
    """Kind of a terrain, a key of `STORED_TERRAINS`, from its name, as in ``file-hills``."""
    return name.partition("-")[0]


def is_survey(terrain: str) -> bool:
    """Tell by the name of a terrain whether it is a survey, whose truth nobody knows."""
    return terrain_kind(terrain) == "survey"


@dataclass
class PlannerConfig:
    """What all planners have."""

    name: str = option("", "planner")
    execute_actions: int | None = option(
        None, "drive only the first actions of a plan; null: all", at_least=1
    )
    smoothing: float = option(
        2.0,
        "standard deviation of the Gaussian that smooths the outlier matrix",
        unit="workspace units",
        at_least=0,
        at_most=1e12,
    )


OF_COVARIANCE = ("mutual_information", "variance_reduction")
"""Rewards for which the model must tell how its predictions go together."""

REWARDS = ("std", *OF_COVARIANCE, "ucb")
"""What a planner may gather along its track."""


@dataclass
class GatheringConfig(PlannerConfig):
    """What all planners have that add up a reward along the track."""

    reward: str = option(
        "std",
        "of a sample: the deviation there, what it says about all other nodes, by how much it "
        "lowers their variances, or mean plus kappa deviations",
        choices=REWARDS,
    )
    kappa: float = option(
        2.0, "weight of the deviation in the reward ucb", at_least=0, at_most=1e12
    )


@dataclass
class TreeSearchConfig(GatheringConfig):
    """Tree search over the robot's actions."""

    name: str = option("puct", "tree policy", choices=("uct", "puct"))
    iterations: int = option(500, "tree search iterations a decision", at_least=1, at_most=10**9)
    rollouts: int = option(5, "straight steps of a rollout", at_least=0, at_most=10**6)
    rollout_step: str = option(
        "action", "length of such a step: an action, or to the next sample",
        choices=("action", "sample"),
    )  # fmt: skip
    exploration: float = option(
        0.3,
        "C of the (Pareto) UCB, times the largest mean among the children",
        at_least=0,
        at_most=1e12,
    )
    average: str = option(
        "driven",
        "what the reward of a rollout that meets the border is divided by: the actions driven "
        "before it, or all that were planned",
        choices=("driven", "planned"),
    )
    border: str = option(
        "struck",
        "an action over the border is struck from the tree at no cost, or for a visit, or leads "
        "to a terminal node without reward",
        choices=("struck", "visit", "terminal"),
    )
    noisy_std: bool = option(False, "reward includes the learned noise in the deviation")


@dataclass
class WeightedConfig(TreeSearchConfig):
    """Tree search with the upper confidence bound on a weighted sum of both rewards."""

    name: str = option("weighted", "planner", choices=("weighted",))
    weight: float = option(
        0.5, "share of the outlier density in the reward, the deviation has the rest",
        at_least=0, at_most=1,
    )  # fmt: skip


@dataclass
class RandomConfig(PlannerConfig):
    """Random walk of the car."""

    name: str = option("random", "planner", choices=("random",))
    actions: int = option(6, "actions of a plan", at_least=1, at_most=10**6)


@dataclass
class GreedyConfig(GatheringConfig):
    """The best next action, one after the other."""

    name: str = option("greedy", "planner", choices=("greedy",))
    actions: int = option(6, "actions of a plan", at_least=1, at_most=10**6)
    noisy_std: bool = option(False, "reward includes the learned noise in the deviation")


@dataclass
class BayesOptConfig(GatheringConfig):
    """Bayesian optimisation: drive to the node of the largest reward."""

    name: str = option("bayes_opt", "planner", choices=("bayes_opt",))
    reward: str = option(
        "ucb",
        "acquisition function: mean plus kappa deviations, or another worth of a node",
        choices=REWARDS,
    )
    actions: int = option(6, "most actions of a plan", at_least=1, at_most=10**6)
    distance_penalty: float = option(
        0.0,
        "taken from the reward for each workspace unit of the way",
        unit="units of the reward",
        at_least=0,
        at_most=1e100,
    )


@dataclass
class RigTreeConfig(GatheringConfig):
    """RIG-tree: a random tree of actions, of which the best branch is driven."""

    name: str = option("rig_tree", "planner", choices=("rig_tree",))
    samples: int = option(300, "random places that the tree grows to", at_least=1, at_most=10**6)
    actions: int = option(8, "budget of a branch, in actions", at_least=1, at_most=10**4)
    near: float = option(
        4.0, "nodes so far around a new one are extended to it, too", unit="workspace units",
        at_least=0, at_most=1e12,
    )  # fmt: skip
    prune: float = option(
        1.0, "nodes so far apart are of one place, of which the better stays",
        unit="workspace units", at_least=0, at_most=1e12,
    )  # fmt: skip
    noisy_std: bool = option(False, "reward includes the learned noise in the deviation")


@dataclass
class CmaesConfig(GatheringConfig):
    """CMA-ES: waypoints moved until the track past them gathers most."""

    name: str = option("cmaes", "planner", choices=("cmaes",))
    waypoints: int = option(4, "number of waypoints", at_least=1, at_most=100)
    actions: int = option(8, "most actions of a plan", at_least=1, at_most=10**4)
    spread: float = option(
        0.25, "first deviation of the waypoints, a share of the sides", above=0, at_most=1
    )
    evaluations: int = option(300, "tracks that are tried", at_least=1, at_most=10**6)
    noisy_std: bool = option(False, "reward includes the learned noise in the deviation")


@dataclass
class LawnmowerConfig(PlannerConfig):
    """Coverage in parallel tracks, whatever was measured."""

    name: str = option("lawnmower", "planner", choices=("lawnmower",))
    actions: int = option(6, "actions of a plan", at_least=1, at_most=10**6)
    spacing: float = option(5.0, "between tracks", unit="workspace units", above=0, at_most=1e12)
    lookahead: int = option(3, "actions that are looked ahead for each", at_least=1, at_most=5)


@dataclass
class OwnPlannerConfig(PlannerConfig):
    """A planner of the user's."""

    name: str = option("own", "planner", choices=("own",))
    function: str | None = option(
        None, "module.function; a module in the current directory is found"
    )
    options: dict[str, Any] = option({}, "its keyword-only parameters")
    noisy_std: bool = option(False, "deviation that it is given includes the learned noise")


@dataclass
class DetectorConfig:
    """What judges the samples."""

    name: str = option("none", "detector", choices=("none", "best"))
    scope: str = option(
        "batch", "judge the new batch, or re-judge all data", choices=("batch", "historical")
    )
    judge_pilot: bool = option(
        False, "judge the pilot samples, too, before the model learns from them"
    )


@dataclass
class CopodConfig(DetectorConfig):
    """COPOD on the measured elevation."""

    name: str = option("copod", "detector", choices=("copod",))
    contamination: float = option(0.1, "share of the data to flag", above=0, at_most=0.5)
    score: str = option(
        "pyod", "PyOD's score, or the paper's maximum of the tails", choices=("pyod", "paper")
    )


@dataclass
class PyodConfig(DetectorConfig):
    """Any detector of PyOD."""

    name: str = option("pyod", "detector", choices=("pyod",))
    model: str = option("ECOD", "class of PyOD: ECOD, IForest, LOF, KNN, HBOS ...")
    features: list[str] = option(
        ["y"], "what it sees, standardised: position and measurement", choices=("x1", "x2", "y")
    )
    contamination: float = option(0.1, "share of the data to flag", above=0, at_most=0.5)
    params: dict[str, Any] = option(
        {}, "further parameters of the class, as in detector.params.n_neighbors=5"
    )


@dataclass
class GpResidualConfig(DetectorConfig):
    """Leave-one-out residual of the Gaussian process."""

    name: str = option("gp_residual", "detector", choices=("gp_residual",))
    threshold: float = option(
        3.0, "largest residual kept", unit="standard deviations", above=0, at_most=1e12
    )
    one_by_one: bool = option(
        True, "drop the worst, look at the others without it, and so on; false: all at once"
    )


@dataclass
class LocalConfig(DetectorConfig):
    """Deviation from the nearest neighbours."""

    name: str = option("local", "detector", choices=("local",))
    neighbours: int = option(10, "nearest samples that one is compared with", at_least=2)
    threshold: float = option(
        3.5,
        "largest distance from their median kept",
        unit="their deviations",
        above=0,
        at_most=1e12,
    )


@dataclass
class HampelConfig(DetectorConfig):
    """Deviation from the running median along the track."""

    name: str = option("hampel", "detector", choices=("hampel",))
    reach: int = option(
        5, "samples before and after that one is compared with", at_least=1, at_most=10**6
    )
    threshold: float = option(
        3.0,
        "largest distance from their median kept",
        unit="their deviations",
        above=0,
        at_most=1e12,
    )


@dataclass
class QartodConfig(DetectorConfig):
    """Tests of oceanography's real-time data: gross range, spike, rate of change, flat line."""

    name: str = option("qartod", "detector", choices=("qartod",))
    gross_range: float | None = option(
        5.0,
        "largest distance from the median of all kept; null: not tested",
        unit="the measurements' deviations",
        above=0,
        at_most=1e12,
    )
    spike: float | None = option(
        8.0,
        "largest distance from the middle of both neighbours kept; null: not tested",
        unit="the usual distance",
        above=0,
        at_most=1e12,
    )
    rate: float | None = option(
        8.0,
        "largest step from the sample before kept; null: not tested",
        unit="the usual step",
        above=0,
        at_most=1e12,
    )
    flat: int | None = option(
        3,
        "samples that a value may last for; null: not tested",
        unit="samples",
        at_least=1,
        at_most=10**6,
    )
    tolerance: float = option(
        0.0, "by how much it may change meanwhile", unit="the terrain's unit", at_least=0,
        at_most=1e100,
    )  # fmt: skip


@dataclass
class OwnDetectorConfig(DetectorConfig):
    """A detector of the user's."""

    name: str = option("own", "detector", choices=("own",))
    function: str | None = option(
        None, "module.function; a module in the current directory is found"
    )
    options: dict[str, Any] = option({}, "its keyword-only parameters")


@dataclass
class ModelConfig:
    """What all models have."""

    name: str = option("", "model")
    pilot_iterations: int = option(
        500, "optimiser iterations on the pilot data", at_least=0, at_most=10**9
    )
    iterations: Any = option(  # a union would be right, but OmegaConf 2.3 cannot merge one
        5,
        "optimiser iterations an epoch, or as many as new samples",
        at_least=0,
        at_most=10**9,
        choices=("per_sample",),
    )


KERNELS = (
    "squared_exponential", "matern12", "matern32", "matern52", "rational_quadratic", "gibbs",
)  # fmt: skip
"""Modules of `infoplan.model.kernels`, each of which holds a kernel."""


@dataclass
class GuardedConfig(ModelConfig):
    """Guards against the collapse of a model, all of them off."""

    min_lengthscale: float = option(
        0.0,
        "floor of both lengthscales; 0: none",
        unit="distances of successive samples",
        at_least=0,
        at_most=1e3,
    )
    lengthscale_prior: list[float] | None = option(
        None,
        "median, and deviation of the logarithm, of a log-normal prior of the lengthscales",
        above=0,
        at_most=1e6,
        length=2,
    )
    noise_prior: list[float] | None = option(
        None, "likewise of the noise variance", above=0, at_most=1e6, length=2
    )
    restarts: int = option(
        0, "further starts of the optimiser in every epoch; the best end counts", at_least=0,
        at_most=1000,
    )  # fmt: skip


def _noise_start() -> Any:
    """Declare where an epoch's learning begins."""
    return option(
        "carried",
        "where the noise variance starts in every epoch: as learned so far, or at its start value",
        choices=("carried", "restarted"),
    )


def _optimizer_state() -> Any:
    """Declare what an epoch's learning knows of those before."""
    return option(
        "carried",
        "what the optimiser remembers of earlier epochs: moments or curvature are kept, or reset",
        choices=("carried", "reset"),
    )


@dataclass
class GaussianNoiseConfig(ModelConfig):
    """What Gaussian processes with a noise variance have; hyperparameters in scaled units."""

    kernel: str = option("squared_exponential", "correlation of two positions", choices=KERNELS)
    amplitude: float = option(1.0, "start value of the amplitude", above=0, at_most=1e6)
    lengthscale: float = option(0.5, "start value of both lengthscales", above=0, at_most=1e6)
    noise_variance: float = option(1.0, "start value of the noise variance", above=0, at_most=1e6)
    min_noise_variance: float = option(
        1e-4, "floor of the learned noise variance", at_least=0, at_most=1e6
    )
    jitter: float = option(1e-6, "added to the diagonal of the covariance", at_least=0, at_most=1e6)
    optimizer: str = option(
        "adam", "maximises the log marginal likelihood", choices=("adam", "lbfgs")
    )
    learning_rate: float = option(0.01, "Adam's step on the logarithms", above=0, at_most=1)


@dataclass
class GpConfig(GuardedConfig, GaussianNoiseConfig):
    """Gaussian process regression; hyperparameters in scaled units."""

    name: str = option("gp", "model", choices=("gp",))
    noise_start: str = _noise_start()
    optimizer_state: str = _optimizer_state()
    dtype: str = option("float64", "precision of the matrices", choices=("float64", "float32"))


@dataclass
class VecchiaConfig(GpConfig):
    """Gaussian process regression from nearest neighbours; its cost is linear in the samples."""

    name: str = option("vecchia", "model", choices=("vecchia",))
    neighbours: int = option(
        30, "samples that a block is conditioned on in the likelihood", at_least=1, at_most=1000
    )
    block: int = option(
        7, "samples that are conditioned together in the likelihood", at_least=1, at_most=100
    )
    prediction_neighbours: int = option(
        160, "samples that a prediction is conditioned on", at_least=1, at_most=5000
    )
    ordering: str = option(
        "collected",
        "order of conditioning: as they come, far from all before, or at random",
        choices=("collected", "maxmin", "random"),
    )


@dataclass
class StudentTConfig(GuardedConfig):
    """Gaussian process regression with Student-t noise; hyperparameters in scaled units."""

    name: str = option("student_t", "model", choices=("student_t",))
    kernel: str = option("squared_exponential", "correlation of two positions", choices=KERNELS)
    dof: float = option(
        4.0,
        "degrees of freedom of the noise; the smaller, the less an outlier counts",
        above=2,
        at_most=1e12,
    )
    amplitude: float = option(1.0, "start value of the amplitude", above=0, at_most=1e6)
    lengthscale: float = option(0.5, "start value of both lengthscales", above=0, at_most=1e6)
    noise_variance: float = option(
        1.0, "start value of the squared scale of the noise", above=0, at_most=1e6
    )
    min_noise_variance: float = option(
        1e-4, "floor of the learned squared scale", at_least=0, at_most=1e6
    )
    jitter: float = option(1e-6, "added to the diagonal of the covariance", at_least=0, at_most=1e6)
    optimizer: str = option(
        "adam", "maximises the log marginal likelihood", choices=("adam", "lbfgs")
    )
    learning_rate: float = option(0.01, "Adam's step on the logarithms", above=0, at_most=1)
    noise_start: str = _noise_start()
    optimizer_state: str = _optimizer_state()


@dataclass
class RcgpConfig(GaussianNoiseConfig):
    """Robust and conjugate Gaussian process regression: data far from a centre count less."""

    name: str = option("rcgp", "model", choices=("rcgp",))
    noise_start: str = _noise_start()
    optimizer_state: str = _optimizer_state()
    outlier_fraction: float = option(
        0.2, "share of the samples expected far from the centre", above=0, below=1
    )
    centre_neighbours: int | None = option(
        10,
        "nearest samples whose median is the centre; null: the prior mean, as in the paper",
        at_least=1,
        at_most=10**6,
    )
    criterion: str = option(
        "weighted",
        "leave-one-out density that the optimiser maximises: each sample's by its weight, or alike",
        choices=("weighted", "plain"),
    )


@dataclass
class ItgpConfig(GaussianNoiseConfig):
    """Gaussian process regression that trims the samples it predicts worst."""

    name: str = option("itgp", "model", choices=("itgp",))
    dtype: str = option("float64", "precision of the matrices", choices=("float64", "float32"))
    iterations: Any = option(
        30,
        "optimiser iterations each step of an epoch, from the start values, or as many as new "
        "samples",
        at_least=0,
        at_most=10**9,
        choices=("per_sample",),
    )
    optimizer: str = option(
        "lbfgs", "maximises the log marginal likelihood", choices=("adam", "lbfgs")
    )
    alpha1: float = option(0.5, "share of the samples kept while concentrating", above=0, at_most=1)
    alpha2: float = option(
        0.975, "probability of the interval in which reweighting keeps samples", above=0, below=1
    )
    shrinking: int = option(
        2, "steps from all samples towards alpha1 of them", at_least=0, at_most=1000
    )
    concentrating: int = option(
        2, "most steps with alpha1 of the samples", at_least=0, at_most=1000
    )
    reweighting: int = option(
        1, "most steps with all samples inside the interval", at_least=0, at_most=1000
    )


@dataclass
class RelevancePursuitConfig(GaussianNoiseConfig):
    """Gaussian process regression with noise of their own for samples that need it."""

    name: str = option("relevance_pursuit", "model", choices=("relevance_pursuit",))
    noise_start: str = _noise_start()
    optimizer_state: str = _optimizer_state()
    outlier_fraction: float = option(
        0.2, "share of the samples expected to need it: mean of the prior", above=0, at_most=1
    )
    fractions: list[float] = option(
        [0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5],
        "shares that are compared, besides none",
        above=0,
        at_most=1,
    )


@dataclass
class OwnModelConfig(ModelConfig):
    """A model of the user's."""

    name: str = option("own", "model", choices=("own",))
    function: str | None = option(None, "module.Class; a module in the current directory is found")
    options: dict[str, Any] = option({}, "keyword-only parameters of its constructor")


RANGES = "ranges of the terrain"
"""Unit of a fault's sizes: the highest elevation minus the lowest, at the query grid's nodes."""


@dataclass
class FaultConfig:
    """What all faults of the sensor have."""

    name: str = option("", "fault")


@dataclass
class SpikeConfig(FaultConfig):
    """Single measurements far off, either way."""

    name: str = option("spike", "fault", choices=("spike",))
    count: str = option(
        "round",
        "spikes in a batch of n: rho n rounded half to even, its floor, or n draws",
        choices=("round", "floor", "bernoulli"),
    )
    amplitude: list[float] = option(
        [1.0, 2.0],
        "bounds of the uniform amplitude, times the data range",
        at_least=0,
        at_most=1e9,
        length=2,
    )
    quantiles: list[float] = option(
        [0.05, 0.95],
        "quantiles between which the batch's data range lies",
        at_least=0,
        at_most=1,
        length=2,
    )
    draw: str = option(
        "spike",
        "amplitude and sign are drawn for each spike, or once for all of a batch",
        choices=("spike", "batch"),
    )


def _sizes(default: list[float], doc: str) -> Any:
    """Declare the bounds of a size that is drawn."""
    return option(default, doc, unit=RANGES, above=0, at_most=1e9, length=2)


def _length(default: float, doc: str) -> Any:
    """Declare the mean length of what lasts."""
    return option(default, doc, unit="samples", at_least=1, at_most=1e6)


@dataclass
class MaxRangeConfig(FaultConfig):
    """Returns at the sensor's limit."""

    name: str = option("max_range", "fault", choices=("max_range",))
    level: float = option(
        1.5,
        "what they say: 0 is the terrain's lowest point, 1 its highest",
        unit=RANGES,
        at_least=-1e9,
        at_most=1e9,
    )


@dataclass
class UniformConfig(FaultConfig):
    """Cross-talk: measurements from anywhere in a range."""

    name: str = option("uniform", "fault", choices=("uniform",))
    bounds: list[float] = option(
        [-0.5, 1.5],
        "of the range: 0 is the terrain's lowest point, 1 its highest",
        unit=RANGES,
        at_least=-1e9,
        at_most=1e9,
        length=2,
    )


@dataclass
class HeavyTailConfig(FaultConfig):
    """Student-t noise on some measurements."""

    name: str = option("heavy_tail", "fault", choices=("heavy_tail",))
    dof: float = option(
        2.0, "degrees of freedom; the fewer, the heavier the tails", at_least=0.5, at_most=1e6
    )
    scale: float = option(
        0.05, "of the noise", unit=RANGES, above=0,
        at_most=1e9,
    )  # fmt: skip


@dataclass
class LocalFaultConfig(FaultConfig):
    """Spikes, more often on some ground."""

    name: str = option("local", "fault", choices=("local",))
    regions: list[float] = option(
        [],
        "bad ground: xmin, xmax, ymin, ymax of one rectangle, then of the next; none: the steeper, "
        "the worse",
        unit="workspace units",
    )
    factor: float = option(
        10.0,
        "how many times as often on the worst ground as on the best",
        at_least=1,
        at_most=1e9,
    )
    amplitude: list[float] = _sizes([0.25, 1.0], "bounds of a spike's size")


@dataclass
class StretchConfig(FaultConfig):
    """What all faults have that last for a stretch."""

    length: float = _length(10.0, "mean length of a stretch")


@dataclass
class StuckConfig(StretchConfig):
    """The last value, again and again."""

    name: str = option("stuck", "fault", choices=("stuck",))


@dataclass
class BurstConfig(StretchConfig):
    """Spikes in runs."""

    name: str = option("burst", "fault", choices=("burst",))
    length: float = _length(5.0, "mean length of a burst")
    amplitude: list[float] = _sizes([0.25, 1.0], "bounds of a spike's size")


@dataclass
class BiasConfig(StretchConfig):
    """Steps: the same error for a stretch."""

    name: str = option("bias", "fault", choices=("bias",))
    length: float = _length(20.0, "mean length of a stretch")
    amplitude: list[float] = _sizes([0.1, 0.5], "bounds of the error's size")


@dataclass
class DriftConfig(StretchConfig):
    """An error that grows until it is reset."""

    name: str = option("drift", "fault", choices=("drift",))
    length: float = _length(20.0, "mean number of samples to the reset")
    rate: float = option(
        0.02,
        "growth a sample",
        unit=RANGES,
        above=0,
        at_most=1e9,
    )


@dataclass
class DropoutConfig(StretchConfig):
    """No measurement at all."""

    name: str = option("dropout", "fault", choices=("dropout",))
    length: float = _length(3.0, "mean length of a stretch without any")


@dataclass
class MixedConfig(FaultConfig):
    """Several faults at once, each by its weight."""

    name: str = option("mixed", "fault", choices=("mixed",))
    faults: list[str] = option(
        ["burst", "max_range", "stuck"],
        "which",
        choices=(
            "spike", "max_range", "uniform", "burst", "stuck", "bias", "drift", "heavy_tail",
            "local", "dropout",
        ),
    )  # fmt: skip
    weights: list[float] = option(
        [], "how frequent each is, compared with the others; none: all alike", above=0, at_most=1e9
    )
    options: dict[str, Any] = option({}, "theirs by name, as in fault.options.burst.length=8")

    def shares(self, rho: float) -> list[float]:
        """Share of the samples that each fault spoils, such that rho are spoilt by any of them.

        They go their ways independently: 1 - rho is the product of what each leaves alone.
        """
        weights = self.weights or [1.0] * len(self.faults)
        return [1.0 - (1.0 - rho) ** (weight / sum(weights)) for weight in weights]

    def parts(self) -> list[FaultConfig]:
        """Options of each fault.

        Raises
        ------
        UsageError
            If one has not such an option.
        """
        parts = []
        for name in self.faults:
            part = METHODS["fault"][name]
            given = self.options.get(name, {})
            known = {item.name for item in fields(part)} - {"name"}
            if not isinstance(given, dict) or not set(given) <= known:
                raise UsageError(
                    f"fault.options.{name}={given} is not possible: it must be a mapping of "
                    f"{', '.join(sorted(known))}"
                )
            # A rounded share of a batch, of a small share, would always be none.
            usual = {"count": "bernoulli"} if name == "spike" else {}
            parts.append(replace(part, **{**usual, **given}))
        return parts


@dataclass
class OwnFaultConfig(FaultConfig):
    """A fault of the user's."""

    name: str = option("own", "fault", choices=("own",))
    function: str | None = option(
        None, "module.function; a module in the current directory is found"
    )
    options: dict[str, Any] = option({}, "its keyword-only parameters")


METHODS: dict[str, dict[str, Any]] = {
    "planner": {
        "uct": TreeSearchConfig(name="uct"),
        "puct": TreeSearchConfig(name="puct"),
        "weighted": WeightedConfig(),
        "greedy": GreedyConfig(),
        "bayes_opt": BayesOptConfig(),
        "rig_tree": RigTreeConfig(),
        "cmaes": CmaesConfig(),
        "lawnmower": LawnmowerConfig(),
        "random": RandomConfig(),
        "own": OwnPlannerConfig(),
    },
    "detector": {
        "none": DetectorConfig(name="none"),
        "best": DetectorConfig(name="best"),
        "copod": CopodConfig(),
        "pyod": PyodConfig(),
        "gp_residual": GpResidualConfig(),
        "local": LocalConfig(),
        "hampel": HampelConfig(),
        "qartod": QartodConfig(),
        "own": OwnDetectorConfig(),
    },
    "model": {
        "gp": GpConfig(),
        "student_t": StudentTConfig(),
        "vecchia": VecchiaConfig(),
        "rcgp": RcgpConfig(),
        "itgp": ItgpConfig(),
        "relevance_pursuit": RelevancePursuitConfig(),
        "own": OwnModelConfig(),
    },
    "fault": {
        "spike": SpikeConfig(),
        "max_range": MaxRangeConfig(),
        "uniform": UniformConfig(),
        "burst": BurstConfig(),
        "stuck": StuckConfig(),
        "bias": BiasConfig(),
        "drift": DriftConfig(),
        "heavy_tail": HeavyTailConfig(),
        "local": LocalFaultConfig(),
        "dropout": DropoutConfig(),
        "mixed": MixedConfig(),
        "own": OwnFaultConfig(),
    },
}
"""The options of every planner, detector, model and fault, with their defaults."""

RENAMED = {"outliers": "fault"}
"""Groups that had another name in version 0.1, by that name; it is still understood."""

GROUPS: dict[str, dict[str, Any]] = {
    **METHODS,
    "terrain": {name: schema(name=name) for name, schema in TERRAIN_SCHEMAS.items()},
}
"""Schema of every choice of every group, with its defaults; each YAML file repeats one."""

REPLAY_GROUPS = ("detector", "model")
"""Groups that a replay may choose anew."""

REPLAY_OPTIONS = ("planner.smoothing",)
"""Further options that change what is told of a mission, and not its trajectory."""

REPLAY_HOW = ("n_jobs", "backend", "mission_timeout", "on_error", "resume")
"""Options that say how a replay is run."""

SURVEY_OPTIONS, SURVEY_HOW = ("grid",), ("resume",)
"""Likewise of a survey: what may be chosen besides what a replay may, and how it is run."""


@dataclass
class RobotConfig:
    """Dubins car."""

    speed: float = option(
        0.7, "distance between samples", unit="workspace units", above=0, at_most=1e12
    )
    samples_per_action: int = option(10, "samples along an action", at_least=1, at_most=10**6)
    max_steering: float = option(
        0.15, "largest steering angle, a turn per sample", unit="rad", above=0, at_most=math.pi
    )
    steering_angles: int = option(5, "number of steering angles, even over both sides", at_least=1)


@dataclass
class PilotConfig:
    """The path driven before any planning: a Bezier curve."""

    samples: int = option(100, "samples along the curve", at_least=3)
    outliers: bool = option(False, "the sensor's fault spoils the pilot samples, too")
    control_points: list[list[float]] = option(
        [  # around the workspace and back to its middle (paper's Fig. 4 (a))
            [0.25, 0.0],
            [0.0, 0.0],
            [0.0, 0.25],
            [0.0, 0.5],
            [0.0, 0.75],
            [0.0, 1.0],
            [0.25, 1.0],
            [0.5, 1.0],
            [0.75, 1.0],
            [1.0, 1.0],
            [1.0, 0.75],
            [1.0, 0.5],
            [1.0, 0.25],
            [1.0, 0.0],
            [0.75, 0.0],
            [0.5, 0.0],
            [0.5, 0.25],
            [0.5, 0.5],
        ],
        "control points, fractions of the extent",
        at_least=0,
        at_most=1,
    )


@dataclass
class SensorConfig:
    """The elevation sensor."""

    noise_std: float = option(
        1.0,
        "standard deviation of the Gaussian noise",
        unit="the terrain's unit",
        at_least=0,
        at_most=1e12,
    )


if TYPE_CHECKING:
    Read = TypeVar("Read", covariant=True)
    Written = TypeVar("Written", contravariant=True)

    # For type checkers an option of any choice is there: which choice it is, is known at run time.
    class AnyPlanner(
        WeightedConfig, GreedyConfig, BayesOptConfig, RigTreeConfig, CmaesConfig, LawnmowerConfig,
        RandomConfig, OwnPlannerConfig,
    ):  # fmt: skip
        """Options of all planners."""

    class AnyDetector(
        CopodConfig, PyodConfig, GpResidualConfig, LocalConfig, HampelConfig, QartodConfig,
        OwnDetectorConfig,
    ):  # fmt: skip
        """Options of all detectors."""

    class AnyTerrain(  # type: ignore[misc]
        HelensConfig, FileConfig, RandomFieldConfig, OwnTerrainConfig, SurveyedConfig
    ):
        """Options of all terrains."""

    class AnyModel(
        VecchiaConfig, ItgpConfig, StudentTConfig, RcgpConfig, RelevancePursuitConfig,
        OwnModelConfig,
    ):  # fmt: skip
        """Options of all models."""

    class AnyFault(
        SpikeConfig, MaxRangeConfig, UniformConfig, BurstConfig, StuckConfig, BiasConfig,
        DriftConfig, HeavyTailConfig, LocalFaultConfig, DropoutConfig, MixedConfig, OwnFaultConfig,
    ):  # fmt: skip
        """Options of all faults."""

    class Choice(Generic[Read, Written]):
        """A field that takes one of several schemas, and is read as if it were all."""

        def __get__(self, owner: object, kind: Any = None) -> Read: ...

        def __set__(self, owner: object, value: Written) -> None: ...


@dataclass
class MissionConfig:
    """All that decides the numbers of a mission, its seed and the map's bytes apart."""

    if TYPE_CHECKING:
        planner: Choice[AnyPlanner, PlannerConfig] = Choice()
        detector: Choice[AnyDetector, DetectorConfig] = Choice()
        terrain: Choice[AnyTerrain, TerrainConfig] = Choice()
        model: Choice[AnyModel, ModelConfig] = Choice()
        fault: Choice[AnyFault, FaultConfig] = Choice()
    else:
        planner: PlannerConfig = field(default_factory=TreeSearchConfig)
        detector: DetectorConfig = field(default_factory=CopodConfig)
        terrain: TerrainConfig = field(default_factory=HelensConfig)
        model: ModelConfig = field(default_factory=GpConfig)
        fault: FaultConfig = field(default_factory=SpikeConfig)
    robot: RobotConfig = field(default_factory=RobotConfig)
    pilot: PilotConfig = field(default_factory=PilotConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    rho: float = option(0.1, "expected share of outliers in a batch", at_least=0, at_most=1)
    budget: int = option(2000, "samples of a mission, the pilot's included", at_least=1)
    grid: list[int] = option(
        [50, 50], "nodes of the query grid along y and x", at_least=2, length=2
    )


@dataclass
class Config(MissionConfig):
    """A mission's science and how to run it."""

    seeds: Any = option(10, "how many seeds (0 to n - 1), or a list of them")
    n_jobs: int = option(-1, "parallel missions; -1: one a core", at_most=10_000)
    backend: str = option(
        "loky",
        "where missions run: worker processes, a Dask cluster, or this process",
        choices=("loky", "dask", "sequential"),
    )
    scheduler: str | None = option(
        None, "address or scheduler file of a Dask cluster; null: one on this machine"
    )
    on_error: str = option(
        "continue", "after a failed mission: fly the others, or start no more",
        choices=("continue", "stop"),
    )  # fmt: skip
    mission_timeout: float | None = option(
        None, "longest time of a mission, whose worker is then ended; null: any", unit="s", above=0
    )
    results_dir: str = option("results", "where the tables land")
    resume: bool = option(True, "keep the seeds whose table is already there")
    sweep: list[str] = option(
        [], "command lines whose configurations are the study; options given beside replace theirs"
    )


def validate(config: MissionConfig) -> None:
    """Check every bound, and the relations between options.

    Raises
    ------
    UsageError
        Names the first option that is wrong and what it may be.
    """
    check_options(config)
    xmin, xmax, ymin, ymax = checked_extent(config.terrain.extent)
    action = config.robot.speed * config.robot.samples_per_action
    if min(xmax - xmin, ymax - ymin) < 2 * action:
        # Half a side must hold an action, or the car could be stuck whatever its heading.
        raise UsageError(
            f"terrain.extent={config.terrain.extent} is too small for the robot: each side must be "
            f"at least twice robot.speed x robot.samples_per_action = {plain_number(2 * action)}"
        )
    planner, speed = config.planner, config.robot.speed
    if isinstance(planner, LawnmowerConfig) and planner.spacing < speed:
        raise UsageError(
            f"planner.spacing={planner.spacing} is too narrow: it must be at least "
            f"robot.speed={plain_number(speed)}, the distance between samples"
        )
    if getattr(planner, "reward", "") in OF_COVARIANCE and getattr(planner, "noisy_std", False):
        raise UsageError(
            f"planner.noisy_std=true has no use with planner.reward={planner.reward}, in which the "
            "noise is: leave planner.noisy_std=false"
        )
    if config.budget <= config.pilot.samples:
        raise UsageError(
            f"budget={config.budget} leaves nothing to plan: it counts the pilot and must be above "
            f"pilot.samples={config.pilot.samples}"
        )
    _check_fault(config.fault, config.rho)
    iterations = config.model.iterations
    if isinstance(iterations, bool) or not isinstance(iterations, int | str):
        raise UsageError(f"model.iterations={iterations} must be a whole number or per_sample")
    for name, other in (("noise_start", "restarted"), ("optimizer_state", "reset")):
        if iterations == 0 and getattr(config.model, name, "") == other:
            raise UsageError(
                f"model.{name}={other} has no use with model.iterations=0, which leaves the "
                f"hyperparameters as the pilot made them: leave model.{name}=carried"
            )
    points = config.pilot.control_points
    if len(points) < 2 or any(len(point) != 2 for point in points):
        raise UsageError(
            "pilot.control_points must be a list of at least two [x,y] pairs, fractions of the "
            "extent"
        )
    if isinstance(config, Config):
        seed_list(config.seeds)
        if config.n_jobs == 0:
            raise UsageError("n_jobs=0 runs nothing: give a number of workers, or -1 for all cores")
        if config.scheduler is not None and config.backend != "dask":
            raise UsageError(
                f"scheduler={config.scheduler} has no use with backend={config.backend}: "
                "give backend=dask, too"
            )
        if config.mission_timeout is not None and config.backend != "loky":
            raise UsageError(
                f"mission_timeout={config.mission_timeout:g} has no use with "
                f"backend={config.backend}, which cannot end a mission alone: use backend=loky"
            )


def _check_fault(fault: FaultConfig, rho: float) -> None:
    """Check the relations between the options of a fault, and that it can have its share."""
    for name in ("amplitude", "quantiles", "bounds"):
        bounds = getattr(fault, name, [0, 0])
        if bounds[0] > bounds[1]:
            raise UsageError(
                f"fault.{name}={bounds} is the wrong way round: the smaller bound is first"
            )
    if isinstance(fault, StretchConfig) and rho * (fault.length + 1) > fault.length:
        raise UsageError(
            f"rho={plain_number(rho)} is out of reach of fault={fault.name}: between stretches of "
            f"fault.length={plain_number(fault.length)} at least one sample is sound, so rho is at "
            f"most {plain_number(fault.length / (fault.length + 1))}"
        )
    regions = fault.regions if isinstance(fault, LocalFaultConfig) else []
    lows, highs = regions[::2], regions[1::2]
    if len(regions) % 4 or any(low >= high for low, high in zip(lows, highs, strict=True)):
        raise UsageError(
            f"fault.regions={regions} are no rectangles: give xmin, xmax, ymin, ymax of each, the "
            "smaller bound first"
        )
    if isinstance(fault, MixedConfig):
        if len(fault.weights) not in (0, len(fault.faults)):
            raise UsageError(
                f"fault.weights={fault.weights} does not fit fault.faults={fault.faults}: give one "
                "weight for each, or none"
            )
        if foreign := set(fault.options) - set(fault.faults):
            raise UsageError(
                f"fault.options.{min(foreign)} has no use: fault.faults={fault.faults} has it not"
            )
        for part, share in zip(fault.parts(), fault.shares(rho), strict=True):
            check_options(part, f"fault.options.{part.name}.")
            _check_fault(part, share)


def seed_list(seeds: Any) -> Sequence[int]:
    """Seeds that ``seeds=`` stands for: a count n means 0 to n - 1.

    Raises
    ------
    UsageError
        If it is neither a positive count nor a list of different non-negative integers.
    """
    allowed = "it must be a count of at least 1, or a list of different integers of at least 0"
    if isinstance(seeds, bool) or not isinstance(seeds, int | list):
        raise UsageError(f"seeds={seeds!r} is not a number of seeds: {allowed}")
    if isinstance(seeds, int) and seeds > 0:
        return range(seeds)  # of any length
    chosen = [] if isinstance(seeds, int) else seeds
    if any(isinstance(seed, bool) or not isinstance(seed, int) or seed < 0 for seed in chosen):
        raise UsageError(f"seeds={seeds} holds something else than seeds: {allowed}")
    if not chosen:
        raise UsageError(f"seeds={seeds} is no seed at all: {allowed}")
    if len(set(chosen)) < len(chosen):
        raise UsageError(f"seeds={seeds} names a seed twice: {allowed}")
    return chosen
