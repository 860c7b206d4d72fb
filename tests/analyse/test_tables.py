"""Which missions belong together."""

import shutil

import made_tables
import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from infoplan.analyse import (
    find_missions,
    find_study,
    judge_claims,
    load_curves,
    load_maps,
    load_samples,
    summarise,
)
from infoplan.analyse.configurations import differing
from infoplan.errors import RunError, UsageError


def test_tables_come_with_their_labels(tmp_path):
    run = made_tables.store(tmp_path, "uct-copod", rho=0.05, seed=3, rmse=[3, 2, 1])
    made_tables.store(tmp_path, "uct-none", rho=0.05, seed=3)
    for load, rows in ((load_curves, 3), (load_samples, 4), (load_maps, made_tables.SIDE**2)):
        table = load(tmp_path, method="UCT-COPOD")
        assert len(table) == rows
        labels = table[["run", "method", "scope", "rho", "seed"]].drop_duplicates()
        assert labels.to_numpy().tolist() == [[run, "UCT-COPOD", "batch", 0.05, 3]]
    assert load_curves(tmp_path)["method"].nunique() == 2


@pytest.mark.parametrize(
    ("filters", "missions"),
    [
        ({}, 6),
        ({"rho": 0.1}, 4),
        ({"rho": [0.05, 0.1]}, 6),
        ({"method": "uct-none"}, 3),
        ({"seed": [1, 9]}, 2),
        ({"detector": "copod", "seed": 0}, 2),
        ({"planner.exploration": 0.3}, 6),
        ({"detector.contamination": 0.1}, 6),
        ({"terrain": None}, 6),
    ],
)
def test_filters(tmp_path, filters, missions):
    for method in ("uct-none", "puct-copod"):
        for rho, seed in ((0.1, 0), (0.1, 1), (0.05, 0)):
            made_tables.store(tmp_path, method, rho, seed=seed)
    assert len(find_missions(tmp_path, **filters).missions) == missions


def test_a_run_is_found_by_its_hash(tmp_path):
    run = made_tables.store(tmp_path, "uct-none")
    made_tables.store(tmp_path, "uct-best")
    assert list(find_missions(tmp_path, run=run[-8:]).options) == [run]


def test_helens_is_the_default_terrain_if_it_is_there(tmp_path):
    made_tables.store(tmp_path, "uct-none", terrain="volcano")
    assert find_missions(tmp_path).terrain == "volcano"
    made_tables.store(tmp_path, "uct-none")
    chosen = find_missions(tmp_path)
    assert chosen.terrain == "helens"
    assert chosen.notes == ("missions on volcano (1) left out; choose with terrain=",)
    assert find_missions(tmp_path, terrain="helens").notes == ()
    assert find_missions(tmp_path, terrain="volcano").terrain == "volcano"


@pytest.mark.parametrize(
    ("second", "message"),
    [
        ({"terrain": "jacksboro"}, r"terrains, jacksboro \(1\), volcano \(2\).*terrain="),
        ({"collected": [100, 1000, 1500]}, r"budgets, 1500 \(1\), 2000 \(2\).*budget="),
        ({"terrain__extent": [0.0, 90.0, 0.0, 90.0]}, "different maps called volcano.*extent"),
        ({"terrain__sha256": "1" * 64}, "different maps called volcano.*sha256"),
    ],
)
def test_what_does_not_belong_together_is_refused(tmp_path, second, message):
    for seed in (0, 1):
        made_tables.store(tmp_path, "uct-none", seed=seed, terrain="volcano")
    made_tables.store(tmp_path, "uct-best", **{"terrain": "volcano", **second})
    with pytest.raises(UsageError, match=message):
        load_curves(tmp_path)


def test_tables_of_another_schema_are_refused(tmp_path):
    made_tables.store(tmp_path, "uct-none", schema_version=0)
    with pytest.raises(RunError, match="schema version 0, but this infoplan reads version 1"):
        find_missions(tmp_path)


def test_a_study_takes_the_default_options_and_says_so(tmp_path):
    usual = made_tables.store(tmp_path, "puct-copod")
    other = made_tables.store(tmp_path, "puct-copod", planner__exploration=0.5)
    study = find_study(tmp_path)
    assert list(study.options) == [usual]
    assert "1 run with other than the default planner.exploration is left out" in study.notes[0]
    chosen = find_study(tmp_path, **{"planner.exploration": 0.5})
    assert list(chosen.options) == [other]
    assert not chosen.notes


