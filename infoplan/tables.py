"""The columns of the three tables of a mission, and the sizes within which files are read."""

COLUMNS: dict[str, dict[str, str]] = {
    "curves": {
        **dict.fromkeys(["planner", "detector", "scope"], "text"),
        "rho": "double",
        "terrain": "text",
        **dict.fromkeys(["seed", "epoch", "collected", "accepted"], "integer"),
        **dict.fromkeys(["rmse", "mae", "nlpd", "coverage95"], "double"),
        **dict.fromkeys(["tp", "fp", "fn", "tn"], "integer"),
        **dict.fromkeys(["amplitude", "lengthscale_1", "lengthscale_2"], "double"),
        **dict.fromkeys(["noise_std", "jitter", "lml"], "double"),
        **dict.fromkeys(["plan_seconds", "fit_seconds"], "double"),
        **dict.fromkeys(["predict_seconds", "detect_seconds"], "double"),
    },
    "samples": {
        **dict.fromkeys(["seed", "epoch"], "integer"),
        **dict.fromkeys(["x1", "x2", "heading", "truth", "measured", "score"], "double"),
        **dict.fromkeys(["is_outlier", "flagged", "used"], "boolean"),
    },
    "maps": {
        "seed": "integer",
        **dict.fromkeys(["x1", "x2", "truth", "mean", "std", "outlier_density"], "double"),
    },
}
"""Columns that each table has at least, in order, and what each holds."""

GAPS = ("score",)
"""Columns whose values may be missing: a sample that was never judged has no score."""

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
