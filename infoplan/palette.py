"""Colours of all that is shown, by what they mean: on figures, pages, the site, the terminal."""

from dataclasses import dataclass

ORANGE, SKY, GREEN, BLUE = "#E69F00", "#56B4E9", "#009E73", "#0072B2"
VERMILLION, PURPLE, GREY = "#D55E00", "#CC79A7", "#999999"
"""Okabe and Ito's (2008), which most people tell apart; of methods, and of lines on white."""

OUTLIER = VERMILLION
"""A sample that is an outlier, or is taken for one, on white."""


@dataclass(frozen=True)
class Mark:
    """How a point is drawn that means something.

    Attributes
    ----------
    colour
        As ``#0072B2``.
    marker
        Its shape as Matplotlib names it, for eyes without colours.
    """

    colour: str
    marker: str


MARKS = {
    "caught": Mark("#ffffff", "o"),
    "missed": Mark("#d946ef", "v"),
    "false-alarm": Mark("#ff5a00", "X"),
    "flagged": Mark("#ff8a3d", "X"),
}
"""Of samples over coloured maps; flagged is what nobody can judge. All have a rim."""

RIM, REVISITED = "#10202e", "#7cc7ff"
"""Around marks, and around those near which a later log has been."""

VERDICTS = {
    "supported": Mark(GREEN, "o"),
    "undecided": Mark(ORANGE, "d"),
    "contradicted": Mark(VERMILLION, "x"),
}
"""Of claims in figures, in the order of a legend; what is missing is not drawn."""

ERROR_PARTS = {
    "best_itself": GREY,
    "places": SKY,
    "lost": ORANGE,
    "spikes": VERMILLION,
    "learning": BLUE,
}
"""Parts of the gap to BEST, each a named bar."""

PAGE = {
    "page": ("#ffffff", "#12161c"),
    "panel": ("#f6f7f9", "#1a2029"),
    "text": ("#1c2128", "#e4e8ee"),
    "muted": ("#59636e", "#9aa6b4"),
    "rule": ("#d5dae0", "#323b47"),
    "accent": ("#0b5cad", "#79b8ff"),
    "caution": ("#946200", "#ffd75e"),
    "supported": ("#0b6b45", "#4fd1a5"),
    "contradicted": ("#8f1507", "#f2705c"),
    "undecided": ("#946200", "#ffd75e"),
    "missing": ("#59636e", "#9aa6b4"),
}
"""Of pages and the site, in light and in dark; what is text can be read on page and panel."""

TERMINAL = {
    "caution": "yellow",
    "alarm": "bold yellow",
    "failure": "bold red",
    "supported": "green",
    "contradicted": "red",
    "undecided": "yellow",
    "missing": "dim",
}
"""Of the terminal, as Rich names them: its own colours, which suit its background."""
