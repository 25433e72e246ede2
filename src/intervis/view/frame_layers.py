"""What a page draws of a frame besides its returns: objects, blind spots, the paper's mesh."""

import logging
from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives import Frame
from intervis.drives.boxes import Box
from intervis.errors import IntervisError
from intervis.method.analysis import Analysis, analyze
from intervis.sight import OCCLUDED
from intervis.uses.blind_spots import BlindSpot
from intervis.uses.objects import ObjectSight
from intervis.uses.visibility_grid import VisibilityGrid, blind_cells
from intervis.view.columns import Columns
from intervis.view.judged_frame import PER_M

log = logging.getLogger(__name__)

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""Corners of a box of edge 1."""


def box_content(one: ObjectSight) -> dict[str, Any]:
    """A labelled object as JSON, with the corners of its box."""
    return {**one.to_json(), "corners": box_corners(one.box).round(2).tolist()}


def box_corners(box: Box) -> Float64Array:
    """(8, 3) corners of a box in the order of `CORNERS`, sensor frame, metres."""
    corners = CORNERS * box.size_m @ box.velo_from_box[:3, :3].T
    return np.asarray(corners + box.velo_from_box[:3, 3])


def spot_content(spot: BlindSpot) -> dict[str, Any]:
    """A blind spot as JSON, without its outline: its cells are drawn."""
    return {
        "area_m2": round(spot.area_m2, 1),
        "nearest_m": round(spot.nearest_m, 1),
        "centre": spot.centre.round(2).tolist(),
        "hides": spot.hides,
        "occluded": round(spot.occluded, 3),
    }


def cell_columns(grid: VisibilityGrid) -> Columns:
    """Middles of the cells that are not visible (cm, on the ground), and which are occluded."""
    blind = blind_cells(grid)
    middles = np.column_stack([grid.middles[blind], grid.ground_m[blind]])
    middles_cm = np.rint(middles * PER_M).astype(np.int64)
    columns: Columns = {f"cell_{name}": middles_cm[:, axis] for axis, name in enumerate("xyz")}
    columns["cell_occluded"] = (grid.state[blind] == OCCLUDED).astype(np.int64)
    return columns


def analysis_of(frame: Frame, viewpoint: Float64Array) -> Analysis | None:
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


def mesh_columns(analysis: Analysis) -> Columns:
    """Nodes (cm), edges and triangles of the paper's mesh, with what is intervisible."""
    nodes = np.rint(analysis.node_points * PER_M).astype(np.int64)
    columns: Columns = {f"node_{name}": nodes[:, axis] for axis, name in enumerate("xyz")}
    columns["node_intervisible"] = analysis.node_intervisible.astype(np.int64)
    columns |= {"edge_a": analysis.edges[:, 0], "edge_b": analysis.edges[:, 1]}
    columns["edge_intervisible"] = analysis.edge_intervisible.astype(np.int64)
    region = analysis.triangles[analysis.region]
    columns |= {f"region_{name}": region[:, corner] for corner, name in enumerate("abc")}
    return columns
