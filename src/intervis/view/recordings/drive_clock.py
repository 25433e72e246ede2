"""The times of the frames of a recording."""

from collections.abc import Sequence

from intervis.drives import Drive

NS_PER_FRAME = 100_000_000
"""Assumed between frames of a drive without timestamps: 10 frames a second."""

EPOCH_FROM_NS = 631_152_000_000_000_000
"""1 January 1990: later times are taken as times since 1970, earlier ones as durations."""


class DriveClock:
    """The times of the frames of a drive, nanoseconds.

    Parameters
    ----------
    drive : Drive
    numbers : sequence of int
        The frames of the recording.

    Attributes
    ----------
    is_measured : bool
        Whether the drive has timestamps for all of them; otherwise 10 frames a second are assumed.
    is_epoch : bool
        Whether the times count from 1970.
    """

    def __init__(self, drive: Drive, numbers: Sequence[int]) -> None:
        self._times_ns = drive.timestamps_ns
        self.is_measured = all(self._times_ns.get(number, -1) >= 0 for number in numbers)
        self.is_epoch = self.is_measured and self.time_ns(numbers[0]) >= EPOCH_FROM_NS

    def time_ns(self, number: int) -> int:
        """Time of a frame; assumed where the drive has none."""
        return self._times_ns[number] if self.is_measured else number * NS_PER_FRAME
