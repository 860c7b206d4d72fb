"""The multiverse as an HTML page: curves to pick universes on, their Fig. 5, what moves claims."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from infoplan.analyse.multiverse import ClaimCurve, JointTest
from infoplan.analyse.universe_numbers import Multiverse
from infoplan.draw.multiverse_page_data import Moved, page_data
from infoplan.draw.multiverse_table import default_verdict, heading, remarks
from infoplan.draw.page import as_html, fill_page, html_table, write_page
from infoplan.study.universes import CHOICES, Universe
from infoplan.wording import counted, figure


def write_multiverse_page(
    path: Path,
    multiverse: Multiverse,
    curves: Sequence[ClaimCurve],
    moved: Mapping[str, Moved],
    nearest: Sequence[str],
    commands: Callable[[Universe], Sequence[str]],
) -> None:
    """Write the page.

    Parameters
    ----------
    path
        The file; its folder is made.
    multiverse, curves, moved, nearest, commands
        As `page_data` takes them.

    Raises
    ------
    RunError
        If it cannot be written.
    """
    data = page_data(multiverse, curves, moved, nearest, commands)
    parts = {
        "title": "What the paper's claims hang on",
        "subtitle": as_html(heading(multiverse)),
        "summary": _summary(multiverse, curves, moved, nearest),
        "shares": _shares(moved),
    }
    page = fill_page("multiverse_page", data, parts, brand="multiverse", first="summary",
                     first_words="claims", charts=True)  # fmt: skip
    write_page(path, page)


def _summary(
    multiverse: Multiverse,
    curves: Sequence[ClaimCurve],
    moved: Mapping[str, Moved],
    nearest: Sequence[str],
) -> str:
    """Tell how every claim fares over all universes, and which are not judged."""
    told = "".join(f"<p>{as_html(line)}</p>" for line in remarks(multiverse, curves))
    if not curves:
        return told
    headings = ["claim", "median effect", "supported", "contradicted", "undecided", "by default",
                *([f"supported in the {len(nearest)} nearest to the clip"] if nearest else []),
                "p of the median", "on one side of zero", "mean t, p"]  # fmt: skip
    rows = []
    for curve in curves:
        near = [v for n, v in zip(curve.universes, curve.verdicts, strict=True) if n in nearest]
        test = moved[curve.name].test
        rows.append([
            f"{curve.name}: {curve.text}",
            f"{figure(test.median)} {curve.unit}".strip(),
            *(str(curve.verdicts.count(one)) for one in ("supported", "contradicted", "undecided")),
            default_verdict(curve), *([str(near.count("supported"))] if nearest else []),
            figure(test.p_median),
            *test_words(test),
        ])  # fmt: skip
    caption = f"Claims over {counted(_most(curves), 'universe')}"
    return html_table(headings, rows, caption=caption) + told


def _most(curves: Sequence[ClaimCurve]) -> int:
    return max(len(curve.universes) for curve in curves)


def test_words(test: JointTest) -> tuple[str, str]:
    """Write the share on one side of zero, and the mean t of a joint test with its p."""
    if not test.flips:
        return "–", "–"
    return (
        f"{100 * test.one_side:.0f} %",
        f"{figure(test.mean_t)}, {figure(test.p_mean_t)}",
    )


def _shares(moved: Mapping[str, Moved]) -> str:
    """Lay out which choice explains how much of which claim."""
    known = {name: one.jointly for name, one in moved.items() if not one.jointly.empty}
    if not known:
        return (
            "<p>There are too few universes to tell what moves claims whatever the others are.</p>"
        )
    shares = {name: _share_words(table) for name, table in known.items()}
    rows = [[one.name, *(words.get(one.name, "–") for words in shares.values())] for one in CHOICES]
    caption = (
        "Share of a claim's variance over joint universes that only this choice explains; "
        "* p below 0.05 by Holm"
    )
    return html_table(["choice", *shares], rows, caption=caption)


def _share_words(jointly: pd.DataFrame) -> dict[str, str]:
    """Write the share of each choice, with a star where it is sure."""
    once = jointly.drop_duplicates("choice")
    return {
        str(choice): f"{100 * share:.0f} %{'*' if p <= 0.05 else ''}"
        for choice, share, p in zip(once["choice"], once["share"], once["p"], strict=True)
    }
