"""One frame with the scans around it, judged from any viewpoint."""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.drives import Drive, Frame
from intervis.sight import Scene, explain
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.registration import query_moment_s, registered_scene
from intervis.uses.visibility_grid import VisibilityGrid, visibility_grid
from intervis.view.frame_layers import analysis_of
from intervis.view.judged_frame import PER_M, JudgedFrame, SightLine
from intervis.view.verdicts import thinned_rows
from intervis.view.view_request import ViewRequest, place_in_frame, remembered_frames

GRID_REACH_M, GRID_CELL_M = 30.0, 0.8
"""Blind spots are coarser here than those of `intervis blindspots`: they are judged per frame."""


class FrameJudge:
    """One frame with the scans around it: judges its returns, or a line, from any viewpoint.

    Parameters
    ----------
    frame : Frame
    scene : Scene
        The frame's scan and others, in its sensor frame.
    request : ViewRequest
    remembered : list of int
        Numbers of the other frames in the scene.
    moment_s : float or None
        The query time: see `intervis.Scene.sight`.
    """

    def __init__(
        self,
        frame: Frame,
        scene: Scene,
        request: ViewRequest,
        remembered: list[int],
        moment_s: float | None,
    ) -> None:
        self.frame = frame
        self.scene = scene
        self.moment_s = moment_s
        self._request = request
        self._remembered = remembered
        self._rows = thinned_rows(frame.points, request.most_returns)
        points = frame.points[self._rows, :3].astype(np.float64)
        self._centimetres: IntArray = np.rint(points * PER_M).astype(np.int64)

    def line(self, start: Float64Array, end: Float64Array) -> SightLine:
        """One line explained."""
        said = explain(self.scene, start, end, risk=self._request.risk, moment_s=self.moment_s)
        return SightLine(start, end, said)

    def judged(self, viewpoint: Float64Array) -> JudgedFrame:
        """The frame as seen from a viewpoint (3,), sensor frame, metres."""
        request = self._request
        points = self._centimetres / PER_M
        ends = [place_in_frame(self.frame, end) for end in request.ends]
        return JudgedFrame(
            self.frame,
            self.scene,
            self.moment_s,
            self._remembered,
            viewpoint,
            self._rows,
            self._centimetres,
            self.scene.sight(viewpoint, points, risk=request.risk, moment_s=self.moment_s),
            tuple(self.line(viewpoint, end) for end in ends),
            self._objects(viewpoint),
            self._grid(viewpoint, points) if request.has_blind_spots else None,
            analysis_of(self.frame, viewpoint) if request.has_method else None,
            float(self.scene.ground_height(viewpoint[None, :2])[0]),
        )

    def _objects(self, viewpoint: Float64Array) -> list[ObjectSight]:
        if self.frame.read_boxes is None:
            return []
        return objects_of_frame(
            self.frame, self.scene, viewpoint, risk=self._request.risk, moment_s=self.moment_s
        )

    def _grid(self, viewpoint: Float64Array, points: Float64Array) -> VisibilityGrid:
        return visibility_grid(
            self.scene,
            viewpoint,
            points,
            reach_m=GRID_REACH_M,
            cell_m=GRID_CELL_M,
            risk=self._request.risk,
            moment_s=self.moment_s,
        )


def frame_judge(drive: Drive, number: int, request: ViewRequest) -> FrameJudge:
    """The judge of one frame of a drive, with the scans before and after it.

    Raises
    ------
    DriveError
        The frame cannot be read.
    """
    frame = drive[number]
    remembered = remembered_frames(drive, number, request.memory)
    scene = registered_scene(drive, frame, remembered)
    return FrameJudge(frame, scene, request, remembered, query_moment_s(scene))
