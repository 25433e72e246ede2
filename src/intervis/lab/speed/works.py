"""What is timed on a frame of a drive: triangulation, the method, sight lines, and other tools."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import Delaunay

from intervis.arrays import Float64Array, finite_rows
from intervis.delaunay import triangulate
from intervis.lab.speed.grid_works import grid_works
from intervis.lab.speed.numpy_mask import numpy_mask
from intervis.lab.speed.route_works import route_works
from intervis.lab.speed.timing import Work
from intervis.lab.truth.baselines import depth_buffer, triangulated
from intervis.lab.truth.baselines.hidden_points import hidden_point_removal
from intervis.lab.truth.baselines.input_scans import InputScans
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.method.analysis import analyze
from intervis.method.comparison import interpolation_points
from intervis.settings import Settings
from intervis.sight import Scene, visible_mask
from intervis.transform import inverse, transform

try:
    import open3d
except ImportError:
    open3d = None
try:
    import pythoncdt
except ImportError:
    pythoncdt = None

if TYPE_CHECKING:
    from intervis.drives import Drive, Frame

AHEAD_M = 5.0
"""Distance of the viewpoint of the sight lines, ahead of the sensor."""

MOST_SCANS = 7
JUMP_FRACTION = 0.2
"""Triangles over larger jumps of range are cut, as in the baseline `triangulated`."""

TAUS = (35, 10, 1)


@dataclass(frozen=True)
class Question:
    """A frame, the scans around it with their poses, and the sight lines asked for.

    Attributes
    ----------
    frame : Frame
        The frame; the targets are its returns.
    scans, poses : lists
        Scans in their sensors' frames, and world_from_velo of each; the frame's own first.
    viewpoint : (3,) array
        World frame, metres.
    targets : (N, 3) array
        World frame, metres.
    """

    frame: "Frame"
    scans: list[Float64Array]
    poses: list[Float64Array]
    viewpoint: Float64Array
    targets: Float64Array


def question_of(drive: "Drive", number: int) -> Question:
    """The sight lines of a frame: from 5 m ahead of its sensor to all of its returns."""
    frame = drive[number]
    numbers = [number]
    if drive.poses:  # every other frame from this one on, as in a drive at half its rate
        numbers += [n for n in drive.frame_numbers if n > number and n in drive.poses][1::2]
    frames = [frame, *(drive[n] for n in numbers[1:MOST_SCANS])]
    poses = [np.eye(4) if one.pose is None else one.pose for one in frames]
    scans = [np.asarray(one.points[finite_rows(one.points), :3], np.float64) for one in frames]
    viewpoint = transform(poses[0], np.array([AHEAD_M, 0.0, 0.0]))
    return Question(frame, scans, poses, viewpoint, transform(poses[0], scans[0]))


def works_of(question: Question) -> Iterator[Work]:
    """All works on a frame, group by group; tools that are not installed are left out."""
    yield from _triangulations(question.scans[0])
    yield from _method(question.frame)
    yield from _preparations(question)
    yield from _sight_lines(question)
    yield from _masks(question)
    yield from grid_works(question.scans, question.poses)


def _triangulations(scan: Float64Array) -> Iterator[Work]:
    random = np.random.default_rng(0).random((20_000, 2))
    above = np.ascontiguousarray(np.unique(scan[:, :2], axis=0))
    for name, positions in (("20,000 random positions", random), ("a scan from above", above)):
        group = f"triangulation, {name}"
        yield Work(group, "intervis", _call(triangulate, positions), len(positions))
        yield Work(group, "scipy", _call(Delaunay, positions), len(positions))
        if pythoncdt is not None:
            yield Work(group, "CDT", _call(_cdt, positions), len(positions))


def _cdt(positions: Float64Array) -> object:
    order, crossing = pythoncdt.VertexInsertionOrder, pythoncdt.IntersectingConstraintEdges
    mesh = pythoncdt.Triangulation(order.AUTO, crossing.NOT_ALLOWED, 0.0)
    mesh.insert_vertices(positions)
    mesh.erase_super_triangle()
    return mesh


def _method(frame: "Frame") -> Iterator[Work]:
    camera: dict[str, Any] = {"camera": frame.camera, "cam_from_velo": frame.cam_from_velo}
    for tau in TAUS:
        settings = Settings(tau=tau)
        measures = analyze(frame.points, settings=settings, **camera).measures
        call = _call(analyze, frame.points, settings=settings, **camera)
        yield Work(f"raw scan to region, tau {tau}", "intervis", call, int(measures.n))
        in_view = int(measures.n_fov)
    settings = Settings(tau=1, view="circle")
    call = _call(analyze, frame.points, settings=settings)
    yield Work("raw scan to region, full circle, tau 1", "intervis", call, len(frame.points))
    call = _call(interpolation_points, frame.points, **camera)
    yield Work("interpolation points, which the paper compares with", "intervis", call, in_view)


def _preparations(question: Question) -> Iterator[Work]:
    scan, pose = question.frame.points, question.poses[0]
    group = "a scan made ready"
    yield Work(group, "intervis", _call(Scene.from_scan, scan, pose), len(scan))
    yield Work(group, "scipy and Embree", _call(_caster, question.scans[0]), len(scan))
    if open3d is not None:
        triangles = triangulated.surface(question.scans[0], JUMP_FRACTION)
        yield Work(group, "Open3D, triangles given", _call(_open3d_scene, triangles), len(scan))


def _masks(question: Question) -> Iterator[Work]:
    scan, group = question.frame.points, "a mask of a scan by a depth buffer"
    viewpoint = np.array([AHEAD_M, 0.0, 0.0])
    yield Work(group, "intervis", _call(visible_mask, scan, viewpoint), len(scan))
    yield Work(group, "the same in numpy", _call(numpy_mask, scan, viewpoint), len(scan))


def _sight_lines(question: Question) -> Iterator[Work]:
    lines, viewpoint, targets = len(question.targets), question.viewpoint, question.targets
    scene = Scene.from_scan(question.scans[0], question.poses[0])
    group = "all sight lines of a viewpoint"
    yield Work(group, "intervis", _call(scene.sight, viewpoint, targets), lines)
    caster, back = _caster(question.scans[0]), inverse(question.poses[0])
    slack_m = 0.3 + 0.02 * np.linalg.norm(targets - viewpoint, axis=1)
    start, ends = transform(back, viewpoint), transform(back, targets)
    yield Work(group, "Embree", lambda: caster.blocked(start, ends, slack_m=slack_m), lines)
    inputs = InputScans((0,), (question.scans[0],), (question.poses[0],), 0, 0)
    buffer = {"azimuth_deg": 0.4, "elevation_deg": 0.4, "tolerance_m": 0.5}
    yield Work(
        group,
        "numpy depth buffer",
        _call(depth_buffer.predict, inputs, viewpoint, targets, tolerance_fraction=0.02, **buffer),
        lines,
    )
    yield Work(
        group, "hidden point removal", _call(hidden_point_removal, ends, start, 100.0), lines
    )
    if open3d is not None:
        casting = _open3d_scene(triangulated.surface(question.scans[0], JUMP_FRACTION))
        direction = ends - start
        rays = np.hstack([np.broadcast_to(start, ends.shape), direction]).astype(np.float32)
        tensor = open3d.core.Tensor(rays)
        yield Work(group, "Open3D", lambda: casting.test_occlusions(tensor, 0.0, 0.97), lines)
    if len(question.scans) > 1:
        several = Scene()
        for scan, pose in zip(question.scans, question.poses, strict=True):
            several.add(scan, pose)
        group = f"the same, {len(question.scans)} scans"
        yield Work(group, "intervis", _call(several.sight, viewpoint, targets), lines)
        yield from route_works(several, question.poses)


def _caster(scan: Float64Array) -> RayCaster:
    return RayCaster(triangulated.surface(scan, JUMP_FRACTION))


def _open3d_scene(triangles: Float64Array) -> Any:
    corners = np.ascontiguousarray(triangles.reshape(-1, 3), np.float32)
    faces = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(open3d.core.Tensor(corners), open3d.core.Tensor(faces))
    return scene


def _call(function: Callable[..., object], *arguments: Any, **options: Any) -> Callable[[], object]:
    return lambda: function(*arguments, **options)
