"""The answers for objects in boxes: which share of each is visible."""

from __future__ import annotations  # help() shows the names of the array types

from dataclasses import dataclass

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.sight.box_surface import SurfacePoints
from intervis.sight.sight import Sight


@dataclass(frozen=True, eq=False, repr=False)
class BoxSight:
    """Shares of B objects, by solid angle of the part of their surface that faces the viewpoint.

    Attributes
    ----------
    visible, occluded, unknown : (B,) float64 arrays
        Shares with these states; the three sum to 1. NaN where the viewpoint lies in the box.
    probability : (B,) float64 array
        Expected visible share: the mean of P(visible) over the surface.
    blocker : (B, 3) float64 array
        Scene frame, metres: where the blocked line whose blocker is the median of all, by distance
        from the viewpoint, is blocked; NaN where no line is.
    lines : (B,) int64 array
        Number of sight lines.
    """

    visible: Float64Array
    occluded: Float64Array
    unknown: Float64Array
    probability: Float64Array
    blocker: Float64Array
    lines: IntArray

    def __len__(self) -> int:
        return len(self.visible)

    def __repr__(self) -> str:
        seen = int((self.visible >= 0.5).sum())
        return f"<BoxSight: {len(self)} boxes, {seen} at least half visible>"


def box_sight(
    viewpoint: Float64Array, surface: SurfacePoints, sight: Sight, count: int
) -> BoxSight:
    """Sum the answers for the points of the surfaces of `count` boxes."""
    lines = np.bincount(surface.box, minlength=count)
    known = lines > 0

    def share(values: Float64Array) -> Float64Array:
        total = np.bincount(surface.box, values * surface.share, count)
        return np.where(known, total, np.nan)

    blocker = np.full((count, 3), np.nan)
    for box in np.unique(surface.box[sight.occluded]):
        blocked = sight.blocker[(surface.box == box) & sight.occluded]
        order = np.argsort(np.linalg.norm(blocked - viewpoint, axis=1), kind="stable")
        blocker[box] = blocked[order[(len(order) - 1) // 2]]
    return BoxSight(
        share(sight.visible.astype(np.float64)),
        share(sight.occluded.astype(np.float64)),
        share(sight.unknown.astype(np.float64)),
        share(sight.probability),
        blocker,
        lines,
    )
