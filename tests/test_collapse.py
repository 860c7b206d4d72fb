"""A model whose lengthscale is below the distance of two samples: stored, told, audited."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analyse.test_audit_methods import touch
from command import SMALL

from infoplan.analyse import load_curves, load_samples
from infoplan.analyse.audit import audit
from infoplan.analyse.curves import collapse
from infoplan.cli import main
from infoplan.collapse import collapse_sentence, has_collapsed

OLD = Path(__file__).parent / "data" / "results-0.1.0"
FIXED = ["model.pilot_iterations=0", "model.iterations=0", "detector=none", "seeds=[2,3]"]
SENTENCE = (
    "2 of 2 missions end with a lengthscale below the distance of two samples: their model has "
    "collapsed; try model.restarts=3 (gp, student_t, vecchia), or see docs/collapse.md"
)


def flown(folder, lengthscale):
    words = [word for word in SMALL if not word.startswith(("seeds", "model"))]
    assert main(["run", *words, *FIXED, f"model.lengthscale={lengthscale}", "backend=sequential",
                 f"results_dir={folder}"]) == 0  # fmt: skip


def said(capfd):
    return " ".join(capfd.readouterr().out.split())


def test_the_smaller_lengthscale_counts_in_workspace_units():
    pilot = np.array([[0.0, 10.0], [50.0, 30.0], [25.0, 20.0]])  # 25 and 10 units a scaled one
    assert has_collapsed([0.1, 0.069], pilot, 0.7)
    assert not has_collapsed([0.1, 0.07], pilot, 0.7)
    assert has_collapsed([0.027, 0.5], pilot, 0.7)
    assert not has_collapsed([0.028, 0.5], pilot, 0.7)
    assert has_collapsed([np.nan, 0.5], pilot, 0.7) is None


def test_the_sentence_counts_what_is_known():
    assert collapse_sentence([False, None]) == collapse_sentence([]) == ""
    assert collapse_sentence([True, False, None, True]).startswith("2 of 3 missions end with")
    assert collapse_sentence([True]).startswith("the mission ends with")


def test_a_collapsed_mission_is_stored_told_and_audited(tmp_path, capfd):
    flown(tmp_path, 0.02)
    table = said(capfd)
    assert SENTENCE in table
    assert "2 of 2" in table
    assert load_curves(tmp_path)["collapsed"].tolist() == [True] * len(load_curves(tmp_path))
    assert main(["show", f"results_dir={tmp_path}"]) == 0
    assert SENTENCE in said(capfd)
    assert main(["report", f"results_dir={tmp_path}"]) == 0
    assert f"{SENTENCE[:80]}" in " ".join((tmp_path / "report.html").read_text().split())
    assert all(finding.holds for finding in audit(tmp_path))
    run = load_curves(tmp_path)["run"].iloc[0]
    touch(tmp_path, "curves", run, "collapsed", lambda value: not value)
    assert {finding.check for finding in audit(tmp_path) if not finding.holds} == {
        "hyperparameters"
    }


def test_a_sound_mission_says_nothing(tmp_path, capfd):
    flown(tmp_path, 0.5)
    table = said(capfd)
    assert "0 of 2" in table
    assert "model has collapsed" not in table
    assert main(["show", f"results_dir={tmp_path}"]) == 0
    assert "collapsed" not in said(capfd)
    assert not load_curves(tmp_path)["collapsed"].any()


@pytest.mark.parametrize("speed", [0.7, 12.0])
def test_older_results_are_judged_by_their_lengthscales(tmp_path, speed, monkeypatch):
    """Of a robot that fast every one of them has collapsed."""
    folder = tmp_path / "old"
    shutil.copytree(OLD, folder)
    curves, samples = load_curves(folder), load_samples(folder)
    assert curves["collapsed"].isna().all()
    if speed != 0.7:
        import infoplan.study.stored_curves as stored

        kept = stored.has_collapsed
        monkeypatch.setattr(stored, "has_collapsed", lambda scales, x, _: kept(scales, x, speed))
    expected = 0
    for (run, seed), rows in curves.groupby(["run", "seed"]):
        own = samples[(samples["run"] == run) & (samples["seed"] == seed) & (samples["epoch"] == 0)]
        last = rows.iloc[-1]
        units = [(own[axis].max() - own[axis].min()) / 2 for axis in ("x1", "x2")]
        lengths = [last["lengthscale_1"] * units[0], last["lengthscale_2"] * units[1]]
        expected += min(lengths) < speed
    number = len(curves.groupby(["run", "seed"]))
    found = collapse(curves, folder)
    assert (f"{expected} of {number} missions" in found) if expected else found == ""
    assert pd.isna(load_curves(folder)["collapsed"]).all()
