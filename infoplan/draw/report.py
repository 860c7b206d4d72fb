"""The study as one HTML page that needs nothing besides itself."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from infoplan.analyse.by_fault import by_fault
from infoplan.analyse.claims import METHODS, judge_claims
from infoplan.analyse.configurations import changed_options, differing
from infoplan.analyse.curves import ratios
from infoplan.analyse.error_sources import PARTS, ErrorSources, stored_explanations
from infoplan.analyse.judging import Claim, Comparison
from infoplan.analyse.later_logs import later_sentences
from infoplan.analyse.mission_scores import read_scores
from infoplan.analyse.statistics import Interval
from infoplan.analyse.stretches import NO_TRUTH
from infoplan.analyse.tables import Selection, study_of, told_apart
from infoplan.collapse import collapse_sentence, moving_sentence
from infoplan.config import is_survey
from infoplan.draw import claims_table, explain_table, fault_table
from infoplan.draw.page import (
    as_html,
    fill_page,
    html_table,
    sentence,
    write_page,
)
from infoplan.draw.report_data import (
    Findings,
    Panel,
    alarm_map,
    calibration_charts,
    curve_charts,
    method_looks,
    panels_of,
    provenance_facts,
    quality_charts,
    read_findings,
    read_footers,
    run_records,
)
from infoplan.errors import UsageError
from infoplan.method_identity import looks
from infoplan.study.records import Footer
from infoplan.wording import counted, figure, harmless

BEYOND_PAGE = 1e100
"""An effect that large would leave no room for others on their axis."""

Scale = tuple[float, float]

PLANNERS = {
    "uct": "UCT plans paths through uncertain places",
    "puct": "PUCT weighs uncertain places against places where outliers were flagged",
    "weighted": "WEIGHTED plans by a weighted sum of both",
    "greedy": "GREEDY takes the best next action, one after the other",
    "bayes_opt": "BAYES_OPT drives to the node of the largest reward",
    "rig_tree": "RIG_TREE takes the best branch of a random tree of actions",
    "cmaes": "CMAES moves waypoints until the track past them gathers most",
    "lawnmower": "LAWNMOWER covers the map in parallel tracks",
    "random": "RANDOM drives at random",
}
DETECTORS = {
    "none": "NONE keeps every sample",
    "best": "BEST drops the true outliers",
    "copod": "COPOD drops what its detector flags",
    "gp_residual": "GP_RESIDUAL drops what lies far from the model",
    "local": "LOCAL drops what lies far from its neighbours",
    "hampel": "HAMPEL drops what lies far from the running median along the track",
    "qartod": "QARTOD drops what fails the tests of real-time ocean data",
}
MODELS = {
    "student_t": "STUDENT_T models the noise with heavy tails",
    "itgp": "ITGP trims the samples that it predicts worst",
    "rcgp": "RCGP lets samples count less the farther they lie from their neighbours' median",
    "relevance_pursuit": "RELEVANCE_PURSUIT gives noise of their own to samples that need it",
    "vecchia": "VECCHIA predicts from the nearest samples",
}
"""What the built-in planners, detectors and models do, as parts of the methods' names."""


def write_report(selection: Selection) -> Path:
    """Write ``report.html`` into the folder of the tables.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_missions`. Runs of one method with other options are shown
        beside each other; the claims are judged by what `infoplan.analyse.find_study` would take.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    RunError
        If a table cannot be read or the page cannot be written.
    """
    path = selection.results_dir / "report.html"
    write_page(path, render(selection))
    return path


def render(selection: Selection) -> str:
    """Build the page of a selection of missions."""
    with np.errstate(over="ignore", invalid="ignore"):  # old tables may hold infinite errors
        return _rendered(selection)


