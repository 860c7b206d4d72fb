"""How Sphinx makes a site of these pages: `make docs`. It fetches nothing."""

import re
from importlib import import_module

import infoplan
from infoplan.draw.page_theme import site_variables

project = "infoplan"
version = release = infoplan.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "infoplan"
html_theme_options = site_variables()
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_copyright = False
html_copy_source = False

# The same links work in a repository browser: headings have anchors as there.
myst_heading_anchors = 4
myst_links_external_new_tab = False
highlight_language = "text"

# A name in single backticks is a link where there is one.
default_role = "py:obj"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

PUBLIC = re.compile(r"^## `([\w.]+)`$", re.MULTILINE)


def navigation(text: str) -> str:
    """Make the side bar of the front page's lists: a caption a heading, an entry a link."""
    trees = ""
    for section in text.split("\n## ")[1:]:
        caption, _, body = section.partition("\n")
        pages = "\n".join(re.findall(r"\]\(([\w/]+)\.md\)", body))
        trees += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{pages}\n```\n"
    return text + trees


def reference(text: str) -> str:
    """Put the docstrings of all public names of a module under its heading and table."""
    parts, told = PUBLIC.split(text), set()
    for place in range(1, len(parts), 2):
        module = import_module(parts[place])
        names = re.findall(r"^\| `(\w+)` \|", parts[place + 1], re.MULTILINE)
        entries = "\n\n".join(_directive(module, name, told) for name in names)
        parts[place] = f"## `{parts[place]}`"
        parts[place + 1] += f"\n```{{eval-rst}}\n{entries}\n```\n\n"
    return "".join(parts)


def whole(text: str) -> str:
    """Leave the link to a file out of a page that holds that file."""
    head, _, rest = text.partition("\n")
    return f"{head}\n\n```{rest.partition('```')[2]}"


def _directive(module, name: str, told: set) -> str:
    """Write the directive of a name; what two modules offer is in the index once."""
    one = getattr(module, name)
    options = ["members"] if isinstance(one, type) else []
    options += ["no-index"] if one in told else []
    told.add(one)
    kind = "autoclass" if isinstance(one, type) else "autofunction"
    return "\n".join([f".. {kind}:: {module.__name__}.{name}", *(f"   :{o}:" for o in options)])


def _read(app, page: str, source: list[str]) -> None:
    """Complete pages while they are read; in a repository browser they stand as they are."""
    changes = {"index": navigation, "reference": reference}
    change = (changes | {"changelog": whole, "contributing": whole}).get(page)
    if change:
        source[0] = change(source[0])


def setup(app) -> None:
    """Be asked by Sphinx."""
    app.connect("source-read", _read)
