"""Exact worlds: the triangles are known, so that rays cast at them say what is visible.

What is asked, for one scan of the world at one moment:

- *viewpoints* lie within 12 m of the sensor (uniform over the disc), 0.5 to 3 m over the ground,
  in the open, and 0.3 m or more from every surface;
- *returns*: points of the scan, within 1 to 75 m of the viewpoint;
- *free points*: on the scan's beams, somewhere between the sensor and 95 % of the range of a
  return: space that the sensor found free;
- points *anywhere*: uniform over the disc of 40 m around the sensor, 0.2 to 4 m over the ground, in
  the open, whether or not any beam came near. They are scored apart: an honest answer about space
  that no beam has entered is "unknown", and the coverage says how much of that there is.

A point is in the open when a straight way leads from it to the sky: the inside of houses and cars
is not asked about.

Returns and free points are scored once more over the viewpoints that the scan saw (part
``from scanned space``): those to which a free way leads from the sensor, within the fan of its
beams. From above the fan or from behind a wall, every line begins in space that no beam entered.
And they are scored over the lines that the scan can honestly answer at all (part ``answerable``,
see `intervis.lab.truth.observed`): visible through space that beams crossed, or hidden by a surface
that a beam hit.

What is true: with s = 0.15 m + 1 % of the distance of the target, and h the distance at which the
sight line first meets a triangle,

- a return is *visible* when h is not before the last s of the line, for it lies on a surface, give
  or take the noise of its range; it is *occluded* when h is before the last 2 s;
- any other point is *visible* when the line meets nothing at all before it; it is *occluded* when
  h is before the last s;
- what falls in between is not judged.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from intervis.arrays import BoolArray, Float64Array, finite_rows
from intervis.lab.truth.baselines.input_scans import Seen
from intervis.lab.truth.observed import Beams, answerable
from intervis.lab.truth.query_set import Question, Questions
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import transform

VIEWPOINT_DISC_M, VIEWPOINT_HEIGHT_M = 12.0, (0.5, 3.0)
ANYWHERE_DISC_M, ANYWHERE_HEIGHT_M = 40.0, (0.2, 4.0)
BEAM_SHARE = (0.05, 0.95)
"""Where on a beam free points lie, as a share of its range."""
CLEARANCE_M = 0.3
"""No surface may be nearer to a viewpoint."""
TARGET_RANGE_M = (1.0, 75.0)
SLACK_M, SLACK_SHARE = 0.15, 0.01
"""A surface this near to a return, plus a share of its distance, does not hide it."""
SKY_M = 200.0
"""A ray that meets nothing over this length has reached the sky."""
DEPTH_M = 30.0
"""The ground is looked for from so far below."""

SKY_WAYS = 64
SIDE_WAYS = 40


@dataclass(frozen=True)
class Sampling:
    """How many questions are asked of each frame.

    Attributes
    ----------
    viewpoints : int
    returns, free_points, anywhere : int
        Targets of each kind and viewpoint, before those that are not judged are left out.
    seed : int
        The same seed asks the same questions.
    """

    viewpoints: int = 6
    returns: int = 3000
    free_points: int = 3000
    anywhere: int = 1500
    seed: int = 0


def questions(seen: Seen, caster: RayCaster, sampling: Sampling | None = None) -> Questions:
    """Ask about the asked scan of ``seen``, from random viewpoints around its sensor.

    Parameters
    ----------
    seen : Seen
        Holds the asked scan.
    caster : RayCaster
        Over the triangles of the world, world frame, at the moment of that scan.
    sampling : Sampling

    Yields
    ------
    Question
        Fewer than asked for where too few places around the sensor are in the open.
    """
    sampling = sampling or Sampling()
    rng = np.random.default_rng([sampling.seed, seen.asked])
    place = seen.numbers.index(seen.asked)
    pose, raw = seen.poses[place], seen.scans[place]
    scan = raw[finite_rows(raw), :3].astype(np.float64)
    viewpoints = _drawn(
        lambda count: _standing(
            caster, pose[:3, 3], VIEWPOINT_DISC_M, VIEWPOINT_HEIGHT_M, rng, count
        ),
        lambda points: in_the_open(caster, points) & _clear_around(caster, points),
        sampling.viewpoints,
    )
    beams = Beams.of_scan(caster, pose, scan)
    scanned = beams.see(viewpoints)
    for number, viewpoint in enumerate(viewpoints):
        kinds = _targets(scan, pose, caster, sampling, rng)
        targets = np.vstack(list(kinds.values()))
        kind = np.repeat(np.arange(len(kinds)), [len(points) for points in kinds.values()])
        visible, occluded = truth(caster, viewpoint, targets, kind == 0)
        judged = visible | occluded
        parts = {name: kind[judged] == place for place, name in enumerate(kinds)}
        counted = kind[judged] != len(kinds) - 1
        told = answerable(beams, viewpoint, targets[judged], visible[judged])
        yield Question(
            label=f"{seen.asked} from {number}",
            seen=seen,
            viewpoint=viewpoint,
            targets=targets[judged],
            visible=visible[judged],
            parts={
                **parts,
                "from scanned space": counted & scanned[number],
                "answerable": counted & told,
            },
            counted=counted,
        )


def _targets(
    scan: Float64Array,
    pose: Float64Array,
    caster: RayCaster,
    sampling: Sampling,
    rng: np.random.Generator,
) -> dict[str, Float64Array]:
    """Random targets by kind, world frame; returns come first, points anywhere last."""
    returns = scan[rng.permutation(len(scan))[: sampling.returns]]
    beams = scan[rng.integers(0, len(scan), sampling.free_points)]
    free = beams * rng.uniform(*BEAM_SHARE, len(beams))[:, None]
    return {
        "returns": transform(pose, returns),
        "free points": transform(pose, free),
        "anywhere": _drawn(
            lambda count: _standing(
                caster, pose[:3, 3], ANYWHERE_DISC_M, ANYWHERE_HEIGHT_M, rng, count
            ),
            lambda points: in_the_open(caster, points),
            sampling.anywhere,
        ),
    }


def truth(
    caster: RayCaster, viewpoint: Float64Array, targets: Float64Array, is_return: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Which targets (M, 3) are visible and which occluded; neither: not judged.

    Examples
    --------
    A wall at x = 5, seen from the origin: a return on it, free points before it and behind it, and
    one so near behind it that nothing is said.

    >>> from intervis.lab.worlds.ray_casting import RayCaster
    >>> wall = RayCaster(np.array([[[5.0, -99, -99], [5, 99, -99], [5, 0, 99]]]))
    >>> targets = np.array([[5.02, 0, 0], [4.9, 0, 0], [6, 0, 0], [5.1, 0, 0]])
    >>> truth(wall, np.zeros(3), targets, np.array([True, False, False, False]))
    (array([ True,  True, False, False]), array([False, False,  True, False]))
    """
    distance = np.linalg.norm(targets - viewpoint, axis=1)
    slack = SLACK_M + SLACK_SHARE * distance
    missing = distance - caster.first_hit(viewpoint, targets)  # -inf where nothing is met
    asked = (distance >= TARGET_RANGE_M[0]) & (distance <= TARGET_RANGE_M[1])
    visible = asked & (missing <= np.where(is_return, slack, 0.0))
    occluded = asked & (missing > np.where(is_return, 2 * slack, slack))
    return visible, occluded


