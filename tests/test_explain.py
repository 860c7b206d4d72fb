"""Where a run's error comes from: refits, their split, and what is stored, told and drawn of it."""

import csv
import io
import itertools
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from command import SMALL, suggested
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from infoplan.analyse import load_curves, mean_interval
from infoplan.analyse.audit import audit
from infoplan.analyse.error_sources import PARTS, shapley_of_two, split_gap
from infoplan.cli import main
from infoplan.collapse import is_rate_limited, moving_sentence, was_moving

OLD = Path(__file__).parent / "data" / "results-0.1.0"
WORDS = [word for word in SMALL if not word.startswith("seeds")] + ["backend=sequential"]
FAULTS = ["detector=copod", "planner=puct"]
SEEDS = (0, 1)


def fly(folder, *words):
    assert main(["run", *WORDS, f"results_dir={folder}", "seeds=2", *words]) == 0


def explain(folder, *words):
    return main(["explain", "puct-copod", "backend=sequential", f"results_dir={folder}", *words])


def named(folder, begin):
    return next(path.stem for path in (folder / "runs").glob(f"{begin}*.yaml"))


def table(folder, name, begin, seed):
    return pd.read_parquet(
        folder / name / f"run={named(folder, begin)}" / f"seed={seed}.parquet", partitioning=None
    )


def stamps(folder):
    return {path: path.stat().st_mtime_ns for path in folder.glob("refits/*/*.parquet")}


@pytest.fixture(scope="module")
def explained(tmp_path_factory):
    """A run whose detector errs both ways, and BEST, explained."""
    folder = tmp_path_factory.mktemp("explained")
    fly(folder, *FAULTS)
    fly(folder, "detector=best", "planner=uct")
    assert explain(folder) == 0
    return folder


@pytest.mark.parametrize("number", range(5))
def test_shares_are_the_mean_over_all_orders(number):
    errors = np.random.default_rng(number).uniform(0, 1000, 4)
    value = dict(zip([frozenset("ab"), frozenset("b"), frozenset("a"), frozenset()], errors,
                     strict=True))  # fmt: skip
    shares = dict.fromkeys("ab", 0.0)
    for order in itertools.permutations("ab"):
        left = frozenset("ab")
        for player in order:
            shares[player] += (value[left] - value[left - {player}]) / 2
            left -= {player}
    assert shapley_of_two(*errors) == pytest.approx((shares["a"], shares["b"]))


def test_parts_add_up_to_the_gap():
    refits = {"used": 300.0, "without_spikes": 210.0, "with_lost": 250.0, "clean": 120.0}
    parts = split_gap(900.0, refits, 96.0, 105.0)
    assert parts == {"learning": 600.0, "spikes": 110.0, "lost": 70.0, "places": 15.0,
                     "best_itself": 9.0}  # fmt: skip
    assert sum(parts.values()) == pytest.approx(900.0 - 96.0)


@pytest.mark.parametrize("data", ["used", "without_spikes", "with_lost", "clean"])
def test_refits_are_at_the_optimum_that_scikit_learn_finds(explained, data):
    seed = 0
    samples = table(explained, "samples", "puct-copod", seed)
    maps = table(explained, "maps", "puct-copod", seed)
    refit = table(explained, "refits", "puct-copod", seed).set_index("data").loc[data]
    used, outlier = samples["used"], samples["is_outlier"]
    chosen = {"used": used, "without_spikes": used & ~outlier, "with_lost": used | ~outlier,
              "clean": ~outlier}[data]  # fmt: skip
    assert refit["accepted"] == chosen.sum()
    x, y = samples[["x1", "x2"]].to_numpy(), samples["measured"].to_numpy()
    pilot = (samples["epoch"] == 0).to_numpy()
    low, high = x[pilot].min(0), x[pilot].max(0)
    centre, scale = y[pilot].mean(), y[pilot].std()

    def inputs(at):
        return 2 * (at - low) / (high - low) - 1

    kernel = ConstantKernel(1.0, (1e-8, 1e8)) * RBF([1.0, 1.0], (1e-4, 1e4)) + WhiteKernel(
        1.0, (1e-4, 1e4)
    )
    ours = kernel.clone_with_theta(np.log([
        refit["amplitude"] ** 2, refit["lengthscale_1"], refit["lengthscale_2"],
        refit["noise_std"] ** 2,
    ]))  # fmt: skip
    data_of = inputs(x[chosen]), (y[chosen] - centre) / scale
    theirs = GaussianProcessRegressor(kernel, alpha=1e-6, n_restarts_optimizer=1, random_state=0)
    theirs.fit(*data_of)
    same = GaussianProcessRegressor(ours, alpha=1e-6, optimizer=None).fit(*data_of)
    assert refit["lml"] == pytest.approx(same.log_marginal_likelihood_value_, abs=1e-4)
    assert refit["lml"] >= theirs.log_marginal_likelihood_value_ - 0.1
    assert refit["converged"]
    assert refit["slope"] <= 0.1
    mean = centre + scale * same.predict(inputs(maps[["x1", "x2"]].to_numpy()))
    error = math.sqrt(np.mean((mean - maps["truth"].to_numpy()) ** 2))
    assert refit["rmse"] == pytest.approx(error, rel=1e-4)


