"""Formulas as drawings within the page: no script, no font, no network.

MathML would be shorter, but few systems have a font that browsers need to draw it well.
"""

from html import escape
from typing import Any

import ziamath
from docutils.nodes import SkipNode
from sphinx.util.logging import getLogger

ziamath.config.svg2 = False  # outlines, not symbols, whose names would meet within a page
ziamath.config.precision = 2
INLINE_PX, BLOCK_PX = 17.0, 19.0
TALLEST_PX = 150
LOGGER = getLogger(__name__)


def write_inline(writer: Any, node: Any) -> None:
    """Write a formula within a line, on the line's base."""
    formula = ziamath.Latex(node.astext().strip(), INLINE_PX, color="currentColor", inline=True)
    base = f'style="vertical-align: {formula.getyofst():.2f}px"'
    writer.body.append(f'<span class="formula" {_text(node)} {base}>{formula.svg()}</span>')
    raise SkipNode


def write_block(writer: Any, node: Any) -> None:
    """Write a formula on a line of its own, in a box that scrolls where it is too wide."""
    formula = ziamath.Latex(node.astext().strip(), BLOCK_PX, color="currentColor")
    if formula.getsize()[1] > TALLEST_PX:  # ziamath draws some brackets as high as a house
        LOGGER.warning("formula is too high: %s", node.astext(), location=node)
    writer.body.append(f'<div class="formula" {_text(node)}>{formula.svg()}</div>\n')
    raise SkipNode


def _text(node: Any) -> str:
    """What those hear who do not see the drawing: the formula in TeX."""
    return f'role="math" aria-label="{escape(node.astext().strip())}"'
