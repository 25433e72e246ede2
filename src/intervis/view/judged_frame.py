"""What a viewpoint sees of one frame: what a page and a recording show alike."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.drives import Frame
from intervis.method.analysis import Analysis
from intervis.run.frame_file import FrameRecord
from intervis.sight import Explanation, Scene, Sight
from intervis.uses.blind_spots import BlindSpot, blind_spots
from intervis.uses.objects import ObjectSight
from intervis.uses.visibility_grid import VisibilityGrid
from intervis.view.reduced_image import ReducedImage, reduced_image

PER_M = 100
"""Coordinates of returns are whole multiples of 1 / PER_M metres."""


@dataclass(frozen=True, eq=False)
class SightLine:
    """A line that is explained.

    Attributes
    ----------
    start, end : (3,) float64 arrays
        Sensor frame, metres.
    explanation : Explanation
    """

    start: Float64Array
    end: Float64Array
    explanation: Explanation


@dataclass(frozen=True, eq=False)
class JudgedFrame:
    """One frame as a viewpoint sees it. Coordinates: sensor frame of this frame, metres.

    Attributes
    ----------
    frame : Frame
    scene : Scene
        The frame's scan and those around it.
    moment_s : float or None
        The query time of all answers.
    remembered : list of int
        Numbers of the other frames whose scans are in the scene.
    viewpoint : (3,) float64 array
    rows : (N,) int64 array
        Rows of the scan's file that are judged.
    centimetres : (N, 3) int64 array
        Coordinates of these returns, rounded to centimetres before they were judged.
    sight : Sight
        Of the N lines to these returns.
    lines : tuple of SightLine
        The lines that the request asks for.
    objects : list of ObjectSight
        Labelled objects, nearest first; empty where there are no labels.
    grid : VisibilityGrid or None
        The ground around the viewpoint; None where it was not asked for.
    analysis : Analysis or None
        The paper's method; None where it has no result.
    ground_m : float
        Height of the ground below the viewpoint; NaN where none is known.
    record : FrameRecord or None
        What a run stored of the frame: measures, stage times, tau, shares of the states. None where
        no run is shown.
    unexplained : str
        Why only states and probabilities are known: what a run stored, without its drive. Empty
        where blockers, clearances and observed parts are known, too.
    """

    frame: Frame
    scene: Scene
    moment_s: float | None
    remembered: list[int]
    viewpoint: Float64Array
    rows: IntArray
    centimetres: IntArray
    sight: Sight
    lines: tuple[SightLine, ...]
    objects: list[ObjectSight]
    grid: VisibilityGrid | None
    analysis: Analysis | None
    ground_m: float
    record: FrameRecord | None = None
    unexplained: str = ""

    @property
    def points(self) -> Float64Array:
        """(N, 3) the judged returns, sensor frame, metres."""
        return np.asarray(self.centimetres / PER_M)

    @cached_property
    def spots(self) -> list[BlindSpot]:
        """The blind spots of the grid, without outlines; none without a grid."""
        return [] if self.grid is None else blind_spots(self.grid, has_outlines=False)

    @cached_property
    def image(self) -> ReducedImage | None:
        """The camera's image, reduced; None without one."""
        return reduced_image(self.frame)
