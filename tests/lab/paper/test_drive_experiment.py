"""Which frames of a drive serve for temporal consistency, and why none do."""

import pytest

from intervis.lab.paper.drive_experiment import consecutive_numbers
from small_drive import MemoryDrive

POSED = dict.fromkeys((0, 1, 2, 5))


class Drive(MemoryDrive):
    def __len__(self):
        return len(self.frame_numbers)


@pytest.mark.parametrize(
    ("number", "count", "expected"),
    [
        (0, 2, [0, 1]),
        (1, 8, [1, 2, 5]),
        (2, 2, [2, 5]),
        (5, 3, [1, 2, 5]),
        (5, 8, [0, 1, 2, 5]),
    ],
)
def test_frames_follow_the_chosen_one_or_precede_it(number, count, expected):
    assert consecutive_numbers(Drive(poses=POSED), number, count) == (expected, None)


@pytest.mark.parametrize(
    ("drive", "count", "reason"),
    [
        (Drive(poses=POSED), 1, "it was not requested"),
        (Drive((3,), poses={3: None}), 8, "there is a single frame"),
        (Drive(), 8, "the frames have no poses"),
        (Drive(poses={1: None}), 8, "fewer than two frames have poses"),
    ],
)
def test_the_reason_for_leaving_it_out(drive, count, reason):
    numbers, said = consecutive_numbers(drive, 0, count)
    assert numbers == ()
    assert said == f"Temporal consistency is left out: {reason}."
