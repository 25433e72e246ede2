"""One frame with the scans around it, judged from any viewpoint."""

from functools import cached_property
from typing import Any

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.drives import Drive
from intervis.sight import Scene, explain
from intervis.sight.observed_profile import unobserved_parts
from intervis.uses.blind_spots import blind_spots
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.registration import query_moment_s, registered_scene
from intervis.uses.visibility_grid import VisibilityGrid, visibility_grid
from intervis.view.columns import Columns, packed
from intervis.view.frame_layers import (
    analysis_of,
    box_content,
    cell_columns,
    mesh_columns,
    spot_content,
)
from intervis.view.verdicts import (
    BY_DIFFERENCE,
    PARTS,
    PER_M,
    JudgedReturns,
    judged_returns,
    thinned_rows,
    verdict_columns,
)
from intervis.view.view_request import ViewRequest, place_in_frame, remembered_frames

GRID_REACH_M, GRID_CELL_M = 30.0, 0.8
"""Blind spots are coarser here than those of `intervis blindspots`: they are judged per frame."""


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

    def content(self, viewpoint: Float64Array) -> tuple[dict[str, Any], bytes]:
        """The frame as seen from a viewpoint.

        Parameters
        ----------
        viewpoint : (3,) float64 array
            Sensor frame, metres.

        Returns
        -------
        header : dict
            Plain JSON: number, viewpoint, counts, lines, boxes, blind spots.
        block : bytes
            Columns: see `intervis.view.columns` and `verdict_columns`.
        """
        judged = self._judged(viewpoint)
        sight, columns = judged.sight, verdict_columns(judged)
        ground_m = float(self.scene.ground_height(viewpoint[None, :2])[0])
        header: dict[str, Any] = {
            "number": self.frame.number,
            "viewpoint": viewpoint.tolist(),
            "returns": len(self.frame.points),
            "stored": len(self.rows),
            "memory": self.remembered,
            "ground_m": _number(round(ground_m, 2)),
            "visible": int(sight.visible.sum()),
            "occluded": int(sight.occluded.sum()),
            "unknown": int(sight.unknown.sum()),
            "lines": [
                self.line(viewpoint, place_in_frame(self.frame, end)) for end in self.request.ends
            ],
            "boxes": [box_content(one) for one in self._objects(viewpoint)],
        }
        if self.request.has_blind_spots:
            grid = self._grid(viewpoint)
            columns |= cell_columns(grid)
            spots = [spot_content(spot) for spot in blind_spots(grid)]
            header |= {"cell_m": grid.cell_m, "spots": spots}
        self._add_mesh(viewpoint, header, columns)
        return header, packed(columns, BY_DIFFERENCE)

    def _judged(self, viewpoint: Float64Array) -> JudgedReturns:
        return judged_returns(
            self.scene, viewpoint, self.rows, self.centimetres, self.request.risk, self.moment_s
        )

    def _objects(self, viewpoint: Float64Array) -> list[ObjectSight]:
        if self.frame.read_boxes is None:
            return []
        return objects_of_frame(
            self.frame, self.scene, viewpoint, risk=self.request.risk, moment_s=self.moment_s
        )

    def _grid(self, viewpoint: Float64Array) -> VisibilityGrid:
        return visibility_grid(
            self.scene,
            viewpoint,
            self.centimetres / PER_M,
            reach_m=GRID_REACH_M,
            cell_m=GRID_CELL_M,
            risk=self.request.risk,
            moment_s=self.moment_s,
        )

    def _add_mesh(self, viewpoint: Float64Array, header: dict[str, Any], columns: Columns) -> None:
        """The paper's mesh, where its method has a result."""
        analysis = analysis_of(self.frame, viewpoint)
        if analysis is not None:
            columns |= mesh_columns(analysis)
            header["TPI"] = round(analysis.measures.TPI, 2)


def _number(value: float) -> float | None:
    """The number, or None where it is not finite, as JSON has no other word for that."""
    return float(value) if np.isfinite(value) else None
