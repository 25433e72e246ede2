"""The messages of a recording for Foxglove: one topic for each layer of the page."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives import Frame
from intervis.method.field_of_view import image_from_velo, in_camera
from intervis.sight import OCCLUDED, VISIBLE
from intervis.uses.visibility_grid import VisibilityGrid, blind_cells
from intervis.view.colours import COLOURS, ON_IMAGE, rgb
from intervis.view.frame_data import frustum_corners
from intervis.view.frame_layers import box_corners
from intervis.view.judged_frame import JudgedFrame
from intervis.view.recordings.foxglove_primitives import (
    EDGE_PX,
    LINE_PX,
    points_of,
    pose_of,
    rgba,
    segments,
    sphere,
    xyz,
    xyzw,
)
from intervis.view.recordings.measures import STATES, frame_measures, state_counts
from intervis.view.recordings.object_look import object_label, state_of_object
from intervis.view.recordings.placement import placement, velo_from_pinhole
from intervis.view.reduced_image import reduced_camera

WORLD_FRAME, SENSOR_FRAME, CAMERA_FRAME = "world", "sensor", "camera"

TOPICS = {
    "/returns": "PointCloud",
    "/blind_spots": "Grid",
    "/scene": "SceneUpdate",
    "/tf": "FrameTransforms",
    "/camera/calibration": "CameraCalibration",
    "/camera/image": "CompressedImage",
    "/camera/states": "ImageAnnotations",
    "/sight_lines": "Log",
}
"""Type of the messages of each topic; ``/measures`` is JSON."""

MEASURES_SCHEMA: dict[str, Any] = {
    "title": "intervis.Measures",
    "type": "object",
    "properties": {"frame": {"type": "integer"}},
    "additionalProperties": {"type": "number"},
}

RETURN_RECORD = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z", "probability")),
        ("row", "<u4"),
        ("state", "<i1"),
        *((name, "<u1") for name in ("red", "green", "blue", "alpha")),
    ]
)
"""A return in ``/returns``: ``row`` is its row in the scan's file."""

CELL_RECORD = np.dtype(
    [
        ("probability", "<f4"),
        ("state", "<i1"),
        *((name, "<u1") for name in ("red", "green", "blue", "alpha")),
    ]
)
"""A cell of ``/blind_spots``; alpha is 0 where it is visible or has no ground."""

NUMERIC_TYPES = {"<f4": "Float32", "<u4": "Uint32", "|i1": "Int8", "|u1": "Uint8"}
PALETTE = COLOURS["dark"]
SPOT_ALPHA = 110
BOX_EDGES = (
    *((0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3)),
    *((4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)),
)
"""Pairs of `CORNERS` of a box."""


def frame_messages(judged: JudgedFrame, time_ns: int) -> Iterator[tuple[str, Any]]:
    """The messages of a frame, by topic.

    Parameters
    ----------
    judged : JudgedFrame
    time_ns : int
        Time of the frame, nanoseconds.
    """
    from foxglove.messages import Timestamp

    stamp = Timestamp(*divmod(time_ns, 1_000_000_000))
    yield "/tf", _transforms(judged.frame, stamp)
    yield "/returns", _cloud(judged, stamp)
    yield "/scene", _scene(judged, stamp)
    if judged.grid is not None:
        yield "/blind_spots", _grid(judged.grid, judged.ground_m, stamp)
    yield from _camera_messages(judged, stamp)
    for line in judged.lines:
        yield "/sight_lines", _sentence(line.explanation.text, stamp)
    measures = {"frame": judged.frame.number, **state_counts(judged.sight)}
    yield "/measures", {**measures, **frame_measures(judged)}


def _transforms(frame: Frame, stamp: Any) -> Any:
    """The sensor in the world, if it has a pose, and the camera in the sensor's frame."""
    from foxglove.messages import FrameTransform, FrameTransforms, Quaternion, Vector3

    poses: list[tuple[str, str, Float64Array]] = []
    if frame.pose is not None:
        poses.append((WORLD_FRAME, SENSOR_FRAME, frame.pose))
    if frame.camera is not None and frame.cam_from_velo is not None:
        extrinsics = velo_from_pinhole(frame.camera, frame.cam_from_velo)
        poses.append((SENSOR_FRAME, CAMERA_FRAME, extrinsics))
    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=stamp,
                parent_frame_id=parent,
                child_frame_id=child,
                translation=Vector3(**xyz(pose[:3, 3])),
                rotation=Quaternion(**xyzw(placement(pose).quaternion)),
            )
            for parent, child, pose in poses
        ]
    )


