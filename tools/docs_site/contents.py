"""The order of the pages on the site.

The pages are plain Markdown that GitHub shows as well, so that no page holds a table of contents
in Sphinx's markup: `pages.py` adds this one to the start page.
"""

from collections.abc import Iterable

CONTENTS: dict[str, dict[str, str]] = {
    "Sight lines": {
        "sight": "Sight lines",
        "live": "While scans arrive",
        "accuracy": "Accuracy",
        "limits": "Limits",
        "calibration": "Calibration",
    },
    "Uses": {
        "uses": "Overview",
        "objects": "Objects",
        "semantics": "Classes of blockers",
        "blind_spots": "Blind spots",
        "masks": "Grids and masks",
        "routes": "Routes, sight distance",
        "agents": "Agents",
        "siting": "Places for scanners",
        "view": "The interactive page",
        "recipes": "Recipes",
    },
    "Data": {"drives": "Drives and formats", "simulate": "Simulated drives"},
    "The paper": {
        "method": "The method",
        "reproduction": "Reproduction",
        "run": "Files of a run",
    },
    "Reference": {
        "reference": "Names of the library",
        "words": "Words",
        "performance": "Performance",
    },
    "Development": {"extending": "Extending", "testing": "Tests", "releasing": "Releasing"},
}
"""Captions of the side bar; below each pages of docs/, without ``.md``, and their titles there."""

REFERENCE = [
    "sight",
    "drives",
    "method",
    "run",
    "objects",
    "voxels",
    "routes",
    "agents",
    "sites",
    "errors",
]
"""Pages of docs/reference, below the page ``reference``."""


def toctree(pages: Iterable[str], caption: str = "") -> str:
    """A hidden toctree in MyST's markup."""
    options = [":hidden:", *([f":caption: {caption}"] if caption else [])]
    return "\n".join(["", "```{toctree}", *options, "", *pages, "```", ""])


def toctrees(page: str) -> str:
    """What a page gets at its end: the toctrees of the pages below it."""
    if page == "index":
        return "".join(
            toctree([f"{title} <{name}>" for name, title in pages.items()], caption)
            for caption, pages in CONTENTS.items()
        )
    if page == "reference":
        return toctree([f"reference/{name}" for name in REFERENCE])
    return ""