def test_what_is_stored_is_told_split_and_not_computed_again(explained, capfd):
    before = stamps(explained)
    assert len(before) == 2 * len(SEEDS)
    capfd.readouterr()
    assert explain(explained, "--csv") == 0
    text, _ = capfd.readouterr()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [int(row["seed"]) for row in rows] == [*SEEDS]
    for row in rows:
        seed = int(row["seed"])
        ends = [table(explained, "curves", begin, seed)["rmse"].iloc[-1]
                for begin in ("puct-copod", "uct-best")]  # fmt: skip
        assert [float(row["rmse"]), float(row["best_rmse"])] == pytest.approx(ends)
        assert float(row["gap"]) == pytest.approx(ends[0] - ends[1])
        assert sum(float(row[part]) for part in PARTS) == pytest.approx(float(row["gap"]))
        refits = table(explained, "refits", "puct-copod", seed).set_index("data")["rmse"]
        assert float(row["learning"]) == pytest.approx(ends[0] - refits["used"])
        assert float(row["spikes"]) + float(row["lost"]) == pytest.approx(
            refits["used"] - refits["clean"]
        )
        assert abs(float(row["spikes"])) > 1e-6
        assert abs(float(row["lost"])) > 1e-6
    assert explain(explained, "--json") == 0
    (document,) = json.loads(capfd.readouterr().out)
    mean = mean_interval([float(row["learning"]) for row in rows])
    assert document["means"]["learning"] == pytest.approx(
        {"mean": mean.mean, "low": mean.low, "high": mean.high}
    )
    assert len(document["seeds"]) == 2
    assert explain(explained, "--seeds", "seeds=[1]") == 0
    told = " ".join(capfd.readouterr().out.split())
    assert "each seed, in ft" in told
    assert "clean samples lost" in told
    assert "one seed has no interval" in told
    assert stamps(explained) == before


def test_parts_are_drawn_and_reported_without_computing(explained, capfd):
    before = stamps(explained)
    assert main(["figures", "explain", f"results_dir={explained}"]) == 0
    drawn = pd.read_csv(explained / "figures" / "explain.csv").set_index("part")
    steps = drawn.loc[["best_itself", "places", "lost", "spikes", "learning"]]
    assert steps["start"].iloc[0] == pytest.approx(drawn.loc["best_rmse", "mean"])
    ends = (steps["start"] + steps["mean"]).tolist()
    assert steps["start"].tolist()[1:] == pytest.approx(ends[:-1])
    assert ends[-1] == pytest.approx(drawn.loc["rmse", "mean"])
    assert {"seed_0", "seed_1", "low", "high"} <= set(drawn)
    assert main(["report", f"results_dir={explained}"]) == 0
    page = (explained / "report.html").read_text(encoding="utf-8")
    assert 'id="sources"' in page
    assert "spikes let through" in page
    assert stamps(explained) == before
    capfd.readouterr()


