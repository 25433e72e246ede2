"""Array types, and checks of the arrays that callers pass in: nothing passed in is changed."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.errors import PointsError

FloatArray = NDArray[np.floating[Any]]
Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
UInt8Array = NDArray[np.uint8]
Int16Array = NDArray[np.int16]
Int32Array = NDArray[np.int32]
UInt32Array = NDArray[np.uint32]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def array_of(points: ArrayLike, name: str) -> NDArray[Any]:
    """An array of what was passed in; rows of different lengths raise `PointsError`."""
    try:
        return np.asarray(points)
    except ValueError:
        raise PointsError(f"{name} must have rows of the same length.") from None


def checked_points(points: ArrayLike, name: str = "points") -> FloatArray:
    """The coordinates of a point array, its shape and type checked.

    Parameters
    ----------
    points : (N, 3) or (N, 4) float array
        Metres; a fourth column (intensity) is ignored.
    name : str
        Name of the array in the error message.

    Returns
    -------
    (N, 3) float32 or float64 array
        A view of the input where possible. May hold non-finite rows: see `finite_rows`.

    Raises
    ------
    PointsError
        The array is not two-dimensional with three or four columns, or not floating point.

    Examples
    --------
    >>> checked_points(np.zeros((5, 4), np.float32)).shape
    (5, 3)
    """
    if hasattr(points, "points"):
        raise PointsError(f"{name} must be an array: pass frame.points, not the frame.")
    array = array_of(points, name)
    if array.ndim != 2 or array.shape[1] not in (3, 4):
        raise PointsError(
            f"{name} must have the shape (N, 3) or (N, 4), got {array.shape};"
            " one row for each point, x, y, z in metres."
        )
    if array.dtype not in (np.float32, np.float64):
        raise PointsError(
            f"{name} must be float32 or float64 metres, got {array.dtype};"
            f" convert them first, for example with {name}.astype(np.float32)."
        )
    return array[:, :3]


def checked_point(point: ArrayLike, name: str = "viewpoint") -> Float64Array:
    """One point as three finite float64 coordinates in metres.

    Raises
    ------
    PointsError
        It is not three finite numbers.

    Examples
    --------
    >>> checked_point((0, 0, 1.7))
    array([0. , 0. , 1.7])
    """
    try:
        array = np.asarray(point, dtype=np.float64)
    except (TypeError, ValueError):
        raise PointsError(f"{name} must be three numbers in metres, got {point!r}.") from None
    if array.shape != (3,) or not np.isfinite(array).all():
        raise PointsError(f"{name} must be three finite numbers in metres, got {point!r}.")
    return array.copy()


def finite_rows(points: FloatArray) -> BoolArray:
    """(N,) mask of the rows whose three coordinates are all finite.

    Examples
    --------
    >>> finite_rows(np.array([[0.0, 1.0, 2.0], [0.0, np.nan, 2.0]]))
    array([ True, False])
    """
    # At metre scale a float64 sum cannot overflow: it is non-finite exactly when a term is. This
    # takes one pass and no (N, 3) mask.
    with np.errstate(invalid="ignore"):  # inf - inf
        total = points[:, 0].astype(np.float64) + points[:, 1] + points[:, 2]
    return np.isfinite(total)