def test_a_study_without_the_default_options_is_refused(tmp_path):
    made_tables.store(tmp_path, "puct-copod", model__iterations=7)
    made_tables.store(tmp_path, "uct-copod", model__iterations="per_sample")
    with pytest.raises(UsageError, match=r"model.iterations \(7, per_sample\).*model.iterations=7"):
        find_study(tmp_path)


def test_an_option_that_all_share_need_not_be_the_default(tmp_path):
    made_tables.store(tmp_path, "puct-copod", model__iterations=7)
    made_tables.store(tmp_path, "uct-none", model__iterations=7)
    assert len(find_study(tmp_path).options) == 2


def test_options_of_copod_go_with_any_other_method(tmp_path):
    none = made_tables.store(tmp_path, "uct-none")
    tuned = made_tables.store(tmp_path, "uct-copod", detector__contamination=0.2)
    usual = made_tables.store(tmp_path, "uct-copod")
    assert set(find_study(tmp_path).options) == {none, usual}
    assert set(find_study(tmp_path, **{"detector.contamination": 0.2}).options) == {none, tuned}


def test_a_method_is_found_under_its_scope(tmp_path):
    none = made_tables.store(tmp_path, "uct-none")
    batch = made_tables.store(tmp_path, "uct-copod")
    historical = made_tables.store(tmp_path, "uct-copod", scope="historical", seed=4)
    study = find_study(tmp_path)
    assert study.run("UCT-NONE", 0.1, "historical") == none
    assert study.run("UCT-COPOD", 0.1) == batch
    assert study.run("UCT-COPOD", 0.1, "historical") == historical
    assert study.run("UCT-COPOD", 0.15) is None
    assert study.seeds(historical) == [4]
    assert study.only([none, batch], [0]).missions["run"].to_list() == [none, batch][::-1]


def test_unequal_seeds_are_told(tmp_path):
    for seed in (0, 1):
        made_tables.store(tmp_path, "uct-none", seed=seed)
    made_tables.store(tmp_path, "uct-best")
    assert find_study(tmp_path).notes == (
        "the runs have 1 to 2 seeds; pairs use the seeds both have",
    )


def test_no_results_is_one_sentence(tmp_path):
    with pytest.raises(UsageError, match="holds no finished mission: make some with infoplan run"):
        find_missions(tmp_path / "nowhere")


def test_unknown_filters_and_values_are_named(tmp_path):
    made_tables.store(tmp_path, "uct-none")
    with pytest.raises(UsageError, match=r"did you mean 'planner.exploration'"):
        find_missions(tmp_path, **{"planner.exploratoin": 1})
    with pytest.raises(UsageError, match=r"no mission with rho=0.2: there is 0.1 \(1\)"):
        find_missions(tmp_path, rho=0.2)


@pytest.mark.parametrize("table", ["curves", "maps"])
def test_a_damaged_table_is_named(tmp_path, table):
    run = made_tables.store(tmp_path, "uct-none")
    path = tmp_path / table / f"run={run}" / "seed=0.parquet"
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(RunError, match=f"{table}/run={run}/seed=0.parquet"):
        (load_curves if table == "curves" else load_maps)(tmp_path)


def test_scratch_files_are_no_missions(tmp_path):
    run = made_tables.store(tmp_path, "uct-none")
    folder = tmp_path / "curves" / f"run={run}"
    (folder / ".seed=1.parquet.0123").write_bytes(b"half a table")
    assert find_missions(tmp_path).seeds(run) == [0]


def test_made_up_truth_is_what_the_tests_say():
    truth = made_tables.truth()
    assert truth.std() == pytest.approx(100.0)
    assert np.abs(np.diff(truth[:, :14])).max() < 1.0
    assert np.abs(np.diff(truth[:, 15:])).min() > 100.0


@pytest.mark.parametrize("table", ["curves", "samples", "maps"])
@pytest.mark.parametrize("foreign", ["seed", "run"])
def test_another_mission_s_table_is_refused(tmp_path, table, foreign):
    run = made_tables.store(tmp_path, "uct-none", seed=0)
    made_tables.store(tmp_path, "uct-none", seed=1)
    other = made_tables.store(tmp_path, "uct-best", seed=1)
    folder = tmp_path / table
    source = (run, 0) if foreign == "seed" else (other, 1)
    path = folder / f"run={run}" / "seed=1.parquet"
    shutil.copy(folder / f"run={source[0]}" / f"seed={source[1]}.parquet", path)
    with pytest.raises(RunError, match=rf"{table}.*belongs to {source[0]} seed {source[1]}"):
        load_curves(tmp_path)


