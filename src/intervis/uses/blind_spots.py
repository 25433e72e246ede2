"""Blind spots: connected ground around a viewpoint where something could stand unseen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from intervis.arguments import object_of
from intervis.arrays import BoolArray, Float64Array
from intervis.plots.tables import Table
from intervis.result_table import percent
from intervis.sight.query_checks import finite_number
from intervis.uses.visibility_grid import VisibilityGrid, blind_cells, occluded_share

LEAST_AREA_M2 = 1.0
"""Smaller spots are left out."""

HIDDEN_OBJECTS = (("car", 1.9), ("bicycle", 0.7), ("person", 0.5))
"""What could hide in a spot, and the width of free ground it needs, metres; the largest first."""


@dataclass(frozen=True, eq=False)
class BlindSpot:
    """One connected blind spot.

    Attributes
    ----------
    area_m2 : float
    nearest_m : float
        Horizontal distance from the viewpoint to the nearest cell.
    centre : (2,) float64 array
        Of the area; scene frame, metres.
    occluded : float
        Share of the area that is occluded; the rest is unknown.
    probability : float
        Mean of P(visible).
    width_m : float
        Diameter of the largest circle of cells that fits in.
    hides : str
        The largest of `HIDDEN_OBJECTS` that could hide there; empty if none could.
    blocker : (3,) float64 array
        The nearest blocker; NaN where nothing is occluded.
    outline : tuple of (K, 2) float64 arrays
        Closed rings, the outer one first and counter-clockwise, holes clockwise.
    """

    area_m2: float
    nearest_m: float
    centre: Float64Array
    occluded: float
    probability: float
    width_m: float
    hides: str
    blocker: Float64Array
    outline: tuple[Float64Array, ...]


def blind_spots(
    grid: VisibilityGrid, *, least_area_m2: float = LEAST_AREA_M2, has_outlines: bool = True
) -> list[BlindSpot]:
    """The connected blind spots of a grid, nearest first.

    Cells that touch along an edge are connected.

    Parameters
    ----------
    grid : VisibilityGrid
    least_area_m2 : float
        Smaller spots are left out.
    has_outlines : bool
        False: without outlines, which take most of the time.
    """
    object_of(grid, VisibilityGrid, "grid")
    least_area_m2 = finite_number("least_area_m2", least_area_m2, "square metres")
    label, _ = ndimage.label(blind_cells(grid))
    range_m, middles = grid.range_m, grid.middles
    spots = []
    for nth, box in enumerate(ndimage.find_objects(label), start=1):
        cells = label[box] == nth
        area_m2 = float(cells.sum()) * grid.cell_m**2
        if area_m2 >= least_area_m2:
            outline = _outline(grid, box, cells) if has_outlines else ()
            spots.append(_spot(grid, box, cells, area_m2, range_m[box], middles[box], outline))
    return sorted(spots, key=lambda spot: spot.nearest_m)


def _spot(
    grid: VisibilityGrid,
    box: tuple[slice, ...],
    cells: BoolArray,
    area_m2: float,
    range_m: Float64Array,
    middles: Float64Array,
    outline: tuple[Float64Array, ...],
) -> BlindSpot:
    whole = np.zeros(grid.state.shape, np.bool_)
    whole[box] = cells
    blockers = grid.blocker[whole]
    blockers = blockers[np.isfinite(blockers).all(axis=1)]
    distance_m = np.linalg.norm(blockers - grid.viewpoint, axis=1)
    inner = ndimage.distance_transform_edt(np.pad(cells, 1))
    width_m = (2.0 * float(inner.max()) - 1.0) * grid.cell_m
    return BlindSpot(
        area_m2,
        float(range_m[cells].min()),
        np.asarray(middles[cells].mean(axis=0)),
        occluded_share(grid, whole),
        float(np.mean(grid.probability[whole])),
        width_m,
        next((name for name, needs_m in HIDDEN_OBJECTS if width_m >= needs_m), ""),
        blockers[distance_m.argmin()] if len(blockers) else np.full(3, np.nan),
        outline,
    )


def _outline(
    grid: VisibilityGrid, box: tuple[slice, ...], cells: BoolArray
) -> tuple[Float64Array, ...]:
    """The rings of a spot in the scene."""
    corner = grid.corner + grid.cell_m * np.array([box[0].start, box[1].start])
    return tuple(corner + grid.cell_m * ring for ring in rings(cells))


def rings(cells: BoolArray) -> list[Float64Array]:
    """Outlines of cells (I, J) that are connected along edges, in units of cells.

    Closed rings (K, 2) of the corners where they turn; the cells lie on the left: the outer ring is
    counter-clockwise and comes first, holes are clockwise.

    Examples
    --------
    >>> rings(np.ones((2, 1), bool))
    [array([[0., 0.],
           [2., 0.],
           [2., 1.],
           [0., 1.],
           [0., 0.]])]
    """
    padded = np.pad(cells, 1)
    here, edges = padded[1:-1, 1:-1], []
    # Sides of a cell with the cell on the left: towards +x below it, and so on around.
    for (di, dj), begin, end in (
        ((0, -1), (0, 0), (1, 0)),
        ((1, 0), (1, 0), (1, 1)),
        ((0, 1), (1, 1), (0, 1)),
        ((-1, 0), (0, 1), (0, 0)),
    ):
        rows, columns = padded.shape
        beside = padded[1 + di : rows - 1 + di, 1 + dj : columns - 1 + dj]
        at = np.argwhere(here & ~beside)
        edges.append(np.hstack([at + begin, at + end]))
    following: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for i, j, to_i, to_j in np.concatenate(edges).tolist():
        following.setdefault((i, j), []).append((to_i, to_j))
    found = []
    while following:
        found.append(_ring(following))
    return sorted(found, key=_signed_area, reverse=True)


def _ring(following: dict[tuple[int, int], list[tuple[int, int]]]) -> Float64Array:
    """Take one ring out of directed edges; where four meet, it turns left, around one cell."""
    start = min(following)
    ring, at = [start], _taken(following, start, following[start][0])
    while at != start:
        before = ring[-1]
        heading = (at[0] - before[0], at[1] - before[1])
        ring.append(at)
        left = (at[0] - heading[1], at[1] + heading[0])
        choices = following[at]
        at = _taken(following, at, left if left in choices else choices[0])
    corners = np.array([*ring, start], np.float64)
    step = np.diff(corners, axis=0)
    turns = np.append(True, (step[1:] != step[:-1]).any(axis=1))
    return np.vstack([corners[:-1][turns], corners[:1]])


def _taken(
    following: dict[tuple[int, int], list[tuple[int, int]]],
    begin: tuple[int, int],
    end: tuple[int, int],
) -> tuple[int, int]:
    """Remove an edge; its end."""
    following[begin].remove(end)
    if not following[begin]:
        del following[begin]
    return end


def _signed_area(ring: Float64Array) -> float:
    x, y = ring.T
    return float(0.5 * (x[:-1] * y[1:] - x[1:] * y[:-1]).sum())


def spot_table(spots: Sequence[BlindSpot]) -> Table:
    """One row for each spot."""
    heads = ("nearest, m", "area, m2", "x, y", "width, m", "hides", "occluded", "P", "blocker")
    rows = tuple(
        (
            f"{spot.nearest_m:.1f}",
            f"{spot.area_m2:.1f}",
            ", ".join(f"{value:.1f}" for value in spot.centre),
            f"{spot.width_m:.1f}",
            spot.hides or "-",
            percent(spot.occluded),
            percent(spot.probability),
            "-" if math.isnan(spot.blocker[0]) else ", ".join(f"{v:.1f}" for v in spot.blocker),
        )
        for spot in spots
    )
    return Table("Blind spots", heads, rows)


def geojson_of(spots: Sequence[BlindSpot], grid: VisibilityGrid) -> dict[str, Any]:
    """The spots as a GeoJSON feature collection; coordinates are metres in the scene's frame."""
    return {
        "type": "FeatureCollection",
        "coordinates": "metres in the sensor frame: x forward, y left",
        "viewpoint": grid.viewpoint.round(3).tolist(),
        "height_m": grid.height_m,
        "features": [
            {
                "type": "Feature",
                "geometry": {
                    "type": "Polygon",
                    "coordinates": [ring.round(3).tolist() for ring in spot.outline],
                },
                "properties": {
                    "area_m2": round(spot.area_m2, 3),
                    "nearest_m": round(spot.nearest_m, 3),
                    "occluded": round(spot.occluded, 3),
                    "probability": round(spot.probability, 3),
                    "width_m": round(spot.width_m, 3),
                    "hides": spot.hides or None,
                    "blocker": None
                    if math.isnan(spot.blocker[0])
                    else spot.blocker.round(3).tolist(),
                },
            }
            for spot in spots
        ],
    }
