"""Exact worlds: labels from rays cast at the known triangles of a simulated world.

The query sets of one scan, at the time of that scan:

- *viewpoints* lie within 12 m of the sensor (uniform over the disc), 0.5 to 3 m above the ground,
  in the open, and at least 0.3 m from every surface;
- *returns*: points of the scan, 1 to 75 m from the viewpoint;
- *free points*: on the scan's beams, between 5 and 95 % of the range of a return: space that the
  sensor observed to be free;
- points *anywhere*: uniform over the disc of 40 m around the sensor, 0.2 to 4 m above the ground,
  in the open, whether or not a beam passed near. They are left out of the overall scores: for
  space that no beam entered, "unknown" is the correct answer.

A point is in the open where a straight line leads from it to the sky. This excludes the inside of
houses and cars.

Two subsets of the returns and free points are scored separately:

- ``from scanned space``: viewpoints that are visible from the sensor and within the elevation
  range of its beams. From all other viewpoints every line starts in unobserved space;
- ``answerable``: lines that the scan determines, see `intervis.lab.truth.observed`.

The labels, with s = 0.15 m + 1 % of the target's distance, and h the distance at which the sight
line first hits a triangle:

- a return is *visible* where h is not before the last s of the line, because the return lies on a
  surface, within range noise. It is *occluded* where h is before the last 2 s;
- any other point is *visible* where the line hits nothing before it. It is *occluded* where h is
  before the last s;
- all other points have no label.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from intervis.arrays import BoolArray, Float64Array, finite_rows
from intervis.lab.truth.baselines.input_scans import InputScans
from intervis.lab.truth.observed import Beams, answerable
from intervis.lab.truth.query_set import QuerySet, QuerySets
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import transform

VIEWPOINT_DISC_M, VIEWPOINT_HEIGHT_M = 12.0, (0.5, 3.0)
ANYWHERE_DISC_M, ANYWHERE_HEIGHT_M = 40.0, (0.2, 4.0)
FREE_FRACTION = (0.05, 0.95)
"""Position of free points on a beam, as a fraction of the beam's range."""
CLEARANCE_M = 0.3
"""Least distance of a viewpoint from every surface."""
TARGET_RANGE_M = (1.0, 75.0)
TOLERANCE_M, TOLERANCE_FRACTION = 0.15, 0.01
"""A surface this near to a return, plus a fraction of its distance, does not occlude it."""
SKY_M = 200.0
"""A ray that hits nothing over this length reaches the sky."""
DEPTH_M = 30.0
"""The ground is searched from this depth below the sensor upwards."""

SKY_DIRECTIONS = 64
CLEARANCE_DIRECTIONS = 40


@dataclass(frozen=True)
class Sampling:
    """The number of viewpoints and targets of each frame.

    Attributes
    ----------
    viewpoints : int
    returns, free_points, anywhere : int
        Targets of each kind for each viewpoint, including those that get no label.
    seed : int
        Equal seeds give equal query sets.
    """

    viewpoints: int = 6
    returns: int = 3000
    free_points: int = 3000
    anywhere: int = 1500
    seed: int = 0


def exact_query_sets(
    inputs: InputScans, caster: RayCaster, sampling: Sampling | None = None
) -> QuerySets:
    """Query sets for the target frame of ``inputs``, from random viewpoints around its sensor.

    Parameters
    ----------
    inputs : InputScans
        Holds the scan of the target frame.
    caster : RayCaster
        Over the triangles of the world, world frame, at the time of that scan.
    sampling : Sampling

    Yields
    ------
    QuerySet
        Fewer than ``sampling.viewpoints`` where too few places around the sensor are in the open.
    """
    sampling = sampling or Sampling()
    rng = np.random.default_rng([sampling.seed, inputs.target_number])
    index = inputs.numbers.index(inputs.target_number)
    pose, raw = inputs.poses[index], inputs.scans[index]
    scan = raw[finite_rows(raw), :3].astype(np.float64)
    viewpoints = _drawn(
        lambda count: _above_ground(
            caster, pose[:3, 3], VIEWPOINT_DISC_M, VIEWPOINT_HEIGHT_M, rng, count
        ),
        lambda points: in_the_open(caster, points) & _has_clearance(caster, points),
        sampling.viewpoints,
    )
    beams = Beams.of_scan(caster, pose, scan)
    scanned = beams.reach(viewpoints)
    for number, viewpoint in enumerate(viewpoints):
        kinds = _targets(scan, pose, caster, sampling, rng)
        targets = np.vstack(list(kinds.values()))
        kind = np.repeat(np.arange(len(kinds)), [len(points) for points in kinds.values()])
        visible, occluded = exact_labels(caster, viewpoint, targets, kind == 0)
        labelled = visible | occluded
        by_kind = {name: kind[labelled] == k for k, name in enumerate(kinds)}
        overall = ~by_kind["anywhere"]
        determined = answerable(beams, viewpoint, targets[labelled], visible[labelled])
        yield QuerySet(
            label=f"{inputs.target_number} from {number}",
            inputs=inputs,
            viewpoint=viewpoint,
            targets=targets[labelled],
            visible=visible[labelled],
            subsets={
                **by_kind,
                "from scanned space": overall & scanned[number],
                "answerable": overall & determined,
            },
            overall=overall,
        )