def _rendered(selection: Selection) -> str:
    claims, reason = _judged(selection)
    selection = told_apart(selection)
    selection = replace(
        selection, terrain=harmless(selection.terrain), unit=harmless(selection.unit)
    )
    panels, findings = panels_of(selection), read_findings(selection)
    footers = read_footers(selection)
    quality, places = quality_charts(selection, panels), alarm_map(selection, panels)
    first = _papers_own(panels).title
    surveyed = is_survey(selection.terrain)
    unjudged = (
        f"Errors of detectors need the truth, and {NO_TRUTH}."
        if surveyed
        else "No run here has a detector that can err."
    )
    calibration = {"axis": [], "panels": []} if surveyed else calibration_charts(selection, panels)
    faults = _faults(selection)
    sources = [] if surveyed else stored_explanations(selection)
    data = {
        "unit": selection.unit,
        "methods": method_looks({method for panel in panels for method in panel.runs}),
        "axis": findings.axis.tolist(),
        "panels": curve_charts(panels, findings),
        "calibration": calibration,
        "quality": quality | {"first": _first(quality["panels"], {"title": first})},
        "map": places | {"first": _first(places["runs"], {"panel": first, "method": METHODS[-1]})},
    }
    days = sorted({footer.ended[:10] for footer in footers})
    parts = {
        "title": as_html(claims_table.heading(selection)),
        "subtitle": as_html(
            f"{counted(len(footers), 'mission')}, flown {' to '.join(_ends(days))}"
        ),
        "summary": _summary(selection, panels, findings, claims),
        "finals": _finals(selection, panels, findings),
        "faults": faults,
        "faults_link": '<a href="#faults">Faults</a>\n' if faults else "",
        "calibration": _calibration(calibration, panels, selection),
        "sources": _sources(sources, selection),
        "sources_link": '<a href="#sources">Sources</a>\n' if sources else "",
        "claims": _claims(claims, reason),
        "error": f"Cross-validated RMSE, each stretch of the track predicted from the others, as "
        f"{NO_TRUTH},"
        if surveyed
        else "RMSE of the model's mean on the query grid",
        "detector": _detector(quality, panels, findings, unjudged),
        "places": _places(places, selection, unjudged),
        "runs": _runs(selection, findings, footers),
        "provenance": _provenance(selection, footers),
    }
    return fill_page(
        "report_page",
        data,
        parts,
        brand="report",
        first="summary",
        first_words="summary",
        charts=True,
    )


def _judged(selection: Selection) -> tuple[list[Claim], str]:
    """Judge the claims by the missions that make a study, and say what was left out of it."""
    if is_survey(selection.terrain):
        return [], f"the claims need the truth, and {NO_TRUTH}"
    try:
        study = study_of(selection)
    except UsageError as error:
        return [], f"the claims were not judged: {error}"
    left_out = [note for note in study.notes if note not in selection.notes]
    return judge_claims(study), "; ".join(left_out)


def _first(candidates: Sequence[dict[str, Any]], wanted: dict[str, str]) -> int:
    """Index of the first candidate that has the wanted entries, else 0."""
    fits = (i for i, one in enumerate(candidates) if wanted.items() <= one.items())
    return next(fits, 0)


# The sections: HTML in which every text is escaped.


def _summary(
    selection: Selection, panels: Sequence[Panel], findings: Findings, claims: Sequence[Claim]
) -> str:
    runs = selection.missions.groupby("run")["seed"].nunique()
    seeds = " to ".join(str(n) for n in _ends(sorted(set(runs))))
    introduction = [
        f"A robot collects {selection.budget} elevation samples of {selection.terrain}; a share ρ "
        f"of each batch becomes outliers. {_method_words(selection)}",
        f"The page shows {counted(int(runs.sum()), 'finished mission')} of "
        f"{counted(len(runs), 'run')}, {seeds} seed{'' if seeds == '1' else 's'} a run. Numbers "
        "are means over seeds, with 95 % t intervals in brackets.",
    ]
    if is_survey(selection.terrain):
        introduction = [
            f"The log of a real survey, {selection.terrain}: {counted(selection.budget, 'sample')},"
            " judged by detectors and mapped. Predictions are cross-validated along the track, as "
            f"{NO_TRUTH}.",
            *_later_logs(selection),
        ]
    points = [
        _ranking(panel, findings, selection.unit, _error_words(selection)) for panel in panels
    ]
    judging = [panel for panel in panels if panel.judging]
    points += [_detection(panel, findings) for panel in judging if panel is _papers_own(judging)]
    told = "".join(
        f"<li>{_chip(verdict)} {len(names)}: {', '.join(names)}</li>"
        for verdict in ("supported", "contradicted", "undecided", "missing")
        if (names := [_anchor(claim.name) for claim in claims if claim.verdict == verdict])
    )
    lines = [*claims_table.remarks([], selection), *_gaps(panels, findings)]
    told_collapse = collapse_sentence(list(findings.ends.values()))
    lines += [told_collapse] if told_collapse else []
    told_moving = moving_sentence(
        list(findings.moving.values()), explain=not is_survey(selection.terrain)
    )
    lines += [told_moving] if told_moving else []
    cautions = [f"<p>{as_html(sentence(line))}</p>" for line in lines]
    return (
        "".join(f"<p>{as_html(text)}</p>" for text in introduction)
        + (f"<p>Of the paper's {len(claims)} claims:</p>" if claims else "")
        + (f'<ul class="verdicts">{told}</ul>' if claims else "")
        + "<p>In words:</p>"
        + f"<ul>{''.join(f'<li>{as_html(text)}</li>' for text in points)}</ul>"
        + (f'<div class="note">{"".join(cautions)}</div>' if cautions else "")
    )


