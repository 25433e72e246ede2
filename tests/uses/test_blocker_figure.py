"""Pictures of what blocks: every target is drawn once, and the bars hold the shares."""

import numpy as np
import pytest

from intervis.sight import Sight
from intervis.uses.semantics.blocker_figure import (
    OTHER,
    OTHER_COLOUR,
    Panel,
    _colours,
    _groups,
    blocker_picture,
)

pytest.importorskip("matplotlib", reason="matplotlib, which draws, is not installed")
TARGETS = np.array([[5.0, 0, 0], [6, 0, 0], [7, 0, 0], [8, 0, 0], [90, 0, 0]])


def panel(title, state, classes):
    state = np.array(state, np.int8)
    nothing = np.full(len(state), np.nan)
    sight = Sight(state, nothing, np.full((len(state), 3), np.nan), nothing, nothing)
    return Panel(title, sight, np.array(classes))


BEFORE = panel("as scanned", [1, 0, 0, -1, 0], ["", "car", "vegetation", "", "car"])
AFTER = panel("without car", [1, 1, 0, -1, -1], ["", "", "vegetation", "", ""])


def test_every_target_belongs_to_one_group():
    many = [f"class {n}" for n in range(9)]
    crowded = panel("as scanned", [0] * 9 + [1, -1], [*many, "", ""])
    colours = _colours([crowded])
    assert colours[OTHER] == OTHER_COLOUR
    assert len(set(colours.values())) == len(colours)
    masks = np.array([mask for _, mask in _groups(crowded, colours)])
    assert (masks.sum(axis=0) == 1).all()
    assert OTHER not in _colours([BEFORE, AFTER])


def test_bars_hold_the_shares_of_the_lines_occluded_as_scanned():
    figure = blocker_picture(TARGETS, np.zeros(3), [BEFORE, AFTER])
    above, beside, bars = figure.axes
    assert (above.get_title(loc="left"), beside.get_title(loc="left")) == (
        *("As scanned", "Without car"),
    )
    widths = {
        row: sorted(bar.get_width() for bar in bars.patches if round(bar.get_y() + 0.35) == -row)
        for row in (0, 1)
    }
    # As scanned: car 2 of 3, vegetation 1 of 3. Without: vegetation, visible and unknown 1 of 3.
    assert [width for width in widths[0] if width] == pytest.approx([100 / 3, 200 / 3])
    assert [width for width in widths[1] if width] == pytest.approx([100 / 3] * 3)
    said = [text.get_text() for text in above.texts]
    assert said == ["20 % visible, 60 % occluded, 20 % unknown"]


def test_one_panel_and_no_occluded_line_are_drawn():
    open_lines = panel("as scanned", [1, 1, 1, 1, 1], [""] * 5)
    figure = blocker_picture(TARGETS, np.zeros(3), [open_lines])
    assert len(figure.axes) == 2
    assert blocker_picture(TARGETS[:0], np.zeros(3), [panel("as scanned", [], [])]).axes
