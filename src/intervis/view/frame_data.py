"""What a page stores of one frame: judged returns, mesh, blind spots, boxes, lines, image."""

import io
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.drives import Drive, Frame
from intervis.errors import DriveError, IntervisError, MissingExtraError
from intervis.method.analysis import Analysis, analyze
from intervis.method.field_of_view import image_from_velo
from intervis.sight import OCCLUDED, Scene, explain
from intervis.sight.observed_profile import unobserved_parts
from intervis.uses.blind_spots import BlindSpot, blind_spots
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.registration import query_moment_s, registered_scene
from intervis.uses.visibility_grid import VisibilityGrid, blind_cells, visibility_grid
from intervis.view.columns import Columns, packed
from intervis.view.verdicts import (
    BY_DIFFERENCE,
    PARTS,
    PER_M,
    judged_returns,
    thinned_rows,
    verdict_columns,
)
from intervis.view.view_request import (
    ViewRequest,
    place_in_frame,
    remembered_frames,
    viewpoint_in_frame,
)

log = logging.getLogger(__name__)

IMAGE_WIDTH_PX = 828
JPEG_QUALITY = 70

GRID_REACH_M, GRID_CELL_M = 30.0, 0.8
"""Blind spots are coarser here than those of `intervis blindspots`: they are judged per frame."""

FRUSTUM_M = 6.0
"""Length of the camera's frustum as drawn."""

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""Corners of a box of edge 1."""


@dataclass(frozen=True, eq=False)
class FrameData:
    """One frame as it stands in a page.

    Attributes
    ----------
    header : dict
        Plain JSON: number, viewpoint, boxes, lines, camera, measures.
    block : bytes
        Columns: see `intervis.view.columns` and `intervis.view.verdicts`.
    jpeg : bytes or None
        The reduced image.
    """

    header: dict[str, Any]
    block: bytes
    jpeg: bytes | None


class FrameJudge:
    """One frame with the scans around it: judges its returns, or a line, from any viewpoint.

    Parameters
    ----------
    drive : Drive
    number : int
        The frame's number.
    request : ViewRequest

    Raises
    ------
    DriveError
        The frame cannot be read.
    """

    def __init__(self, drive: Drive, number: int, request: ViewRequest) -> None:
        self.frame = drive[number]
        self.request = request
        self.remembered = remembered_frames(drive, number, request.memory)
        self._drive = drive
        self.rows = thinned_rows(self.frame.points, request.most_returns)
        points = self.frame.points[self.rows, :3].astype(np.float64)
        self.centimetres: IntArray = np.rint(points * PER_M).astype(np.int64)

    @cached_property
    def scene(self) -> Scene:
        """The frame's scan and those around it, in its sensor frame."""
        return registered_scene(self._drive, self.frame, self.remembered)

    @cached_property
    def moment_s(self) -> float | None:
        """The query time: that of the frame, if all scans have timestamps."""
        return query_moment_s(self.scene)

    def line(self, start: Float64Array, end: Float64Array) -> dict[str, Any]:
        """One line explained, as JSON: the numbers of `intervis.explain`, and `parts_m`."""
        said = explain(self.scene, start, end, risk=self.request.risk, moment_s=self.moment_s)
        scans = self.scene.packed_scans(self.moment_s)
        parts_m = unobserved_parts(scans, start[None], end[None], PARTS)[0]
        return {
            "text": said.text,
            "state": said.state,
            "probability": _number(said.probability),
            "length_m": said.length_m,
            "blocker": [_number(value) for value in said.blocker],
            "blocker_m": _number(said.blocker_m),
            "clearance_m": _number(said.clearance_m),
            "unobserved_m": said.unobserved_m,
            "parts_m": parts_m.round(3).tolist(),
            "start": start.tolist(),
            "end": end.tolist(),
        }

    def verdicts(self, viewpoint: Float64Array) -> tuple[Columns, dict[str, Any]]:
        """Columns of the judged returns, and their summary for the header."""
        judged = judged_returns(
            self.scene, viewpoint, self.rows, self.centimetres, self.request.risk, self.moment_s
        )
        sight = judged.sight
        summary = {
            "viewpoint": viewpoint.tolist(),
            "visible": int(sight.visible.sum()),
            "occluded": int(sight.occluded.sum()),
            "unknown": int(sight.unknown.sum()),
        }
        return verdict_columns(judged), summary


def frame_data(
    drive: Drive, number: int, request: ViewRequest, fixed_world: Float64Array | None = None
) -> FrameData:
    """Everything that a page stores of one frame.

    Parameters
    ----------
    drive : Drive
    number : int
    request : ViewRequest
    fixed_world : (3,) float64 array or None
        A viewpoint in world coordinates instead of that of the request.

    Raises
    ------
    DriveError
        The frame cannot be read, has no camera or no pose where the request needs one.
    """
    judge = FrameJudge(drive, number, request)
    frame = judge.frame
    viewpoint = viewpoint_in_frame(frame, request.viewpoint, fixed_world)
    columns, summary = judge.verdicts(viewpoint)
    header: dict[str, Any] = {
        "number": number,
        "returns": len(frame.points),
        "stored": len(judge.rows),
        "ground_m": _number(round(float(judge.scene.ground_height(viewpoint[None, :2])[0]), 2)),
        "memory": judge.remembered,
        **summary,
        "lines": [judge.line(viewpoint, place_in_frame(frame, end)) for end in request.ends],
        "boxes": [_box(one) for one in _objects(judge, viewpoint)],
    }
    if request.has_blind_spots:
        grid = _grid(judge, viewpoint)
        columns |= _cell_columns(grid)
        header |= {"cell_m": grid.cell_m, "spots": [_spot(spot) for spot in blind_spots(grid)]}
    analysis = _analysis(frame, viewpoint)
    if analysis is not None:
        columns |= _mesh_columns(analysis)
        header["TPI"] = round(analysis.measures.TPI, 2)
    jpeg, size_px = _reduced_image(frame)
    header["camera"] = _camera(frame, size_px)
    return FrameData(header, packed(columns, BY_DIFFERENCE), jpeg)


