"""The study as one HTML page that needs nothing besides itself."""

import json
import math
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from infoplan import __version__
from infoplan.analyse.claims import METHODS, judge_claims
from infoplan.analyse.curves import ratios
from infoplan.analyse.judging import Claim, Comparison
from infoplan.analyse.statistics import Interval
from infoplan.analyse.tables import Selection, changed_options
from infoplan.draw import claims_table, style
from infoplan.draw.report_data import (
    Findings,
    Panel,
    alarm_map,
    curve_charts,
    panels_of,
    provenance_facts,
    quality_charts,
    read_findings,
    read_footers,
    run_records,
)
from infoplan.errors import RunError
from infoplan.wording import figure

PAGE = Path(__file__).with_name("report_page.html")
"""The page; style sheet and script lie beside it."""

METHOD_WORDS = (
    "UCT plans paths through uncertain places; PUCT weighs them against places where outliers were "
    "flagged. NONE keeps every sample, BEST drops the true outliers, COPOD drops what its detector "
    "flags."
)


def write_report(selection: Selection) -> Path:
    """Write ``report.html`` into the folder of the tables.

    Parameters
    ----------
    selection
        From `infoplan.analyse.find_study`.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    RunError
        If a table cannot be read or the page cannot be written.
    """
    page = render(selection)
    path = selection.results_dir / "report.html"
    unfinished = path.with_name(f".{path.name}")
    try:
        unfinished.write_text(page, encoding="utf-8")
        unfinished.replace(path)
    except OSError as error:
        raise RunError(
            f"{path} could not be written ({error.strerror or error}): make room, or check that "
            "you may write there"
        ) from error
    return path


def render(selection: Selection) -> str:
    """Build the page of a selection of missions."""
    panels, findings = panels_of(selection), read_findings(selection)
    claims, footers = judge_claims(selection), read_footers(selection)
    quality, places = quality_charts(selection, panels), alarm_map(selection, panels)
    first = _papers_own(panels).title
    data = {
        "unit": selection.unit,
        "methods": _methods(panels),
        "axis": findings.axis.tolist(),
        "panels": curve_charts(panels, findings),
        "quality": quality | {"first": _first(quality["panels"], {"title": first})},
        "map": places | {"first": _first(places["runs"], {"panel": first, "method": METHODS[-1]})},
    }
    days = sorted({footer["ended"][:10] for footer in footers})
    parts = {
        "title": escape(claims_table.heading(selection)),
        "subtitle": escape(f"{_count(len(footers), 'mission')}, flown {' to '.join(_ends(days))}"),
        "summary": _summary(selection, panels, findings, claims),
        "finals": _finals(selection, panels, findings),
        "claims": _claims(claims),
        "detector": _detector(quality, panels, findings),
        "places": _places(places, selection),
        "runs": _runs(selection, findings, footers),
        "provenance": _provenance(selection, footers),
        "data": _embedded(data),
        "style": PAGE.with_suffix(".css").read_text(encoding="utf-8"),
        "script": PAGE.with_suffix(".js").read_text(encoding="utf-8"),
        "version": escape(__version__),
    }
    return Template(PAGE.read_text(encoding="utf-8")).substitute(parts)


def _methods(panels: Sequence[Panel]) -> list[dict[str, Any]]:
    """Name, colour, line and first state of each method; the paper's are shown first."""
    present = {method for panel in panels for method in panel.runs}
    papers_own = present & set(METHODS)
    return [
        {
            "name": method,
            "colour": colour,
            "dash": _dash(style.DASHES[method]),
            "shown": method in (papers_own or present),
        }
        for method, colour in style.COLOURS.items()
        if method in present
    ]


def _dash(dashes: Any) -> str:
    """Write a line style as SVG does, for a line of two pixels."""
    return "" if dashes == "solid" else " ".join(f"{2 * length:g}" for length in dashes[1])


def _first(candidates: Sequence[dict[str, Any]], wanted: dict[str, str]) -> int:
    """Index of the first candidate that has the wanted entries, else 0."""
    fits = (i for i, one in enumerate(candidates) if wanted.items() <= one.items())
    return next(fits, 0)


