"""What the site adds to the plain Markdown of docs/ when it reads a page.

The toctrees, links to files outside docs/, and below each table of names of docs/reference the
docstrings of these names.
"""

import inspect
import re
from importlib import import_module
from pathlib import Path

from contents import toctrees

DOCS = Path(__file__).resolve().parents[2] / "docs"
SOURCE = "https://github.com/intervis/intervis"
OUTSIDE = re.compile(r"\]\(((?:\.\./)+)([^)#\s]*)(#[^)\s]*)?\)")
PAGE_IN_DOCSTRING = re.compile(r"`{1,2}docs/(\w+)\.md`{1,2}")
NAME_ROW = re.compile(r"^\| \[`(?P<name>[\w.]+)`\]\((?P<file>[^)]+)\) \| (?P<text>.*) \|$", re.M)


def as_site_page(page: str, text: str) -> str:
    """The text of a page as the site shows it.

    Parameters
    ----------
    page : str
        The page below docs/, without ``.md``.
    text : str
        Its Markdown.
    """
    if page.startswith("reference/"):
        text = _with_docstrings(text)
    return _with_links_to_source(page, text) + toctrees(page)


def as_site_docstring(line: str) -> str:
    """A line of a docstring, in which the file of a page becomes a link to the page."""
    return PAGE_IN_DOCSTRING.sub(r":doc:`/\1`", line)


def _with_links_to_source(page: str, text: str) -> str:
    """Links to files that are no page lead to the repository."""

    def link(found: re.Match[str]) -> str:
        target = (DOCS / page).parent / found[1] / found[2]
        if target.resolve().is_relative_to(DOCS):
            return found[0]
        place = target.resolve().relative_to(DOCS.parent).as_posix()
        kind = "tree" if target.is_dir() else "blob"
        return f"]({SOURCE}/{kind}/main/{place}{found[3] or ''})"

    return OUTSIDE.sub(link, text)


def _with_docstrings(text: str) -> str:
    """Names in tables become links to their docstrings, which follow the text."""
    described = [_description(row["name"], row["text"]) for row in NAME_ROW.finditer(text)]
    linked = NAME_ROW.sub(r"| {py:obj}`\g<name>` | \g<text> |", text)
    return "\n".join([linked, "", "```{eval-rst}", *described, "```", ""])


def _description(name: str, text: str) -> str:
    """Markup that documents one name; a constant has no docstring but its row's text."""
    module, _, attribute = name.rpartition(".")
    value = getattr(import_module(module), attribute)
    if inspect.isclass(value):
        kind = "exception" if issubclass(value, Exception) else "class"
        return f".. auto{kind}:: {name}\n   :members:\n"
    if callable(value):
        return f".. autofunction:: {name}\n"
    plain = text.replace("`", "``")
    shown = f"   :value: {value!r}\n" if isinstance(value, int | str) else ""
    return f".. py:data:: {name}\n{shown}\n   {plain}\n"
