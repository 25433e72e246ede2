"""The engine behind a page: any line, and any frame of the page from any viewpoint."""

import base64
from collections import OrderedDict
from collections.abc import Callable, Collection
from threading import Lock
from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.errors import PointsError
from intervis.view.frame_data import frame_content, line_content
from intervis.view.frame_judge import FrameJudge

FARTHEST_M = 1e6
KEPT_FRAMES = 4
"""Frames whose scans are kept in memory."""


class PageEngine:
    """Answers the questions of a page; any thread may ask.

    Parameters
    ----------
    judge_of : callable
        Makes the judge of a frame, from its number.
    numbers : collection of int
        Numbers of the frames that may be asked about.
    """

    def __init__(self, judge_of: Callable[[int], FrameJudge], numbers: Collection[int]) -> None:
        self._judge_of, self._numbers = judge_of, numbers
        self._judges: OrderedDict[int, FrameJudge] = OrderedDict()
        self._lock = Lock()

    def answer(self, kind: str, question: Any) -> dict[str, Any]:
        """The answer to a question of the page, as JSON.

        Parameters
        ----------
        kind : str
            ``line`` explains the line between two places, ``judge`` judges a frame.
        question : dict
            ``frame``, ``from`` and, for a line, ``to``.

        Raises
        ------
        PointsError
            The question has not the expected form.
        """
        if not isinstance(question, dict):
            raise PointsError("the question must be a JSON object.")
        if kind not in ("line", "judge"):
            raise PointsError("the kind of a question must be line or judge.")
        with self._lock:
            judge = self._judge(question.get("frame"))
            start = _place(question.get("from"), "from")
            if kind == "line":
                line = judge.line(start, _place(question.get("to"), "to"))
                return line_content(line, judge.scene, judge.moment_s)
            header, block = frame_content(judge.judged(start))
        return {"header": header, "block": base64.b64encode(block).decode("ascii")}

    def _judge(self, number: Any) -> FrameJudge:
        """A frame of the page, by its number, with its scans; those of a few frames are kept."""
        if isinstance(number, bool) or not isinstance(number, int) or number not in self._numbers:
            raise PointsError("frame must be the number of a frame of the page.")
        if number not in self._judges:
            self._judges[number] = self._judge_of(number)
            while len(self._judges) > KEPT_FRAMES:
                self._judges.popitem(last=False)
        self._judges.move_to_end(number)
        return self._judges[number]


def _place(value: Any, name: str) -> Float64Array:
    """(3,) coordinates of a request, metres."""
    if not isinstance(value, list) or len(value) != 3:
        raise PointsError(f"{name} must be three numbers.")
    for number in value:
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise PointsError(f"{name} must be three numbers.")
        if not abs(number) <= FARTHEST_M:  # nor is NaN
            raise PointsError(f"{name} must be three finite numbers in metres.")
    return np.array(value, np.float64)
