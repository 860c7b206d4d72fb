"""The figure of calibration, and the report's, against shares counted in the stored maps."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_tables import store, truth
from scipy.stats import norm, t

from infoplan.cli import main


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("calibrated")
    for seed in range(3):
        noise = np.random.default_rng(seed).normal(size=truth().shape)
        store(folder, "uct-best", seed=seed, mean=truth() + 20 * noise, std=20.0)
        store(folder, "uct-none", seed=seed, mean=truth() + 20 * noise, std=10.0)
    return folder


def share(folder: Path, method: str, seed: int, level: float) -> float:
    """Share of the nodes whose truth lies within, counted by the ends of the intervals."""
    (path,) = folder.glob(f"maps/run={method}-*/seed={seed}.parquet")
    maps = pd.read_parquet(path, partitioning=None)
    low, high = norm.interval(level, maps["mean"], maps["std"])
    return float(np.mean((low <= maps["truth"]) & (maps["truth"] <= high)))


def test_the_lines_are_shares_of_the_maps(results, capfd):
    main(["figures", f"results_dir={results}"])  # those of the paper lack runs
    said, problems = (text.split() for text in capfd.readouterr())
    assert not [line for line in said if "outliers" in line]  # one fault alone
    files = [Path(line) for line in said if "calibration" in line]
    assert files, problems
    assert [path.name for path in files] == [f"calibration.{k}" for k in ("png", "pdf", "csv")]
    assert files[0].stat().st_size > 20_000
    shown = pd.read_csv(files[2])
    for method in ("uct-best", "uct-none"):
        line = shown[(shown["method"] == method.upper()) & (shown["panel"] == "b")]
        assert line["level"].is_monotonic_increasing
        assert line[["level", "mean"]].iloc[[0, -1]].to_numpy().tolist() == [[0, 0], [1, 1]]
        for row in line[line["level"].between(0.05, 0.999)].to_dict("records"):
            seeds = [share(results, method, seed, row["level"]) for seed in range(3)]
            assert [row[f"seed_{k}"] for k in range(3)] == pytest.approx(seeds)
            assert row["mean"] == pytest.approx(np.mean(seeds))
            half = t.ppf(0.975, 2) * np.std(seeds, ddof=1) / np.sqrt(3)
            expected = (row["mean"] - half, row["mean"] + half)
            assert (row["low"], row["high"]) == pytest.approx(expected)


def test_the_report_has_the_same_lines(results, capfd):
    assert main(["report", f"results_dir={results}"]) == 0
    page = (results / "report.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.S)[1])["calibration"]
    assert (data["axis"][0], data["axis"][-1]) == (0.0, 1.0)
    (panel,) = [one for one in data["panels"] if one["title"].startswith("(b)")]
    for line in panel["lines"]:
        for level, mean in zip(data["axis"][1:-1], line["mean"][1:-1], strict=True):
            seeds = [share(results, line["method"].lower(), seed, level) for seed in range(3)]
            assert mean == pytest.approx(np.mean(seeds), rel=1e-3)
    assert 'href="#calibration"' in page
    assert 'id="faults"' not in page  # one fault alone
    best = [share(results, "uct-best", seed, 0.95) for seed in range(3)]
    assert f"{np.mean(best):.2f} [" in page