def _targets(
    scan: Float64Array,
    pose: Float64Array,
    caster: RayCaster,
    sampling: Sampling,
    rng: np.random.Generator,
) -> dict[str, Float64Array]:
    """Random targets by kind, world frame; the returns come first."""
    returns = scan[rng.permutation(len(scan))[: sampling.returns]]
    beams = scan[rng.integers(0, len(scan), sampling.free_points)]
    free = beams * rng.uniform(*FREE_FRACTION, len(beams))[:, None]
    return {
        "returns": transform(pose, returns),
        "free points": transform(pose, free),
        "anywhere": _drawn(
            lambda count: _above_ground(
                caster, pose[:3, 3], ANYWHERE_DISC_M, ANYWHERE_HEIGHT_M, rng, count
            ),
            lambda points: in_the_open(caster, points),
            sampling.anywhere,
        ),
    }


def exact_labels(
    caster: RayCaster, viewpoint: Float64Array, targets: Float64Array, is_return: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Which targets (M, 3) are visible and which occluded; both False: no label.

    Examples
    --------
    A wall at x = 5, seen from the origin: a return on it, free points in front of it and behind
    it, and a point so near behind it that it has no label.

    >>> from intervis.lab.worlds.ray_casting import RayCaster
    >>> wall = RayCaster(np.array([[[5.0, -99, -99], [5, 99, -99], [5, 0, 99]]]))
    >>> targets = np.array([[5.02, 0, 0], [4.9, 0, 0], [6, 0, 0], [5.1, 0, 0]])
    >>> exact_labels(wall, np.zeros(3), targets, np.array([True, False, False, False]))
    (array([ True,  True, False, False]), array([False, False,  True, False]))
    """
    distance = np.linalg.norm(targets - viewpoint, axis=1)
    tolerance = TOLERANCE_M + TOLERANCE_FRACTION * distance
    missing = distance - caster.first_hit(viewpoint, targets)  # -inf where nothing is hit
    in_range = (distance >= TARGET_RANGE_M[0]) & (distance <= TARGET_RANGE_M[1])
    visible = in_range & (missing <= np.where(is_return, tolerance, 0.0))
    occluded = in_range & (missing > np.where(is_return, 2 * tolerance, tolerance))
    return visible, occluded


def _drawn(
    draw: Callable[[int], Float64Array],
    accept: Callable[[Float64Array], BoolArray],
    wanted: int,
    max_rounds: int = 30,
) -> Float64Array:
    """Up to `wanted` random points (K, 3) that are accepted (rejection sampling)."""
    found = np.empty((0, 3))
    for _ in range(max_rounds):
        if len(found) >= wanted:
            break
        points = draw(max(16, 2 * (wanted - len(found))))
        found = np.vstack([found, points[accept(points)]])
    return found[:wanted]


def _above_ground(
    caster: RayCaster,
    centre: Float64Array,
    disc_m: float,
    height_m: tuple[float, float],
    rng: np.random.Generator,
    count: int,
) -> Float64Array:
    """Random points above the lowest surface, uniform over a disc and over the heights."""
    radius, azimuth = disc_m * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    foot = centre + np.column_stack(
        [radius * np.cos(azimuth), radius * np.sin(azimuth), np.full(count, -DEPTH_M)]
    )
    height = rng.uniform(*height_m, count)
    # Cast upwards from below: the first surface is the ground, whatever stands on it.
    rise = caster.first_hit(foot, foot + np.array([0.0, 0.0, 2 * DEPTH_M]))
    found = np.isfinite(rise)
    points: Float64Array = foot[found]
    points[:, 2] += rise[found] + height[found]
    return points


def in_the_open(caster: RayCaster, points: Float64Array) -> BoolArray:
    """Whether a straight line leads from each point (K, 3) to the sky."""
    directions = _sphere_directions(2 * SKY_DIRECTIONS)
    directions = directions[directions[:, 2] > np.sin(np.radians(3.0))]
    blocked = np.ones(len(points), dtype=bool)
    for direction in directions:  # steepest first: most points need few directions
        left = np.flatnonzero(blocked)
        if len(left) == 0:
            break
        blocked[left] = caster.blocked(points[left], points[left] + SKY_M * direction)
    return ~blocked


def _has_clearance(caster: RayCaster, points: Float64Array) -> BoolArray:
    """Whether no surface is within `CLEARANCE_M` of each point (K, 3), in sampled directions."""
    offsets = CLEARANCE_M * _sphere_directions(CLEARANCE_DIRECTIONS)
    start = np.repeat(points, len(offsets), axis=0)
    blocked = caster.blocked(start, start + np.tile(offsets, (len(points), 1)))
    return np.asarray(~blocked.reshape(len(points), len(offsets)).any(axis=1))


def _sphere_directions(count: int) -> Float64Array:
    """(count, 3) unit vectors spread evenly over the sphere, on a golden spiral, from the top."""
    step = np.arange(count) + 0.5
    z = 1 - 2 * step / count
    azimuth = np.pi * (1 + np.sqrt(5)) * step
    horizontal = np.sqrt(1 - z * z)
    return np.column_stack([horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), z])