def _later_logs(selection: Selection) -> list[str]:
    """Say of surveys of several logs what the later ones have made of the flags of the earlier."""
    told = []
    for run in selection.options:
        for seed in selection.seeds(run):
            told += later_sentences(selection.results_dir, run, seed)
    return told


def _method_words(selection: Selection) -> str:
    """Say what the methods of a page do, by the parts of their names."""
    missions = selection.missions
    sentences = []
    for column, words in (("planner", PLANNERS), ("detector", DETECTORS)):
        there = list(dict.fromkeys(missions[column]))
        told = [words[name] for name in words if name in there]
        told += [f"{name.upper()} drops what that class of PyOD flags" for name in sorted(there)
                 if name.startswith("pyod_")]  # fmt: skip
        sentences += [f"{'; '.join(told)}."] if told else []
    models = {flat["model.name"] for flat in selection.options.values()}
    sentences += [f"{told}." for name, told in MODELS.items() if name in models]
    return " ".join(sentences)


def _gaps(panels: Sequence[Panel], findings: Findings) -> list[str]:
    """Name the runs whose errors are not all in the charts."""
    lost = {run for panel in panels for run in findings.gaps(panel.runs.values())}
    return [f"the charts have gaps where errors are infinite or beyond all measure: "
            f"{', '.join(sorted(lost))}"] if lost else []  # fmt: skip


def _anchor(claim: str) -> str:
    return f'<a href="#{as_html(claim)}">{as_html(claim)}</a>'


def _papers_own(panels: Sequence[Panel]) -> Panel:
    """Return the panel of the paper's own setting, else the first."""
    return next((one for one in panels if (one.rho, one.scope) == (0.1, "batch")), panels[0])


def _error_words(selection: Selection) -> str:
    """Name the errors that a page shows."""
    return "cross-validated RMSE" if is_survey(selection.terrain) else "RMSE"


def _ranking(panel: Panel, findings: Findings, unit: str, error: str) -> str:
    """Say in which order the methods of a panel end."""
    finals = {method: findings.interval(run, "final") for method, run in panel.runs.items()}
    known = {method: one.mean for method, one in finals.items() if not math.isnan(one.mean)}
    best, *others = sorted(finals, key=lambda method: known.get(method, math.inf))
    article = "an" if error == "RMSE" else "a"
    told = (
        f"{panel.title}: {best} ends with {article} {error} of {interval_text(finals[best])} {unit}"
    )
    if others:
        told = told.replace(" ends with a", " ends lowest, with a")
        told += f", then {', '.join(f'{one} {interval_text(finals[one])}' for one in others)}"
    return f"{told}."


def _detection(panel: Panel, findings: Findings) -> str:
    """Say what the detectors of a panel caught, and what they flagged in error."""
    told = []
    for method, run in panel.judging.items():
        counts, alarms = findings.pooled(run), findings.interval(run, "fp")
        share = ratios(**counts)
        told.append(
            f"{method}'s detector flagged {_percent(share['recall'])} of the outliers and raised "
            f"{interval_text(alarms)} false alarms a mission; {_percent(share['precision'])} of "
            "what it flagged were outliers"
        )
    return f"{panel.title}: {'. '.join(told)}."


def _finals(selection: Selection, panels: Sequence[Panel], findings: Findings) -> str:
    methods = looks(name for panel in panels for name in panel.runs)
    tables = []
    error = _error_words(selection)
    for name, what in (
        ("final", f"{error} at {selection.budget} samples"),
        ("area", f"mean {error}"),
    ):
        rows = [[method, *(_number_of(panel, method, name, findings) for panel in panels)]
                for method in methods]  # fmt: skip
        headings = ["method", *(panel.title for panel in panels)]
        tables.append(html_table(headings, rows, caption=f"{what} ({selection.unit})"))
    rows = [[method, *(findings.collapsed(panel.runs[method]) if method in panel.runs else "–"
                       for panel in panels)] for method in methods]  # fmt: skip
    tables.append(html_table(headings, rows, caption="missions that end with a collapsed model"))
    return "".join(tables)


