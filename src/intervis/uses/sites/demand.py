"""What is to be seen: target points in zones, and how much each counts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from intervis.arrays import Float64Array, IntArray
from intervis.drives import Drive
from intervis.errors import DriveError, PointsError, SceneError, SettingsError
from intervis.sight import Scene
from intervis.sight.query_checks import finite_number, positive_length
from intervis.transform import transform
from intervis.uses.routes.survey import poses_in_scene
from intervis.uses.routes.zone import Zone

USER_RADIUS_M = 2.0
"""A road user counts for the targets within this horizontal distance."""
BACKGROUND = 0.1
"""Share of the weight that every target keeps where road users are known."""


@dataclass(frozen=True, eq=False, repr=False)
class Demand:
    """T targets and their weights.

    Attributes
    ----------
    points : (T, 3) float64 array
        Scene frame, metres.
    weight : (T,) float64 array
        Not negative; the sum is 1.
    zone : (T,) int64 array
        Index of the zone of each target; -1 without zones.
    zones : tuple of Zone
    users : int
        Number of places of road users that gave the weights; 0 for none.
    users_outside : int
        Of these, those with no target within `USER_RADIUS_M`.
    """

    points: Float64Array
    weight: Float64Array
    zone: IntArray
    zones: tuple[Zone, ...] = ()
    users: int = 0
    users_outside: int = 0

    def __repr__(self) -> str:
        return f"<Demand: {len(self.points):,} targets, {len(self.zones)} zones>"


def demand_of_zones(scene: Scene, zones: Sequence[Zone], cell_m: float = 1.0) -> Demand:
    """Targets on cells of zones, at three heights; each counts by its area and its zone's weight.

    Targets where the scene shows no ground are left out.

    Raises
    ------
    PointsError
        No zone is given, or all weigh 0.
    SceneError
        The scene shows no ground below a zone.
    SettingsError
        The cells are not positive, or too many.
    """
    if not zones:
        raise PointsError("no zone is given.")
    cell_m = positive_length("the edge of cells", cell_m)
    if not any(zone.weight > 0.0 for zone in zones):
        raise PointsError("all zones have the weight 0: give one a positive weight.")
    points, weights, members = [], [], []
    for nth, zone in enumerate(zones):
        samples = zone.samples(scene, cell_m)
        samples = samples[np.isfinite(samples).all(axis=1)]
        if not len(samples):
            raise SceneError(f"the scene shows no ground below zone {zone.name!r}.")
        points.append(samples)
        weights.append(np.full(len(samples), zone.weight * zone.area_m2 / len(samples)))
        members.append(np.full(len(samples), nth, np.int64))
    weight = np.concatenate(weights)
    if not weight.sum() > 0.0:  # a weight so small that its product with an area is 0
        raise PointsError("all zones have the weight 0: give one a positive weight.")
    return Demand(
        np.concatenate(points), weight / weight.sum(), np.concatenate(members), tuple(zones)
    )


def demand_of_points(points: Float64Array, weight: Float64Array | None = None) -> Demand:
    """Targets given as points (T, 3), with weights (T,) or equal ones.

    Raises
    ------
    PointsError
        There is no target, a target is not finite, or the weights are negative, not finite, or
        all 0.
    """
    if not len(points) or not np.isfinite(points).all():
        raise PointsError("targets need one point or more, with finite coordinates in metres.")
    if weight is None:
        weight = np.ones(len(points))
    if not ((weight >= 0.0) & np.isfinite(weight)).all() or not weight.sum() > 0.0:
        raise PointsError("the weights of targets must be 0 or more, finite, and not all 0.")
    return Demand(points, weight / weight.sum(), np.full(len(points), -1, np.int64))


def weighted_by_users(
    demand: Demand,
    users: Float64Array,
    weight: Float64Array | None = None,
    background: float = BACKGROUND,
) -> Demand:
    """The same targets, weighted by where road users are.

    The weight of each road user is shared out among the targets within `USER_RADIUS_M`, in
    proportion to their weight so far. All targets keep the share `background` of their weight, so
    that a place where nobody happened to be still counts.

    Parameters
    ----------
    demand : Demand
    users : (U, 2) or (U, 3) float64 array
        Places of road users, scene frame, metres.
    weight : (U,) float64 array or None
        None: they are equal.
    background : float
        From 0 to 1.

    Raises
    ------
    PointsError
        No road user is near a target, a place is not finite, or a weight is negative or not
        finite.
    SettingsError
        `background` is not from 0 to 1.

    Examples
    --------
    >>> two = demand_of_points(np.array([[0.0, 0, 1], [10, 0, 1]]))
    >>> weighted_by_users(two, np.array([[0.5, 0.5], [0, 1], [11, 0]]), background=0.1).weight
    array([0.65, 0.35])
    """
    if not 0.0 <= finite_number("background", background, "0 to 1") <= 1.0:
        raise SettingsError(f"background must be a share from 0 to 1, got {background}.")
    each = np.ones(len(users)) if weight is None else np.asarray(weight, np.float64)
    if each.shape != (len(users),) or not ((each >= 0.0) & np.isfinite(each)).all():
        raise PointsError("the weights of road users must be 0 or more, and finite, one for each.")
    if not np.isfinite(users[:, :2]).all():
        raise PointsError("the places of road users must be finite, in metres.")
    if len(users) and not each.any():
        raise PointsError("all road users have the weight 0: give one a positive weight.")
    near = cKDTree(users[:, :2]).query_ball_tree(cKDTree(demand.points[:, :2]), USER_RADIUS_M)
    gathered, outside = np.zeros(len(demand.points)), 0
    for mine, amount in zip(near, each, strict=True):
        total = float(demand.weight[mine].sum())
        if total > 0.0:
            gathered[mine] += amount * demand.weight[mine] / total
        else:
            outside += 1
    if not gathered.sum() > 0.0:
        raise PointsError(
            f"none of {len(users)} road users is within {USER_RADIUS_M:g} m of a target: give their"
            " places in the frame of the drive's poses, or zones where they are."
        )
    mixed = background * demand.weight + (1.0 - background) * gathered / gathered.sum()
    return Demand(demand.points, mixed, demand.zone, demand.zones, len(users), outside)


def labelled_users(drive: Drive, numbers: Sequence[int]) -> Float64Array:
    """Middles (U, 3) of the labelled boxes of the frames of a scene, scene frame, metres.

    An object counts once in every frame that shows it, so long stays weigh more.

    Raises
    ------
    DriveError
        There are no labelled objects, the labels cannot be read, or as `poses_in_scene`.
    """
    places = []
    for number, pose in poses_in_scene(drive, numbers).items():
        places += [transform(pose, box.velo_from_box[:3, 3]) for box in drive[number].boxes]
    if not places:
        raise DriveError(
            f"{drive.name} has no labelled objects in these frames: give the road users' places as"
            " a CSV file."
        )
    return np.array(places).reshape(-1, 3)
