"""A plan of a route: turned so that the line from its start to its end is level."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from intervis.arrays import Float64Array
from intervis.plots.style import FAINT, INK, dots
from intervis.uses.routes.route import Route

AROUND_M = 9.0
"""Margin of the plan around what it shows."""
ASPECTS = (0.16, 0.9)
"""Least and largest ratio of height and width."""
ABOVE_ROAD_M = 0.3
"""Returns lower above the road are not drawn."""


@dataclass(frozen=True, eq=False)
class PlanFrame:
    """The turned frame, and the window that is drawn.

    Attributes
    ----------
    route : Route
    window : (2, 2) float64 array
        Lower left and upper right corner, turned frame, metres.
    """

    route: Route
    window: Float64Array

    @classmethod
    def around(cls, route: Route, others: Float64Array) -> Self:
        """A plan of a route and other places (N, 2) or (N, 3)."""
        bare = cls(route, np.zeros((2, 2)))
        shown = bare.turned(np.vstack([route.points[:, :2], others[:, :2]]))
        low, high = shown.min(axis=0) - AROUND_M, shown.max(axis=0) + AROUND_M
        wide, tall = high - low
        least, most = ASPECTS
        missing = np.array([max(tall / most - wide, 0.0), max(least * wide - tall, 0.0)]) / 2
        return cls(route, np.stack([low - missing, high + missing]))

    @property
    def aspect(self) -> float:
        """Height by width of the window."""
        wide, tall = self.window[1] - self.window[0]
        return float(tall / wide)

    def turned(self, xy: Float64Array) -> Float64Array:
        """Points (N, 2) or more columns in the turned frame, (N, 2)."""
        first, last = self.route.points[[0, -1], :2]
        span_m = float(np.linalg.norm(last - first))
        ahead = (last - first) / span_m if span_m > 0 else np.array([1.0, 0.0])
        from_first = xy[:, :2] - first
        return np.column_stack([from_first @ ahead, from_first @ [-ahead[1], ahead[0]]])

    def draw(self, axes: Any, returns: Float64Array, road_below_m: float = 0.0) -> None:
        """The returns (N, 3) that are above the road, and the route.

        Parameters
        ----------
        axes : Axes
        returns : (N, 3) float64 array
            Scene frame.
        road_below_m : float
            How far below the places of the route the road is.
        """
        shown = self.turned(returns)
        along = self.turned(self.route.points)[:, 0]
        order = np.argsort(along, kind="stable")
        road_m = np.interp(shown[:, 0], along[order], self.route.points[order, 2]) - road_below_m
        low, high = self.window
        inside = ((shown > low) & (shown < high)).all(axis=1)
        inside &= returns[:, 2] - road_m > ABOVE_ROAD_M
        dots(axes, shown[inside], s=0.25, color=FAINT, rasterized=True)
        path = self.turned(self.route.points)
        axes.plot(path[:, 0], path[:, 1], color=INK, linewidth=0.7)
        axes.set(xlim=self.window[:, 0], ylim=self.window[:, 1], aspect="equal")