def _number_of(panel: Panel, method: str, name: str, findings: Findings) -> str:
    return (
        interval_text(findings.interval(panel.runs[method], name)) if method in panel.runs else "–"
    )


def _faults(selection: Selection) -> str:
    """Section on methods against faults; empty where there is but one fault."""
    if len({flat["fault.name"] for flat in selection.options.values()}) < 2:
        return ""
    if is_survey(selection.terrain):
        return ""
    table = by_fault(read_scores(selection.results_dir, {"run": list(selection.options)}).table)
    return (
        '<section id="faults" aria-labelledby="faults-title">\n'
        f'<h2 id="faults-title">{fault_table.TITLE}</h2>\n{fault_table.page_table(table)}\n'
        "</section>\n"
    )


def _calibration(
    calibration: Mapping[str, Any], panels: Sequence[Panel], selection: Selection
) -> str:
    if not calibration["panels"]:
        return f"<p>{as_html(sentence(f'calibration needs the truth, and {NO_TRUTH}'))}</p>"
    headings = ["method", *(panel.title for panel in panels)]
    at = calibration["axis"].index(0.95)
    lines = [{line["method"]: line for line in panel["lines"]} for panel in calibration["panels"]]
    rows = [
        [method, *(_covered(of_panel.get(method), at) for of_panel in lines)]
        for method in looks(name for panel in panels for name in panel.runs)
    ]
    return (
        "<p>Share of the query grid whose truth lies within the final model's central interval of "
        "a level: mean over seeds, with a pointwise 95 % interval over seeds. On the "
        "diagonal a model is calibrated; below it, it is too sure of itself.</p>"
        '<div class="toolbar"><div class="legend" data-legend="calibration" role="group" '
        'aria-label="Lines shown"></div></div><div class="panels" id="calibration-panels"></div>'
        "<details><summary>The intervals of 95 % as a table</summary>"
        + html_table(headings, rows, caption="Share within intervals of 95 %")
        + "</details>"
    )


def _covered(line: Mapping[str, Any] | None, at: int) -> str:
    if line is None or line["mean"][at] is None:
        return "–"
    mean, low, high = (line[name][at] for name in ("mean", "low", "high"))
    return f"{mean:.2f}" if low is None else f"{mean:.2f} [{low:.2f}, {high:.2f}]"


def _sources(sources: Sequence[ErrorSources], selection: Selection) -> str:
    """Section on where errors come from; empty where no run has been explained."""
    if not sources:
        return ""
    methods = selection.missions.drop_duplicates("run").set_index("run")["method"]
    ends = [0.0, *(value for one in sources for part in ("gap", *PARTS)
                   for value in (*one.table[part], one.interval(part).low, one.interval(part).high)
                   if math.isfinite(value))]  # fmt: skip
    margin = 0.05 * (max(ends) - min(ends)) or 1.0
    scale = (min(ends) - margin, max(ends) + margin)
    bodies = []
    for one in sources:
        scope = ", historical scope" if one.scope == "historical" else ""
        title = f"{methods[one.run]}, ρ = {one.rho:g}{scope}, {counted(len(one.table), 'seed')}"
        rows = [f'<tr class="claim"><th scope="rowgroup" colspan="4">{as_html(title)}</th></tr>']
        for name, words in explain_table.WORDS.items():
            mean = one.interval(name)
            strip = _strip(mean, one.table[name], scale) if name in ("gap", *PARTS) else ""
            cells = (explain_table.span(mean), explain_table.share(one, name))
            rows.append(
                f'<tr><th scope="row">{as_html(words)}</th><td class="picture">{strip}</td>'
                + "".join(f'<td class="number">{as_html(text)}</td>' for text in cells)
                + "</tr>"
            )
        told = "".join(f"{as_html(sentence(text))} " for text in explain_table.remarks(one))
        rows.append(f'<tr><td colspan="4" class="muted">{told}</td></tr>' if told else "")
        bodies.append(f"<tbody>{''.join(rows)}</tbody>")
    unit = as_html(selection.unit)
    return (
        '<section id="sources" aria-labelledby="sources-title">\n'
        '<h2 id="sources-title">Where the error comes from</h2>\n'
        "<p>The final error of each mission less that of BEST with the same seed, in parts that "
        "add up to it: learning, what a refit of the hyperparameters at the likelihood's optimum "
        "would take away; spikes that the detector let through, and clean samples that it dropped, "
        "each with a refit; places, what is left with true labels on the mission's own path; and "
        "BEST itself, what a refit would add to BEST's own error. Means over seeds with 95 % t "
        "intervals; a stroke a seed, all on one scale, "
        f"{as_html(_scale_words({selection.unit: scale}))}.</p>"
        f'<div class="scroll" role="region" aria-label="Parts of the gap to BEST" tabindex="0">'
        f'<table><thead><tr><th scope="col">part</th><td></td><th scope="col" class="number">'
        f'RMSE ({unit})</th><th scope="col" class="number">share</th></tr></thead>'
        f"{''.join(bodies)}</table></div>\n</section>\n"
    )


