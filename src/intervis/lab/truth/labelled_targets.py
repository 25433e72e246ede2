"""Targets that a reference scan labels: returns of another scan, or random points in space."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from intervis.arrays import BoolArray, Float64Array, FloatArray
from intervis.drives import Drive
from intervis.lab.truth.choices import checked_choice
from intervis.lab.truth.held_out import DRIVE_RULE, LabelRule, held_out_labels
from intervis.lab.truth.space_points import SPACE_COUNT, space_points
from intervis.sight.query_checks import rate_of
from intervis.transform import transform

TargetKind = Literal["returns", "space"]
TARGET_KINDS: tuple[TargetKind, ...] = get_args(TargetKind)
"""Targets of an evaluation against a reference scan: returns of scan i, or points in space."""


def checked_targets(name: str) -> TargetKind:
    """The kind of targets.

    Raises
    ------
    SettingsError
        There is no such kind.
    """
    return checked_choice(name, TARGET_KINDS, "there are no targets")


@dataclass(frozen=True)
class HeldOutSettings:
    """How a reference scan of a drive is used.

    Attributes
    ----------
    targets : {"returns", "space"}
        Points of scan i, or random points in the field of view of scan j
        (`intervis.lab.truth.space_points`).
    rule : LabelRule
        How the returns of scan j label points.
    rate_hz : float or None
        Frames a second, for a drive without timestamps.

    Raises
    ------
    SettingsError
        No such targets, or the rate is not from 1e-6 to 1e6.
    """

    targets: str = "returns"
    rule: LabelRule = DRIVE_RULE
    rate_hz: float | None = None

    def __post_init__(self) -> None:
        checked_targets(self.targets)
        if self.rate_hz is not None:
            rate_of("the rate of scans", self.rate_hz)

    def timestamps_ns(self, drive: Drive) -> Mapping[int, int]:
        """Time of each frame of a drive; none where neither times nor a rate are known."""
        if drive.timestamps_ns or self.rate_hz is None:
            return drive.timestamps_ns
        return {number: round(1e9 * number / self.rate_hz) for number in drive.frame_numbers}


HELD_OUT = HeldOutSettings()
"""Returns as targets, without times that the drive does not have."""


def targets_suffix(targets: str) -> str:
    """The end of the name of a ground truth: names the targets, empty for returns."""
    return ", random points in space" if targets == "space" else ""


Posed = tuple[FloatArray, Float64Array]
"""A scan (N, 3) in its sensor's frame, and its pose (4, 4)."""


def labelled_targets(
    kind: str, known: Posed, reference: Posed, rule: LabelRule, seed: tuple[int, int]
) -> tuple[Float64Array, BoolArray]:
    """Targets (K, 3) in the frame of the poses, and whether they are visible from the reference."""
    if kind == "space":
        rng = np.random.default_rng(seed)
        found = space_points(reference[0], rule, SPACE_COUNT, rng)
        return transform(reference[1], found.points), found.visible
    labels = held_out_labels(*known, *reference, rule)
    return transform(known[1], known[0][labels.index]), labels.visible
