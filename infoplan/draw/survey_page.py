"""A survey as one HTML page to send: map, track, flagged samples, several detectors."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from infoplan.analyse.detector_check import agreement
from infoplan.analyse.later_logs import COUNTS, COUNTS_TITLE, read_origins, verdict_counts
from infoplan.analyse.stretches import read_stretches
from infoplan.analyse.verdicts import Verdict, survey_verdicts
from infoplan.draw.page import as_html, fill_page, html_table, sentence, write_page
from infoplan.draw.survey_page_data import page_data, sources_of
from infoplan.draw.survey_table import score_lines
from infoplan.study.store import read_table
from infoplan.study.study import Study
from infoplan.survey import SurveyLog
from infoplan.wording import counted, figure, harmless

Booleans = NDArray[np.bool_]


def write_survey_page(path: Path, study: Study, log: SurveyLog) -> str:
    """Write the page of a survey.

    Parameters
    ----------
    path
        The file; its folder is made.
    study
        Of one survey, done.
    log
        As read.

    Returns
    -------
    str
        A sentence on the file.

    Raises
    ------
    RunError
        If a table cannot be read or the page cannot be written.
    """
    run, (seed,) = study.runs[0]
    samples, maps, curve = (
        read_table(study.results_dir, name, run.name, seed).to_pandas()
        for name in ("samples", "maps", "curves")
    )
    origins = read_origins(study.results_dir, run.name, seed)
    counts = None if origins is None else verdict_counts(origins, samples)
    told = samples["measured"].notna().to_numpy()
    samples, sources = samples[told], sources_of(log)[told]
    verdicts, remarks = survey_verdicts(samples, curve.iloc[-1].to_dict(), run.config)
    own = next(iter(verdicts))
    later = None if origins is None else origins["verdict"][told].fillna("").tolist()
    data = page_data(samples, sources, maps, verdicts, log, run.config.terrain, later)
    data["belongs"] = (
        f"The map is that of {own}, with which the survey was done: another choice shows the "
        "flags, scores and expected values of another detector on the same map."
    )
    where = f"the plane {log.crs}" if log.crs else "a plane of the log's own"
    parts = {
        "title": as_html(log.name),
        "subtitle": as_html(
            f"{counted(len(samples), 'sample')} of {data['value']} {unit_words(log.unit)}, on "
            f"{where if len(where) < 30 else 'the plane of a projection'}"
        ),
        "later": "" if counts is None else _later(counts),
        "detectors": _detectors(verdicts, remarks),
        "numbers": _numbers(log, int((~told).sum()), run.name, score_lines(
            read_stretches(study.results_dir, run.name, seed), log.unit)),
    }  # fmt: skip
    write_page(path, fill_survey_page(data, parts))
    return f"{path.name}: the map to look around in, flags of {', '.join(verdicts)}"


def fill_survey_page(data: Mapping[str, Any], parts: dict[str, str]) -> str:
    """Put the page together, of the data of `page_data` and the parts that are HTML."""
    return fill_page("survey_page", data, parts, brand="survey", first="place", first_words="map")


def unit_words(unit: str) -> str:
    """Name a unit, or say that it is not known."""
    return f"in {harmless(unit)}" if unit else "in no known unit"


def _detectors(verdicts: Mapping[str, Verdict], remarks: Sequence[str]) -> str:
    """Say what the detectors flag, how they agree, and what is expected of a sample."""
    flags = {name: one.flagged for name, one in verdicts.items()}
    both = agreement(flags)
    own, *others = verdicts
    rows = [
        [name, str(int(one.flagged.sum())), str(_alone(flags, name)), limit_words(one.threshold)]
        for name, one in verdicts.items()
    ]
    asked = (
        f" {', '.join(others)}, with their usual options, have judged all samples at once, under "
        "the hyperparameters with which the survey has ended."
        if others
        else ""
    )
    return (
        f"<p>{as_html(own)} is the survey's own detector, as in <code>clean.csv</code>."
        f"{as_html(asked)} The expected value of a sample is what the model predicts there from "
        "all samples that the detector keeps, that sample itself left out; with another detector "
        "it is another. Scores above the threshold are flagged; where there is none, flags do not "
        "follow one number.</p>"
        + "".join(f'<p class="note">{as_html(sentence(one))}</p>' for one in remarks)
        + html_table(["detector", "flags", "no other flags", "threshold"], rows,
                     caption="What each detector flags")
        + html_table(
            ["flagged by both", *both],
            [[str(name), *map(str, row)] for name, row in both.iterrows()],
            caption="Agreement: samples that two detectors flag",
        )
    )  # fmt: skip


def _later(counts: pd.DataFrame) -> str:
    """Count what the later logs have made of the flags of each log."""
    rows = [[str(name), *(str(row[one]) for one in COUNTS)] for name, row in counts.iterrows()]
    return html_table(["log", *COUNTS.values()], rows, caption=COUNTS_TITLE)


def _alone(flags: Mapping[str, Booleans], name: str) -> int:
    """Count what a detector flags and none of the others does."""
    votes = np.sum([*flags.values()], axis=0)
    return int(np.sum(flags[name] & (votes == 1)))


def limit_words(threshold: float | None) -> str:
    """Write a threshold, if there is one."""
    return "–" if threshold is None else figure(threshold)


def _numbers(log: SurveyLog, silent: int, run: str, scores: Sequence[str]) -> str:
    """Tell what the reader of the log has met, and the cross-validated scores."""
    facts = list(log.remarks) if log.parts else []
    for one in log.parts or (log,):
        before = f"log {one.name}: " if log.parts else ""
        facts.append(f"{before}{counted(len(one), 'sample')} from {len(one.columns)} rows")
        facts += [before + remark for remark in one.remarks]
    if silent:
        facts.append(f"{counted(silent, 'sample')} without a value: not on the map")
    lists = [[sentence(one) for one in told] for told in (facts, scores)]
    log_list, score_list = (
        f"<ul>{''.join(f'<li>{as_html(line)}</li>' for line in lines)}</ul>" for lines in lists
    )
    return (
        f"<p>What was read:</p>{log_list}"
        "<p>How well the samples that are kept predict each other:</p>"
        f"{score_list}<p>The run: <code>{as_html(run)}</code></p>"
    )
