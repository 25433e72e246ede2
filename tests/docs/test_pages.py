"""The pages of the documentation: complete, linked, and true to the names they list.

`make docs` is not part of `make test`: what would fail there is looked for here, without Sphinx.
"""

import importlib
import inspect
import re
import shlex
from pathlib import Path

import pytest
from markdown_pages import (
    DOCS,
    PAGES,
    ROOT,
    anchors,
    blocks,
    inline_tokens,
    links,
    relative,
    tokens,
)
from typer.main import get_command

import intervis
from intervis.cli import COMMANDS
from intervis.cli.program import app

LANGUAGES = {"python", "pycon", "sh", "console", "toml", "csv", "markdown"}
"""What stands behind a fence: doctests are pycon; toml and csv are read by the tests of a page."""

SUBPACKAGES = ("drives", "live", "run", "sight", "uses", "view")
PUBLIC = ("intervis", *(f"intervis.{name}" for name in SUBPACKAGES))
NAME_ROW = re.compile(r"^\| \[`([\w.]+)`\]\(([^)]+)\) \| (.*) \|$", re.MULTILINE)


@pytest.fixture
def site(monkeypatch):
    """The modules of the site that need no Sphinx."""
    monkeypatch.syspath_prepend(str(ROOT / "tools" / "docs_site"))
    return importlib.import_module("contents"), importlib.import_module("pages")


def test_every_page_stands_in_the_contents_once(site):
    contents, _ = site
    listed = [name for pages in contents.CONTENTS.values() for name in pages]
    assert sorted(listed) == sorted({path.stem for path in DOCS.glob("*.md")} - {"index"})
    reference = sorted(path.stem for path in (DOCS / "reference").glob("*.md"))
    assert sorted(contents.REFERENCE) == reference


def test_the_start_page_leads_to_every_page():
    found = {target.partition("#")[0] for target in links(DOCS / "index.md")}
    assert {path.name for path in DOCS.glob("*.md")} - {"index.md"} <= found
    below = {target.partition("#")[0] for target in links(DOCS / "reference.md")}
    assert {f"reference/{path.name}" for path in (DOCS / "reference").glob("*.md")} <= below


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_links_lead_somewhere(page):
    broken = []
    for target in links(page):
        place, _, anchor = target.partition("#")
        file = (page.parent / place).resolve() if place else page
        there = file.exists() and file.is_relative_to(ROOT)
        if not there or (anchor and file.suffix == ".md" and anchor not in anchors(file)):
            broken.append(target)
    assert not broken


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_a_page_has_one_title_and_pictures_say_what_they_show(page):
    titles = [one for one in tokens(page) if one.type == "heading_open" and one.tag == "h1"]
    assert len(titles) == 1
    pictures = [token for token in inline_tokens(page) if token.type == "image"]
    assert not [token.attrs["src"] for token in pictures if len(token.content) < 15]


def test_every_picture_is_shown():
    shown = {Path(target).name for page in PAGES for target in links(page)}
    assert {path.name for path in (DOCS / "images").iterdir()} <= shown


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_no_table_is_torn(page):
    """A row that an empty line cuts off from its table is shown as text with bars."""
    torn = [
        token.content
        for token in tokens(page)
        if token.type == "inline" and token.content.startswith("|")
    ]
    assert not torn


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_blocks_name_their_language(page):
    assert {block.language for block in blocks(page)} <= LANGUAGES


def test_the_reference_lists_every_public_name():
    listed = [
        name
        for page in (DOCS / "reference").glob("*.md")
        for name, _, _ in NAME_ROW.findall(page.read_text())
    ]
    assert len(listed) == len(set(listed))
    values = {id(_value(name)) for name in listed}
    for module in PUBLIC:
        for name in importlib.import_module(module).__all__:
            assert f"{module}.{name}" in listed or id(_value(f"{module}.{name}")) in values


@pytest.mark.parametrize("page", sorted((DOCS / "reference").glob("*.md")), ids=relative)
def test_the_reference_says_what_the_docstrings_say(page):
    for name, file, text in NAME_ROW.findall(page.read_text()):
        value = _value(name)
        source = (page.parent / file).resolve()
        attribute = name.rpartition(".")[2]
        if inspect.isclass(value) or inspect.isfunction(value):
            assert source == Path(inspect.getfile(value))
            assert text == (inspect.getdoc(value) or "").partition("\n\n")[0].replace("\n", " ")
        else:  # a constant, which has no docstring of its own
            assert re.search(rf"^.*\b{attribute}\b.* = ", source.read_text(), re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_commands_of_blocks_are_understood(page):
    """All lines, also those that are not run: a renamed option is found here."""
    for block in blocks(page):
        for line in block.commands():
            name, *words = shlex.split(line.replace(" ...", ""), comments=True) or [""]
            if name == "intervis" and words and words[0] in COMMANDS:
                _command(words[0]).make_context(words[0], words[1:])


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_commands_in_the_text_have_the_options_they_name(page):
    for token in inline_tokens(page):
        name, *words = token.content.split() or [""]
        if token.type == "code_inline" and name == "intervis" and words:
            assert words[0] in COMMANDS or words[0].startswith("-") or words[0] == "COMMAND"
            if words[0] in COMMANDS:
                asked = set(re.findall(r"--[a-z-]+", token.content))
                assert asked <= _options(words[0]), token.content


def test_the_site_leads_from_links_to_source_to_the_repository(site):
    _, pages = site
    text = "[a](../src/intervis/camera.py) [b](../examples) [c](method.md#7-measures)"
    shown = pages.as_site_page("sight", text)
    assert f"[a]({pages.SOURCE}/blob/main/src/intervis/camera.py)" in shown
    assert f"[b]({pages.SOURCE}/tree/main/examples)" in shown
    assert "[c](method.md#7-measures)" in shown
    assert "[d](../sight.md)" in pages.as_site_page("reference/agents", "[d](../sight.md)")


def test_the_site_leads_from_docstrings_to_pages(site):
    _, pages = site
    shown = pages.as_site_docstring("`docs/accuracy.md`, ``docs/sight.md``, `tau`")
    assert shown == ":doc:`/accuracy`, :doc:`/sight`, `tau`"


def test_the_site_describes_each_name_of_a_table(site):
    _, pages = site
    row = "| [`intervis.{0}`](../../src/intervis/errors.py) | Text. |"
    names = ("PoseError", "Scene", "explain", "VISIBLE")
    shown = pages.as_site_page("reference/x", "\n".join(row.format(name) for name in names))
    for directive, name in zip(
        ("autoexception", "autoclass", "autofunction", "py:data"), names, strict=True
    ):
        assert f".. {directive}:: intervis.{name}\n" in shown
        assert f"{{py:obj}}`intervis.{name}`" in shown
    assert f":value: {intervis.VISIBLE}" in shown


def _value(name: str) -> object:
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def _command(name: str):
    return get_command(app).commands[name]


def _options(name: str) -> set[str]:
    options = {"--help"}
    for one in _command(name).params:
        options |= {*one.opts, *one.secondary_opts}
    return options
