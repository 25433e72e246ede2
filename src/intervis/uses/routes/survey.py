"""A survey: the scans of a drive in one scene, in the frame of its poses, and the road below."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from intervis.arguments import object_of, whole_numbers_of
from intervis.arrays import LARGEST_M, BoolArray, Float64Array, finite_rows
from intervis.drives import Drive
from intervis.errors import DriveError, SceneError, SettingsError
from intervis.progress import Progress, reporter
from intervis.sight import Scene
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.sight.query_checks import finite_number
from intervis.transform import inverse, transform
from intervis.uses.objects import category_at
from intervis.uses.routes.road_surface import RoadSurface
from intervis.uses.routes.route import Route
from intervis.uses.routes.route_file import frame_times_s

MOST_BYTES = 2 << 30
"""Memory for scans, unless the caller says otherwise."""
FARTHEST_M = 60.0
"""A place of a route that is farther from every scanner has left the survey."""
ROUNDING_M = 0.05
"""So much farther is no error: a printed distance has one decimal."""
LEAST_ROAD = 0.3
"""A route whose road was seen along a smaller share has no road surface."""

MOMENTS, NEAR_SCANS_M = 8, 100.0
"""Query times of a station, and how near the scans are whose times they are."""


@dataclass(frozen=True, eq=False)
class Survey:
    """The scans of a drive.

    Attributes
    ----------
    scene : Scene
        In the frame of the drive's poses. Its times are seconds after the drive's first frame.
    frames : tuple of int
        Numbers of the frames in the scene.
    road : RoadSurface
        Of the route that the survey was made for.
    """

    scene: Scene
    frames: tuple[int, ...]
    road: RoadSurface

    def height_above_road(self, route: Route) -> float:
        """Median height of a route above the road below it; 1.5 m where the scans show none."""
        above_m = route.points[:, 2] - self.road.heights(
            np.minimum(route.chainage_m, route.length_m)
        )
        known = above_m[np.isfinite(above_m)]
        return float(np.median(known)) if len(known) else 1.5


def survey_of(
    drive: Drive,
    route: Route,
    *,
    numbers: Sequence[int] | None = None,
    spacing_m: float = 0.0,
    scans_per_s: float | None = None,
    sensor: str | None = None,
    max_bytes: int = MOST_BYTES,
    progress: Progress | None = None,
) -> Survey:
    """Read the scans of a drive into one scene.

    Parameters
    ----------
    drive : Drive
        With poses.
    route : Route
        Whose road surface is collected.
    numbers : sequence of int or None
        Frames to read; None: all.
    spacing_m : float
        Scans that follow the one before at a smaller distance are left out.
    scans_per_s : float or None
        Gives times to a drive that has none.
    sensor : str or None
        Name of a preset of `intervis.Sensor`; None: derived from each scan.
    max_bytes : int
        Memory for scans. It is checked before a second scan is read.
    progress : Progress or None

    Raises
    ------
    DriveError
        A frame has no pose, or cannot be read.
    SceneError
        The scans need more memory.
    SettingsError
        The spacing is negative, or there is no such sensor.
    """
    object_of(drive, Drive, "drive")
    object_of(route, Route, "route")
    if numbers is not None:
        numbers = whole_numbers_of(numbers, "numbers")
    chosen = spaced(drive, list(drive.frame_numbers if numbers is None else numbers), spacing_m)
    road = RoadSurface(route)
    scene = scene_of_drive(
        drive,
        chosen,
        scans_per_s=scans_per_s,
        sensor=sensor,
        max_bytes=max_bytes,
        use=road.add,
        progress=progress,
    )
    return Survey(scene, tuple(chosen), road)


def scene_of_drive(
    drive: Drive,
    numbers: Sequence[int],
    *,
    scans_per_s: float | None = None,
    sensor: str | None = None,
    max_bytes: int = MOST_BYTES,
    use: Callable[[Float64Array, Float64Array], None] | None = None,
    progress: Progress | None = None,
) -> Scene:
    """A scene of frames of a drive, in the frame of its poses.

    One frame of a drive without poses is a scene in the frame of its own scanner.

    Parameters
    ----------
    drive, scans_per_s, sensor, max_bytes, progress
        See `survey_of`.
    numbers : sequence of int
        Frames to read.
    use : function or None
        Called with the returns (N, 3) of each scan in the scene's frame, and the scanner's place.

    Raises
    ------
    DriveError, SceneError
        As `survey_of`.
    """
    chosen = list(numbers)
    poses = poses_in_scene(drive, chosen)
    time_s = frame_times_s(drive, chosen, scans_per_s)
    scene = Scene(sensor=sensor, max_scans=len(chosen), max_bytes=max_bytes)
    report = reporter(progress)
    for nth, number in enumerate(chosen):
        frame, pose = drive[number], poses[number]
        scene.add(frame.points, pose, None if time_s is None else float(time_s[nth]))
        if nth == 0:
            _check_memory(scene.bytes * len(chosen), len(chosen), max_bytes)
        if use is not None:
            points = frame.points[finite_rows(frame.points), :3]
            use(transform(pose, points), pose[:3, 3])
        report(f"frame {number}")
    return scene


def has_times(scene: Scene) -> bool:
    """Whether every scan of a scene has a time."""
    return not bool(np.isnan(scene.timestamps_s).any())


def poses_in_scene(drive: Drive, numbers: Sequence[int]) -> dict[int, Float64Array]:
    """Poses (4, 4) of frames in the scene that they make, by number: scene from sensor.

    Those of the drive. One frame of a drive without poses is a scene in its own frame.

    Raises
    ------
    DriveError
        No frame is given, or one has no pose and is not alone in a drive without poses.
    """
    if not numbers:
        raise DriveError("a scene needs one frame at least: choose some.")
    poses = drive.poses or {}
    if not poses and len(numbers) == 1:
        return {numbers[0]: np.eye(4)}
    if not poses:
        raise DriveError(
            f"{drive.name} has no poses, which put its scans into one scene: put a poses.txt beside"
            " the scans, or choose one frame, which is then a scene in its own frame."
        )
    for number in numbers:
        if number not in poses:
            raise DriveError(f"frame {number} of {drive.name} has no pose: leave it out.")
    return {number: poses[number] for number in numbers}


def spaced(drive: Drive, numbers: list[int], spacing_m: float) -> list[int]:
    """Numbers of the frames that lie a distance apart along the drive.

    Raises
    ------
    DriveError
        As `poses_in_scene`.
    SettingsError
        The spacing is negative or not finite.
    """
    spacing_m = finite_number("the spacing of scans", spacing_m, "metres")
    if spacing_m < 0.0:
        raise SettingsError(f"the spacing of scans must be 0 or more metres, got {spacing_m:g}.")
    poses = poses_in_scene(drive, numbers)
    kept: list[int] = []
    for number in numbers:
        place = poses[number][:3, 3]
        if not kept or np.linalg.norm(place - poses[kept[-1]][:3, 3]) >= spacing_m:
            kept.append(number)
    return kept


def _check_memory(needed: int, scans: int, most: int) -> None:
    if needed > most:
        raise SceneError(
            f"{scans:,} scans need some {needed / 1e9:.1f} GB, and {most / 1e9:.1f} GB are allowed:"
            " take fewer scans, at a greater spacing, or allow more memory."
        )


def check_route_in_survey(survey: Survey, route: Route) -> None:
    """Raise where a route leaves the space around the scans.

    Raises
    ------
    SceneError
        A place is farther than `FARTHEST_M` from every scan; the message names the first.
    """
    chainage_m = np.append(route.stations(1.0), route.length_m)
    distance_m = distance_to_scans(survey.scene, route.at(chainage_m))
    is_outside = distance_m > FARTHEST_M + ROUNDING_M
    if is_outside.any():
        first = int(np.argmax(is_outside))
        raise SceneError(
            f"the route leaves the scans at chainage {chainage_m[first]:.0f} m, where the nearest"
            f" scan is {distance_m[first]:.1f} m away, and {FARTHEST_M:g} m are allowed: cut the"
            " route, or add scans from there."
        )


def distance_to_scans(scene: Scene, points: Float64Array) -> Float64Array:
    """Horizontal distance (M,) of points (M, 3) to the nearest place of a scanner, metres."""
    distance_m, _ = cKDTree(scene.poses[:, :2, 3]).query(points[:, :2])
    return np.asarray(distance_m)


def hidden_eyes(scene: Scene, eyes: Float64Array, risk: float = DEFAULT_RISK) -> BoolArray:
    """Which eyes (S, 3) no scanner within 60 m sees, and one does not see for certain.

    They stand in an obstacle, or behind one: what they see themselves means little.
    """
    places = scene.poses[:, :3, 3]
    _, eye, sight = scene.sight_within(places, eyes, FARTHEST_M, risk=risk)
    visible = np.bincount(eye[sight.visible], minlength=len(eyes))
    occluded = np.bincount(eye[sight.occluded], minlength=len(eyes))
    return np.asarray((visible == 0) & (occluded > 0))


def route_on_road(survey: Survey, route: Route, height_m: float | None = None) -> Route:
    """The route on the road surface.

    Parameters
    ----------
    survey : Survey
        Made for this route.
    route : Route
        With the places of its file or scanner.
    height_m : float or None
        Height of these places above the road. None: the road is where the scans show it.

    Raises
    ------
    SceneError
        The scans show the road along less than 30 % of the route.
    SettingsError
        The height is not finite, or beyond 1e9 m.
    """
    object_of(survey, Survey, "survey")
    object_of(route, Route, "route")
    if height_m is not None:
        height_m = finite_number("the height of the route", height_m, "metres")
        if abs(height_m) > LARGEST_M:
            raise SettingsError(
                f"the height of the route must be at most {LARGEST_M:g} m, got {height_m:g}."
            )
        return route.with_heights(route.points[:, 2] - height_m)
    if survey.road.known_share < LEAST_ROAD:
        raise SceneError(
            f"the scans show the road along {100 * survey.road.known_share:.0f} % of the route"
            f" only, and {100 * LEAST_ROAD:.0f} % are needed: give the height of the route's places"
            " above the road (--mount M)."
        )
    fine = route.refined(1.0)
    return fine.with_heights(survey.road.heights(fine.chainage_m))


def moments_of_poses(survey: Survey, road: Route, chainage_m: Float64Array) -> Float64Array:
    """Times (S, 1) at which the route passes chainages.

    Raises
    ------
    SettingsError
        The route has no time there.
    """
    times_s = road.time_at(chainage_m)
    if not np.isfinite(times_s).all():
        first = float(chainage_m[~np.isfinite(times_s)][0])
        raise SettingsError(f"the route has no time at chainage {first:.0f} m.")
    return times_s[:, None]


def moments_near(survey: Survey, road: Route, chainage_m: Float64Array) -> Float64Array:
    """Times (S, `MOMENTS`) of scans that were taken near stations, evenly over all of them."""
    scans_s, places = survey.scene.timestamps_s, survey.scene.poses[:, :2, 3]
    stations = road.at(chainage_m)[:, :2]
    moments = np.empty((len(stations), MOMENTS))
    for nth, station in enumerate(stations):
        distance_m = np.linalg.norm(places - station, axis=1)
        near_s = scans_s[distance_m <= max(NEAR_SCANS_M, float(distance_m.min()))]
        moments[nth] = near_s[np.linspace(0, len(near_s) - 1, MOMENTS).round().astype(np.int64)]
    return moments


def classes_of(drive: Drive, survey: Survey, points: Float64Array) -> tuple[str, ...]:
    """Categories of the labelled boxes that hold points (M, 3); empty texts where none does.

    The boxes are those of the frame nearest to each point.

    Raises
    ------
    DriveError, CalibrationError
        Labels cannot be read.
    """
    words = [""] * len(points)
    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    if drive.read_boxes is None or not len(known):
        return tuple(words)
    poses = list(poses_in_scene(drive, survey.frames).values())
    _, nearest = cKDTree([pose[:3, 3] for pose in poses]).query(points[known])
    for nth in np.unique(nearest).tolist():
        frame = drive[survey.frames[nth]]
        for k in known[nearest == nth].tolist():
            words[k] = category_at(transform(inverse(poses[nth]), points[k]), frame.boxes)
    return tuple(words)