def return_records(judged: JudgedFrame) -> NDArray[np.void]:
    """(N,) the judged returns as `RETURN_RECORD`."""
    records = np.empty(len(judged.rows), RETURN_RECORD)
    for name, values in zip("xyz", judged.points.T, strict=True):
        records[name] = values
    records["probability"], records["row"] = judged.sight.probability, judged.rows
    records["state"] = judged.sight.state
    _colour(records, judged.sight.state, 255)
    return records


def cell_records(grid: VisibilityGrid) -> NDArray[np.void]:
    """(J, I) the cells of a grid as `CELL_RECORD`: rows along y, as Foxglove orders them."""
    records = np.empty(grid.state.shape, CELL_RECORD)
    records["probability"], records["state"] = grid.probability, grid.state
    _colour(records, grid.state, np.where(blind_cells(grid), SPOT_ALPHA, 0))
    return np.ascontiguousarray(records.T)


def _colour(records: NDArray[np.void], state: NDArray[np.int8], alpha: Any) -> None:
    """Write the colours of states into records."""
    palette = np.array([rgb(PALETTE[name]) for name in STATES], np.uint8)
    colours = palette[np.where(state < 0, STATES.index("unknown"), state)]
    for k, name in enumerate(("red", "green", "blue")):
        records[name] = colours[..., k]
    records["alpha"] = alpha


def _fields(record: np.dtype[Any]) -> list[Any]:
    """The fields of a record as Foxglove describes them."""
    from foxglove.messages import PackedElementField, PackedElementFieldNumericType

    assert record.fields is not None
    return [
        PackedElementField(
            name=name,
            offset=offset,
            type=getattr(PackedElementFieldNumericType, NUMERIC_TYPES[kind.str]),
        )
        for name, (kind, offset, *_) in record.fields.items()
    ]


def _cloud(judged: JudgedFrame, stamp: Any) -> Any:
    from foxglove.messages import PointCloud

    return PointCloud(
        timestamp=stamp,
        frame_id=SENSOR_FRAME,
        pose=pose_of(np.eye(4)),
        point_stride=RETURN_RECORD.itemsize,
        fields=_fields(RETURN_RECORD),
        data=return_records(judged).tobytes(),
    )


def _grid(grid: VisibilityGrid, ground_m: float, stamp: Any) -> Any:
    """The ground around the viewpoint, as a plane at the height of the ground below it."""
    from foxglove.messages import Grid, Vector2

    corner = np.eye(4)
    height_m = ground_m if np.isfinite(ground_m) else 0.0
    corner[:3, 3] = *grid.corner, height_m
    records = cell_records(grid)
    return Grid(
        timestamp=stamp,
        frame_id=SENSOR_FRAME,
        pose=pose_of(corner),
        column_count=records.shape[1],
        cell_size=Vector2(x=grid.cell_m, y=grid.cell_m),
        row_stride=records.shape[1] * CELL_RECORD.itemsize,
        cell_stride=CELL_RECORD.itemsize,
        fields=_fields(CELL_RECORD),
        data=records.tobytes(),
    )


def _scene(judged: JudgedFrame, stamp: Any) -> Any:
    """Viewpoint, frustum, objects, sight lines, and the paper's region, instead of those before."""
    from foxglove.messages import (
        SceneEntity,
        SceneEntityDeletion,
        SceneEntityDeletionType,
        SceneUpdate,
    )

    parts: dict[str, dict[str, Any]] = {
        "viewpoint": {"spheres": [sphere(judged.viewpoint, PALETTE["ink"])]},
        "frustum": {"lines": _frustum(judged.frame)},
        "objects": _objects(judged),
        "sight_lines": _sight_lines(judged),
        "method": _method(judged),
    }
    entities = [
        SceneEntity(timestamp=stamp, frame_id=SENSOR_FRAME, id=name, **content)
        for name, content in parts.items()
        if any(content.values())
    ]
    before = SceneEntityDeletion(timestamp=stamp, type=SceneEntityDeletionType.All)
    return SceneUpdate(deletions=[before], entities=entities)


def _frustum(frame: Frame) -> list[Any]:
    if frame.camera is None or frame.cam_from_velo is None:
        return []
    corners = frustum_corners(frame.camera, frame.cam_from_velo)
    centre = frame.viewpoint_velo
    ends = [(centre, corner) for corner in corners]
    ends += list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    return [segments(np.array(ends), PALETTE["faint"], EDGE_PX)]