def test_refits_of_an_earlier_flight_or_damaged_ones_are_computed_again(explained, tmp_path, capfd):
    folder = tmp_path / "again"
    shutil.copytree(explained, folder)
    run = named(folder, "puct-copod")
    damaged = folder / "refits" / f"run={run}" / "seed=0.parquet"
    damaged.write_bytes(b"nothing")
    # A mission is whole without its refits.
    assert main(["status", "--json", f"results_dir={folder}"]) == 0
    assert not json.loads(capfd.readouterr().out)["problems"]
    assert explain(folder) == 0
    assert "2 of 4" not in capfd.readouterr().out
    assert table(folder, "refits", "puct-copod", 0).equals(
        table(explained, "refits", "puct-copod", 0)
    )
    before = stamps(folder)
    fly(folder, "detector=best", "planner=uct", "resume=false")
    assert explain(folder) == 0
    changed = {path.parent.name for path, time in stamps(folder).items() if time != before[path]}
    assert changed == {f"run={named(folder, 'uct-best')}"}


def test_what_cannot_be_explained_is_told_in_a_sentence(tmp_path, capfd):
    fly(tmp_path, *FAULTS)
    assert explain(tmp_path) == 2
    complaint = capfd.readouterr().err
    assert "the true labels as its filter" in complaint
    (command,) = suggested(complaint)
    assert main([*command, "backend=sequential"]) == 0
    assert named(tmp_path, "uct-best")
    assert explain(tmp_path, "seeds=[0]") == 0
    for words, said in (
        (["puct-copod", "seeds=[7]"], "seed 7 is not stored of puct-copod"),
        (["uct-best"], "is BEST itself"),
        (["puct-copod", "best=puct-copod"], "has the detector copod"),
        ([], "takes one stored run"),
        (["puct-copod", "--csv", "--json"], "--json, --csv or --latex: choose one"),
        (["puct-copod", "rho=0.2"], "rho"),
    ):
        assert main(["explain", *words, f"results_dir={tmp_path}"]) == 2
        assert said in " ".join(capfd.readouterr().err.split())
    assert main(["figures", "explain", f"results_dir={tmp_path}", "run=uct-best"]) == 1
    assert "infoplan" in capfd.readouterr().err


def test_seeds_that_are_not_stored_come_with_the_command_that_flies_them(tmp_path, capfd):
    fly(tmp_path, *FAULTS, "seeds=[0,3]")
    fly(tmp_path, "detector=best", "planner=uct", "seeds=1")
    capfd.readouterr()
    assert explain(tmp_path, "seeds=[0,3]") == 2
    complaint = capfd.readouterr().err
    run, best = named(tmp_path, "puct-copod"), named(tmp_path, "uct-best")
    assert f"seed 3 is not stored of {best}" in " ".join(complaint.split())
    assert run not in complaint
    (command,) = suggested(complaint)
    assert "seeds=[3]" in command
    assert main([*command, "backend=sequential"]) == 0
    assert explain(tmp_path, "seeds=[0,3]") == 0
    capfd.readouterr()
    assert explain(tmp_path, "seeds=[0,5,6]") == 2
    complaint = " ".join(capfd.readouterr().err.split())
    assert f"seeds 5-6 are not stored of {run}" in complaint
    assert "both have seeds 0, 3" in complaint


def test_a_model_that_weighs_its_samples_itself_is_refused(tmp_path, capfd):
    fly(tmp_path, "detector=none", "planner=uct", "model=rcgp", "seeds=1", "budget=110")
    capfd.readouterr()
    assert main(["explain", "uct-none", f"results_dir={tmp_path}"]) == 2
    assert "explain runs of model=gp, vecchia or student_t" in " ".join(
        capfd.readouterr().err.split()
    )


@pytest.mark.parametrize("model", ["vecchia", "student_t"])
def test_other_models_are_refit_by_their_own_likelihood(tmp_path, model):
    words = [f"model={model}", "seeds=1", "budget=130"]
    fly(tmp_path, "detector=none", "planner=uct", *words)
    fly(tmp_path, "detector=best", "planner=uct", *words)
    assert main(["explain", "uct-none", "backend=sequential", f"results_dir={tmp_path}"]) == 0
    refits = table(tmp_path, "refits", "uct-none", 0).set_index("data")
    assert (refits["gain"] > 0).all()
    assert refits.loc["used", "converged"]
    assert refits.loc["used", "accepted"] == 130
    # NONE loses no clean sample: the two refits are one.
    assert refits.loc["used"].equals(refits.loc["with_lost"])
    own = table(tmp_path, "curves", "uct-none", 0).iloc[-1]
    # The neighbours of vecchia are others once all samples are given at once.
    assert refits.loc["used", "lml"] == pytest.approx(
        own["lml"] + refits.loc["used", "gain"], abs=1.0
    )


