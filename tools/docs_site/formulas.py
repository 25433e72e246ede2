"""Formulas as MathML, which browsers draw themselves: no script, no font, no network."""

from typing import Any

from docutils.nodes import SkipNode
from latex2mathml.converter import convert


def write_inline(writer: Any, node: Any) -> None:
    """Write a formula within a line."""
    writer.body.append(convert(node.astext().strip()))
    raise SkipNode


def write_block(writer: Any, node: Any) -> None:
    """Write a formula on a line of its own, in a box that scrolls where it is too wide."""
    formula = convert(node.astext().strip(), display="block")
    writer.body.append(f'<div class="formula">{formula}</div>\n')
    raise SkipNode
