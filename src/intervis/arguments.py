"""Checks of arguments that are no arrays: objects of the library, texts, counts, sequences."""

import os
import re
from collections.abc import Iterable, Mapping
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

from intervis.errors import ArgumentError

LONGEST_SHOWN = 80
"""Letters of a wrong value or name that a message shows."""

LONGEST_PATH, UNFIT = 4096, ("\0", "\n", "\r")
"""Letters of a path at most, and characters that none may hold: messages name it in one line."""

ADDRESS = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/+(.*)", re.DOTALL)
"""Scheme and place of an address that is no path: ``s3://bucket/drive``; a `Path` has one slash."""

Kind = TypeVar("Kind")


def shown(value: object) -> str:
    """A value in one short line, for a message.

    Examples
    --------
    >>> shown("a" * 100)
    "'aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa ..."
    """
    try:
        text = " ".join(repr(value).split())
    except Exception:  # an integer of over 4,300 digits, or an object that cannot say what it is
        text = f"a {type(value).__name__}"
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]} ..."


def object_of(value: object, kind: type[Kind], name: str) -> Kind:
    """An object of a class, by the name of its argument.

    Raises
    ------
    ArgumentError
        It is something else.

    Examples
    --------
    >>> object_of(3.0, str, "name")
    Traceback (most recent call last):
        ...
    intervis.errors.ArgumentError: name must be a str, got 3.0.
    """
    if not isinstance(value, kind):
        raise ArgumentError(f"{name} must be {_with_article(kind)}, got {shown(value)}.")
    return value


def objects_of(values: object, kind: type[Kind], name: str) -> list[Kind]:
    """Objects of a class as a list, by the name of their argument.

    Raises
    ------
    ArgumentError
        It is no sequence, or one of them is something else.
    """
    if not isinstance(values, Iterable) or isinstance(values, str | bytes | Mapping):
        raise ArgumentError(f"{name} must be a list of {kind.__name__}, got {shown(values)}.")
    return [object_of(value, kind, f"each of {name}") for value in _items(values, name)]


def _items(values: Iterable[Any], name: str) -> list[Any]:
    try:
        return list(values)
    except TypeError:  # an array without dimensions
        raise ArgumentError(f"{name} must be a list, got {shown(values)}.") from None


def mapping_of(value: object, name: str) -> Mapping[Any, Any]:
    """A mapping, by the name of its argument.

    Raises
    ------
    ArgumentError
        It is none.
    """
    if not isinstance(value, Mapping):
        raise ArgumentError(f"{name} must be a mapping, got {shown(value)}.")
    return value


def whole_numbers_of(values: object, name: str) -> list[int]:
    """Whole numbers of 64 bits as a list, by the name of their argument.

    Raises
    ------
    ArgumentError
        It is no sequence, or one of them is something else.
    """
    if not isinstance(values, Iterable) or isinstance(values, str | bytes):
        raise ArgumentError(f"{name} must be a list of whole numbers, got {shown(values)}.")
    numbers = _items(values, name)
    for number in numbers:
        if not is_count(number, -(2**63)) or int(number) >= 2**63:
            raise ArgumentError(f"{name} must be whole numbers, got {shown(number)}.")
    return [int(number) for number in numbers]


def flag_of(value: object, name: str) -> bool:
    """True or false, by the name of its argument.

    Raises
    ------
    ArgumentError
        It is neither.
    """
    if type(value).__name__ not in ("bool", "bool_"):  # numpy's is "bool" from version 2 on
        raise ArgumentError(f"{name} must be True or False, got {shown(value)}.")
    return bool(value)


def function_of(value: object, name: str) -> None:
    """Check a callback, which may be None.

    Raises
    ------
    ArgumentError
        It is neither None nor can it be called.
    """
    if value is not None and not callable(value):
        raise ArgumentError(f"{name} must be a function or None, got {shown(value)}.")


def is_count(value: object, least: int = 1) -> bool:
    """Whether a value is a whole number of at least so much; true and false are none.

    Examples
    --------
    >>> is_count(1), is_count(0), is_count(True), is_count(2.0)
    (True, False, False, False)
    """
    return not isinstance(value, bool) and isinstance(value, Integral) and int(value) >= least


def path_of(value: object, name: str) -> Path:
    """A path, by the name of its argument.

    Raises
    ------
    ArgumentError
        It is neither a text nor a path, is longer than a path may be, or has a character that a
        path does not have in a message of one line.
    """
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(text, str):
        raise ArgumentError(f"{name} must be a text or a Path, got {shown(value)}.")
    if len(text) > LONGEST_PATH or any(mark in text for mark in UNFIT):
        raise ArgumentError(f"{name} is no path: {shown(text)}.")
    return Path(text)


def address_of(path: str | os.PathLike[str]) -> str | None:
    """The address of remote storage that a text or a path holds; None for a path on a disk.

    Examples
    --------
    >>> address_of("s3://bucket/drive"), address_of(Path("s3://bucket/drive"))
    ('s3://bucket/drive', 's3://bucket/drive')
    >>> address_of("C:/drive"), address_of("drive/gs://")
    (None, None)
    """
    found = ADDRESS.fullmatch(os.fspath(path))
    if found is None or os.path.lexists(f"{found[1]}:"):  # a folder of this name
        return None
    return f"{found[1]}://{found[2]}"


def _with_article(kind: type[Any]) -> str:
    name = kind.__name__
    return f"an {name}" if name[0] in "AEIOU" else f"a {name}"
