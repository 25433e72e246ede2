"""Answerable lines around a house on flat ground, with known answers."""

import numpy as np
import pytest
from yard import SENSOR, YARD

from intervis.lab.truth.observed import Beams, answerable
from intervis.lab.worlds.ray_casting import RayCaster

ELEVATION_RANGE = (np.radians(-25.0), np.radians(3.0))
# The house fills x 8 to 16, y -6 to 6, z 0 to 5; the sensor is 1.7 m above the origin.
FRONT, FRONT_LEFT = (6.0, -3.0, 1.0), (6.0, 3.0, 1.0)
BEHIND, BEHIND_LEFT = (20.0, -3.0, 1.0), (20.0, 3.0, 1.0)


@pytest.mark.parametrize(
    ("start", "end", "visible", "expected"),
    [
        (FRONT, FRONT_LEFT, True, True),  # beams cross it on their way to the house
        (BEHIND, BEHIND_LEFT, True, False),  # occluded from the sensor by the house
        (FRONT, BEHIND, False, True),  # through the wall that beams hit
        (BEHIND, FRONT, False, True),  # and back
        ((12.0, 10.0, 1.0), (12.0, -10.0, 1.0), False, False),  # through walls that no beam hits
        ((12.0, 16.0, 1.0), (20.0, 16.0, 1.0), True, True),  # past the house, towards the ground
        ((6.0, -3.0, 4.5), (6.0, 3.0, 4.5), True, False),  # above the highest beam
        ((-20.0, 0.0, 2.2), (-30.0, 0.0, 2.5), True, False),  # beams into the sky return nothing
        (FRONT, (6.0, -3.0, -2.0), False, True),  # into the ground that beams hit
        (FRONT, (6.0, -3.4, 1.0), True, True),  # too short for a sample between its ends
        # samples every metre from 0.5 m on; behind the house no beam reaches y < 15 at x = 20
        ((20.0, 25.2, 1.0), (20.0, 13.2, 1.0), True, True),  # one sample, 1 m, is unobserved
        ((20.0, 25.2, 1.0), (20.0, 12.2, 1.0), True, False),  # two samples
        ((20.0, 12.2, 1.0), (20.0, 25.2, 1.0), True, False),
        # nothing of these is observed: 0.5 m at each end are not sampled, 1 m may be unobserved
        ((20.0, -1.0, 1.0), (20.0, 0.9, 1.0), True, True),
        ((20.0, -1.0, 1.0), (20.0, 1.2, 1.0), True, False),
    ],
)
def test_known_lines(start, end, visible, expected):
    beams = Beams(RayCaster(YARD), SENSOR, *ELEVATION_RANGE)
    found = answerable(beams, np.array(start), np.array([end]), np.array([visible]))
    assert found.tolist() == [expected]


def test_no_lines_give_no_answers():
    nothing = np.empty((0, 3))
    none = np.empty(0, dtype=bool)
    beams = Beams.of_scan(RayCaster(YARD), SENSOR, nothing)
    assert answerable(beams, np.zeros(3), nothing, none).shape == (0,)