def _claims(claims: Sequence[Claim], reason: str) -> str:
    told = f'<div class="note"><p>{as_html(sentence(reason))}</p></div>' if reason else ""
    if not claims:
        return told
    scales = _scales(claims)
    pictures = (
        " In the small pictures the shaded side is the one stated, each stroke a seed; all that "
        f"have one unit have one scale: {_scale_words(scales)}."
        if scales
        else ""
    )
    headings = ("claim, and what was compared", "effect [95 %]", "", "p", "stated", "seeds",
                "verdict")  # fmt: skip
    head = "".join(f'<th role="columnheader" scope="col">{as_html(text)}</th>' for text in headings)
    lacking: dict[str, list[str]] = {}
    for claim in claims:
        if claim.commands:
            lacking.setdefault(" && ".join(claim.commands), []).append(claim.name)
    notes = "".join(
        f"<p>Runs are lacking for {as_html(', '.join(names))}; make them with "
        f"<code>{as_html(command)}</code></p>"
        for command, names in lacking.items()
    )
    return (
        "<p>A claim is supported if every comparison it names has its 95 % interval on the side "
        "stated, contradicted if one lies on the other side by an interval that is widened for the "
        "number of comparisons, else undecided; under six seeds it is undecided. Differences are "
        f"paired by seed; p is exact, by sign flips.{as_html(pictures)}</p>"
        f"<p>{as_html(sentence(claims_table.holm_words(claims)))}</p>{told}"
        f'<table class="claims" role="table"><thead role="rowgroup"><tr role="row">{head}</tr>'
        f"</thead>{''.join(_claim(claim, scales) for claim in claims)}</table>"
        + (f'<div class="note">{notes}</div>' if notes else "")
    )


def _claim(claim: Claim, scales: Mapping[str, Scale]) -> str:
    told = "; ".join(claims_table.cautions(claim))
    rows = [
        f'<tr class="claim" role="row" id="{as_html(claim.name)}">'
        '<th role="rowheader" scope="rowgroup" colspan="6">'
        + as_html(f"{claim.name}: {claim.text}")
        + (f'<br><span class="muted">{as_html(sentence(told))}</span>' if told else "")
        + f'</th><td role="cell">{_chip(claim.verdict)}</td></tr>'
    ]
    for item in claim.comparisons:
        side = claims_table.stated(item.stated, item.unit)
        cells = (
            ("compared", "", as_html(item.what)),
            ("number", "", as_html(claims_table.effect(item))),
            ("picture", "", _whisker(item, scales)),
            ("number", "p", as_html(claims_table.exact_p(item))),
            ("number", "stated", as_html(side)),
            ("number", "seeds", str(item.effect.n)),
            (item.verdict, "", as_html(item.verdict)),
        )
        # On a narrow screen the cells stand below each other: the labels take the headings' place.
        made = (f'<td role="cell" class="{k}" data-label="{t}">{html}</td>' for k, t, html in cells)
        rows.append(f'<tr class="comparison" role="row">{"".join(made)}</tr>')
    return f'<tbody role="rowgroup">{"".join(rows)}</tbody>'


def _chip(verdict: str) -> str:
    return f'<span class="chip {as_html(verdict)}">{as_html(verdict)}</span>'


def _unit(item: Comparison) -> str:
    """Name the unit of an effect's axis: without one it is a share."""
    return item.unit or "shares"


