"""Which lines one scan can honestly answer: worked out around a house on flat ground."""

import numpy as np
import pytest
from yard import SENSOR, YARD

from intervis.lab.truth.observed import Beams, answerable
from intervis.lab.worlds.ray_casting import RayCaster

FAN = (np.radians(-25.0), np.radians(3.0))
# The house fills x 8 to 16, y -6 to 6, z 0 to 5; the sensor stands 1.7 m over the origin.
FRONT, FRONT_LEFT = (6.0, -3.0, 1.0), (6.0, 3.0, 1.0)
BEHIND, BEHIND_LEFT = (20.0, -3.0, 1.0), (20.0, 3.0, 1.0)


@pytest.mark.parametrize(
    ("start", "end", "visible", "expected"),
    [
        (FRONT, FRONT_LEFT, True, True),  # beams cross it on their way to the house
        (BEHIND, BEHIND_LEFT, True, False),  # in the house's shadow
        (FRONT, BEHIND, False, True),  # through the wall that beams hit
        (BEHIND, FRONT, False, True),  # and back
        ((12.0, 10.0, 1.0), (12.0, -10.0, 1.0), False, False),  # through walls seen edge on
        ((12.0, 16.0, 1.0), (20.0, 16.0, 1.0), True, True),  # past the house, towards the ground
        ((6.0, -3.0, 4.5), (6.0, 3.0, 4.5), True, False),  # above the fan
        ((-20.0, 0.0, 2.2), (-30.0, 0.0, 2.5), True, False),  # beams into the sky tell nothing
        (FRONT, (6.0, -3.0, -2.0), False, True),  # into the ground that beams hit
        (FRONT, (6.0, -3.4, 1.0), True, True),  # too short for anything between its ends
    ],
)
def test_on_paper(start, end, visible, expected):
    beams = Beams(RayCaster(YARD), SENSOR, *FAN)
    found = answerable(beams, np.array(start), np.array([end]), np.array([visible]))
    assert found.tolist() == [expected]


def test_no_lines_are_no_answers():
    nothing = np.empty((0, 3))
    none = np.empty(0, dtype=bool)
    beams = Beams.of_scan(RayCaster(YARD), SENSOR, nothing)
    assert answerable(beams, np.zeros(3), nothing, none).shape == (0,)
