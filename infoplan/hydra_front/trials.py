"""What a sweeper that searches has tried, and which of it is best."""

import math
import shlex
from collections.abc import Sequence
from typing import Any

from infoplan.text_options import as_override, text_options, typed_text
from infoplan.wording import counted, figure


def best_trial(trials: Sequence[tuple[Sequence[str], float]]) -> str:
    """Say which of a sweeper's trials has the least RMSE, and how to run it again.

    Parameters
    ----------
    trials
        Overrides of each, and its mean final RMSE; NaN where it failed.
    """
    finished = [trial for trial in trials if not math.isnan(trial[1])]
    if not finished:
        return f"none of {counted(len(trials), 'trial')} has an RMSE"
    overrides, number = min(finished, key=lambda trial: trial[1])
    runs = number.runs if isinstance(number, Score) else ()
    run = f" ({runs[0]})" if len(runs) == 1 else ""
    return (
        f"best of {counted(len(trials), 'trial')}: RMSE {figure(number)}{run}: "
        f"infoplan run {' '.join(map(_pasted, overrides))}"
    )


def _pasted(word: str) -> str:
    """Write an override of Hydra's as a word for a shell."""
    name, _, value = word.partition("=")
    if name in text_options():
        return as_override(name, typed_text(name, value))
    return shlex.quote(word)


class Score(float):
    """Mean final RMSE of a job, and the names of the runs that it is the mean of."""

    runs: tuple[str, ...] = ()

    def __new__(cls, value: float, *runs: str) -> "Score":
        """Make a number that knows its runs."""
        score = super().__new__(cls, value)
        score.runs = runs
        return score

    def __reduce__(self) -> tuple[Any, ...]:
        """Let it come back from another process."""
        return Score, (float(self), *self.runs)
