"""Every public call of the package with valid arguments: what `fuzz_calls.py` changes."""

import tempfile
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import intervis
from intervis import sight, uses
from intervis.drives.boxes import Box
from intervis.drives.pose_track import PoseTrack
from intervis.transform import rigid
from intervis.uses.voxels.camera_voxels import PosedCamera


class Call(NamedTuple):
    """A call with valid arguments."""

    function: Callable[..., Any]
    arguments: Mapping[str, Any]


STORES = (
    *("Analysis", "Explanation", "Sight", "BevGrid", "BlindSpot", "CarvedGrid", "Masks"),
    *(
        "LabelledScene",
        "MutualSight",
        "ObjectSight",
        "RouteAnswer",
        "SightDistances",
        "Survey",
        "VisibilityGrid",
    ),
)
"""Classes of answers: they store what they are given, and a caller makes none."""

NOT_YET = (
    *("Candidate", "Coverage", "Demand", "Reach", "Siting", "best_sites", "candidates_along"),
    *("candidates_within", "choose_sites", "coverage", "demand_of_points", "demand_of_zones"),
    "weighted_by_users",
)
"""Siting: its calls are younger than this list, and are not fuzzed yet."""

CONSTANTS = ("OCCLUDED", "UNKNOWN", "VISIBLE", "__version__", "AASHTO", "AUSTROADS", "DMRB")
MADE_BY = {"Drive": "open_drive", "warm_up": "progress"}
"""What is asked in other words: a drive is opened, `warm_up` takes no data."""


def scan(seed: int = 0) -> Any:
    """(N, 3) float64 returns of a street with a wall ahead, sensor frame, metres."""
    azimuth, elevation = np.meshgrid(
        np.radians(np.arange(-180, 180, 3)), np.linspace(-0.4, 0.1, 16)
    )
    x, y, z = np.cos(azimuth), np.sin(azimuth), np.tan(elevation)
    reach_m = 1.7 / np.maximum(-z, 0.04)
    reach_m = np.minimum(reach_m, np.where(x > 0.1, (20.0 - seed) / np.maximum(x, 0.1), np.inf))
    return (reach_m[..., None] * np.stack([x, y, z], axis=-1)).reshape(-1, 3)


def pose(x: float, y: float = 0.0, z: float = 0.0) -> Any:
    """(4, 4) a pose without a turn."""
    return rigid(np.eye(3), [x, y, z])


@cache
def street() -> intervis.Scene:
    """Three scans with times."""
    scene = intervis.Scene()
    for second in range(3):
        scene.add(scan(second), pose(second), float(second))
    return scene


@cache
def folder() -> Path:
    """A folder of this process for files."""
    made = tempfile.TemporaryDirectory()
    _KEPT.append(made)
    return Path(made.name)


_KEPT: list[Any] = []


@cache
def drive() -> intervis.Drive:
    """A drive of four scans with poses."""
    root = folder() / "drive"
    root.mkdir()
    for number in range(4):
        np.hstack([scan(number), np.ones((1920, 1))]).astype("<f4").tofile(root / f"{number}.bin")
    lines = [" ".join(map(str, pose(4.0 * number)[:3].ravel())) for number in range(4)]
    (root / "poses.txt").write_text("\n".join(lines) + "\n")
    return intervis.open_drive(root)


@cache
def camera() -> intervis.Camera:
    """A camera of a few pixels."""
    return intervis.Camera(
        np.array([[20.0, 0, 16, 0], [0, 20, 8, 0], [0, 0, 1, 0]]), 32, 16, "made"
    )


CAM_FROM_VELO = rigid(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), np.array([0.0, 0, 0]))
WAY = np.array([[0.0, 0, 0], [4, 0, 0], [9, 1, 0], [14, 1, 0]])
TARGETS = np.array([[9.0, 1, 0], [30, 1, 0], [-9, 0, 0], [5, -4, -1]])
CORNERS = np.array([[6.0, -2], [9, -2], [9, 2], [6, 2]])


def route() -> uses.Route:
    """A route with times."""
    return uses.Route.through(WAY, time_s=np.arange(4.0))


def zone() -> uses.Zone:
    """A zone on the street."""
    return uses.Zone("crossing", CORNERS)


def grid() -> uses.VoxelGrid:
    """A grid of few voxels."""
    return uses.VoxelGrid(np.array([0.0, -3, -2]), 1.0, (12, 6, 4))


@cache
def agents() -> list[uses.Agent]:
    """Two agents, one of them with a body."""
    body = np.array([[-2.0, -1, -1.5], [2, 1, 0.5]])
    moving = {0: pose(12.0, 2.0), 1: pose(13.0, 2.0)}
    return [uses.Agent("scanner", pose(0.0)), uses.Agent("car", moving, 120.0, 50.0, body)]


