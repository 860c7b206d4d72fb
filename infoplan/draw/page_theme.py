"""What all pages look like: palette, fonts and sizes as custom properties of a style sheet."""

from collections.abc import Mapping

from infoplan.palette import MARKS, PAGE, REVISITED, RIM

FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif'
MONO = 'ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace'

ALWAYS = {
    "font": FONT,
    "mono": MONO,
    "small": "0.9rem",
    "tiny": "0.82rem",
    "rim": RIM,
    "revisited": REVISITED,
    **{name: mark.colour for name, mark in MARKS.items()},
}
"""In light and in dark."""

DARKENED = {
    "lift": ("0%", "25%"),
    "least": ("0", "0.62"),
    "dim": ("brightness(1)", "brightness(0.8)"),
}
"""In light and in dark: how methods' colours are lightened, by a share of white or, in newer
browsers, to a least lightness in OKLCH; and how bright a map is."""


def custom_properties() -> str:
    """Write what page.css and the pages' own style sheets refer to as ``var(--name)``.

    Dark is what the reader's system asks for, or the page's button; paper is light.
    """
    themed = PAGE | DARKENED
    light = _rules({name: pair[0] for name, pair in themed.items()} | {"color-scheme": "light"})
    dark = _rules({name: pair[1] for name, pair in themed.items()} | {"color-scheme": "dark"})
    return (
        f":root {{{_rules(ALWAYS)}{light}}}\n"
        '@media screen { :root[data-theme="dark"] {' + dark + "} }\n"
        '@media screen and (prefers-color-scheme: dark) { :root:not([data-theme="light"]) {'
        + dark
        + "} }\n"
    )


def site_variables() -> dict[str, dict[str, str]]:
    """Give the variables of Sphinx's theme Furo: ``light_css_variables`` and those in dark."""
    return {
        f"{theme}_css_variables": {
            "font-stack": FONT,
            "font-stack--monospace": MONO,
            "color-background-primary": PAGE["page"][side],
            "color-background-secondary": PAGE["panel"][side],
            "color-background-border": PAGE["rule"][side],
            "color-foreground-primary": PAGE["text"][side],
            "color-foreground-secondary": PAGE["muted"][side],
            "color-foreground-muted": PAGE["muted"][side],
            "color-brand-primary": PAGE["accent"][side],
            "color-brand-content": PAGE["accent"][side],
            "color-brand-visited": PAGE["accent"][side],
        }
        for side, theme in enumerate(("light", "dark"))
    }


def _rules(values: Mapping[str, str]) -> str:
    """Write declarations; ``color-scheme`` alone is no property of our own."""
    return " ".join(
        f"{name if name == 'color-scheme' else f'--{name}'}: {value};"
        for name, value in values.items()
    )
