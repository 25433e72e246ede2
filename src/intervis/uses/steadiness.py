"""Steadiness of blind spots: ground that changes between blind and visible, and why."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from intervis.arrays import BoolArray, Float64Array, FloatArray, checked_point, finite_rows
from intervis.drives import Drive
from intervis.errors import DriveError
from intervis.plots.tables import Table
from intervis.progress import Progress, silent
from intervis.sight import VISIBLE, Scene, Sight
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.query_checks import finite_number
from intervis.transform import inverse, transform
from intervis.uses.visibility_grid import obstacle_cells, visibility_grid

STILL_M = 0.05
"""A viewpoint that moves no farther explains no change."""
SAME_M = 0.3
"""A blocker with a return of the other scan so near is there in both."""


@dataclass(frozen=True, eq=False)
class Look:
    """One frame as it judges the ground: its scan and where it looks from, in a common frame.

    Attributes
    ----------
    scene : Scene
        Of the scan of the frame.
    viewpoint : (3,) float64 array
        Metres.
    returns : (N, 3) float64 array
        Finite returns of the scan, metres.
    """

    scene: Scene
    viewpoint: Float64Array
    returns: Float64Array

    @classmethod
    def from_scan(
        cls, points: FloatArray, viewpoint: ArrayLike, pose: Float64Array | None = None
    ) -> "Look":
        """The look of a scan from a viewpoint (3,), both in the sensor's frame.

        `pose` (4, 4) takes them to the common frame; None: it is the sensor's.
        """
        common_from_velo = np.eye(4) if pose is None else pose
        returns = transform(common_from_velo, points[finite_rows(points), :3])
        place = transform(common_from_velo, checked_point(viewpoint))
        return cls(Scene.from_scan(points, pose), place, returns)


@dataclass(frozen=True)
class Flips:
    """Changes of the ground between two frames, as shares of the area judged in both.

    A cell flips if it is visible in one frame and blind (occluded or unknown) in the other. Each
    flip has one cause: the first of these that holds. Shares are NaN where nothing was judged.

    Attributes
    ----------
    motion_m : float
        How far the viewpoint moved.
    judged_m2 : float
        Area of the cells with ground below that hold no obstacle in either frame.
    flipped : float
        Share that flips: the sum of the three below.
    by_motion : float
        The viewpoint moved more than `STILL_M`, and a single scan, asked from both viewpoints,
        tells of a change as well.
    by_returns : float
        The cell is occluded in one frame, and the other scan has no return within `SAME_M` of the
        blocker: it came or went.
    without_cause : float
        Neither.
    contradicted : float
        The part of `without_cause` that is occluded in one frame; the rest is unknown there.
    """

    motion_m: float
    judged_m2: float
    flipped: float
    by_motion: float
    by_returns: float
    without_cause: float
    contradicted: float


def flips_between(
    earlier: Look,
    later: Look,
    *,
    reach_m: float = 40.0,
    cell_m: float = 0.4,
    height_m: float = 1.0,
    risk: float = DEFAULT_RISK,
    still_m: float = STILL_M,
) -> Flips:
    """How much ground changes between blind and visible from one frame to the next.

    Both frames judge the same points: the middles of cells around the earlier viewpoint, `height_m`
    above the ground that the earlier scan shows.

    Parameters
    ----------
    earlier, later : Look
        In one frame.
    reach_m, cell_m, height_m, risk
        See `visibility_grid`.
    still_m : float
        Own motion up to here explains no change.

    Raises
    ------
    SettingsError, PointsError, SceneError
        As `visibility_grid`.

    Examples
    --------
    The same scan twice: nothing changes.

    >>> x, y = np.meshgrid(np.arange(-9, 9, 0.2), np.arange(-9, 9, 0.2))
    >>> flat = np.stack([x.ravel(), y.ravel(), np.full(x.size, -1.7)], axis=1)
    >>> look = Look.from_scan(flat, [0, 0, 0])
    >>> flips_between(look, look, reach_m=8.0).flipped
    0.0
    """
    still_m = finite_number("still_m", still_m, "metres")
    asked = {"reach_m": reach_m, "cell_m": cell_m, "height_m": height_m, "risk": risk}
    grid = visibility_grid(earlier.scene, earlier.viewpoint, earlier.returns, **asked)
    filled = obstacle_cells(
        later.returns, later.scene, grid.corner, grid.cell_m, len(grid.ground_m)
    )
    judged = np.isfinite(grid.ground_m) & ~grid.obstacle & ~filled
    points = np.column_stack([grid.middles[judged], grid.ground_m[judged] + grid.height_m])
    first = earlier.scene.sight(earlier.viewpoint, points, risk=risk)
    last = later.scene.sight(later.viewpoint, points, risk=risk)
    flipped = first.visible != last.visible
    motion_m = float(np.linalg.norm(later.viewpoint - earlier.viewpoint))
    by_motion = np.zeros(len(points), np.bool_)
    if motion_m > still_m:
        moved = earlier.scene.sight(later.viewpoint, points, risk=risk)
        back = later.scene.sight(earlier.viewpoint, points, risk=risk)
        by_motion = (moved.visible != first.visible) | (back.visible != last.visible)
        by_motion &= flipped
    changed = _is_gone(first, later.returns) | _is_gone(last, earlier.returns)
    by_returns = flipped & ~by_motion & changed
    rest = flipped & ~by_motion & ~by_returns
    contradicted = rest & (first.occluded | last.occluded)
    count = len(points) or math.nan  # of nothing there are no shares
    return Flips(
        motion_m=motion_m,
        judged_m2=len(points) * grid.cell_m**2,
        flipped=float(flipped.sum()) / count,
        by_motion=float(by_motion.sum()) / count,
        by_returns=float(by_returns.sum()) / count,
        without_cause=float(rest.sum()) / count,
        contradicted=float(contradicted.sum()) / count,
    )


def _is_gone(sight: Sight, returns: Float64Array) -> BoolArray:
    """Lines (M,) whose blocker has no return (N, 3) of another scan nearby."""
    gone = np.zeros(len(sight), np.bool_)
    blocked = np.flatnonzero((sight.state != VISIBLE) & np.isfinite(sight.blocker).all(axis=1))
    if len(blocked) and len(returns):
        tree = cKDTree(returns)
        distance_m, _ = tree.query(sight.blocker[blocked], distance_upper_bound=SAME_M)
        gone[blocked] = ~np.isfinite(distance_m)
    return gone


def flips_of_drive(
    drive: Drive,
    numbers: Sequence[int],
    *,
    viewpoint: ArrayLike = (0.0, 0.0, 0.0),
    reach_m: float = 40.0,
    cell_m: float = 0.4,
    height_m: float = 1.0,
    risk: float = DEFAULT_RISK,
    still_m: float = STILL_M,
    progress: Progress | None = None,
) -> list[Flips]:
    """The changes from each frame to the next one in `numbers`.

    Parameters
    ----------
    drive : Drive
        With poses.
    numbers : sequence of int
        Two frames or more.
    viewpoint : (3,) array
        In the sensor's frame of each frame, metres.
    reach_m, cell_m, height_m, risk, still_m
        See `flips_between`.
    progress : Progress or None
        Called after each pair.

    Raises
    ------
    DriveError
        There are fewer than two frames, one has no pose, or cannot be read.
    SettingsError, PointsError, SceneError
        As `flips_between`.
    """
    if len(numbers) < 2:
        raise DriveError(
            f"{len(numbers)} frame cannot be compared with the next: give two or more."
        )
    poses = drive.poses or {}
    for number in numbers:
        if number not in poses:
            raise DriveError(
                f"frame {number} of {drive.name} has no pose, which tells how the ground of two"
                " frames fits together: put a poses.txt beside the scans."
            )
    found = []
    now = drive[numbers[0]].points
    for number, following in pairwise(numbers):
        then = drive[following].points
        velo_from_next = inverse(poses[number]) @ poses[following]
        found.append(
            flips_between(
                Look.from_scan(now, viewpoint),
                Look.from_scan(then, viewpoint, velo_from_next),
                reach_m=reach_m,
                cell_m=cell_m,
                height_m=height_m,
                risk=risk,
                still_m=still_m,
            )
        )
        now = then
        (progress or silent)(f"frame {following}")
    return found


def flip_table(found: Sequence[Flips], numbers: Sequence[int]) -> Table:
    """One row for each pair of frames, and the mean of all; of shares, of those judged."""
    heads = (
        "frames",
        "moved, m",
        "judged, m2",
        "flipped",
        "by motion",
        "by returns",
        "no cause",
        "contradicted",
    )
    names = [f"{a} to {b}" for a, b in pairwise(numbers)]
    rows = [_row(name, one) for name, one in zip(names, found, strict=True)]
    columns = [field.name for field in fields(Flips)]
    means = [_mean([getattr(one, name) for one in found]) for name in columns]
    rows.append(_row("mean", Flips(*means)))
    note = (
        "flipped: share of the ground that is visible in one frame and blind in the next; by"
        " motion: a single scan, asked from both viewpoints, changes too; by returns: the blocker"
        f" has no return of the other scan within {SAME_M:g} m; no cause: neither. contradicted:"
        " the part of it that is occluded in one frame; the rest is unknown there."
    )
    return Table("Ground that changes between blind and visible", heads, tuple(rows), (note,))


def _mean(values: Sequence[float]) -> float:
    """Mean of the values that are not NaN; NaN if all are."""
    known = [value for value in values if not math.isnan(value)]
    return math.fsum(known) / len(known) if known else math.nan


def _row(name: str, one: Flips) -> tuple[str, ...]:
    moved_m, judged_m2, *shares = astuple(one)
    percent = ["-" if math.isnan(share) else f"{100 * share:.2f} %" for share in shares]
    return (name, f"{moved_m:.2f}", f"{judged_m2:.0f}", *percent)
