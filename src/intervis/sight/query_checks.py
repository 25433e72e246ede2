"""Checks of what a query to a scene is given: lengths, rates, risk, viewpoints, targets, boxes."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intervis.arguments import shown
from intervis.arrays import (
    LARGEST_M,
    Float64Array,
    array_of,
    checked_point,
    checked_points,
    numbers_of,
)
from intervis.errors import PointsError, PoseError, SettingsError
from intervis.sight.kernels.parameters import Thresholds
from intervis.sight.occupancy_model import RISK_RANGE, thresholds_for
from intervis.transform import checked_pose

LARGEST = 1e15
"""Numbers of any kind are no larger."""

MOST_HZ = 1e6
"""Greatest rate, and the inverse of the least one."""


def finite_number(name: str, value: Any, unit: str) -> float:
    """A finite number up to 1e15, by the name of its argument.

    Raises
    ------
    SettingsError
        It is none.
    """
    is_text = isinstance(value, str | bytes)
    is_other = isinstance(value, np.ndarray | np.generic) and (
        value.ndim > 0 or value.dtype.kind not in "fiub" or isinstance(value, np.ma.MaskedArray)
    )
    try:
        number = np.nan if is_text or is_other else float(value)
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if np.isfinite(number) and abs(number) > LARGEST:
        raise SettingsError(f"{name} must be at most {LARGEST:g} ({unit}), got {number:g}.")
    if not np.isfinite(number):
        raise SettingsError(f"{name} must be a finite number ({unit}), got {shown(value)}.")
    return number


def thresholds_of(risk: Any) -> Thresholds:
    """The thresholds of a risk."""
    least, most = RISK_RANGE
    if not least <= finite_number("risk", risk, "0.001 to 0.2") <= most:
        raise SettingsError(
            f"risk, the allowed share of wrong answers, must be from {least} to {most}, got"
            f" {shown(risk)}."
        )
    return thresholds_for(float(risk))


def positive_length(name: str, value: Any) -> float:
    """A positive and finite length in metres, by the name of its argument.

    Raises
    ------
    SettingsError
        It is none.
    """
    length_m = finite_number(name, value, "metres")
    if not 0.0 < length_m <= LARGEST_M:
        raise SettingsError(f"{name} must be a positive length in metres, got {shown(value)}.")
    return length_m


def rate_of(name: str, value: Any) -> float:
    """A rate in 1/s from 1e-6 to 1e6, by the name of its argument.

    Raises
    ------
    SettingsError
        It is none.
    """
    rate_hz = finite_number(name, value, "1/s")
    if not 1.0 / MOST_HZ <= rate_hz <= MOST_HZ:
        raise SettingsError(
            f"{name} must be from {1.0 / MOST_HZ:g} to {MOST_HZ:g}, got {rate_hz:g}."
        )
    return rate_hz


def viewpoints_of(viewpoint: ArrayLike) -> Float64Array:
    """(N, 3) finite viewpoints."""
    if array_of(viewpoint, "viewpoint").ndim != 2:
        return checked_point(viewpoint)[None]
    points = targets_of(viewpoint, "viewpoint")
    if not np.isfinite(points).all():
        raise PointsError("every viewpoint must be three finite numbers in metres.")
    return points


def boxes_of(scene_from_box: ArrayLike, size_m: ArrayLike) -> tuple[Float64Array, Float64Array]:
    """Poses (B, 4, 4) and sizes (B, 3) of boxes, metres.

    Raises
    ------
    PointsError
        Poses and sizes differ in number, or a size is not positive and finite.
    PoseError
        A pose is no rigid motion.
    """
    sizes = np.atleast_2d(numbers_of(size_m, "size_m"))
    if sizes.size and (sizes.ndim != 2 or sizes.shape[1] != 3):
        raise PointsError(f"size_m must have the shape (B, 3), got {sizes.shape}.")
    matrices = numbers_of(scene_from_box, "scene_from_box")
    if matrices.size and matrices.ndim != 3:
        raise PoseError(f"scene_from_box must have the shape (B, 4, 4), got {matrices.shape}.")
    given = matrices if matrices.size else ()
    poses = [checked_pose(pose, "scene_from_box") for pose in given]
    sizes = sizes.reshape(-1, 3)
    if len(poses) != len(sizes):
        raise PointsError(
            f"each box needs a pose and a size, got {len(poses)} poses and {len(sizes)} sizes."
        )
    if not ((sizes > 0.0) & (sizes <= LARGEST_M)).all():
        raise PointsError("the sizes of boxes must be positive and finite, in metres.")
    return np.array(poses).reshape(-1, 4, 4), sizes


def targets_of(points: ArrayLike, name: str = "targets") -> Float64Array:
    """(M, 3) float64 points, finite or not; (3,) is one target, an empty list has none."""
    array = array_of(points, name)
    if array.shape == (3,):
        array = array[None]
    if array.size == 0 and array.ndim <= 2:
        return np.empty((0, 3))
    if array.dtype.kind in "iu":
        array = array.astype(np.float64)
    # Kernels are compiled for writable arrays; a read-only one is copied.
    return np.require(checked_points(array, name), np.float64, ["C", "W"])
