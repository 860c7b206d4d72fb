"""Surveys of several logs: what the later ones say of the flags of the earlier."""

import os
from pathlib import Path

import pandas as pd

from infoplan.later_logs import CLEARED, CONFIRMED, UNTESTED
from infoplan.study.store import read_table, table_path
from infoplan.wording import counted, harmless

COUNTS = {
    "samples": "samples", "flagged_first": "flagged then", CONFIRMED: CONFIRMED,
    CLEARED: CLEARED, UNTESTED: UNTESTED, "flagged_since": "flagged since",
}  # fmt: skip
"""Columns of `verdict_counts`, and what tables call them."""

COUNTS_TITLE = "Flags of each log when it was the last, and what later logs made of them"


def read_origins(results_dir: Path, run: str, seed: int) -> pd.DataFrame | None:
    """Read where the samples of a survey come from (`infoplan.tables`); None: from one log."""
    if not os.path.lexists(table_path(results_dir, "origins", run, seed)):
        return None
    return read_table(results_dir, "origins", run, seed).to_pandas()


def verdict_counts(origins: pd.DataFrame, samples: pd.DataFrame) -> pd.DataFrame:
    """Count what has become of the flags of each log.

    Parameters
    ----------
    origins, samples
        Tables of a survey.

    Returns
    -------
    DataFrame
        Indexed by log, in order. ``samples``: with a value; ``flagged_first``: of these, when the
        log was the last; ``confirmed``, ``cleared``, ``untested``: what the later logs have made of
        them; ``flagged_since``: flagged at the end and not then.
    """
    told = samples["measured"].notna()
    logs = origins["log"]
    flags = pd.DataFrame(
        {
            "samples": told,
            "flagged_first": origins["flagged_first"],
            **{name: origins["verdict"] == name for name in (CONFIRMED, CLEARED, UNTESTED)},
            "flagged_since": samples["flagged"] & told & ~origins["flagged_first"],
        }
    )
    return flags.astype(int).groupby(logs, sort=False).sum()


def later_sentences(results_dir: Path, run: str, seed: int) -> list[str]:
    """Say of each log but the last what the later ones have made of its flags.

    Parameters
    ----------
    results_dir, run, seed
        A survey.

    Returns
    -------
    list of str
        A sentence a log; none if there is one log.
    """
    origins = read_origins(results_dir, run, seed)
    if origins is None:
        return []
    samples = read_table(results_dir, "samples", run, seed).to_pandas()
    return [
        f"Of {counted(int(row['flagged_first']), 'sample')} of {harmless(name)} that were flagged "
        f"before later logs came, these confirm {row[CONFIRMED]}, clear {row[CLEARED]}, and do "
        f"not come near {row[UNTESTED]}."
        for name, row in verdict_counts(origins, samples)[:-1].iterrows()
    ]