def _scales(claims: Sequence[Claim]) -> dict[str, Scale]:
    """Find the ends of the axis that all effects of a unit share; zero lies on it."""
    ends: dict[str, list[float]] = {}
    for item in (item for claim in claims for item in claim.comparisons if item.effect.n):
        effect, stated = item.effect, item.stated
        marks = (0.0, effect.mean, effect.low, effect.high, stated.low, stated.high,
                 *item.values.values())  # fmt: skip
        ends.setdefault(_unit(item), []).extend(mark for mark in marks if abs(mark) < BEYOND_PAGE)
    margins = {unit: 0.05 * (max(marks) - min(marks)) or 1.0 for unit, marks in ends.items()}
    return {
        unit: (min(marks) - margins[unit], max(marks) + margins[unit])
        for unit, marks in ends.items()
    }


def _scale_words(scales: Mapping[str, Scale]) -> str:
    return ", ".join(
        f"{figure(low)} to {figure(high)} {unit}" for unit, (low, high) in scales.items()
    )


def _whisker(item: Comparison, scales: Mapping[str, Scale]) -> str:
    """Picture of an effect: its interval, the side stated, and zero, on the axis of its unit."""
    effect, stated = item.effect, item.stated
    if effect.n == 0 or not math.isfinite(effect.mean):
        return ""
    scale = scales[_unit(item)]
    start = 0.0 if math.isinf(stated.low) else _along(stated.low, scale)
    end = 130.0 if math.isinf(stated.high) else _along(stated.high, scale)
    side = f'<rect class="stated" x="{start}" y="0" width="{end - start:.1f}" height="16"/>'
    return _strip(effect, item.values.values(), scale, side, item.verdict)


def _strip(
    mean: Interval, seeds: Iterable[float], scale: Scale, behind: str = "", kind: str = ""
) -> str:
    """Picture of a mean: its interval, a stroke a seed, and zero, on an axis."""
    known = not (math.isnan(mean.low) or math.isnan(mean.high))
    left, right = (_along(mean.low, scale), _along(mean.high, scale)) if known else (0.0, 0.0)
    interval = f'<path class="whisker" d="M{left} 8H{right}"/>' if known else ""
    strokes = "".join(f"M{_along(seed, scale)} 2V14" for seed in seeds)
    return (
        f'<svg viewBox="0 0 130 16" aria-hidden="true">{behind}'
        f'<path class="zero" d="M{_along(0.0, scale)} 0V16"/><g class="{kind}">'
        f'<path class="seeds" d="{strokes}"/>{interval}'
        f'<circle class="middle" cx="{_along(mean.mean, scale)}" cy="8" r="4"/></g></svg>'
    )


def _along(value: float, scale: Scale) -> float:
    """Where a value lies on a picture of that axis."""
    low, high = scale
    return round(4 + 122 * min(max((value - low) / (high - low), 0.0), 1.0), 1)


def _detector(
    quality: dict[str, Any], panels: Sequence[Panel], findings: Findings, reason: str
) -> str:
    if not quality["panels"]:
        return f"<p>{as_html(reason)}</p>"
    rows = []
    for panel in panels:
        for method, run in panel.judging.items():
            share = ratios(**findings.pooled(run))
            rates = (_percent(share[name]) for name in ("recall", "precision", "false_alarm_rate"))
            alarms = interval_text(findings.interval(run, "fp"))
            rows.append([f"{panel.title}: {method}", *rates, alarms])
    headings = ["run", "recall", "precision", "false-alarm rate", "false alarms a mission"]
    return (
        "<p>Recall is the share of the outliers that was flagged; precision the share of outliers "
        "among what was flagged; the false-alarm rate the share of the clean samples that was "
        "flagged. The charts pool all seeds in stretches of the mission, with 95 % bands over "
        "seeds: batch scope counts each epoch's own samples, historical scope "
        "everything judged so far.</p>"
        '<div class="toolbar"><label for="quality-choice">Runs</label>'
        '<select id="quality-choice"></select><div class="legend" data-legend="quality" '
        'role="group" aria-label="Lines shown"></div></div>'
        '<div class="panels" id="quality-panels"></div>'
        + html_table(headings, rows, caption="Over the whole mission")
    )


