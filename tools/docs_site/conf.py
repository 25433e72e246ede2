"""Sphinx's settings for the documentation site, which `make docs` builds into out/site.

They stand beside the modules that they use and not in docs/, whose pages are Markdown only.
"""

import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import formulas  # noqa: E402
import pages  # noqa: E402
from pygments.lexers.special import TextLexer  # noqa: E402

import intervis  # noqa: E402

project = "intervis"
author = "the authors of intervis"
copyright = "2026, the authors of intervis"
version = release = intervis.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
numpydoc_show_class_members = False
autodoc_typehints = "none"  # types, shapes and units stand in the docstrings
autodoc_member_order = "bysource"
add_module_names = False
default_role = "py:obj"
highlight_language = "none"
nitpicky = True
smartquotes = False

html_theme = "furo"
html_title = "intervis"
html_static_path = [str(HERE / "static")]
html_css_files = ["site.css"]
html_math_renderer = "drawn"
html_copy_source = False
html_theme_options = {
    "source_repository": "https://github.com/intervis/intervis",
    "source_branch": "main",
    "source_directory": "docs/",
}


def _read(app: Any, page: str, source: list[str]) -> None:
    source[0] = pages.as_site_page(page, source[0])


def _docstring(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    lines[:] = map(pages.as_site_docstring, lines)


def _unknown_name(app: Any, env: Any, node: Any, content: Any) -> Any:
    """A name in single backticks that is no documented name, such as an argument: no link."""
    return content if node["reftype"] == "obj" else None


def setup(app: Any) -> None:
    """What Sphinx calls first."""
    app.add_lexer("csv", TextLexer)
    app.connect("source-read", _read)
    app.connect("autodoc-process-docstring", _docstring)
    app.connect("missing-reference", _unknown_name)
    app.add_html_math_renderer(
        "drawn",
        inline_renderers=(formulas.write_inline, None),
        block_renderers=(formulas.write_block, None),
    )
