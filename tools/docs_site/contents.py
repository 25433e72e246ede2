"""The order of the pages on the site.

The pages are plain Markdown that GitHub shows as well, so that no page holds a table of contents
in Sphinx's markup: `pages.py` adds this one to the start page.
"""

CONTENTS = {
    "Sight lines": ["sight", "live", "accuracy", "limits", "calibration"],
    "Uses": [
        "uses",
        "objects",
        "blind_spots",
        "masks",
        "routes",
        "agents",
        "view",
        "recipes",
    ],
    "Data": ["drives", "simulate"],
    "The paper": ["method", "reproduction", "run"],
    "Reference": ["reference", "words", "performance"],
    "Development": ["extending", "testing", "releasing"],
}
"""Captions of the side bar, and the pages of docs/ below each, without ``.md``."""

REFERENCE = ["sight", "drives", "method", "run", "objects", "voxels", "routes", "agents", "errors"]
"""Pages of docs/reference, below the page ``reference``."""


def toctree(pages: list[str], caption: str = "") -> str:
    """A hidden toctree in MyST's markup."""
    options = [":hidden:", *([f":caption: {caption}"] if caption else [])]
    return "\n".join(["", "```{toctree}", *options, "", *pages, "```", ""])


def toctrees(page: str) -> str:
    """What a page gets at its end: the toctrees of the pages below it."""
    if page == "index":
        return "".join(toctree(pages, caption) for caption, pages in CONTENTS.items())
    if page == "reference":
        return toctree([f"reference/{name}" for name in REFERENCE])
    return ""
