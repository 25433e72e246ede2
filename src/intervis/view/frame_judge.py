"""One frame with the scans around it, judged from any viewpoint."""

import logging
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.drives import Drive, Frame
from intervis.errors import ScanError
from intervis.sight import Scene, Sight, explain
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.registration import query_moment_s, scene_of_frames
from intervis.uses.visibility_grid import VisibilityGrid, visibility_grid
from intervis.view.frame_layers import analysis_of
from intervis.view.judged_frame import PER_M, JudgedFrame, SightLine
from intervis.view.verdicts import thinned_rows
from intervis.view.view_request import ViewRequest, place_in_frame, remembered_frames

log = logging.getLogger(__name__)

GRID_REACH_M, GRID_CELL_M = 30.0, 0.8
"""Blind spots are coarser here than those of `intervis blindspots`: they are judged per frame."""

MOST_THREADS = 4
"""Frames that are judged at a time: each takes some 100 MB."""

ReadFrame = Callable[[int], Frame]


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

    Attributes
    ----------
    rows : (N,) int64 array
        Rows of the scan's file that are judged.
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
        self.rows = thinned_rows(frame.points, request.most_returns)
        points = frame.points[self.rows, :3].astype(np.float64)
        self._centimetres: IntArray = np.rint(points * PER_M).astype(np.int64)

    def line(self, start: Float64Array, end: Float64Array) -> SightLine:
        """One line explained."""
        said = explain(self.scene, start, end, risk=self._request.risk, moment_s=self.moment_s)
        return SightLine(start, end, said)

    def judged(self, viewpoint: Float64Array, sight: Sight | None = None) -> JudgedFrame:
        """The frame as seen from a viewpoint (3,), sensor frame, metres.

        Parameters
        ----------
        viewpoint : (3,) float64 array
        sight : Sight or None
            Answers for the returns in `rows`, where they are known.
        """
        request = self._request
        points = self._centimetres / PER_M
        ends = [place_in_frame(self.frame, end) for end in request.ends]
        if sight is None:
            sight = self.scene.sight(viewpoint, points, risk=request.risk, moment_s=self.moment_s)
        return JudgedFrame(
            self.frame,
            self.scene,
            self.moment_s,
            self._remembered,
            viewpoint,
            self.rows,
            self._centimetres,
            sight,
            tuple(self.line(viewpoint, end) for end in ends),
            self._objects(viewpoint),
            self._grid(viewpoint, points),
            analysis_of(self.frame, viewpoint) if request.has_method else None,
            self._ground_m(viewpoint),
        )

    def _objects(self, viewpoint: Float64Array) -> list[ObjectSight]:
        if self.frame.read_boxes is None:
            return []
        return objects_of_frame(
            self.frame, self.scene, viewpoint, risk=self._request.risk, moment_s=self.moment_s
        )

    def _ground_m(self, viewpoint: Float64Array) -> float:
        """Height of the ground below; NaN if none is shown, or z is not up."""
        return (
            np.nan if self._is_tilted else float(self.scene.ground_height(viewpoint[None, :2])[0])
        )

    @property
    def _is_tilted(self) -> bool:
        """Whether the scanner is tilted, and has no pose: there is no map of the ground then."""
        return self.scene.tilt_deg > 0.0

    def _grid(self, viewpoint: Float64Array, points: Float64Array) -> VisibilityGrid | None:
        if self._is_tilted or not self._request.has_blind_spots:
            return None
        return visibility_grid(
            self.scene,
            viewpoint,
            points,
            reach_m=GRID_REACH_M,
            cell_m=GRID_CELL_M,
            risk=self._request.risk,
            moment_s=self.moment_s,
        )


def cached_reader(drive: Drive, request: ViewRequest) -> ReadFrame:
    """Reads frames of a drive, and keeps those that the next frames use, too; for any thread."""
    return lru_cache(2 * request.memory + 2 * MOST_THREADS)(drive.__getitem__)


def frame_judge(
    drive: Drive, number: int, request: ViewRequest, read: ReadFrame | None = None
) -> FrameJudge:
    """The judge of one frame of a drive, with the scans before and after it.

    Parameters
    ----------
    drive : Drive
    number : int
    request : ViewRequest
    read : callable or None
        Reads a frame of the drive; see `cached_reader`.

    Raises
    ------
    DriveError
        The frame cannot be read.
    """
    read = drive.__getitem__ if read is None else read
    return judge_of(drive, read(number), request, read)


def judge_of(drive: Drive, frame: Frame, request: ViewRequest, read: ReadFrame) -> FrameJudge:
    """The judge of a frame that is read already, with the scans before and after it.

    Scans around it that cannot be read are left out, with a warning.
    """
    others = []
    for number in remembered_frames(drive, frame.number, request.memory):
        try:
            others.append(read(number))
        except ScanError as error:
            log.warning("frame %d is judged without that scan: %s", frame.number, error)
    scene = scene_of_frames(frame, others)
    remembered = [other.number for other in others]
    return FrameJudge(frame, scene, request, remembered, query_moment_s(scene))