def _drawn(
    draw: Callable[[int], Float64Array],
    good: Callable[[Float64Array], BoolArray],
    wanted: int,
    most_rounds: int = 30,
) -> Float64Array:
    """Up to so many random points (K, 3) that are good."""
    found = np.empty((0, 3))
    for _ in range(most_rounds):
        if len(found) >= wanted:
            break
        points = draw(max(16, 2 * (wanted - len(found))))
        found = np.vstack([found, points[good(points)]])
    return found[:wanted]


def _standing(
    caster: RayCaster,
    centre: Float64Array,
    disc_m: float,
    height_m: tuple[float, float],
    rng: np.random.Generator,
    count: int,
) -> Float64Array:
    """Random points over the lowest surface, uniform over a disc and over the heights."""
    radius, turn = disc_m * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    foot = centre + np.column_stack(
        [radius * np.cos(turn), radius * np.sin(turn), np.full(count, -DEPTH_M)]
    )
    height = rng.uniform(*height_m, count)
    # from below: the first surface is the ground, whatever stands on it
    rise = caster.first_hit(foot, foot + np.array([0.0, 0.0, 2 * DEPTH_M]))
    found = np.isfinite(rise)
    points: Float64Array = foot[found]
    points[:, 2] += rise[found] + height[found]
    return points


def in_the_open(caster: RayCaster, points: Float64Array) -> BoolArray:
    """Whether a straight way leads from each point (K, 3) to the sky."""
    ways = _spread(2 * SKY_WAYS)
    ways = ways[ways[:, 2] > np.sin(np.radians(3.0))]
    blocked = np.ones(len(points), dtype=bool)
    for way in SKY_M * ways:  # upwards first: most points need few ways
        left = np.flatnonzero(blocked)
        if len(left) == 0:
            break
        blocked[left] = caster.blocked(points[left], points[left] + way)
    return ~blocked


def _clear_around(caster: RayCaster, points: Float64Array) -> BoolArray:
    """Whether no surface is met near each point (K, 3), in any of many directions."""
    ways = CLEARANCE_M * _spread(SIDE_WAYS)
    start = np.repeat(points, len(ways), axis=0)
    blocked = caster.blocked(start, start + np.tile(ways, (len(points), 1)))
    return np.asarray(~blocked.reshape(len(points), len(ways)).any(axis=1))


def _spread(count: int) -> Float64Array:
    """Unit vectors spread evenly over the sphere, along a golden spiral."""
    step = np.arange(count) + 0.5
    z = 1 - 2 * step / count
    turn = np.pi * (1 + np.sqrt(5)) * step
    flat = np.sqrt(1 - z * z)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