@cache
def survey() -> uses.Survey:
    """The survey of the drive."""
    return uses.survey_of(drive(), uses.route_of_drive(drive()))


@cache
def seen_grid() -> uses.VisibilityGrid:
    """What the scanner sees around itself."""
    return uses.visibility_grid(street(), np.zeros(3), scan(), reach_m=12.0, cell_m=1.0)


@cache
def labelled_frame() -> intervis.Frame:
    """A frame with two boxes."""
    boxes = tuple(Box(pose(9.0, y, -1), np.array([4.0, 2, 1.5]), "Car") for y in (-3.0, 3.0))
    return intervis.Frame(0, scan().astype(np.float32), read_boxes=lambda: boxes)


@cache
def labelled_drive() -> intervis.Drive:
    """Two scans with labels of their points."""
    root = folder() / "labelled"
    root.mkdir()
    for number in range(2):
        points = np.hstack([scan(number), np.ones((1920, 1))]).astype("<f4")
        points.tofile(root / f"{number}.bin")
        np.where(points[:, 0] > 15, 50, 40).astype("<u4").tofile(root / f"{number}.label")
    lines = [" ".join(map(str, pose(4.0 * number)[:3].ravel())) for number in range(2)]
    (root / "poses.txt").write_text("\n".join(lines) + "\n")
    return intervis.open_drive(root)


def _classed(points: Any, labels: Any, names: Any, classes: Any, places: Any, reach: Any) -> None:
    returns = uses.ClassedReturns.of_labels(points, labels, names)
    repr(returns)
    returns.are(classes)
    returns.names_at(places, reach)


def _in_boxes(points: Any, boxes: Any) -> None:
    uses.ClassedReturns.in_boxes(points, boxes)


def _labelled_scene(
    number: Any, frames: Any, without: Any, viewpoint: Any, targets: Any, risk: Any, within_m: Any
) -> None:
    labelled = uses.labelled_scene(labelled_drive(), number, frames=frames, without=without)
    labelled.blocker_classes(labelled.sight(viewpoint, targets, risk=risk), within_m)


def _frame(**values: Any) -> None:
    frame = intervis.Frame(**values)
    repr(frame)
    _ = frame.viewpoint_velo, frame.scans, frame.timestamp_s, frame.point_times_ns
    if frame.timestamp_ns is not None:
        frame.deskewed()


def _written(name: str, content: str) -> Path:
    path = folder() / name
    path.write_text(content)
    return path


def _read_route(content: str, start_s: float) -> None:
    path = folder() / "route.csv"
    path.write_text(str(content), errors="replace")
    uses.read_route(path, start_s)


def _masks(
    points: Any, grid_from_sensor: Any, scanner: Any, labels: Any, definition: str, camera_pose: Any
) -> None:
    one = uses.PosedScan(points, grid_from_sensor, scanner, labels)
    cameras = (
        {"c": PosedCamera(camera(), camera_pose)} if str(definition) != "semantickitti" else None
    )
    uses.masks_of(grid(), [one], definition=definition, cameras=cameras)


def _agent(name: Any, places: Any, fov_deg: Any, range_m: Any, body: Any, frame: Any) -> None:
    agent = uses.Agent(name, places, fov_deg, range_m, body)
    agent.pose_at(frame)
    uses.mutual_sight(street(), [agent, agents()[0]], [0])


def _zone(name: Any, corners: Any, low_m: Any, high_m: Any, xy: Any) -> None:
    made = uses.Zone(name, corners, low_m, high_m)
    made.contains(xy)
    made.samples(street())


def _standard(speed_mps: Any, grade: Any, **values: Any) -> None:
    standard = uses.AASHTO.changed(**values)
    standard.stopping_m(speed_mps, grade)


def _grid(corner: Any, cell_m: Any, shape: Any) -> None:
    repr(uses.VoxelGrid(corner, cell_m, shape))


def _carver(lift_m: Any, sensor: Any, points: Any, scan_pose: Any, now: Any) -> None:
    carver = uses.Carver(grid(), sensor=sensor, lift_m=lift_m)
    carver.add(points, scan_pose, now=now)
    carver.result()


def _push(points: Any, scan_pose: Any, time_s: Any, viewpoint: Any, targets: Any) -> None:
    stream = intervis.Stream()
    stream.push(points, scan_pose, time_s)
    stream.sight(viewpoint, targets)


