"""The audit accepts honest missions and catches every kind of tampering."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from made_run import CONFIGURATION, RUN, SEED, fly, hills, store, table_path, with_options

from infoplan.analyse.audit import Finding, audit, audit_mission
from infoplan.draw.findings_table import render
from infoplan.errors import UsageError

Tables = dict[str, pd.DataFrame]

HONEST = {
    "default": {},
    "historical": {"detector__scope": "historical"},
    "paper's score": {"detector__score": "paper"},
    "paper's score, historical": {"detector__score": "paper", "detector__scope": "historical"},
    "none": {"detector__name": "none"},
    "best, spikes in the pilot": {"detector__name": "best", "pilot__outliers": True},
    "bernoulli, low contamination": {
        "outliers__count": "bernoulli",
        "detector__contamination": 0.03,
    },
    "floor of a product that falls short": {"outliers__count": "floor", "rho": 0.29},
    "short plans, unsmoothed": {"planner__execute_actions": 1, "planner__smoothing": 0.0},
    "no noise, no spikes": {"sensor__noise_std": 0.0, "rho": 0.0},
    "a cut last action": {"budget": 147},
}


@pytest.fixture(scope="module")
def honest() -> Tables:
    return fly(CONFIGURATION)


@pytest.fixture(scope="module")
def historical() -> Tables:
    return fly(with_options(detector__scope="historical"))


@pytest.fixture
def tables(honest: Tables) -> Tables:
    return {name: table.copy() for name, table in honest.items()}


def failures(folder: Path) -> set[str]:
    [run] = [path.name.removeprefix("run=") for path in (folder / "curves").iterdir()]
    findings = audit_mission(folder, run, SEED, {"0" * 64: hills()})
    return {finding.check for finding in findings if not finding.holds}


@pytest.mark.parametrize("options", HONEST.values(), ids=HONEST.keys())
@pytest.mark.parametrize("seed", [0, 1])
def test_an_honest_mission_holds(tmp_path, options, seed):
    configuration = with_options(**options)
    run = store(tmp_path, configuration, fly(configuration, seed), seed=seed)
    findings = audit_mission(tmp_path, run, seed, {"0" * 64: hills()})
    assert [finding for finding in findings if not finding.holds or finding.omitted] == []
    assert len(findings) == 26
    assert {(finding.run, finding.seed) for finding in findings} == {(run, seed)}


# Tampering: (which table, what is done to it, the check that must notice).


def nth(table: pd.DataFrame, condition: pd.Series, n: int = 0) -> int:
    """Index of the n-th row that fulfils a condition."""
    return table.index[condition][n]


def move_a_sample(tables: Tables) -> None:
    tables["samples"].loc[77, "x1"] += 1e-4


def move_a_pilot_sample(tables: Tables) -> None:
    tables["samples"].loc[12, "x2"] += 1e-4


def turn_a_heading(tables: Tables) -> None:
    tables["samples"].loc[78, "heading"] += 1e-3


def turn_the_last_heading(tables: Tables) -> None:
    tables["samples"].loc[149, "heading"] += 1e-3


def leave_the_workspace(tables: Tables) -> None:
    tables["samples"].loc[80, "x2"] = 13.1


def unwrap_a_heading(tables: Tables) -> None:
    tables["samples"].loc[81, "heading"] += 2 * np.pi


def turn_on_the_spot_for_nothing(tables: Tables) -> None:
    # All the car does is turned around the pilot's end: every step and action stays in order.
    samples = tables["samples"]
    car, angle = samples["epoch"] > 0, np.pi / 8
    end = samples.loc[29, ["x1", "x2"]].to_numpy(dtype=float)
    away = samples.loc[car, ["x1", "x2"]].to_numpy() - end
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    samples.loc[car, ["x1", "x2"]] = end + away @ turn
    samples.loc[car, "heading"] = (samples.loc[car, "heading"] + angle) % (2 * np.pi)


def shift_an_epoch(tables: Tables) -> None:
    samples, curves = tables["samples"], tables["curves"]
    samples.loc[nth(samples, samples["epoch"] == 3), "epoch"] = 2
    curves.loc[2, "collected"] += 1


def drop_a_sample(tables: Tables) -> None:
    tables["samples"] = tables["samples"].drop(index=60)


def drop_a_row(tables: Tables) -> None:
    tables["curves"] = tables["curves"].drop(index=4)


def swap_epochs(tables: Tables) -> None:
    tables["samples"] = tables["samples"].iloc[[*range(98), 99, 98, *range(100, 150)]]
    tables["samples"]["epoch"] = np.sort(tables["samples"]["epoch"])


def change_collected(tables: Tables) -> None:
    tables["curves"].loc[5, "collected"] += 1


def change_a_seed(tables: Tables) -> None:
    tables["maps"].loc[3, "seed"] = SEED + 1


def change_a_label(tables: Tables) -> None:
    tables["curves"].loc[2, "scope"] = "historical"


def change_a_truth(tables: Tables) -> None:
    tables["samples"].loc[70, "truth"] += 0.1


def change_the_map_s_truth(tables: Tables) -> None:
    tables["maps"].loc[70, "truth"] += 0.1


def change_a_measurement(tables: Tables) -> None:
    samples = tables["samples"]
    samples.loc[nth(samples, ~samples["is_outlier"], 50), "measured"] += 9.0


def double_the_noise(tables: Tables) -> None:
    samples = tables["samples"]
    noise = samples["measured"] - samples["truth"]
    samples["measured"] += noise.where(~samples["is_outlier"], 0.0)


def bias_the_sensor(tables: Tables) -> None:
    samples = tables["samples"]
    samples["measured"] += np.where(samples["is_outlier"], 0.0, 0.6)


def change_a_nonfinite(tables: Tables) -> None:
    tables["maps"].loc[8, "std"] = np.inf


def relabel_a_spike(tables: Tables) -> None:
    samples = tables["samples"]
    samples.loc[nth(samples, samples["is_outlier"]), "is_outlier"] = False


def grow_a_spike(tables: Tables) -> None:
    samples = tables["samples"]
    i = nth(samples, samples["is_outlier"], 3)
    samples.loc[i, "measured"] = samples["truth"][i] + 3.0 * np.ptp(samples["truth"])


def shrink_a_spike(tables: Tables) -> None:
    samples = tables["samples"]
    size = (samples["measured"] - samples["truth"]).abs()
    samples.loc[size.idxmax(), "measured"] = samples["truth"][size.idxmax()] + 20.0


def flip_a_flag(tables: Tables) -> None:
    samples = tables["samples"]
    i = nth(samples, samples["flagged"], 2)
    samples.loc[i, ["flagged", "used"]] = [False, True]


def use_a_flagged_sample(tables: Tables) -> None:
    samples = tables["samples"]
    samples.loc[nth(samples, samples["flagged"], 2), "used"] = True


def change_a_score(tables: Tables) -> None:
    tables["samples"].loc[99, "score"] += 1e-6


def score_the_pilot(tables: Tables) -> None:
    tables["samples"].loc[3, "score"] = 1.0


def change_a_confusion_count(tables: Tables) -> None:
    tables["curves"].loc[4, ["fp", "tn"]] += [1, -1]


def judge_the_pilot(tables: Tables) -> None:
    tables["curves"].loc[0, "tn"] = 30


def change_accepted(tables: Tables) -> None:
    tables["curves"].loc[6, "accepted"] -= 1


def change_a_density(tables: Tables) -> None:
    tables["maps"].loc[40, "outlier_density"] += 1e-6


def change_a_mean(tables: Tables) -> None:
    tables["maps"].loc[33, "mean"] += 0.01


def change_a_std(tables: Tables) -> None:
    tables["maps"].loc[33, "std"] *= 1.001


def change_a_score_of_the_curve(column: str, row: int) -> Callable[[Tables], None]:
    def tamper(tables: Tables) -> None:
        row_label = tables["curves"].index[row]
        tables["curves"].loc[row_label, column] += 0.011

    tamper.__name__ = f"change_{column}_of_row_{row}"
    return tamper


def learn_below_the_floor(tables: Tables) -> None:
    tables["curves"].loc[3, "noise_std"] = 0.0099


def take_a_small_jitter(tables: Tables) -> None:
    tables["curves"].loc[3, "jitter"] = 1e-7


def swap_lengthscales(tables: Tables) -> None:
    curves = tables["curves"]
    swapped = curves[["lengthscale_2", "lengthscale_1"]].to_numpy()
    curves[["lengthscale_1", "lengthscale_2"]] = swapped


def reorder_the_map(tables: Tables) -> None:
    maps = tables["maps"]
    order = np.arange(len(maps)).reshape(9, 13).T.ravel()
    tables["maps"] = maps.iloc[order]


def drop_a_node(tables: Tables) -> None:
    tables["maps"] = tables["maps"].iloc[:-1]


TAMPERING = [
    (move_a_sample, "steps"),
    (move_a_pilot_sample, "pilot"),
    (turn_a_heading, "steps"),
    (turn_the_last_heading, "actions"),
    (leave_the_workspace, "workspace"),
    (unwrap_a_heading, "workspace"),
    (turn_on_the_spot_for_nothing, "spot turns"),
    (shift_an_epoch, "actions"),
    (drop_a_sample, "rows"),
    (drop_a_row, "rows"),
    (swap_epochs, "steps"),
    (change_collected, "rows"),
    (change_a_seed, "files"),
    (change_a_label, "configuration"),
    (change_a_truth, "truth"),
    (change_the_map_s_truth, "truth"),
    (change_a_measurement, "sensor"),
    (double_the_noise, "sensor"),
    (bias_the_sensor, "sensor"),
    (change_a_nonfinite, "values"),
    (relabel_a_spike, "spike count"),
    (grow_a_spike, "spike size"),
    (shrink_a_spike, "spike size"),
    (flip_a_flag, "flags"),
    (use_a_flagged_sample, "flags"),
    (use_a_flagged_sample, "final model"),
    (change_a_score, "scores"),
    (score_the_pilot, "scores"),
    (change_a_confusion_count, "confusion"),
    (judge_the_pilot, "confusion"),
    (change_accepted, "confusion"),
    (change_a_density, "outlier density"),
    (change_a_mean, "final model"),
    (change_a_mean, "final scores"),
    (change_a_std, "final model"),
    (learn_below_the_floor, "hyperparameters"),
    (take_a_small_jitter, "hyperparameters"),
    (swap_lengthscales, "final model"),
    (swap_lengthscales, "earlier models"),
    (reorder_the_map, "grid"),
    (drop_a_node, "files"),
    *(
        (change_a_score_of_the_curve(column, -1), "final scores")
        for column in ("rmse", "mae", "nlpd", "coverage95", "crps", "msll", "rmse_flat")
    ),
    *(
        (change_a_score_of_the_curve(column, row), "bounds")
        for column in ("smse", "rmse_middle", "rmse_rugged", "path_length")
        for row in (0, 2, -1)
    ),
    (change_a_score_of_the_curve("lml", -1), "final model"),
    *(
        (change_a_score_of_the_curve(column, row), "earlier models")
        for column in ("rmse", "mae", "nlpd", "coverage95", "lml", "crps", "msll", "rmse_flat")
        for row in (0, 3)
    ),
]


@pytest.mark.parametrize(
    ("tamper", "check"), TAMPERING, ids=lambda value: getattr(value, "__name__", value)
)
def test_tampering_is_noticed(tmp_path, tables, tamper, check):
    tamper(tables)
    store(tmp_path, CONFIGURATION, tables)
    assert check in failures(tmp_path)


def test_a_historical_row_is_judged_again(tmp_path, historical):
    configuration = with_options(detector__scope="historical")
    tables = {name: table.copy() for name, table in historical.items()}
    tables["curves"].loc[3, "rmse"] += 0.01
    store(tmp_path, configuration, tables)
    assert failures(tmp_path) == {"earlier models", "bounds"}


CLAIMS = [
    ({"robot__speed": 0.51}, "steps"),
    ({"robot__samples_per_action": 3}, "actions"),
    ({"robot__max_steering": 0.16}, "actions"),
    ({"robot__steering_angles": 3}, "actions"),
    ({"planner__execute_actions": 1}, "actions"),
    ({"planner__smoothing": 1.6}, "outlier density"),
    ({"planner__name": "uct"}, "configuration"),
    ({"detector__contamination": 0.2}, "flags"),
    ({"detector__score": "paper"}, "scores"),
    ({"detector__scope": "historical"}, "scores"),
    ({"detector__name": "best"}, "flags"),
    ({"detector__name": "none"}, "flags"),
    ({"terrain__extent": [-2.0, 18.0, 1.0, 13.1]}, "grid"),
    ({"pilot__samples": 29}, "rows"),
    ({"pilot__outliers": True}, "spike count"),
    ({"pilot__control_points": [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5]]}, "pilot"),
    ({"sensor__noise_std": 2.0}, "sensor"),
    ({"sensor__noise_std": 0.0}, "sensor"),
    ({"outliers__amplitude": [0.1, 0.9]}, "spike size"),
    ({"outliers__amplitude": [2.1, 3.0]}, "spike size"),
    ({"outliers__quantiles": [0.45, 0.55]}, "spike size"),
    ({"outliers__count": "floor"}, "spike count"),
    ({"outliers__count": "bernoulli", "rho": 0.9}, "spike count"),
    ({"rho": 0.25}, "spike count"),
    ({"model__min_noise_variance": 0.1}, "hyperparameters"),
    ({"model__jitter": 1e-3}, "hyperparameters"),
    ({"model__pilot_iterations": 0, "model__amplitude": 2.0}, "hyperparameters"),
    ({"budget": 151}, "rows"),
    ({"grid": [13, 9]}, "grid"),
]


@pytest.mark.parametrize(("options", "check"), CLAIMS, ids=lambda value: str(value))
def test_a_configuration_that_was_not_flown_is_noticed(tmp_path, honest, options, check):
    store(tmp_path, with_options(**options), honest)
    assert check in failures(tmp_path)


def test_a_changed_yaml_differs_from_the_footers(tmp_path, honest):
    store(tmp_path, CONFIGURATION, honest)
    path = tmp_path / "runs" / f"{RUN}.yaml"
    path.write_text(path.read_text().replace("exploration: 0.3", "exploration: 0.4"))
    assert "another configuration than its run's" in only_finding(tmp_path).detail


def test_a_footer_of_another_seed_is_noticed(tmp_path, honest):
    store(tmp_path, CONFIGURATION, honest, footer={"seed": SEED + 1})
    assert f"belongs to {RUN} seed {SEED + 1}" in only_finding(tmp_path).detail


def test_an_option_that_is_missing_is_named(tmp_path, honest):
    configuration = with_options()
    del configuration["planner"]["smoothing"]
    run = store(tmp_path, configuration, honest)
    [finding] = audit_mission(tmp_path, run, SEED)
    assert "planner.smoothing is missing" in finding.detail


# The draws of spikes: a long mission with little noise tells even small deviations.


@pytest.fixture(scope="module")
def long_options() -> dict:
    return {"budget": 500, "rho": 0.4, "sensor__noise_std": 0.01, "detector__name": "none"}


@pytest.fixture(scope="module")
def long_mission(long_options) -> Tables:
    return fly(with_options(**long_options))


def test_even_draws_of_spikes_hold(tmp_path, long_mission, long_options):
    store(tmp_path, with_options(**long_options), long_mission)
    assert failures(tmp_path) == set()


def test_spikes_of_one_sign_are_noticed(tmp_path, long_mission, long_options):
    samples = long_mission["samples"].copy()
    upwards = samples["truth"] + (samples["measured"] - samples["truth"]).abs()
    samples["measured"] = upwards.where(samples["is_outlier"], samples["measured"])
    store(tmp_path, with_options(**long_options), {**long_mission, "samples": samples})
    found = failures(tmp_path)
    assert "spike draws" in found
    assert "spike size" not in found


def test_amplitudes_that_are_not_uniform_are_noticed(tmp_path, long_mission, long_options):
    store(tmp_path, with_options(**long_options, outliers__amplitude=[0.5, 2.0]), long_mission)
    assert failures(tmp_path) == {"spike draws"}


def test_spikes_that_always_come_first_are_noticed(tmp_path, long_mission, long_options):
    samples = long_mission["samples"].copy()
    samples["noise"] = samples["measured"] - samples["truth"]
    for _, batch in samples.groupby("epoch"):
        order = batch.sort_values("is_outlier", ascending=False, kind="stable")
        for column in ("noise", "is_outlier"):
            samples.loc[batch.index, column] = order[column].to_numpy()
    samples["measured"] = samples["truth"] + samples.pop("noise")
    store(tmp_path, with_options(**long_options), {**long_mission, "samples": samples})
    found = failures(tmp_path)
    assert "spike draws" in found
    assert "spike count" not in found


# Files


def only_finding(folder: Path) -> Finding:
    [finding] = audit_mission(folder, RUN, SEED)
    assert finding.check == "files"
    assert not finding.holds
    return finding


@pytest.mark.parametrize("table", ["curves", "samples", "maps"])
def test_a_truncated_table_is_a_failed_finding(tmp_path, honest, table):
    store(tmp_path, CONFIGURATION, honest)
    path = table_path(tmp_path, table)
    path.write_bytes(path.read_bytes()[:-200])
    assert table in only_finding(tmp_path).detail


def test_a_foreign_table_is_a_failed_finding(tmp_path, honest):
    store(tmp_path, CONFIGURATION, honest)
    pq.write_table(pa.table({"depth": [1.0]}), table_path(tmp_path, "samples"))
    assert "samples" in only_finding(tmp_path).detail


def test_a_missing_table_is_a_failed_finding(tmp_path, honest):
    store(tmp_path, CONFIGURATION, honest)
    table_path(tmp_path, "maps").unlink()
    assert "maps" in only_finding(tmp_path).detail


@pytest.mark.parametrize("text", [None, "a: [1", "just words", ""])
def test_a_yaml_that_is_none_is_a_failed_finding(tmp_path, honest, text):
    store(tmp_path, CONFIGURATION, honest)
    path = tmp_path / "runs" / f"{RUN}.yaml"
    path.unlink() if text is None else path.write_text(text)
    assert RUN in only_finding(tmp_path).detail


@pytest.mark.parametrize(
    ("table", "column", "values", "word"),
    [
        ("samples", "flagged", lambda column: column.astype(np.int64), "flagged"),
        ("maps", "mean", lambda column: column.astype(np.float32), "mean"),
        ("curves", "planner", lambda column: np.zeros(len(column)), "planner"),
        ("curves", "epoch", lambda column: column.astype(float), "epoch"),
        ("curves", "run", lambda column: [RUN] * 12, "partition"),
    ],
)
def test_a_column_of_another_type_is_a_failed_finding(
    tmp_path, tables, table, column, values, word
):
    tables[table][column] = values(tables[table].get(column))
    store(tmp_path, CONFIGURATION, tables)
    assert word in only_finding(tmp_path).detail


def test_a_missing_value_is_a_failed_finding(tmp_path, honest):
    store(tmp_path, CONFIGURATION, honest)
    path = table_path(tmp_path, "samples")
    table = pq.ParquetFile(path).read()
    measured = pa.array([None, *table["measured"].to_pylist()[1:]], pa.float64())
    where = table.column_names.index("measured")
    pq.write_table(table.set_column(where, "measured", measured), path)
    assert "measured" in only_finding(tmp_path).detail


def test_more_columns_and_a_dictionary_of_names_are_allowed(tmp_path, tables):
    tables["curves"]["weather"] = "fine"
    store(tmp_path, CONFIGURATION, tables)
    path = table_path(tmp_path, "curves")
    table = pq.ParquetFile(path).read()
    where = table.column_names.index("planner")
    pq.write_table(table.set_column(where, "planner", table["planner"].dictionary_encode()), path)
    assert failures(tmp_path) == set()


def test_tables_that_cannot_be_recomputed_fail_without_a_crash(tmp_path, tables):
    tables["samples"]["measured"] = np.nan
    store(tmp_path, CONFIGURATION, tables)
    assert {"values", "sensor", "scores", "final model"} <= failures(tmp_path)


# Many missions


@pytest.fixture
def study(tmp_path, honest) -> Path:
    """Three missions of two runs, one that is not finished, and a file still being written."""
    configuration = with_options(planner__name="uct", detector__name="none")
    store(tmp_path, CONFIGURATION, honest)
    for seed in (0, 11, 12):
        other = store(tmp_path, configuration, fly(configuration, seed), seed=seed)
    curve = table_path(tmp_path, "curves", other, 12)
    curve.rename(curve.with_name(f".{curve.name}.1234"))
    return tmp_path


def test_all_finished_missions_are_audited(study):
    findings = list(audit(study))
    missions = dict.fromkeys((finding.run[:4], finding.seed) for finding in findings)
    assert list(missions) == [("puct", SEED), ("uct-", 0), ("uct-", 11)]
    assert all(finding.holds for finding in findings)
    assert {finding.detail for finding in findings if finding.check == "truth"} == {""}


def test_one_damaged_mission_does_not_hide_the_others(study):
    table_path(study, "samples").write_bytes(b"PAR1")
    findings = list(audit(study))
    assert [finding.run for finding in findings if not finding.holds] == [RUN]
    assert len({finding.seed for finding in findings if finding.holds}) == 2


def test_runs_and_seeds_are_chosen(study):
    other = next(finding.run for finding in audit(study) if finding.run != RUN)
    assert {finding.seed for finding in audit(study, run=other)} == {0, 11}
    assert {finding.run for finding in audit(study, seeds=[SEED])} == {RUN}
    assert {finding.seed for finding in audit(study, run=other, seeds=[11])} == {11}


def test_what_is_not_stored_cannot_be_audited(study, tmp_path_factory):
    with pytest.raises(UsageError, match="no finished mission"):
        audit(tmp_path_factory.mktemp("empty"))
    with pytest.raises(UsageError, match=f"run=nothing.*{RUN}"):
        audit(study, run="nothing")
    with pytest.raises(UsageError, match=r"seed 12 of any run is not stored .*0, 3, 11"):
        audit(study, seeds=[0, 12])


def test_another_terrain_is_not_compared(tmp_path, honest):
    store(tmp_path, CONFIGURATION, honest)
    assert all(finding.holds for finding in audit(tmp_path, terrains={"1" * 64: np.zeros((2, 2))}))
    findings = audit(tmp_path, terrains={"0" * 64: hills() + 1.0})
    assert [finding.check for finding in findings if not finding.holds] == ["truth"]


# The table of findings


def test_findings_are_rendered_by_run_and_check():
    findings = [
        Finding("run-a", 0, "steps", True, "10 steps"),
        Finding("run-a", 0, "flags", True, "1 flag"),
        Finding("run-a", 1, "steps", False, "sample 3 (epoch 1) is off"),
        Finding("run-a", 1, "flags", True, "2 flags"),
        Finding("run-b", 0, "steps", True, "12 steps"),
    ]
    lines = [" ".join(line.split()) for line in render(iter(findings)).splitlines() if line]
    assert lines == [
        "run-a: 2 missions",
        "steps FAILS 1 of 2 seed 1: sample 3 (epoch 1) is off",
        "flags holds 2 of 2",
        "run-b: 1 mission",
        "steps holds 1 of 1 12 steps",
        "3 missions, 5 checks: 1 FAIL",
    ]


def test_a_clean_study_renders_its_verdict(study):
    shutil.rmtree(study / "curves" / f"run={RUN}")
    text = render(audit(study))
    assert text.endswith("2 missions, 52 checks: all hold, 2 in part")
    assert "not recomputed: the truth, taken from the tables: the map file-hills" in text
    assert "FAILS" not in text