def _embedded(data: Any) -> str:
    """Write data as JSON that cannot end the element it stands in."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


# The sections: HTML in which every text is escaped.


def _summary(
    selection: Selection, panels: Sequence[Panel], findings: Findings, claims: Sequence[Claim]
) -> str:
    runs = selection.missions.groupby("run")["seed"].nunique()
    seeds = " to ".join(str(n) for n in _ends(sorted(set(runs))))
    introduction = (
        f"A robot collects {selection.budget} elevation samples of {selection.terrain}; a share ρ "
        f"of each batch becomes outliers. {METHOD_WORDS}",
        f"The page shows {_count(int(runs.sum()), 'finished mission')} of "
        f"{_count(len(runs), 'run')}, {seeds} seed{'' if seeds == '1' else 's'} a run. Numbers are "
        "means over seeds, with 95 % bootstrap intervals over whole seeds in brackets.",
    )
    points = [_ranking(panel, findings, selection.unit) for panel in panels]
    judging = [panel for panel in panels if panel.judging]
    points += [_detection(panel, findings) for panel in judging if panel is _papers_own(judging)]
    told = "".join(
        f"<li>{_chip(verdict)} {len(names)}: {', '.join(names)}</li>"
        for verdict in ("supported", "contradicted", "undecided", "missing")
        if (names := [_anchor(claim.name) for claim in claims if claim.verdict == verdict])
    )
    cautions = [f"<p>{escape(_sentence(line))}</p>" for line in claims_table.remarks([], selection)]
    return (
        "".join(f"<p>{escape(text)}</p>" for text in introduction)
        + f"<p>Of the paper's {len(claims)} claims:</p>"
        + f'<ul class="verdicts">{told}</ul>'
        + "<p>In words:</p>"
        + f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in points)}</ul>"
        + (f'<div class="note">{"".join(cautions)}</div>' if cautions else "")
    )


def _anchor(claim: str) -> str:
    return f'<a href="#{escape(claim)}">{escape(claim)}</a>'


def _papers_own(panels: Sequence[Panel]) -> Panel:
    """Return the panel of the paper's own setting, else the first."""
    return next((one for one in panels if (one.rho, one.scope) == (0.1, "batch")), panels[0])


def _ranking(panel: Panel, findings: Findings, unit: str) -> str:
    """Say in which order the methods of a panel end."""
    finals = {method: findings.interval(run, "final") for method, run in panel.runs.items()}
    best, *others = sorted(finals, key=lambda method: finals[method].mean)
    told = f"{panel.title}: {best} ends with an RMSE of {interval_text(finals[best])} {unit}"
    if others:
        told = told.replace(" ends with an", " ends lowest, with an")
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
    methods = [name for name in style.COLOURS if any(name in panel.runs for panel in panels)]
    tables = []
    for name, what in (("final", f"RMSE at {selection.budget} samples"), ("area", "mean RMSE")):
        rows = [[method, *(_number_of(panel, method, name, findings) for panel in panels)]
                for method in methods]  # fmt: skip
        headings = ["method", *(panel.title for panel in panels)]
        tables.append(_table(headings, rows, caption=f"{what} ({selection.unit})"))
    return "".join(tables)


def _number_of(panel: Panel, method: str, name: str, findings: Findings) -> str:
    return (
        interval_text(findings.interval(panel.runs[method], name)) if method in panel.runs else "–"
    )


def _claims(claims: Sequence[Claim]) -> str:
    headings = ("claim, and what was compared", "effect [95 %]", "", "stated", "seeds", "verdict")
    head = "".join(f'<th role="columnheader" scope="col">{escape(text)}</th>' for text in headings)
    lacking: dict[str, list[str]] = {}
    for claim in claims:
        if claim.commands:
            lacking.setdefault(" && ".join(claim.commands), []).append(claim.name)
    notes = "".join(
        f"<p>Runs are lacking for {escape(', '.join(names))}; make them with "
        f"<code>{escape(command)}</code></p>"
        for command, names in lacking.items()
    )
    return (
        "<p>A claim is supported if every comparison it names has its 95 % interval on the side "
        "stated, contradicted if one lies wholly on the other side, else undecided. Differences "
        "are paired by seed. In the small pictures the shaded side is the one stated.</p>"
        f'<table class="claims" role="table"><thead role="rowgroup"><tr role="row">{head}</tr>'
        f"</thead>{''.join(_claim(claim) for claim in claims)}</table>"
        + (f'<div class="note">{notes}</div>' if notes else "")
    )


def _claim(claim: Claim) -> str:
    advice = claims_table.advice(claim)
    rows = [
        f'<tr class="claim" role="row" id="{escape(claim.name)}">'
        f'<th role="rowheader" scope="rowgroup" colspan="5">{escape(f"{claim.name}: {claim.text}")}'
        + (f'<br><span class="muted">{escape(_sentence(advice))}</span>' if advice else "")
        + f'</th><td role="cell">{_chip(claim.verdict)}</td></tr>'
    ]
    for item in claim.comparisons:
        side = claims_table.stated(item.stated, item.unit)
        cells = (
            ("compared", "", escape(item.what)),
            ("number", "", escape(claims_table.effect(item))),
            ("picture", "", _whisker(item)),
            ("number", "stated", escape(side)),
            ("number", "seeds", str(item.effect.n)),
            (item.verdict, "", escape(item.verdict)),
        )
        # On a narrow screen the cells stand below each other: the labels take the headings' place.
        made = (f'<td role="cell" class="{k}" data-label="{t}">{html}</td>' for k, t, html in cells)
        rows.append(f'<tr class="comparison" role="row">{"".join(made)}</tr>')
    return f'<tbody role="rowgroup">{"".join(rows)}</tbody>'


def _chip(verdict: str) -> str:
    return f'<span class="chip {escape(verdict)}">{escape(verdict)}</span>'


