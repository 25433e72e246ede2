"""What a page stores of one judged frame: a header as JSON, columns, the reduced image."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.method.field_of_view import image_from_velo
from intervis.run.frame_file import FrameRecord
from intervis.sight import Scene
from intervis.sight.observed_profile import unobserved_parts
from intervis.view.columns import packed
from intervis.view.frame_layers import box_content, cell_columns, mesh_columns, spot_content
from intervis.view.judged_frame import JudgedFrame, SightLine
from intervis.view.reduced_image import reduced_camera
from intervis.view.verdicts import BY_DIFFERENCE, PARTS, returns_with_parts, verdict_columns

FRUSTUM_M = 6.0
"""Length of the camera's frustum as drawn."""


@dataclass(frozen=True, eq=False)
class FrameData:
    """One frame as it stands in a page.

    Attributes
    ----------
    header : dict
        Plain JSON: see `frame_content`; and the camera.
    block : bytes
        Columns.
    jpeg : bytes or None
        The reduced image.
    """

    header: dict[str, Any]
    block: bytes
    jpeg: bytes | None


def frame_data(judged: JudgedFrame) -> FrameData:
    """Everything that a page stores of one frame."""
    header, block = frame_content(judged)
    jpeg = None if judged.image is None else judged.image.jpeg
    return FrameData({**header, "camera": _camera(judged)}, block, jpeg)


def frame_content(judged: JudgedFrame) -> tuple[dict[str, Any], bytes]:
    """A frame as seen from a viewpoint, without camera and image.

    Returns
    -------
    header : dict
        Plain JSON: number, viewpoint, counts, lines, boxes, blind spots.
    block : bytes
        Columns: see `intervis.view.columns` and `verdict_columns`.
    """
    sight = judged.sight
    columns = verdict_columns(returns_with_parts(judged))
    header: dict[str, Any] = {
        "number": judged.frame.number,
        "viewpoint": judged.viewpoint.tolist(),
        "returns": len(judged.frame.points),
        "stored": len(judged.rows),
        "memory": judged.remembered,
        "ground_m": _number(round(judged.ground_m, 2)),
        "visible": int(sight.visible.sum()),
        "occluded": int(sight.occluded.sum()),
        "unknown": int(sight.unknown.sum()),
        "lines": [line_content(line, judged.scene, judged.moment_s) for line in judged.lines],
        "boxes": [box_content(one) for one in judged.objects],
    }
    if judged.scene.tilt_deg:
        header["tilt_deg"] = round(judged.scene.tilt_deg)
    if judged.grid is not None:
        columns |= cell_columns(judged.grid)
        spots = [spot_content(spot) for spot in judged.spots]
        header |= {"cell_m": judged.grid.cell_m, "spots": spots}
    if judged.analysis is not None:
        columns |= mesh_columns(judged.analysis)
        header["TPI"] = round(judged.analysis.measures.TPI, 2)
    if judged.record is not None:
        header["run"] = run_content(judged.record)
        header["unexplained"] = judged.unexplained
    return header, packed(columns, BY_DIFFERENCE)


def run_content(record: FrameRecord) -> dict[str, Any]:
    """What a run stored of a frame as JSON: the numbers of its files, not rounded."""
    numbers = {"measures": record.measures, "times_s": record.times_s, "shares": record.sight or {}}
    return {
        "tau": record.tau,
        **{
            name: {key: _number(value) for key, value in values.items()}
            for name, values in numbers.items()
        },
    }


def line_content(line: SightLine, scene: Scene, moment_s: float | None) -> dict[str, Any]:
    """One explained line as JSON, with the observed and unobserved parts of the line."""
    said, scans = line.explanation, scene.packed_scans(moment_s)
    parts_m = unobserved_parts(scans, line.start[None], line.end[None], PARTS)[0]
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
        "start": line.start.tolist(),
        "end": line.end.tolist(),
    }


def _camera(judged: JudgedFrame) -> dict[str, Any] | None:
    """Projection into the reduced image, and the frustum; None without a camera."""
    frame, camera, cam_from_velo = judged.frame, judged.frame.camera, judged.frame.cam_from_velo
    if camera is None or cam_from_velo is None:
        return None
    reduced = reduced_camera(camera, judged.image)
    return {
        "name": camera.name,
        "width_px": reduced.width_px,
        "height_px": reduced.height_px,
        "has_image": judged.image is not None,
        "image_from_velo": image_from_velo(reduced, cam_from_velo).tolist(),
        "centre": frame.viewpoint_velo.round(3).tolist(),
        "frustum": frustum_corners(camera, cam_from_velo).round(3).tolist(),
    }


def frustum_corners(camera: Camera, cam_from_velo: Float64Array) -> Float64Array:
    """(4, 3) the corners of the image at a depth of `FRUSTUM_M`, sensor frame, metres."""
    matrix = image_from_velo(camera, cam_from_velo)
    w, h = float(camera.width_px), float(camera.height_px)
    pixels = np.array([[0.0, 0.0, 1.0], [w, 0.0, 1.0], [w, h, 1.0], [0.0, h, 1.0]])
    corners = np.linalg.solve(matrix[:, :3], FRUSTUM_M * pixels.T - matrix[:, 3:]).T
    return np.asarray(corners)


def _number(value: float) -> float | None:
    """The number, or None where it is not finite, as JSON has no other word for that."""
    return float(value) if np.isfinite(value) else None