def _number(value: float) -> float | None:
    """The number, or None where it is not finite, as JSON has no other word for that."""
    return float(value) if np.isfinite(value) else None


def _objects(judge: FrameJudge, viewpoint: Float64Array) -> Sequence[ObjectSight]:
    if judge.frame.read_boxes is None:
        return ()
    return objects_of_frame(
        judge.frame, judge.scene, viewpoint, risk=judge.request.risk, moment_s=judge.moment_s
    )


def _box(one: ObjectSight) -> dict[str, Any]:
    """A labelled object as JSON, with the corners of its box."""
    corners = CORNERS * one.box.size_m @ one.box.velo_from_box[:3, :3].T
    corners += one.box.velo_from_box[:3, 3]
    return {**one.to_json(), "corners": corners.round(2).tolist()}


def _grid(judge: FrameJudge, viewpoint: Float64Array) -> VisibilityGrid:
    return visibility_grid(
        judge.scene,
        viewpoint,
        judge.centimetres / PER_M,
        reach_m=GRID_REACH_M,
        cell_m=GRID_CELL_M,
        risk=judge.request.risk,
        moment_s=judge.moment_s,
    )


def _spot(spot: BlindSpot) -> dict[str, Any]:
    return {
        "area_m2": round(spot.area_m2, 1),
        "nearest_m": round(spot.nearest_m, 1),
        "centre": spot.centre.round(2).tolist(),
        "hides": spot.hides,
        "occluded": round(spot.occluded, 3),
    }


def _cell_columns(grid: VisibilityGrid) -> Columns:
    """Middles of the cells that are not visible (cm, on the ground), and which are occluded."""
    blind = blind_cells(grid)
    middles = np.column_stack([grid.middles[blind], grid.ground_m[blind]])
    middles_cm = np.rint(middles * PER_M).astype(np.int64)
    columns: Columns = {f"cell_{name}": middles_cm[:, axis] for axis, name in enumerate("xyz")}
    columns["cell_occluded"] = (grid.state[blind] == OCCLUDED).astype(np.int64)
    return columns


def _analysis(frame: Frame, viewpoint: Float64Array) -> Analysis | None:
    """The paper's method on this frame; None where it has no result."""
    try:
        return analyze(
            frame.points,
            camera=frame.camera,
            cam_from_velo=frame.cam_from_velo,
            viewpoint=viewpoint,
        )
    except IntervisError as error:
        log.info("frame %d has no mesh: %s", frame.number, error)
        return None


def _mesh_columns(analysis: Analysis) -> Columns:
    """Nodes (cm), edges and triangles of the paper's mesh, with what is intervisible."""
    nodes = np.rint(analysis.node_points * PER_M).astype(np.int64)
    columns: Columns = {f"node_{name}": nodes[:, axis] for axis, name in enumerate("xyz")}
    columns["node_intervisible"] = analysis.node_intervisible.astype(np.int64)
    columns |= {"edge_a": analysis.edges[:, 0], "edge_b": analysis.edges[:, 1]}
    columns["edge_intervisible"] = analysis.edge_intervisible.astype(np.int64)
    region = analysis.triangles[analysis.region]
    columns |= {f"region_{name}": region[:, corner] for corner, name in enumerate("abc")}
    return columns


def _reduced_image(frame: Frame) -> tuple[bytes | None, tuple[int, int] | None]:
    """The image as JPEG of at most `IMAGE_WIDTH_PX`, and its size; None without an image."""
    if frame.image_path is None or frame.camera is None:
        return None, None
    try:
        image = frame.image
    except (DriveError, MissingExtraError) as error:
        log.warning("frame %d is shown without its image: %s", frame.number, error)
        return None, None
    assert image is not None
    from PIL import Image

    picture = Image.fromarray(image)
    scale = min(1.0, IMAGE_WIDTH_PX / picture.width)
    if scale < 1.0:
        size_px = (IMAGE_WIDTH_PX, max(1, round(picture.height * scale)))
        picture = picture.resize(size_px, Image.Resampling.BILINEAR, reducing_gap=2.0)
    buffer = io.BytesIO()
    picture.save(buffer, "JPEG", quality=JPEG_QUALITY)
    return buffer.getvalue(), picture.size


def _camera(frame: Frame, size_px: tuple[int, int] | None) -> dict[str, Any] | None:
    """Projection into the reduced image, and the frustum; None without a camera."""
    camera, cam_from_velo = frame.camera, frame.cam_from_velo
    if camera is None or cam_from_velo is None:
        return None
    width_px, height_px = size_px or (camera.width_px, camera.height_px)
    matrix = image_from_velo(camera, cam_from_velo)
    scaled = np.diag([width_px / camera.width_px, height_px / camera.height_px, 1.0]) @ matrix
    w, h = float(camera.width_px), float(camera.height_px)
    pixels = np.array([[0.0, 0.0, 1.0], [w, 0.0, 1.0], [w, h, 1.0], [0.0, h, 1.0]])
    rays = np.linalg.solve(matrix[:, :3], FRUSTUM_M * pixels.T - matrix[:, 3:]).T
    return {
        "name": camera.name,
        "width_px": width_px,
        "height_px": height_px,
        "has_image": size_px is not None,
        "image_from_velo": scaled.tolist(),
        "centre": frame.viewpoint_velo.round(3).tolist(),
        "frustum": rays.round(3).tolist(),
    }
