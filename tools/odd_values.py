"""Odd arguments for fuzzing: values of every kind, and valid arguments that were changed."""

import random
import warnings
from collections.abc import Mapping
from datetime import datetime
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Lengthless:
    """Refuses whatever is asked of it."""

    def __len__(self) -> int:
        raise RuntimeError("no length")


def taken(*values: object) -> tuple[object, ...]:
    """Take whatever is given: as a callback it must not fail itself."""
    return values


NUMBERS = (
    *(0, 1, -1, 2, 3, 100, 2**31, 2**53 + 1, 2**63, -(2**63), 2**64, 10**30, 10**400),
    *(0.0, -0.0, 0.5, -3.7, 1e-9, 5e-324, 1e9, 1e20, 1e39, 1e155, 1e300, 1e308, -1e308),
    *(float("nan"), float("inf"), float("-inf")),
)
OBJECTS: tuple[Any, ...] = (
    *(
        None,
        True,
        False,
        "",
        "text",
        "nan",
        "1e308",
        "\0",
        "a\nb",
        "9" * 5000,
        "\udc80",
        b"",
        b"12",
    ),
    *(1j, [], (), {}, set(), [None], [[]], [[1, 2], [3]], ["x"] * 3, {"x": 1}, {1: 2}, range(3)),
    *(object(), taken, Ellipsis, Lengthless(), Decimal("NaN"), Decimal(1), Fraction(1, 3)),
    *(datetime(2026, 1, 1), Path("x"), slice(None), np.float32(2), np.float64("nan")),
    *(np.int64(-1), np.bool_(True), np.str_("x"), np.datetime64("NaT"), np.array(1.0)),
    *(np.array(None), np.empty(0), np.empty((0, 3)), np.empty((3, 0)), np.zeros(3), np.eye(3)),
    *(np.zeros((2, 2, 2)), np.array(["a", "b"]), np.array([{}, None]), np.zeros(2, "f4,i4")),
)
KINDS = (
    *("f2", "f4", ">f4", ">f8", "f8", "g", "i1", "u1", ">i4", "i8", "u8", "?", "c16", "O", "U9"),
    *("M8[ns]", "m8[s]", "S4"),
)


def odd(valid: Any, rng: random.Random) -> Any:
    """An odd argument in place of a valid one: any value, or the valid one changed."""
    choice = rng.random()
    if choice < 0.15:
        return rng.choice(NUMBERS)
    if choice < 0.4:
        return rng.choice(OBJECTS) if rng.random() < 0.95 else (n for n in range(3))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _changed(valid, rng)
    except (ValueError, OverflowError):  # the change does not fit the value
        return rng.choice(OBJECTS)


def _changed(valid: Any, rng: random.Random) -> Any:
    match valid:
        case np.ndarray():
            for _ in range(rng.choice((1, 1, 2))):
                if isinstance(valid, np.ndarray):
                    valid = rng.choice(ARRAY_CHANGES)(valid, rng)
            return valid
        case bool() | None:
            return rng.choice((*NUMBERS, *OBJECTS))
        case int() | float():
            return _changed_number(valid, rng)
        case str():
            return rng.choice((valid.upper(), f" {valid}", valid[:-1], valid * 3, valid.encode()))
        case list() | tuple():
            return _changed_sequence(valid, rng)
        case Mapping():
            return _changed_mapping(valid, rng)
    return rng.choice(((valid,), [valid, None], type(valid), str(valid)))


def _changed_number(valid: float, rng: random.Random) -> Any:
    factor = rng.choice((-1, 0, 1e-9, 0.1, 10, 1e3, 1e6, 1e12))
    kind = rng.choice((float, int, str, np.float32, np.float16, np.int32, np.array, Fraction))
    return kind(valid * factor)


def _changed_sequence(valid: Any, rng: random.Random) -> Any:
    items = list(valid)
    match rng.randrange(8):
        case 0:
            return items[:0]
        case 1:
            return items[:1]
        case 2:
            return items * 3
        case 3:
            return (item for item in items)
        case 4 if items:
            place = rng.randrange(len(items))
            items[place] = odd(items[place], rng)
            return items
        case 5:
            return dict(enumerate(items))
        case 6:
            return [*items, rng.choice(OBJECTS)]
        case _:
            return tuple(reversed(items))


def _changed_mapping(valid: Mapping[Any, Any], rng: random.Random) -> Any:
    items = dict(valid)
    key = rng.choice(list(items)) if items else 0
    match rng.randrange(4):
        case 0:
            return {rng.choice((None, "x", -1, 10**30, 1.5)): value for value in items.values()}
        case 1 if items:
            items[key] = odd(items[key], rng)
            return items
        case 2:
            return list(items.items())
        case _:
            return {}


Array = NDArray[Any]


def _cast(array: Array, rng: random.Random) -> Any:
    kind = rng.choice(KINDS)
    try:
        return array.astype(kind)
    except (TypeError, ValueError, OverflowError, RuntimeError):
        return np.zeros(array.shape, kind)


def _with_value(array: Array, rng: random.Random) -> Any:
    """One entry, a row, a column or all of it replaced by one value."""
    if array.dtype.kind != "f" or not array.size:
        return array[..., :0]
    copy = array.copy()
    place = tuple(rng.randrange(length) for length in array.shape)
    where: Any = rng.choice((place, place[:1], (..., *place[-1:]), ...))
    copy[where] = float(rng.choice(NUMBERS))
    return copy


def _scaled(array: Array, rng: random.Random) -> Any:
    if array.dtype.kind != "f":
        return array
    return array * array.dtype.type(rng.choice((0, -1, 1e-6, 1e6, 1e30, 1e150, 1e300)))


def _reshaped(array: Array, rng: random.Random) -> Any:
    match rng.randrange(10):
        case 0:
            return array[:0]
        case 1:
            return array[:1]
        case 2:
            return array[..., :2]
        case 3:
            return array[..., :1]
        case 4:
            return array.T
        case 5:
            return array[None]
        case 6:
            return array.ravel()
        case 7:
            return np.concatenate([array, array], axis=-1)
        case 8:
            return array[..., None]
        case _:
            return np.concatenate([array, array], axis=0) if array.ndim else array


def _laid_out(array: Array, rng: random.Random) -> Any:
    """The same values, elsewhere: none of these may change an answer or fail."""
    match rng.randrange(5):
        case 0:
            array = array.copy()
            array.setflags(write=False)
            return array
        case 1:
            return np.asfortranarray(array)
        case 2:
            return np.repeat(array, 2, axis=0)[::2] if array.ndim else array
        case 3:
            return array[::-1] if array.ndim else array
        case _:
            return array.astype(array.dtype.newbyteorder())


def _as_other(array: Array, rng: random.Random) -> Any:
    match rng.randrange(6):
        case 0:
            return array.tolist()
        case 1:
            return (row for row in array.tolist()) if array.ndim else array
        case 2:
            return np.ma.masked_array(array, np.zeros(array.shape, bool))
        case 3:
            return np.ma.masked_array(array, np.ones(array.shape, bool))
        case 4:
            return np.ascontiguousarray(array).data
        case _:
            return [rng.choice(OBJECTS), *array.tolist()] if array.ndim else array


ARRAY_CHANGES = (
    _cast,
    _with_value,
    _with_value,
    _scaled,
    _reshaped,
    _reshaped,
    _laid_out,
    _as_other,
)