@pytest.mark.parametrize("table", ["curves", "samples", "maps"])
def test_changed_values_are_refused(tmp_path, table):
    run = made_tables.store(tmp_path, "uct-none", seed=0)
    path = tmp_path / table / f"run={run}" / "seed=0.parquet"
    stored = pq.read_table(path, partitioning=None)
    doubled = pc.multiply(stored["seed"], 2)
    changed = stored.append_column("twice", doubled)
    pq.write_table(changed, path)
    with pytest.raises(RunError, match="does not hold the values that were written"):
        find_missions(tmp_path)


def test_options_in_which_runs_differ_are_columns(tmp_path):
    none = made_tables.store(tmp_path, "uct-none", planner__exploration=0.25)
    half = made_tables.store(tmp_path, "uct-copod", planner__exploration=0.5)
    own = made_tables.store(
        tmp_path, "uct-copod", detector__contamination=0.2, model__iterations="per_sample"
    )
    wide = made_tables.store(tmp_path, "uct-best", grid=[20, 30])
    study = find_missions(tmp_path)
    named = ["grid", "planner.exploration", "detector.contamination", "model.iterations"]
    assert sorted(differing(study.options)) == sorted(named)
    for load in (load_curves, load_samples, load_maps):
        table = load(study)
        assert sorted(table.columns[-4:]) == sorted(named)
        first = table.groupby("run").first()
        assert first.loc[half, "planner.exploration"] == 0.5
        assert first.loc[none, "planner.exploration"] == 0.25
        assert first.loc[own, "detector.contamination"] == 0.2
        assert np.isnan(first.loc[none, "detector.contamination"])
        assert first.loc[own, "model.iterations"] == "per_sample"
        assert first.loc[none, "model.iterations"] == 5
        assert first.loc[wide, "grid"] == "[20,30]"
    summary = summarise(load_curves(study)).droplevel("seed")
    assert summary.loc[half, "planner.exploration"] == 0.5
    assert summary.loc[wide, "grid"] == "[20,30]"
    assert set(summary.columns) >= set(named)
    alone = load_curves(tmp_path, run=half)
    assert list(alone.columns) == [name for name in load_curves(study) if name not in named]


def test_labels_and_what_belongs_to_another_choice_do_not_differ():
    first = {"planner.name": "uct", "rho": 0.1, "terrain.name": "x", "terrain.sha256": "1",
             "detector.name": "none", "budget": 5}  # fmt: skip
    copod = first | {"rho": 0.2, "terrain.name": "y", "terrain.sha256": "2",
                     "detector.name": "copod", "detector.contamination": 0.1}  # fmt: skip
    pyod = copod | {"detector.name": "pyod_knn", "detector.contamination": 0.3}
    assert differing({"a": first, "b": copod, "c": pyod}) == []
    other = copod | {"terrain.sha256": "3", "budget": 6, "detector.contamination": 0.2}
    found = differing({"a": first, "b": copod, "c": pyod, "d": other})
    assert set(found) == {"terrain.sha256", "budget", "detector.contamination"}


def test_a_filter_is_told_to_the_last_digit(tmp_path):
    made_tables.store(tmp_path, "puct-copod", robot__max_steering=0.26179939)
    made_tables.store(tmp_path, "uct-copod", robot__max_steering=0.3)
    with pytest.raises(UsageError, match=r"choose with robot.max_steering=0.26179939 or"):
        find_study(tmp_path)


def test_a_selection_is_short_in_a_notebook(tmp_path):
    folder = tmp_path / "<b>"
    made_tables.store(folder, "uct-none", planner__exploration=0.25)
    run = made_tables.store(folder, "uct-none", planner__exploration=0.5)
    study = find_missions(folder)
    assert repr(study) == f"Selection(2 runs, 2 missions: helens, budget 2000, in {folder})"
    page = study._repr_html_()
    assert f"<td>{run}</td><td>0</td><td>0.5</td>" in page
    assert "<b>" not in page
    (claim,) = judge_claims(study.only([run]), ["C3"])
    assert repr(claim).startswith("Claim(C3 missing: rho 0.10: UCT-NONE falls")
