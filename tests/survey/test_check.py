"""Planted spikes and agreement are what one counts by hand."""

import re

import numpy as np
import survey_detector
from survey_logs import QUICK, write_log

from infoplan.cli import main


def rows_of(told: str, title: str) -> dict[str, list[str]]:
    """Cells of the table below a title, by the first of each row."""
    lines = told[told.index(title) :].splitlines()[1:]
    cells = [re.split(r" {2,}", line.strip()) for line in lines if line.strip()]
    found = {}
    for first, *rest in cells:
        if first.startswith("Agreement"):
            break
        found[first] = rest
    return found


def test_planted_spikes_and_agreement_agree_with_counts_by_hand(tmp_path, capsys):
    log = write_log(tmp_path / "bay.csv")
    words = ["survey", str(log), f"results_dir={tmp_path / 'results'}", *QUICK, "check=0.1",
             "detector=own", "detector.function=survey_detector.far"]  # fmt: skip
    survey_detector.ASKED.clear()
    assert main(words) == 0
    told = capsys.readouterr().out
    log_itself, copy = survey_detector.ASKED[-2:]
    planted = copy != log_itself
    assert planted.sum() == 8
    low, high = np.quantile(log_itself, [0.05, 0.95])
    size = np.abs(copy - log_itself)[planted] / (high - low)
    assert (size >= 1).all()
    assert (size <= 2).all()

    def flags(measured):
        return np.abs(measured - np.median(measured)) > 4

    rows = rows_of(told, "Detectors on the log")
    assert rows["far"][:3] == [
        str(flags(log_itself).sum()),
        f"{(flags(copy) & planted).sum()} of 8",
        str((flags(copy) & ~planted).sum()),
    ]
    assert set(rows) >= {"far", "gp_residual", "copod", "local", "hampel", "qartod"}
    both = rows_of(told, "Agreement: samples")
    assert both["far"][0] == str(flags(log_itself).sum()) == rows["far"][0]
    names = both["flagged by both"]
    for i, a in enumerate(names):
        for j, b in enumerate(names):
            assert both[a][j] == both[b][i]
            assert int(both[a][j]) <= min(int(both[a][i]), int(both[b][j]))
    # The three spikes of the log stand out for all that look at neighbours.
    assert both["local"][names.index("hampel")] == "3"


def test_a_share_without_a_spike_is_told(tmp_path, capsys):
    log = write_log(tmp_path / "bay.csv")
    words = ["survey", str(log), f"results_dir={tmp_path / 'results'}", *QUICK]
    assert main([*words, "check=0.001"]) == 2
    assert "check=0.001 of 80 samples is no spike: make it larger" in capsys.readouterr().err
    assert main([*words, "check=0.7"]) == 2
    assert "check=0.7 is not possible" in capsys.readouterr().err