def _places(places: dict[str, Any], selection: Selection, reason: str) -> str:
    if not places["runs"]:
        return f"<p>{as_html(reason)}</p>"
    unit = as_html(selection.unit)
    headings = ("land", f"local relief ({unit})", f"final RMSE ({unit})", "false-alarm rate")
    head = "".join(f'<th scope="col">{text}</th>' for text in headings)
    return (
        '<div class="toolbar"><label for="alarm-choice">Run</label>'
        '<select id="alarm-choice"></select></div>'
        '<div class="places"><figure><div id="alarm-map"></div></figure><div>'
        '<div class="legend" id="alarm-layers" role="group" aria-label="Marks shown"></div>'
        '<p id="alarm-counts" role="status"></p>'
        f"<table><caption>By thirds of the land</caption><thead><tr>{head}</tr></thead>"
        '<tbody id="alarm-relief"></tbody></table>'
        '<p class="muted">All seeds together, as judged at the end, the pilot left out. Local '
        "relief: highest less lowest elevation within 2 workspace units.</p></div></div>"
    )


def _runs(selection: Selection, findings: Findings, footers: Sequence[Footer]) -> str:
    hours, minutes = divmod(round(sum(footer.seconds for footer in footers) / 60), 60)
    differ = differing(selection.options)
    rows = [
        [
            record["run"],
            seeds_text(record["seeds"]),
            *(_option(selection.options[record["run"]].get(name)) for name in differ),
            interval_text(record["final"]),
            period_text(record["started"], record["ended"]),
            f"{record['seconds']:.1f}",
        ]
        for record in run_records(selection, findings)
    ]
    final = f"final {_error_words(selection)} ({selection.unit})"
    headings = ["run", "seeds", *differ, final, "flown (UTC)", "seconds a mission"]
    took = f"{hours} h {minutes} min" if hours else f"{minutes} min"
    return (
        f"<p>The missions took {took} one after the other; the seconds are the median of a run's. "
        "The headings sort.</p>" + html_table(headings, rows, sortable=True)
    )


def _provenance(selection: Selection, footers: Sequence[Footer]) -> str:
    entries = []
    for name, values in provenance_facts(footers).items():
        lines = [
            f"<code>{as_html(value)}</code>"
            + ("" if len(values) == 1 else f" ({counted(count, 'mission')})")
            for value, count in values.most_common()
        ]
        entries.append(f"<dt>{as_html(name)}</dt><dd>{'<br>'.join(lines)}</dd>")
    changed: dict[str, list[str]] = {}
    for flat in selection.options.values():
        for name, value in changed_options(flat).items():
            seen = changed.setdefault(name, [])
            if str(value) not in seen:
                seen.append(str(value))
    for name in ("terrain.name", "terrain.sha256", "terrain.unit", "numerics_version"):
        changed.pop(name, None)  # no options, or told above
    options = ", ".join(f"{name}={' or '.join(values)}" for name, values in changed.items())
    told = f"<code>{as_html(options)}</code>, the others" if options else "all"
    entries.append(f"<dt>options</dt><dd>{told} as they come</dd>")
    return (
        "<p>From the footers of the tables, which hold each run's whole configuration, too.</p>"
        f"<dl>{''.join(entries)}</dl>"
    )


# Words


def interval_text(interval: Interval) -> str:
    """Write a mean with its interval: 525 [409, 644]."""
    if math.isnan(interval.low):
        return "–" if math.isnan(interval.mean) else figure(interval.mean)
    return f"{figure(interval.mean)} [{figure(interval.low)}, {figure(interval.high)}]"


def seeds_text(seeds: Sequence[int]) -> str:
    """Write seeds as ranges: 0–4, 7."""
    ranges: list[list[int]] = []
    for seed in sorted(seeds):
        if ranges and seed == ranges[-1][-1] + 1:
            ranges[-1].append(seed)
        else:
            ranges.append([seed])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in ranges)


def _ends(values: Sequence[Any]) -> list[Any]:
    """First and last of several, or the only one."""
    return [values[0]] if len(values) == 1 else [values[0], values[-1]]


def period_text(start: str, end: str) -> str:
    """Write the time between two ISO moments to the minute, the day once if it is the same."""
    (day, clock), (last_day, last_clock) = (moment[:16].split("T") for moment in (start, end))
    if (day, clock) == (last_day, last_clock):
        return f"{day} {clock}"
    return f"{day} {clock} to {last_clock if day == last_day else f'{last_day} {last_clock}'}"


def _percent(share: float) -> str:
    return "–" if math.isnan(share) else f"{100 * share:.{0 if share >= 0.1 else 1}f} %"


def _option(value: Any) -> str:
    """Write an option's value; a run that has not the option gets a dash."""
    return "–" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
