"""Words and numbers for people: suggestions, counts, figures, and text of unknown origin."""

import math
import re
import unicodedata
from collections.abc import Iterable
from difflib import get_close_matches

UNSEEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
"""Unicode's categories of characters that are no letter, mark, figure, sign or space."""

PLAIN_SIGNS = {"±": "+-", "–": "-", "…": "..."}
"""What stands for signs of infoplan's own where an encoding lacks them."""


def suggest(word: str, known: Iterable[str], n: int = 1) -> str:
    """Return ' (did you mean X?)' for a misspelled word; empty if nothing is near.

    Parameters
    ----------
    word
        What was written.
    known
        What could have been meant.
    n
        How many of the nearest to name at most.
    """
    near = get_close_matches(word, list(known), n=n, cutoff=0.6)
    return f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""


def counted(number: int, noun: str, plural: str = "") -> str:
    """Count things: ``1 mission``, ``2 missions``."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def figure(value: float) -> str:
    """Write a number with at least three significant digits, and no digit before the point lost.

    ``1125.4`` is 1125, ``96.04`` is 96.0, ``0.01234`` is 0.0123; NaN is empty.
    """
    if math.isnan(value):
        return ""
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    if value == 0:
        return "0"
    rounded = float(f"{value:.3g}")
    size = abs(rounded)
    if size >= 1e7 or size < 1e-3:
        return f"{value:.2e}"
    decimals = max(0, 2 - math.floor(math.log10(size)))
    return f"{value:.{decimals}f}"


def spans(numbers: Iterable[int]) -> str:
    """Write whole numbers in short, runs of them as one: ``0-3, 7``."""
    parts: list[list[int]] = []
    for number in sorted(numbers):
        if parts and number == parts[-1][-1] + 1:
            parts[-1] = [parts[-1][0], number]
        else:
            parts.append([number])
    return ", ".join("-".join(map(str, part)) for part in parts)


def rough(number: float) -> str:
    """Write a count, from a million on with three significant digits."""
    return f"{number:.0f}" if number < 1e6 else figure(number)


def interval(mean: float, low: float, high: float) -> str:
    """Write a mean with its interval, all with the decimals that the mean deserves.

    A mean that is small beside its interval, as that of a difference may be, gets the decimals that
    the interval's width deserves: ``0.7 [-21.0, 26.0]``. Without an interval (NaN) it is `figure`.
    """
    if math.isnan(mean) or math.isnan(low) or math.isnan(high):
        return figure(mean)
    width = high - low
    leading = mean if abs(mean) >= width / 10 else width
    return f"{like(mean, leading)} [{like(low, leading)}, {like(high, leading)}]"


def like(value: float, leading: float) -> str:
    """Write a number with the decimals that `figure` gives to another."""
    text = figure(leading)
    if "e" in text or "inf" in text or not math.isfinite(value):
        return figure(value)
    decimals = len(text.partition(".")[2])
    written = f"{value:.{decimals}f}"
    return written if float(written) else written.lstrip("-")


def encodable(text: str, encoding: str) -> str:
    r"""Write text with the characters of an encoding alone.

    Signs that infoplan itself writes become plain ones (``±`` is ``+-``), all others escapes such
    as ``\xe4``.
    """
    try:
        text.encode(encoding)
    except LookupError:
        encoding = "ascii"
    except UnicodeEncodeError:
        pass
    else:
        return text
    for sign, plain in PLAIN_SIGNS.items():
        text = text.replace(sign, plain)
    return text.encode(encoding, "backslashreplace").decode(encoding)


def harmless(text: object) -> str:
    r"""Write text of unknown origin so that a terminal shows it and does nothing else.

    Control, format (bidirectional ones among them) and surrogate characters become escapes such as
    ``\x1b``; line feeds, too.
    """
    return "".join(
        character.encode("unicode_escape").decode()
        if unicodedata.category(character) in UNSEEN
        else character
        for character in str(text)
    )


def markdown_cell(text: object) -> str:
    """Write text of unknown origin as the cell of a Markdown table, where it means itself."""
    escaped = re.sub(r"([\\`*_\[\]|~$])", r"\\\1", harmless(text))
    return escaped.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def csv_cell(text: object) -> str:
    """Write text of unknown origin as the cell of a CSV file that no spreadsheet takes for code."""
    plain = harmless(text)
    return f"'{plain}" if plain[:1] in ("=", "+", "-", "@") and not _is_number(plain) else plain


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