def _whisker(item: Comparison) -> str:
    """Picture of an effect: its interval, the side stated, and zero."""
    effect, stated = item.effect, item.stated
    if effect.n == 0:
        return ""
    marks = [effect.mean, effect.low, effect.high, stated.low, stated.high, 0.0]
    finite = [value for value in marks if math.isfinite(value)]
    margin = 0.15 * (max(finite) - min(finite)) or 1.0
    low, span = min(finite) - margin, max(finite) - min(finite) + 2 * margin
    places = [round(130 * min(max((value - low) / span, 0.0), 1.0), 1) for value in marks]
    middle, left, right, start, end, zero = places
    known = not math.isnan(effect.low)
    interval = f'<path class="whisker" d="M{left} 8H{right}"/>' if known else ""
    return (
        '<svg viewBox="0 0 130 16" aria-hidden="true">'
        f'<rect class="stated" x="{start}" y="0" width="{end - start:.1f}" height="16"/>'
        f'<path class="zero" d="M{zero} 0V16"/><g class="{item.verdict}">{interval}'
        f'<circle class="middle" cx="{middle}" cy="8" r="4"/></g></svg>'
    )


def _detector(quality: dict[str, Any], panels: Sequence[Panel], findings: Findings) -> str:
    if not quality["panels"]:
        return "<p>No run here has a detector that can err.</p>"
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
        "flagged. The charts pool all seeds in stretches of the mission, with 95 % bootstrap bands "
        "over whole seeds: batch scope counts each epoch's own samples, historical scope "
        "everything judged so far.</p>"
        '<div class="toolbar"><label for="quality-choice">Runs</label>'
        '<select id="quality-choice"></select><div class="legend" data-legend="quality" '
        'role="group" aria-label="Lines shown"></div></div>'
        '<div class="panels" id="quality-panels"></div>'
        + _table(headings, rows, caption="Over the whole mission")
    )


def _places(places: dict[str, Any], selection: Selection) -> str:
    if not places["runs"]:
        return "<p>No run here has a detector that can err.</p>"
    unit = escape(selection.unit)
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


def _runs(selection: Selection, findings: Findings, footers: Sequence[dict[str, Any]]) -> str:
    hours, minutes = divmod(round(sum(footer["seconds"] for footer in footers) / 60), 60)
    rows = [
        [
            record["run"],
            seeds_text(record["seeds"]),
            interval_text(record["final"]),
            period_text(record["started"], record["ended"]),
            f"{record['seconds']:.1f}",
        ]
        for record in run_records(selection, findings)
    ]
    final = f"final RMSE ({selection.unit})"
    headings = ["run", "seeds", final, "flown (UTC)", "seconds a mission"]
    took = f"{hours} h {minutes} min" if hours else f"{minutes} min"
    return (
        f"<p>The missions took {took} one after the other; the seconds are the median of a run's. "
        "The headings sort.</p>" + _table(headings, rows, sortable=True)
    )


def _provenance(selection: Selection, footers: Sequence[dict[str, Any]]) -> str:
    entries = []
    for name, values in provenance_facts(footers).items():
        lines = [
            f"<code>{escape(value)}</code>"
            + ("" if len(values) == 1 else f" ({_count(count, 'mission')})")
            for value, count in values.most_common()
        ]
        entries.append(f"<dt>{escape(name)}</dt><dd>{'<br>'.join(lines)}</dd>")
    changed: dict[str, list[str]] = {}
    for flat in selection.options.values():
        for name, value in changed_options(flat).items():
            seen = changed.setdefault(name, [])
            if str(value) not in seen:
                seen.append(str(value))
    for name in ("terrain.name", "terrain.sha256", "terrain.unit", "numerics_version"):
        changed.pop(name, None)  # no options, or told above
    options = ", ".join(f"{name}={' or '.join(values)}" for name, values in changed.items())
    told = f"<code>{escape(options)}</code>, the others" if options else "all"
    entries.append(f"<dt>options</dt><dd>{told} as they come</dd>")
    return (
        "<p>From the footers of the tables, which hold each run's whole configuration, too.</p>"
        f"<dl>{''.join(entries)}</dl>"
    )


def _table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    caption: str = "",
    sortable: bool = False,
) -> str:
    """Lay texts out as a table, numbers from the second column on; too wide, it scrolls."""
    first, *others = headings
    head = f'<th scope="col">{escape(first)}</th>' + "".join(
        f'<th scope="col" class="number">{escape(text)}</th>' for text in others
    )
    body = "".join(
        f'<tr><th scope="row">{escape(name)}</th>'
        + "".join(f'<td class="number">{escape(text)}</td>' for text in numbers)
        + "</tr>"
        for name, *numbers in rows
    )
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    kind = ' class="sortable"' if sortable else ""
    return (
        f'<div class="scroll" role="region" aria-label="{escape(caption or first)}" tabindex="0">'
        f"<table{kind}>{title}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
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


def _count(n: int, thing: str) -> str:
    return f"{n} {thing}{'' if n == 1 else 's'}"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", ":")) else ".")
