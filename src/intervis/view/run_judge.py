"""The frames of a run: what it stored, and the rest from its drive, where that is still there."""

from dataclasses import replace

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.drives import Drive
from intervis.errors import IntervisError
from intervis.run.frame_sight import FrameSight
from intervis.run.stored_frame import StoredFrame
from intervis.run.stored_run import StoredRun
from intervis.sight import UNKNOWN, Scene, Sight
from intervis.view.frame_judge import FrameJudge, cached_reader, judge_of
from intervis.view.judged_frame import PER_M, JudgedFrame
from intervis.view.page_file import shown
from intervis.view.verdicts import thinned_rows
from intervis.view.view_request import ViewRequest

NO_SIGHT = "The run asked no sight lines"
NO_NEXT = "The run asked no sight line in this frame: there is no next frame."


class RunJudge:
    """Frames of a run as a page shows them.

    The paper's mesh, region and measures are those of the run, and so are states and probabilities
    of its sight lines. Blockers, clearances, observed parts, objects, blind spots and images come
    from the drive; so do the states, where the run has none. Without the drive, or where a scan is
    another one now, only the nodes are shown.

    Parameters
    ----------
    run : StoredRun
    drive : Drive or None
    missing : str
        Why there is no drive; empty where there is.
    request : ViewRequest
        For what the run has not stored.
    """

    def __init__(
        self, run: StoredRun, drive: Drive | None, missing: str, request: ViewRequest
    ) -> None:
        self._run, self._drive, self._missing = run, drive, missing
        self._request = replace(request, has_method=False)
        self._read = None if drive is None else cached_reader(drive, request)

    def judged(self, number: int) -> JudgedFrame:
        """One frame of the run.

        Raises
        ------
        OutputError
            The frame's file is damaged.
        """
        stored = self._run.frame(number)
        judge, missing = self._judge(stored)
        if judge is None:
            return nodes_only(stored, missing, self._request.most_returns)
        sight = None
        if stored.sight is not None:
            sight = sight_with_stored(stored.sight, judge, self._request.risk)
        has_start = stored.sight is None or _has_start(stored.sight)
        return replace(
            judge.judged(viewpoint_of(stored), sight),
            analysis=stored.analysis,
            record=stored.record,
            unexplained="" if has_start else NO_NEXT,
        )

    def _judge(self, stored: StoredFrame) -> tuple[FrameJudge | None, str]:
        """The judge of the frame that the results were made of; else why there is none."""
        if self._drive is None or self._read is None:
            return None, self._missing
        number = stored.record.number
        try:
            frame = self._read(number)
        except IntervisError as error:
            return None, str(error).rstrip(".")
        if not self._run.is_made_of(self._drive, frame, stored):
            return None, f"scan, pose or camera of frame {number} changed after the run"
        return judge_of(self._drive, frame, self._request, self._read), ""


def viewpoint_of(stored: StoredFrame) -> Float64Array:
    """(3,) where the sight lines of a frame start; without any, P0. Sensor frame, metres."""
    sight = stored.sight
    return stored.analysis.viewpoint if sight is None or not _has_start(sight) else sight.viewpoint


def _has_start(sight: FrameSight) -> bool:
    """Whether there was a place to start from: the last frame has no next one."""
    return bool(np.isfinite(sight.viewpoint).all())


def sight_with_stored(stored: FrameSight, judge: FrameJudge, risk: float) -> Sight:
    """States and probabilities of a run; blockers, clearances and observed shares by the engine.

    The lines end at the returns as the scan's file holds them, as those of the run did.

    Parameters
    ----------
    stored : FrameSight
    judge : FrameJudge
        Of the frame's scan alone; the answer is for its rows.
    risk : float
        Of the run.
    """
    known = stored_sight(stored, judge.rows)
    if not _has_start(stored):
        return known
    ends = judge.frame.points[judge.rows, :3].astype(np.float64)
    asked = judge.scene.sight(stored.viewpoint, ends, risk=risk)
    return replace(asked, state=known.state, probability=known.probability)


def stored_sight(stored: FrameSight | None, rows: IntArray) -> Sight:
    """What a run stored of the lines to some rows of a scan; of all else that nothing is known."""
    count = len(rows)
    state, probability = np.full(count, UNKNOWN, np.int8), np.full(count, np.nan)
    if stored is not None:
        state, probability = stored.state[rows], stored.probability[rows].astype(np.float64)
    return Sight(
        state, probability, np.full((count, 3), np.nan), np.full(count, np.inf), np.ones(count)
    )


def nodes_only(stored: StoredFrame, missing: str, most: int) -> JudgedFrame:
    """A frame without its scan: the nodes, with what the run stored of the lines to them.

    Parameters
    ----------
    stored : StoredFrame
    missing : str
        Why there is no scan, without a full stop.
    most : int
        Nodes at most; more are thinned evenly.
    """
    analysis = stored.analysis
    thinned = thinned_rows(analysis.node_points, most)
    rows = analysis.nodes[thinned]
    lacks = f"{NO_SIGHT}, and the scan" if stored.sight is None else "The scan"
    return JudgedFrame(
        frame=stored.frame,
        scene=Scene(),
        moment_s=None,
        remembered=[],
        viewpoint=viewpoint_of(stored),
        rows=rows,
        centimetres=np.rint(analysis.node_points[thinned] * PER_M).astype(np.int64),
        sight=stored_sight(stored.sight, rows),
        lines=(),
        objects=[],
        grid=None,
        analysis=analysis,
        ground_m=np.nan,
        record=stored.record,
        unexplained=shown(f"{lacks} is missing: {missing}."),
    )