def test_epochs_at_the_limit_of_the_learning_rate_are_stored_told_and_audited(tmp_path, capfd):
    fly(tmp_path, "detector=none", "planner=uct", "model.iterations=5")
    told = " ".join(capfd.readouterr().out.split())
    for seed in SEEDS:
        curve = table(tmp_path, "curves", "uct-none", seed)
        theta = np.log(curve[["amplitude", "lengthscale_1", "lengthscale_2", "noise_std"]])
        theta["noise_std"] *= 2
        moved = theta.diff().abs().max(axis=1).iloc[1:]
        assert curve["rate_limited"].isna().iloc[0]
        assert curve["rate_limited"].iloc[1:].tolist() == (moved >= 0.5 * 5 * 0.01).tolist()
        assert curve["rate_limited"].iloc[1:].any()
    assert "2 of 2 missions end with hyperparameters that still move" in told
    assert main(["show", f"results_dir={tmp_path}"]) == 0
    assert "still move" in " ".join(capfd.readouterr().out.split())
    assert all(finding.holds for finding in audit(tmp_path))


@pytest.mark.parametrize(
    "word", ["model.optimizer=lbfgs", "model.restarts=1", "model.iterations=0"]
)
def test_nothing_is_said_where_no_rate_limits(tmp_path, word, capfd):
    fly(tmp_path, "detector=none", "planner=uct", word, "seeds=1")
    assert load_curves(tmp_path)["rate_limited"].isna().all()
    assert "still move" not in capfd.readouterr().out


def test_the_last_ten_epochs_tell(capfd):
    assert was_moving([True] * 20 + [False] * 6 + [True] * 4) is False
    assert was_moving([False] * 20 + [True] * 5 + [False] * 5) is True
    assert was_moving([None]) is None
    assert moving_sentence([False, None]) == ""
    assert moving_sentence([True, False]).startswith("1 of 2 missions end")
    assert moving_sentence([True], explain=False).endswith("learning is not finished")
    before, after = {"amplitude": 1.0, "noise_std": 1.0}, {"amplitude": 1.0, "noise_std": 1.013}
    assert is_rate_limited(before, after, 5, 0.01)  # the variance has moved by 0.026
    assert not is_rate_limited(before, after, 6, 0.01)
    assert is_rate_limited(before, after, 5, None) is None


def test_older_results_are_judged_by_their_hyperparameters(tmp_path):
    from infoplan.analyse.curves import moving_ends

    shutil.copytree(OLD, tmp_path / "old")
    curves = load_curves(tmp_path / "old")
    assert curves["rate_limited"].isna().all()
    found = moving_ends(curves, tmp_path / "old")
    names = ["amplitude", "lengthscale_1", "lengthscale_2", "noise_std"]
    for (run, seed), rows in curves.groupby(["run", "seed"]):
        stored = yaml.safe_load((tmp_path / "old" / "runs" / f"{run}.yaml").read_text())
        theta = np.log(rows[names].to_numpy()) * [1, 1, 1, 2]
        limit = 0.5 * stored["model"]["learning_rate"] * stored["model"]["iterations"]
        moved = np.abs(np.diff(theta, axis=0)).max(axis=1)[-10:] >= limit
        assert found[run, seed] == (2 * moved.sum() >= len(moved))


def test_for_papers_it_is_a_table_of_latex(explained, capfd):
    assert explain(explained, "--json") == 0
    (document,) = json.loads(capfd.readouterr().out)
    assert explain(explained, "--latex") == 0
    said = capfd.readouterr().out
    assert said.startswith(f"% {document['run']}, compared with ")
    assert rf"\caption{{RMSE in {document['unit']}: mean [95 \% interval over seeds]}}" in said
    rows = [line.split(" & ") for line in said.splitlines() if line.endswith(r"\\")][1:]
    means = [float(row[1].split()[0].replace("$-$", "-")) for row in rows]
    expected = [mean["mean"] for mean in document["means"].values()]
    assert means == pytest.approx(expected, rel=5e-3, abs=0.5)