def _add(points: Any, scan_pose: Any, time_s: Any) -> None:
    scene = intervis.Scene()
    scene.add(points, scan_pose, time_s)
    scene.sight(np.zeros(3), TARGETS)


def _limits(make: Any) -> Any:
    def call(sensor: Any, max_scans: Any, max_bytes: Any) -> None:
        scene = make(sensor=sensor, max_scans=max_scans, max_bytes=max_bytes)
        repr(scene)

    return call


def _settings(**values: Any) -> None:
    intervis.Settings().with_changes(**intervis.Settings(**values).model_dump())


def targets() -> dict[str, Call]:
    """The calls by name."""
    points, eye, xy = scan(), np.zeros(3), np.array([[3.0, 4.0], [5.0, 0.0]])
    query = {"risk": 0.05, "moment_s": 1.0}
    of_sight = street().sight(eye, TARGETS)
    labels = np.full(len(points), 50, np.uint16)
    body = np.array([[-2.0, -1, -1.5], [2, 1, 0.5]])
    way_points = "x,y,z,speed_kmh\n0,0,0,30\n9,0,0,30\n"
    step = {"step_m": 2.0, "max_range_m": 40.0, "risk": 0.05}
    return {
        "analyze": Call(
            intervis.analyze,
            {
                **{"points": points, "camera": camera(), "cam_from_velo": CAM_FROM_VELO},
                **{"viewpoint": eye, "settings": intervis.Settings(tau=5), "tau_for": None},
            },
        ),
        "Settings": Call(_settings, intervis.Settings(time_budget_ms=50.0).model_dump()),
        "Settings.from_toml": Call(
            intervis.Settings.from_toml, {"path": _written("made.toml", "tau = 10\n")}
        ),
        "Camera": Call(
            intervis.Camera,
            {"projection": camera().projection, "width_px": 32, "height_px": 16, "name": "made"},
        ),
        "Sensor": Call(
            intervis.Sensor,
            {
                **{"name": "made", "beams": 32, "lowest_deg": -24.0, "highest_deg": 2.0},
                **{"azimuth_step_deg": 0.2, "min_range_m": 0.9, "max_range_m": 90.0},
                "divergence_deg": 0.1,
            },
        ),
        "sensor_named": Call(sight.sensor_named, {"name": "vlp-16"}),
        "sensor_of_scan": Call(sight.sensor_of_scan, {"points_velo": points}),
        "open_drive": Call(intervis.open_drive, {"path": str(drive().root), "camera": None}),
        "Drive[]": Call(lambda number: drive()[number], {"number": 2}),
        "Drive.calibration_of": Call(drive().calibration_of, {"number": 2}),
        "Frame": Call(
            _frame,
            {
                **{"number": 3, "points": points.astype(np.float32), "pose": pose(1.0)},
                **{"camera": camera(), "cam_from_velo": CAM_FROM_VELO, "timestamp_ns": 10**18},
                "pose_track": PoseTrack.over_gaps(
                    10**18 + np.array([-(10**9), 0, 10**9]), [pose(0.0), pose(9.0), pose(18.0)]
                ),
                "attributes": {"time": np.repeat(np.linspace(0, 0.1, 30), 64)},
            },
        ),
        "Scene": Call(
            _limits(intervis.Scene), {"sensor": "vlp-16", "max_scans": 3, "max_bytes": 10**7}
        ),
        "Scene.from_scan": Call(
            intervis.Scene.from_scan, {"points": points, "pose": pose(1.0), "sensor": "vlp-16"}
        ),
        "Scene.add": Call(_add, {"points": points, "scan_pose": pose(1.0), "time_s": 2.0}),
        "Scene.sight": Call(
            street().sight, {"viewpoint": eye, "targets": TARGETS, "max_range_m": 20.0, **query}
        ),
        "Scene.sight_lines": Call(street().sight_lines, {"starts": WAY, "ends": TARGETS, **query}),
        "Scene.sight_within": Call(
            street().sight_within,
            {"viewpoints": WAY, "targets": TARGETS, "max_range_m": 20.0, **query},
        ),
        "Scene.sight_boxes": Call(
            street().sight_boxes,
            {
                **{"viewpoint": eye, "scene_from_box": np.array([pose(9.0), pose(30.0)])},
                **{"size_m": np.array([[4.0, 2, 1.5], [1, 1, 1]]), **query},
            },
        ),
        "Scene.ground_height": Call(street().ground_height, {"xy": xy}),
        "Scene.unobserved_length": Call(
            street().unobserved_length, {"viewpoint": eye, "target": TARGETS[0], "moment_s": 1.0}
        ),
        "Scene.packed_scans": Call(street().packed_scans, {"moment_s": 1.0}),
        "explain": Call(
            intervis.explain,
            {"scene": street(), "viewpoint": eye, "target": TARGETS[1], **query},
        ),
        "show": Call(
            intervis.show,
            {
                **{"source": street(), "points": points[::20], "viewpoint": eye},
                **{"ends": [TARGETS[0]], "frames": None, "most_frames": 2, "most_returns": 50},
                **{"height_px": 300, "is_live": False, **query},
            },
        ),
        "visible_mask": Call(
            intervis.visible_mask,
            {
                **{"points": points, "viewpoint": eye, "cell_deg": 0.5, "tolerance_m": 1.0},
                "tolerance_fraction": 0.02,
            },
        ),
        "Sight[]": Call(lambda key: of_sight[key], {"key": 1}),
        "Stream": Call(
            _limits(intervis.Stream), {"sensor": "vlp-16", "max_scans": 3, "max_bytes": 10**7}
        ),
        "Stream.push": Call(
            _push,
            {
                **{"points": points, "scan_pose": pose(1.0), "time_s": 3.0},
                **{"viewpoint": eye, "targets": TARGETS},
            },
        ),
        "Agent": Call(
            _agent,
            {
                **{"name": "car", "places": {0: pose(12.0), 1: pose(13.0)}, "fov_deg": 120.0},
                **{"range_m": 50.0, "body": body, "frame": 0},
            },
        ),
        "mutual_sight": Call(
            uses.mutual_sight,
            {
                **{"scene": street(), "agents": agents(), "frames": [0, 1]},
                **{"time_s": np.array([0.0, 1.0]), "risk": 0.05},
            },
        ),
        "ClassedReturns": Call(
            _classed,
            {
                **{"points": points, "labels": np.full(len(points), 70), "names": {70: "hedge"}},
                **{"classes": ["hedge"], "places": TARGETS, "reach": 1.0},
            },
        ),
        "ClassedReturns.in_boxes": Call(
            _in_boxes, {"points": points, "boxes": labelled_frame().boxes}
        ),
        "classed_returns": Call(uses.classed_returns, {"frame": labelled_frame()}),
        "labelled_scene": Call(
            _labelled_scene,
            {
                **{"number": 0, "frames": [1], "without": ["building"], "within_m": 1.0},
                **{"viewpoint": eye, "targets": TARGETS, "risk": 0.05},
            },
        ),
        "blocker_shares": Call(uses.blocker_shares, {"classes": np.array(["car", "", "building"])}),
        "save_answers": Call(
            uses.save_answers,
            {
                **{"path": folder() / "answers.csv", "viewpoint": eye},
                **{"targets": TARGETS, "sight": of_sight},
                "blocker_class": np.full(len(TARGETS), "car"),
            },
        ),
        "blind_spots": Call(uses.blind_spots, {"grid": seen_grid(), "least_area_m2": 1.0}),
        "objects_of_frame": Call(
            uses.objects_of_frame,
            {"frame": labelled_frame(), "scene": street(), "viewpoint": eye, **query},
        ),
        "Route.through": Call(
            uses.Route.through,
            {"points": WAY, "speed_mps": np.full(4, 8.0), "time_s": np.arange(4.0)},
        ),
        "Route": Call(
            uses.Route,
            {
                **{"points": WAY, "chainage_m": route().chainage_m},
                **{"speed_mps": np.full(4, 8.0), "time_s": np.arange(4.0)},
            },
        ),
        "Route.stations": Call(route().stations, {"step_m": 1.0}),
        "Route.at": Call(route().at, {"chainage_m": np.array([0.0, 3.0])}),
        "Route.above": Call(route().above, {"chainage_m": np.array([0.0, 3.0]), "height_m": 1.5}),
        "Route.speed_at": Call(route().speed_at, {"chainage_m": np.array([0.0, 3.0])}),
        "Route.time_at": Call(route().time_at, {"chainage_m": np.array([0.0, 3.0])}),
        "Route.locate": Call(route().locate, {"xy": xy}),
        "Route.shifted": Call(route().shifted, {"offset_m": 1.0}),
        "Route.extended": Call(route().extended, {"length_m": 10.0}),
        "Route.refined": Call(route().refined, {"step_m": 1.0}),
        "Route.with_heights": Call(route().with_heights, {"z_m": np.zeros(4)}),
        "targets_along": Call(
            uses.targets_along,
            {
                **{"scene": street(), "route": route(), "names": ["a", "b", "c", "d"]},
                **{"targets": TARGETS, "at_pose_times": False, "progress": None, **step},
            },
        ),
        "zones_along": Call(
            uses.zones_along,
            {
                **{"scene": street(), "route": route(), "zones": [zone()], "least": 0.5},
                **{"at_pose_times": False, **step},
            },
        ),
        "read_route": Call(
            uses.read_route, {"path": _written("way.csv", way_points), "start_s": 0.0}
        ),
        "read_route of a text": Call(_read_route, {"content": way_points, "start_s": 0.0}),
        "route_of_drive": Call(uses.route_of_drive, {"drive": drive(), "scans_per_s": 10.0}),
        "SightStandard": Call(
            uses.SightStandard,
            {
                **{"name": "own", "eye_m": (1.1,), "object_m": (0.3,), "reaction_s": 2.0},
                **{"braking": 0.3, "with_grade": True, "note": "made"},
            },
        ),
        "SightStandard.changed": Call(
            _standard,
            {
                **{"speed_mps": np.array([10.0, 20.0]), "grade": np.array([0.0, -0.1])},
                **{"eye_m": (1.1,), "object_m": (0.3,), "reaction_s": 2.0, "braking": 0.3},
            },
        ),
        "sight_distances": Call(
            uses.sight_distances,
            {
                **{"scene": street(), "road": route(), "standard": uses.AASHTO},
                **{"speed_mps": 8.0, "step_m": 5.0, "target_step_m": 2.0, "reach_m": 12.0},
                **{"ignore_m": 0.0, "risk": 0.05, "moments_s": np.zeros((2, 1))},
                "progress": None,
            },
        ),
        "survey_of": Call(
            uses.survey_of,
            {
                **{"drive": drive(), "route": route(), "numbers": [0, 1], "spacing_m": 0.0},
                **{"scans_per_s": 10.0, "sensor": "vlp-16", "max_bytes": 10**9},
                "progress": None,
            },
        ),
        "route_on_road": Call(
            uses.route_on_road, {"survey": survey(), "route": route(), "height_m": 1.7}
        ),
        "Zone": Call(
            _zone,
            {"name": "crossing", "corners": CORNERS, "low_m": 0.2, "high_m": 2.0, "xy": xy},
        ),
        "visibility_grid": Call(
            uses.visibility_grid,
            {
                **{"scene": street(), "viewpoint": eye, "returns": points, "reach_m": 12.0},
                **{"cell_m": 1.0, "height_m": 1.0, **query},
            },
        ),
        "bev_grid": Call(
            uses.bev_grid,
            {
                **{"scans": [(points, None), (scan(1), pose(1.0))], "reach_m": 8.0},
                **{"cell_m": 1.0, "heights_m": (0.3, 1.7), "sensor": None},
            },
        ),
        "VoxelGrid": Call(
            _grid, {"corner": np.array([0.0, -3, -2]), "cell_m": 1.0, "shape": (12, 6, 4)}
        ),
        "VoxelGrid.index_of": Call(grid().index_of, {"points": TARGETS}),
        "VoxelGrid.centre_of": Call(grid().centre_of, {"index": np.array([[1, 2, 3]])}),
        "VoxelGrid.occupied_by": Call(grid().occupied_by, {"points": TARGETS}),
        "Carver": Call(uses.Carver, {"grid": grid(), "sensor": None, "lift_m": np.zeros((13, 7))}),
        "Carver.add": Call(
            _carver,
            {
                **{"lift_m": np.zeros((13, 7)), "sensor": None, "points": points},
                **{"scan_pose": pose(1.0), "now": True},
            },
        ),
        "MaskSettings": Call(
            lambda **values: uses.frame_masks(drive(), 1, uses.MaskSettings(**values)),
            {
                **{"grid": grid(), "definition": "exact", "later": 1, "keep_moving": False},
                **{"grid_from_velo": np.eye(4), "classes": {10: 1}},
            },
        ),
        "frame_masks": Call(
            uses.frame_masks,
            {
                **{"drive": drive(), "number": 1, "settings": uses.MaskSettings(grid())},
                **{"cameras": {"made": drive()}, "progress": None},
            },
        ),
        "PosedScan": Call(
            _masks,
            {
                **{"points": points, "grid_from_sensor": pose(1.0), "scanner": "lidar"},
                **{"labels": labels, "definition": "exact", "camera_pose": CAM_FROM_VELO},
            },
        ),
        "masks_of": Call(
            uses.masks_of,
            {
                **{"grid": grid(), "scans": [uses.PosedScan(points, pose(1.0))]},
                **{"definition": "exact", "cameras": {"c": PosedCamera(camera(), CAM_FROM_VELO)}},
                **{"keep_moving": False, "progress": None},
            },
        ),
    }
