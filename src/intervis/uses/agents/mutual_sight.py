"""Who sees whom: agents with places, fields of view and bodies, frame by frame."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arguments import object_of, objects_of, shown, whole_numbers_of
from intervis.arrays import LARGEST_M, Float64Array, numbers_of
from intervis.errors import PointsError, SettingsError
from intervis.sight import OCCLUDED, VISIBLE, Scene
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.query_checks import finite_number
from intervis.transform import checked_pose, inverse, transform

BODY_MARGIN_M = 0.3
"""Returns of a body lie up to this far outside of its box."""
REASONS = ("visible", "occluded", "unknown", "outside field of view", "out of range", "absent")
SEES, HIDDEN, NOT_KNOWN, OUTSIDE, FAR, ABSENT = range(6)
"""Codes of the reasons, as in `REASONS`."""
MOST_LINES = 20_000_000


@dataclass(frozen=True, eq=False)
class Agent:
    """One who sees and is seen.

    Attributes
    ----------
    name : str
    places : mapping of int to (4, 4) float64 array, or one (4, 4) array
        scene_from_agent by frame number: the eye at the origin, x where it looks, metres. One pose
        holds for all frames.
    fov_deg : float
        Horizontal field of view, from 0 to 360, half of it to either side of x.
    range_m : float
        It sees no farther.
    body : (2, 3) float64 array or None
        Lower and upper corner of its body in the agent's frame. Lines start and end outside of it.

    Raises
    ------
    PointsError
        No place, a body without volume, or a field of view or range out of range.
    PoseError
        A place is no rigid motion.
    ArgumentError, SettingsError
        A value is of the wrong kind.
    """

    name: str
    places: Mapping[int, Float64Array] | Float64Array = field(repr=False)
    fov_deg: float = 360.0
    range_m: float = 150.0
    body: Float64Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        object_of(self.name, str, "the name of an agent")
        object.__setattr__(self, "places", _checked_places(self.name, self.places))
        for name, unit in (("fov_deg", "degrees"), ("range_m", "metres")):
            object.__setattr__(self, name, finite_number(name, getattr(self, name), unit))
        if not 0.0 < self.fov_deg <= 360.0:
            raise PointsError(
                f"the field of view of agent {self.name!r} must be above 0 and up to 360 degrees,"
                f" got {self.fov_deg:g}."
            )
        if not self.range_m > 0.0:
            raise PointsError(
                f"the range of agent {self.name!r} must be positive, got {self.range_m:g}."
            )
        if self.body is not None:
            object.__setattr__(self, "body", _checked_body(self.name, self.body))

    def pose_at(self, frame: int) -> Float64Array | None:
        """scene_from_agent (4, 4) in a frame; None where it is absent."""
        if isinstance(self.places, Mapping):
            return self.places.get(whole_numbers_of([frame], "frame")[0])
        return self.places


Places = Mapping[int, Float64Array] | Float64Array


def _checked_places(name: str, places: Any) -> Places:
    """Poses by frame number, or one pose."""
    of = f"the pose of agent {shown(name)}"
    if not isinstance(places, Mapping):
        return checked_pose(places, of)
    if not places:
        raise PointsError(f"agent {shown(name)} has no place: give x and y.")
    frames = whole_numbers_of(places, "the frames of an agent")
    return {
        frame: checked_pose(pose, of) for frame, pose in zip(frames, places.values(), strict=True)
    }


def _checked_body(name: str, body: Any) -> Float64Array:
    """Lower and upper corner (2, 3)."""
    corners = numbers_of(body, f"the body of agent {shown(name)}")
    if corners.shape != (2, 3) or not (corners[1] > corners[0]).all():
        raise PointsError(f"the body of agent {shown(name)} has no volume.")
    if not (np.abs(corners) <= LARGEST_M).all():
        raise PointsError(f"the body of agent {shown(name)} must be within {LARGEST_M:g} m.")
    return corners


@dataclass(frozen=True, eq=False, repr=False)
class MutualSight:
    """Who sees whom in F frames, of A agents.

    Attributes
    ----------
    names : tuple of A str
    frames : (F,) int64 array
    time_s : (F,) float64 array
        NaN where the frames have no times.
    eyes : (F, A, 3) float64 array
        Scene frame; NaN where an agent is absent.
    reason : (F, A, A) int8 array
        [f, a, b]: why a does or does not see b: an index into `REASONS`; the diagonal is absent.
    probability : (F, A, A) float64 array
        P(visible) of the line; NaN where it was not asked.
    range_m : (F, A, A) float64 array
    blocker : (F, A, A, 3) float64 array
    """

    names: tuple[str, ...]
    frames: NDArray[np.int64]
    time_s: Float64Array
    eyes: Float64Array
    reason: NDArray[np.int8]
    probability: Float64Array
    range_m: Float64Array
    blocker: Float64Array

    def __repr__(self) -> str:
        return f"<MutualSight: {len(self.names)} agents, {len(self.frames)} frames>"

    @property
    def seen_share(self) -> Float64Array:
        """(A, A) share of the common frames in which a sees b; NaN where there is none."""
        both = (self.reason != ABSENT).sum(axis=0)
        seen = (self.reason == SEES).sum(axis=0)
        return np.where(both > 0, seen / np.maximum(both, 1), np.nan)


def mutual_sight(
    scene: Scene,
    agents: Sequence[Agent],
    frames: Sequence[int],
    time_s: Float64Array | None = None,
    *,
    risk: float = DEFAULT_RISK,
) -> MutualSight:
    """Ask every agent about every other one, frame by frame.

    The sight line is the same both ways; fields of view and ranges are each agent's own.

    Parameters
    ----------
    scene : Scene
    agents : sequence of Agent
    frames : sequence of int
        Frame numbers, as in the agents' places.
    time_s : (F,) float64 array or None
        Query times. None: no particular time.
    risk : float
        See `intervis.Scene.sight`.

    Raises
    ------
    PointsError
        Fewer than two agents, or two of one name.
    SettingsError
        There are too many lines.
    SceneError
        As `intervis.Scene.sight`.
    """
    object_of(scene, Scene, "scene")
    agents, frames = objects_of(agents, Agent, "agents"), whole_numbers_of(frames, "frames")
    if time_s is not None:
        time_s = numbers_of(time_s, "time_s")
        if time_s.shape != (len(frames),):
            raise PointsError(f"{len(frames)} frames need as many times, got {time_s.shape}.")
    names = tuple(agent.name for agent in agents)
    if len(names) < 2 or len(set(names)) < len(names):
        raise PointsError(
            f"two agents or more are needed, with different names, got {shown(names)}."
        )
    if len(frames) * len(names) ** 2 > MOST_LINES:
        raise SettingsError(
            f"{len(names):,} agents in {len(frames):,} frames are too many: take fewer frames."
        )
    shape = (len(frames), len(names), len(names))
    found = MutualSight(
        names,
        np.asarray(frames, np.int64),
        np.full(len(frames), np.nan) if time_s is None else time_s,
        np.full((*shape[:2], 3), np.nan),
        np.full(shape, ABSENT, np.int8),
        *(np.full(shape, np.nan), np.full(shape, np.nan), np.full((*shape, 3), np.nan)),
    )
    for nth in range(len(frames)):
        _ask_frame(scene, agents, found, nth, None if time_s is None else float(time_s[nth]), risk)
    return found


def _ask_frame(
    scene: Scene,
    agents: Sequence[Agent],
    found: MutualSight,
    nth: int,
    moment_s: float | None,
    risk: float,
) -> None:
    """Fill one frame of the answers."""
    poses = [agent.pose_at(int(found.frames[nth])) for agent in agents]
    here = {a: pose for a, pose in enumerate(poses) if pose is not None}
    for a, pose in here.items():
        found.eyes[nth, a] = pose[:3, 3]
    pairs = [(a, b) for a in here for b in here if a < b]
    if not pairs:
        return
    lines = np.array([_clear_of_bodies(agents[a], here[a], agents[b], here[b]) for a, b in pairs])
    sight = scene.sight_lines(lines[:, 0], lines[:, 1], risk=risk, moment_s=moment_s)
    for (a, b), one in zip(pairs, sight, strict=True):
        state = int(one.state)
        line = SEES if state == VISIBLE else HIDDEN if state == OCCLUDED else NOT_KNOWN
        for x, y in ((a, b), (b, a)):
            found.reason[nth, x, y] = _reason(agents[x], here[x], found.eyes[nth, y], line)
            found.probability[nth, x, y] = float(one.probability)
            found.range_m[nth, x, y] = np.linalg.norm(found.eyes[nth, a] - found.eyes[nth, b])
            found.blocker[nth, x, y] = one.blocker


def _reason(agent: Agent, pose: Float64Array, other: Float64Array, line: int) -> int:
    """Why an agent sees another one or not, given the state of the line."""
    local = transform(inverse(pose), other)
    if np.linalg.norm(local) > agent.range_m:
        return FAR
    bearing_deg = abs(math.degrees(math.atan2(local[1], local[0])))
    return OUTSIDE if bearing_deg > 0.5 * agent.fov_deg else line


def _clear_of_bodies(
    one: Agent, one_pose: Float64Array, other: Agent, other_pose: Float64Array
) -> Float64Array:
    """(2, 3) ends of the line between two agents, outside of their bodies.

    NaN, hence unknown, where the bodies leave nothing of it.
    """
    start, end = one_pose[:3, 3], other_pose[:3, 3]
    leaves = _way_out(one, one_pose, end)
    enters = 1.0 - _way_out(other, other_pose, start)
    if leaves >= enters:
        return np.full((2, 3), np.nan)
    return np.stack([start + leaves * (end - start), start + enters * (end - start)])


def _way_out(agent: Agent, pose: Float64Array, towards: Float64Array) -> float:
    """Share of the line from an agent's eye to a point that lies in its body; 0 without one.

    Examples
    --------
    >>> car = Agent("car", np.eye(4), body=np.array([[-2.0, -1, -1], [2, 1, 1]]))
    >>> round(_way_out(car, np.eye(4), np.array([23.0, 0, 0])), 3)  # 2.3 of 23 m
    0.1
    """
    if agent.body is None:
        return 0.0
    step = transform(inverse(pose), towards)
    low, high = agent.body[0] - BODY_MARGIN_M, agent.body[1] + BODY_MARGIN_M
    if (low > 0).any() or (high < 0).any():
        return 0.0  # the eye is outside of its own body
    with np.errstate(divide="ignore", invalid="ignore"):
        exits = np.where(step > 0, high / step, np.where(step < 0, low / step, np.inf))
    return float(min(exits.min(), 1.0))
