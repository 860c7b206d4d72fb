"""Methods against faults in words: for the terminal, as Markdown, and as a table of a page."""

import html
import math

from rich.cells import cell_len
from rich.console import Console

from infoplan.analyse.by_fault import NO_FAULT, FaultTable
from infoplan.draw import style
from infoplan.draw.console import say
from infoplan.draw.table_layout import GAP, TextColumn, print_table
from infoplan.options import plain_number
from infoplan.wording import counted, harmless, markdown_cell

TITLE = "By fault"

REFERENCE = "(true labels)"
"""Behind the name of a method that is no contestant."""

LOST = "not finite"
"""In a cell with errors of that kind."""


def print_by_fault(table: FaultTable, console: Console) -> None:
    """Print the cells, as many faults beside each other as there is room for."""
    digits = decimals(table)
    names = {method: name(table, method) for method in table.methods}
    written = {
        fault: [plain_cell(table, method, fault, digits) for method in table.methods]
        for fault in table.faults
    }
    room = console.width - max(map(cell_len, names.values()), default=0) - GAP
    say(console, f"{TITLE}: {caption(table)}", style="italic")
    for faults in _chunks(written, room):
        columns = [TextColumn("method"), *(TextColumn(fault, right=True) for fault in faults)]
        rows = [
            [names[method], *(written[fault][number].replace(" ±", "\n±") for fault in faults)]
            for number, method in enumerate(table.methods)
        ]
        print_table(console, "", columns, rows)
    for line in remarks(table, "*"):
        say(console, line)


def _chunks(written: dict[str, list[str]], room: int) -> list[list[str]]:
    """Part the faults so that each part fits into that many characters, if it can."""
    chunks: list[list[str]] = []
    left = 0
    for fault, texts in written.items():
        parts = [part for text in texts for part in text.split(" ±")]
        width = max(map(cell_len, [fault, *parts])) + GAP
        if not chunks or width > left:
            chunks.append([])
            left = room
        chunks[-1].append(fault)
        left -= width
    return chunks


def markdown(table: FaultTable) -> str:
    """Write the cells as a Markdown table."""
    digits = decimals(table)
    lines = [
        f"| method | {' | '.join(map(markdown_cell, table.faults))} |",
        f"|---|{'|'.join('---:' for _ in table.faults)}|",
    ]
    for method in table.methods:
        cells = [plain_cell(table, method, fault, digits, bold=True) for fault in table.faults]
        lines.append(f"| {markdown_cell(name(table, method))} | {' | '.join(cells)} |")
    told = [caption(table), "", *lines, ""]
    return "\n".join([*told, *(f"{markdown_cell(line)}  " for line in remarks(table, "bold"))])


def page_table(table: FaultTable) -> str:
    """Write the cells as an HTML table, coloured as in the picture."""
    style.load_matplotlib()
    from matplotlib.colors import to_hex

    digits = decimals(table)
    means = table.grid("mean").to_numpy(dtype=float)
    colours = style.score_colours(means)
    head = "".join(f'<th scope="col">{_html(fault)}</th>' for fault in table.faults)
    rows = []
    for row, method in zip(means.tolist(), table.methods, strict=True):
        cells = []
        for mean, fault in zip(row, table.faults, strict=True):
            text = _html(plain_cell(table, method, fault, digits)).replace(" ±", "<br>±")
            paint = ""
            if math.isfinite(mean):
                rgba = style.rgba(colours, mean)
                paint = f' style="background:{to_hex(rgba)};color:{style.ink_on(rgba)}"'
            cells.append(f"<td{paint}>{text}</td>")
        rows.append(f'<tr><th scope="row">{_html(name(table, method))}</th>{"".join(cells)}</tr>')
    notes = "".join(f"<p>{_html(line)}</p>" for line in remarks(table, "*"))
    return (
        f'<p>{_html(caption(table))}</p><div class="scroll" role="region" tabindex="0" '
        f'aria-label="{TITLE}"><table class="faults"><thead><tr><th scope="col">method</th>{head}'
        f"</tr></thead><tbody>{''.join(rows)}</tbody></table></div>{notes}"
    )


def caption(table: FaultTable) -> str:
    """Say what the cells are."""
    rhos = " and ".join(map(plain_number, table.rhos))
    share = f", rho {rhos}" if rhos else ""
    return (
        f"area (mean RMSE from the pilot's end to the budget, in standard deviations of the map), "
        f"mean ± 95 % interval over {_seeds(table)} of these maps: {', '.join(table.maps)}{share}"
    )


def remarks(table: FaultTable, mark: str) -> list[str]:
    """Say how to read the cells, and what was left out.

    Parameters
    ----------
    table
        The cells.
    mark
        How cells among the best are shown.
    """
    lines = [
        f"{mark}: not told apart from the best of its fault, paired by map and seed; the method "
        "that truly is the best on these maps is among them with 95 %",
    ]
    if table.references:
        which = ", ".join(table.references)
        lines.append(f"{which}: the filter is given the true labels; no contestant")
    if NO_FAULT in table.faults:
        lines.append(f"{NO_FAULT}: rho 0")
    if table.cells["lost"].any():
        lines.append(f"{LOST}: a mission of this cell has errors that are not")
    if table.grid("n").isna().to_numpy().any():
        lines.append("an empty cell: not all of its maps and rhos were flown by this method")
    if table.seeds[0] < 2:
        lines.append("a cell with a single seed on a map has no interval")
    return [*lines, *table.notes]


def name(table: FaultTable, method: str) -> str:
    """Name a method, and mark one that is no contestant."""
    shown = harmless(method)
    return f"{shown} {REFERENCE}" if method in table.references else shown


def cell_parts(table: FaultTable, method: str, fault: str, digits: int) -> tuple[str, str, bool]:
    """Write a cell: its mean, half of its interval, and whether it is among the best."""
    cells = table.cells
    found = cells[(cells["method"] == method) & (cells["fault"] == fault)]
    if found.empty:
        return "", "", False
    cell = found.iloc[0]
    if cell["lost"]:
        return LOST, "", False
    half = (cell["high"] - cell["low"]) / 2
    written = "" if math.isnan(half) else f"±{_number(half, digits)}"
    return _number(cell["mean"], digits), written, bool(cell["among_best"])


def plain_cell(
    table: FaultTable, method: str, fault: str, digits: int, *, bold: bool = False
) -> str:
    """Write a cell in a line: ``0.36* ±0.02``, or ``**0.36** ±0.02``."""
    mean, half, best = cell_parts(table, method, fault, digits)
    marked = (f"**{mean}**" if bold else f"{mean}*") if best else mean
    return f"{marked} {half}".rstrip()


def decimals(table: FaultTable) -> int:
    """Count the decimals of all cells: two, or as many as the least mean needs for two digits."""
    means = [mean for mean in table.cells["mean"] if mean > 0 and math.isfinite(mean)]
    return max(2, 1 - math.floor(math.log10(min(means, default=1.0))))


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if abs(value) < 1000 else f"{value:.1e}"


def _seeds(table: FaultTable) -> str:
    least, most = table.seeds
    return counted(most, "seed") if least == most else f"{least} to {most} seeds"


def _html(text: str) -> str:
    return html.escape(harmless(text))
