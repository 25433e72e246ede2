"""The Markdown of the repository, taken apart: blocks of code, links, headings, tables."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]

NOT_RUN = re.compile(r"<!-- not run(?: \((?P<lines>[^)]+)\))?: (?P<reason>.+?) -->", re.DOTALL)
"""Stands before a block that is not run, or of which the lines with some text are not."""


@dataclass(frozen=True)
class Block:
    """A fenced block of code.

    Attributes
    ----------
    page : Path
    line : int
        Of the page, from 1.
    language : str
        What stands behind the fence.
    text : str
    reason : str
        Why it, or some of its lines, are not run; empty for one that is run.
    left_out : tuple of str
        Only lines with one of these texts are not run; empty: none is.
    """

    page: Path
    line: int
    language: str
    text: str
    reason: str
    left_out: tuple[str, ...]

    @property
    def is_run(self) -> bool:
        """Whether at least some of its lines are run."""
        return not self.reason or bool(self.left_out)

    def commands(self) -> list[str]:
        """Its command lines, without prompts, continued lines joined."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [line for one in lines if (line := one.strip().removeprefix("$ "))]

    def run_commands(self) -> list[str]:
        """Those of its command lines that are run."""
        if not self.is_run:
            return []
        return [line for line in self.commands() if not any(one in line for one in self.left_out)]


def relative(page: Path) -> str:
    """A page's name for messages and for the ids of tests."""
    return page.relative_to(ROOT).as_posix()


def tokens(page: Path) -> list[Token]:
    """The page as markdown-it reads it, with tables, as GitHub does."""
    return MarkdownIt("commonmark").enable("table").parse(page.read_text(encoding="utf-8"))


def blocks(page: Path) -> Iterator[Block]:
    """The fenced blocks of a page."""
    comment = None
    for token in tokens(page):
        if token.type == "fence":
            line = (token.map or [0])[0] + 1
            reason, some = (comment["reason"], comment["lines"]) if comment else ("", None)
            left_out = tuple(some.split(", ")) if some else ()
            yield Block(page, line, token.info.strip(), token.content, reason, left_out)
        comment = NOT_RUN.match(token.content) if token.type == "html_block" else None


def inline_tokens(page: Path) -> Iterator[Token]:
    """Links, pictures, words and code within the text of a page."""
    for token in tokens(page):
        yield from token.children or ()


def links(page: Path) -> Iterator[str]:
    """Targets of links and pictures, without those on the web."""
    for token in inline_tokens(page):
        target = str(token.attrs.get("href") or token.attrs.get("src") or "")
        if target and not re.match(r"[a-z]+:", target):
            yield target


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and MyST make them."""
    found: dict[str, int] = {}
    names = set()
    heading = False
    for token in tokens(page):
        if heading:
            text = "".join(part.content for part in token.children or ())
            slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
            count = found.get(slug, 0)
            found[slug] = count + 1
            names.add(f"{slug}-{count}" if count else slug)
        heading = token.type == "heading_open"
    return names
