"""What an audit has found, as a table."""

from collections.abc import Iterable

from rich.console import Console
from rich.text import Text

from infoplan.analyse.audit.findings import Finding
from infoplan.draw.console import UNLIMITED, wrapped
from infoplan.wording import counted, encodable, harmless, spans

NARROW = 30
"""With less room than this beside a check its details stand below it."""

BELOW = "      "
"""Before details that stand below their check."""


def render(findings: Iterable[Finding], width: int = UNLIMITED) -> str:
    """Lay findings out as a plain table, grouped by run.

    Parameters
    ----------
    findings
        Of any number of missions.
    width
        Longest line; a word alone may be longer. Details are broken between words, and stand below
        their check where there is little room beside it.

    Returns
    -------
    str
        A line a run and check: ``holds``, ``FAILS`` or ``-`` where nothing could be recomputed, how
        many missions do, and the detail of each that fails, or of the only one there is; then what
        was not recomputed. The last line counts everything.
    """
    everything = list(findings)
    lines = []
    for run in dict.fromkeys(finding.run for finding in everything):
        of_run = [finding for finding in everything if finding.run == run]
        missions = counted(len({finding.seed for finding in of_run}), "mission")
        lines += wrapped(f"{harmless(run)}: {missions}", width)
        for check in dict.fromkeys(finding.check for finding in of_run):
            lines += _render_check([finding for finding in of_run if finding.check == check], width)
        lines.append("")
    failed = sum(not finding.holds for finding in everything)
    missions = counted(len({(finding.run, finding.seed) for finding in everything}), "mission")
    partial = sum(bool(finding.omitted) for finding in everything)
    verdict = f"{failed} FAIL" if failed else "all hold"
    verdict += f", {partial} in part" if partial else ""
    lines += wrapped(f"{missions}, {counted(len(everything), 'check')}: {verdict}", width)
    return "\n".join(lines)


def print_findings(findings: Iterable[Finding], console: Console) -> None:
    """Print findings as `render` lays them out for the console."""
    for line in render(findings, console.width).split("\n"):
        console.print(Text(encodable(line, console.encoding)), soft_wrap=True)


def _render_check(findings: list[Finding], width: int) -> list[str]:
    """Lines of one check of one run."""
    failed = [finding for finding in findings if not finding.holds]
    count = f"{len(failed) or len(findings)} of {len(findings)}"
    made = failed or any(finding.detail for finding in findings)
    verdict = "FAILS" if failed else "holds" if made else "-"
    head = f"  {harmless(findings[0].check):<17} {verdict:<5} {count:>9}"
    if failed:
        details = [f"seed {finding.seed}: {harmless(finding.detail)}" for finding in failed]
    else:
        details = [harmless(findings[0].detail)] if len(findings) == 1 else []
    for omitted in dict.fromkeys(finding.omitted for finding in findings if finding.omitted):
        seeds = [finding.seed for finding in findings if finding.omitted == omitted]
        whose = f" (seeds {spans(seeds)})" if len(seeds) < len(findings) else ""
        details = [*filter(None, details), f"not recomputed: {harmless(omitted)}{whose}"]
    margin = len(head) + 2
    if width - margin < NARROW:
        below = [wrapped(f"{BELOW}{detail}", width, BELOW) for detail in details]
        return [head, *(line for lines in below for line in lines)]
    beside = [line for detail in details for line in wrapped(detail, width - margin)] or [""]
    return [
        f"{' ' * margin if number else f'{head}  '}{line}".rstrip()
        for number, line in enumerate(beside)
    ]
