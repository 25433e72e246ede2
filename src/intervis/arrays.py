"""Array types, checks of the arrays that callers pass in, which are not changed, and digests."""

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arguments import shown
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

LARGEST_M = 1e9
"""Lengths are no larger, so that their squares and products are finite."""


def array_of(points: ArrayLike, name: str) -> NDArray[Any]:
    """An array of what was passed in. Masked entries become NaN: they hold no value.

    Raises
    ------
    PointsError
        Rows have different lengths, or entries without a value are no floating-point numbers.
    """
    if isinstance(points, np.ma.MaskedArray):
        return _without_mask(points, name)
    try:
        return np.asarray(points)
    except (ValueError, OverflowError):
        raise PointsError(f"{name} must have rows of the same length.") from None
    except Exception:
        raise PointsError(f"{name} must be an array, got {shown(points)}.") from None


def _without_mask(points: Any, name: str) -> NDArray[Any]:
    if not np.ma.getmaskarray(points).any():
        return np.asarray(points.data)
    if points.dtype.kind != "f":
        raise PointsError(f"{name} has masked entries: leave these rows out.")
    return np.asarray(points.filled(np.nan))


def numbers_of(values: ArrayLike, name: str) -> Float64Array:
    """Numbers as a float64 array of any shape, finite or not.

    Raises
    ------
    PointsError
        They are no numbers, or rows have different lengths.

    Examples
    --------
    >>> numbers_of([[1, 2], [3, 4]], "corners").dtype
    dtype('float64')
    >>> numbers_of(["1"], "corners")
    Traceback (most recent call last):
        ...
    intervis.errors.PointsError: corners must be numbers, got ['1'].
    """
    array = array_of(values, name)
    if array.size and array.dtype.kind not in "fiu":
        raise PointsError(f"{name} must be numbers, got {shown(values)}.")
    if not array.size:
        return np.empty(array.shape)
    with np.errstate(over="ignore"):  # of longer types
        return array.astype(np.float64)


def fit_together(*arrays: NDArray[Any]) -> bool:
    """Whether arrays have shapes that numpy can broadcast.

    Examples
    --------
    >>> fit_together(np.zeros((5, 1)), np.zeros(3)), fit_together(np.zeros(5), np.zeros(3))
    (True, False)
    """
    try:
        np.broadcast_shapes(*(array.shape for array in arrays))
    except ValueError:
        return False
    return True


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
        array = numbers_of(point, name)
    except PointsError:
        raise PointsError(f"{name} must be three numbers in metres, got {shown(point)}.") from None
    if array.shape != (3,) or not np.isfinite(array).all():
        raise PointsError(f"{name} must be three finite numbers in metres, got {shown(point)}.")
    return array


def checked_place(point: ArrayLike, name: str = "viewpoint") -> Float64Array:
    """As `checked_point`, for a place whose distances are squared: within 1e9 m.

    Raises
    ------
    PointsError
        It is not three finite numbers, or one is larger.
    """
    array = checked_point(point, name)
    if np.abs(array).max() > LARGEST_M:
        raise PointsError(f"{name} must be within {LARGEST_M:g} m, got {shown(array.tolist())}.")
    return array


def finite_rows(points: FloatArray) -> BoolArray:
    """(N,) mask of the rows that are a place: finite, of magnitudes that sum to 1e9 m at most.

    Examples
    --------
    >>> finite_rows(np.array([[0.0, 1.0, 2.0], [0.0, np.nan, 2.0]]))
    array([ True, False])
    """
    # The sum of the magnitudes is NaN or large exactly when a term is: no (N, 3) mask is needed.
    with np.errstate(over="ignore"):
        x, y, z = np.abs(points[:, :3]).T
        return np.asarray(x.astype(np.float64) + y + z <= LARGEST_M)  # nor is NaN


def digest_of(text: str, arrays: Mapping[str, NDArray[Any]]) -> str:
    """Digest of a text and of arrays with their names, types and shapes: 32 hexadecimal digits.

    Examples
    --------
    >>> digest_of("a scan", {"points": np.zeros((2, 3))})
    'be36726320318da452fe0b651eedca91'
    """
    digest = hashlib.blake2b(text.encode(), digest_size=16)
    for name, values in arrays.items():
        array = np.ascontiguousarray(values)
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.data)
    return digest.hexdigest()
