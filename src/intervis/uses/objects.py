"""Labelled objects of a frame: which share of each a viewpoint sees, and what hides the rest."""

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intervis.arguments import object_of
from intervis.arrays import Float64Array, checked_point
from intervis.drives import Frame
from intervis.drives.boxes import Box
from intervis.method.field_of_view import in_camera
from intervis.plots.tables import Table
from intervis.sight import Scene
from intervis.sight.box_surface import facing_surfaces
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.transform import inverse, transform

HALF = 0.5
"""An object is called visible (hidden) if at least this share of it is."""

NEAR_BLOCKER_M = 0.5
"""A blocker belongs to the box that holds it, grown by this."""


@dataclass(frozen=True, eq=False)
class ObjectSight:
    """One labelled object, as seen from a viewpoint.

    Attributes
    ----------
    frame : int
        Number of the frame.
    box : Box
    range_m : float
        From the viewpoint to the middle of the box.
    visible, occluded, unknown, probability : float
        See `intervis.sight.BoxSight`.
    in_image : float
        Share of the box that lies in the image; NaN without a camera. What lies outside is
        truncated, not hidden.
    blocker : (3,) float64 array
        Sensor frame, metres; NaN where no line is blocked.
    blocked_by : str
        Category of the box that holds the blocker; empty where none does.
    """

    frame: int
    box: Box
    range_m: float
    visible: float
    occluded: float
    unknown: float
    probability: float
    in_image: float
    blocker: Float64Array
    blocked_by: str

    def to_json(self) -> dict[str, Any]:
        """Plain numbers and texts; NaN becomes None."""
        numbers = ("range_m", "visible", "occluded", "unknown", "probability", "in_image")
        return {
            "frame": self.frame,
            "category": self.box.category,
            "track": self.box.track,
            "label": self.box.visibility,
            "returns": self.box.returns,
            "centre": self.box.velo_from_box[:3, 3].round(3).tolist(),
            **{name: _rounded(getattr(self, name)) for name in numbers},
            "blocker": [_rounded(value) for value in self.blocker],
            "blocked_by": self.blocked_by,
        }


def objects_of_frame(
    frame: Frame,
    scene: Scene,
    viewpoint: ArrayLike,
    *,
    risk: float = DEFAULT_RISK,
    moment_s: float | None = None,
) -> list[ObjectSight]:
    """The labelled objects of a frame, as seen from a viewpoint; nearest first.

    Parameters
    ----------
    frame : Frame
        With `boxes`.
    scene : Scene
        In the sensor frame of this frame.
    viewpoint : (3,) array
        Sensor frame, metres.
    risk, moment_s
        See `intervis.Scene.sight`.

    Raises
    ------
    CalibrationError
        The labels cannot be read.
    PointsError, SceneError, SettingsError
        As `intervis.Scene.sight_boxes`.
    """
    object_of(frame, Frame, "frame")
    object_of(scene, Scene, "scene")
    start, boxes = checked_point(viewpoint), frame.boxes
    if not boxes:
        return []
    poses = np.array([box.velo_from_box for box in boxes])
    sizes = np.array([box.size_m for box in boxes])
    seen = scene.sight_boxes(start, poses, sizes, risk=risk, moment_s=moment_s)
    in_image = _in_image(frame, start, poses, sizes)
    found = [
        ObjectSight(
            frame.number,
            box,
            float(np.linalg.norm(box.velo_from_box[:3, 3] - start)),
            float(seen.visible[k]),
            float(seen.occluded[k]),
            float(seen.unknown[k]),
            float(seen.probability[k]),
            float(in_image[k]),
            seen.blocker[k],
            category_at(seen.blocker[k], boxes[:k] + boxes[k + 1 :]),
        )
        for k, box in enumerate(boxes)
    ]
    return sorted(found, key=lambda one: one.range_m)


def _in_image(
    frame: Frame, viewpoint: Float64Array, poses: Float64Array, sizes: Float64Array
) -> Float64Array:
    """Shares (B,) of the boxes that lie in the image."""
    if frame.camera is None or frame.cam_from_velo is None:
        return np.full(len(poses), np.nan)
    surface = facing_surfaces(viewpoint, poses, sizes)
    inside = in_camera(surface.points, frame.camera, frame.cam_from_velo).index
    share = np.bincount(surface.box[inside], surface.share[inside], len(poses))
    return np.asarray(share, dtype=np.float64)


def category_at(point: Float64Array, boxes: Sequence[Box]) -> str:
    """Category of the first of the boxes that holds a point (3,), grown by 0.5 m; empty if none."""
    if not np.isfinite(point).all():
        return ""
    for box in boxes:
        local = np.abs(transform(inverse(box.velo_from_box), point))
        if (local <= 0.5 * box.size_m + NEAR_BLOCKER_M).all():
            return box.category
    return ""


def object_table(objects: Iterable[ObjectSight]) -> Table:
    """One row for each object."""
    heads = (
        *("frame", "object", "range, m", "visible", "occluded", "unknown", "P", "in image"),
        *("label", "returns", "blocked by"),
    )
    rows = tuple(
        (
            str(one.frame),
            one.box.category,
            f"{one.range_m:.1f}",
            *(
                _percent(value)
                for value in (
                    one.visible,
                    one.occluded,
                    one.unknown,
                    one.probability,
                    one.in_image,
                )
            ),
            one.box.visibility or "-",
            "-" if one.box.returns is None else str(one.box.returns),
            _blocker_text(one),
        )
        for one in objects
    )
    return Table("Objects", heads, rows)


def object_csv(objects: Iterable[ObjectSight]) -> str:
    """One line for each object, with the names and numbers of `ObjectSight.to_json`.

    Places take three columns, as in ``centre_x``; what is not known is empty.
    """
    rows = [_flat(one.to_json()) for one in objects]
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _flat(numbers: dict[str, Any]) -> dict[str, Any]:
    """Plain numbers with a column for each coordinate of a place."""
    flat: dict[str, Any] = {}
    for name, value in numbers.items():
        if isinstance(value, list):
            flat |= {f"{name}_{axis}": part for axis, part in zip("xyz", value, strict=True)}
        else:
            flat[name] = value
    return flat


def agreement_table(objects: Sequence[ObjectSight]) -> Table:
    """For each of the labels' own words: what the shares say of the objects with that label."""
    labels = sorted({one.box.visibility for one in objects if one.box.visibility})
    heads = ("label", "objects", "mean visible", "mean P", "half visible", "half hidden")
    rows = []
    for label in labels:
        chosen = [one for one in objects if one.box.visibility == label]
        known = [one for one in chosen if not math.isnan(one.visible)]
        if known:
            rows.append(
                (
                    label,
                    str(len(known)),
                    _percent(float(np.mean([one.visible for one in known]))),
                    _percent(float(np.mean([one.probability for one in known]))),
                    str(sum(one.visible >= HALF for one in known)),
                    str(sum(one.occluded >= HALF for one in known)),
                )
            )
    return Table("Objects by the labels' own words", heads, tuple(rows))


def _blocker_text(one: ObjectSight) -> str:
    if not np.isfinite(one.blocker).all():
        return "-"
    place = ", ".join(f"{value:.1f}" for value in one.blocker)
    return f"{one.blocked_by} ({place})" if one.blocked_by else f"({place})"


def _percent(value: float) -> str:
    return "-" if math.isnan(value) else f"{100 * value:.0f} %"


def _rounded(value: float) -> float | None:
    return round(float(value), 3) if math.isfinite(value) else None