def _objects(judged: JudgedFrame) -> dict[str, Any]:
    """Boxes as edges, with their labels above."""
    from foxglove.messages import TextPrimitive

    lines, texts = [], []
    for one in judged.objects:
        colour = PALETTE[state_of_object(one)]
        corners = box_corners(one.box)
        lines.append(segments(corners[np.array(BOX_EDGES)], colour, EDGE_PX))
        above = one.box.velo_from_box.copy()
        above[2, 3] = corners[:, 2].max() + 0.3
        texts.append(
            TextPrimitive(
                pose=pose_of(above),
                billboard=True,
                font_size=12.0,
                scale_invariant=True,
                color=rgba(colour),
                text=object_label(one),
            )
        )
    return {"lines": lines, "texts": texts}


def _sight_lines(judged: JudgedFrame) -> dict[str, Any]:
    """The requested lines, coloured by state; a sphere where one is blocked."""
    names = {VISIBLE: "visible", OCCLUDED: "occluded"}
    lines, spheres = [], []
    for line in judged.lines:
        colour = PALETTE[names.get(line.explanation.state, "unknown")]
        lines.append(segments(np.array([[line.start, line.end]]), colour, LINE_PX))
        if np.isfinite(line.explanation.blocker).all():
            spheres.append(sphere(line.explanation.blocker, PALETTE["occluded"]))
    return {"lines": lines, "spheres": spheres}


def _method(judged: JudgedFrame) -> dict[str, Any]:
    """The paper's region and intervisible edges."""
    from foxglove.messages import TriangleListPrimitive

    if judged.analysis is None:
        return {}
    nodes = judged.analysis.node_points
    edges = judged.analysis.edges[judged.analysis.edge_intervisible]
    region = judged.analysis.triangles[judged.analysis.region]
    triangles = [
        TriangleListPrimitive(
            pose=pose_of(np.eye(4)),
            points=points_of(nodes),
            color=rgba(PALETTE["region"], 0.45),
            indices=region.ravel().tolist(),
        )
    ]
    return {
        "triangles": triangles if len(region) else [],
        "lines": [segments(nodes[edges], PALETTE["visible"], EDGE_PX)] if len(edges) else [],
    }


def _camera_messages(judged: JudgedFrame, stamp: Any) -> Iterator[tuple[str, Any]]:
    """Calibration, image, and the returns in the image by state."""
    from foxglove.messages import CameraCalibration, CompressedImage

    frame, image = judged.frame, judged.image
    if frame.camera is None or frame.cam_from_velo is None:
        return
    camera = reduced_camera(frame.camera, image)
    matrix = camera.projection[:, :3]
    yield (
        "/camera/calibration",
        CameraCalibration(
            timestamp=stamp,
            frame_id=CAMERA_FRAME,
            width=camera.width_px,
            height=camera.height_px,
            K=matrix.ravel().tolist(),
            R=np.eye(3).ravel().tolist(),
            P=np.column_stack([matrix, np.zeros(3)]).ravel().tolist(),
        ),
    )
    if image is None:
        return
    yield (
        "/camera/image",
        CompressedImage(timestamp=stamp, frame_id=CAMERA_FRAME, data=image.jpeg, format="jpeg"),
    )
    seen = in_camera(judged.points, camera, frame.cam_from_velo).index
    homogeneous = np.column_stack([judged.points[seen], np.ones(len(seen))])
    u, v, depth = image_from_velo(camera, frame.cam_from_velo) @ homogeneous.T
    pixels = np.column_stack([u / depth, v / depth])
    yield "/camera/states", _annotations(pixels, judged.sight.state[seen], stamp)


def _annotations(pixels: Float64Array, state: NDArray[np.int8], stamp: Any) -> Any:
    """Points on the image, one list for each state."""
    from foxglove.messages import (
        ImageAnnotations,
        Point2,
        PointsAnnotation,
        PointsAnnotationType,
    )

    lists = []
    for number, name in enumerate(STATES):
        chosen = pixels[state == (-1 if name == "unknown" else number)]
        colour = rgba(ON_IMAGE[name])
        lists.append(
            PointsAnnotation(
                timestamp=stamp,
                type=PointsAnnotationType.Points,
                points=[Point2(x=x, y=y) for x, y in chosen.tolist()],
                outline_color=colour,
                fill_color=colour,
                thickness=1.5,
            )
        )
    return ImageAnnotations(timestamp=stamp, points=lists)


def _sentence(text: str, stamp: Any) -> Any:
    from foxglove.messages import Log, LogLevel

    return Log(timestamp=stamp, level=LogLevel.Info, message=text, name="intervis")
