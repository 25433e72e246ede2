"""Answers for many sight lines as files: CSV, JSON, NPZ, and PLY for point viewers."""

import csv
import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arguments import object_of, path_of
from intervis.arrays import Float64Array, array_of, checked_point
from intervis.errors import OutputError, PointsError
from intervis.files import write_bytes
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Sight
from intervis.sight.query_checks import targets_of

WORDS = {VISIBLE: "visible", OCCLUDED: "occluded", UNKNOWN: "unknown"}
COLUMNS = ("probability", "clearance", "observed")
COLOURS = {VISIBLE: (11, 110, 143), OCCLUDED: (200, 56, 90), UNKNOWN: (198, 202, 209)}
"""Colours of the states in PLY files: those of the pictures."""


Classes = NDArray[np.str_] | None


def save_answers(
    path: Path,
    viewpoint: Float64Array,
    targets: Float64Array,
    sight: Sight,
    blocker_class: ArrayLike | None = None,
) -> None:
    """Write the answers for lines from a viewpoint to targets, in the format of the ending.

    ``.csv`` has a row, ``.json`` an object for each target: its place, state, probability,
    clearance, observed share and blocker; what is not defined is empty or null. ``.npz`` holds the
    arrays of `Sight` with `viewpoint` and `targets`. ``.ply`` holds the targets as vertices with
    the state as a number and as a colour, probability, clearance and observed share. Where the
    classes of the blockers are given, all but PLY files hold them as ``blocker_class``.

    Parameters
    ----------
    path : Path
    viewpoint : (3,) float64 array
    targets : (M, 3) float64 array
    sight : Sight
        Of shape (M,).
    blocker_class : (M,) array of str, optional
        Of `intervis.uses.LabelledScene.blocker_classes`.

    Raises
    ------
    OutputError
        The ending is another one, or the file cannot be written.
    PointsError
        The targets, or the classes, are not as many as the answers, or as `intervis.Scene.sight`.
    """
    path = path_of(path, "path")
    object_of(sight, Sight, "sight")
    start, ends = checked_point(viewpoint), targets_of(targets)
    if sight.state.shape != (len(ends),):
        raise PointsError(
            f"{len(ends)} targets need as many answers, got a Sight of shape {sight.state.shape}."
        )
    write_bytes(path, _writer(path)(start, ends, sight, _classes(blocker_class, len(ends))))


def _classes(given: ArrayLike | None, count: int) -> Classes:
    if given is None:
        return None
    classes = array_of(given, "blocker_class")
    if classes.shape != (count,) or (count and classes.dtype.kind != "U"):
        raise PointsError(
            f"{count} answers need as many names of blocker_class, got {classes.dtype} of shape"
            f" {classes.shape}."
        )
    return classes.astype(np.str_)


def check_ending(path: Path | None) -> None:
    """Raise where `save_answers` cannot write a file of this name.

    Raises
    ------
    OutputError
        The ending is none of those.
    """
    if path is not None:
        _writer(path)


def _writer(path: Path) -> Callable[[Float64Array, Float64Array, Sight, Classes], bytes]:
    ending = path.suffix.lower()
    if ending not in _WRITERS:
        raise OutputError(f"the answers are written as {', '.join(_WRITERS)}: {path} is none.")
    return _WRITERS[ending]


def _csv(_: Float64Array, targets: Float64Array, sight: Sight, classes: Classes) -> bytes:
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    names = [] if classes is None else ["blocker_class"]
    write(["x", "y", "z", "state", *COLUMNS, "blocker_x", "blocker_y", "blocker_z", *names])
    numbers = np.column_stack([*(getattr(sight, name) for name in COLUMNS), sight.blocker])
    named = [[]] * len(targets) if classes is None else classes[:, None].tolist()
    for target, state, row, name in zip(targets, sight.state, numbers, named, strict=True):
        cells = [f"{value:.6g}" if math.isfinite(value) else "" for value in row]
        write([*(f"{value:.9g}" for value in target), WORDS[int(state)], *cells, *name])
    return text.getvalue().encode()


def _json(viewpoint: Float64Array, targets: Float64Array, sight: Sight, classes: Classes) -> bytes:
    lines = [
        {
            "target": _numbers(target),
            "state": WORDS[int(sight.state[nth])],
            **{name: _numbers(getattr(sight, name)[nth]) for name in COLUMNS},
            "blocker": _numbers(sight.blocker[nth]),
            **({} if classes is None else {"blocker_class": str(classes[nth]) or None}),
        }
        for nth, target in enumerate(targets)
    ]
    content = {"viewpoint": _numbers(viewpoint), "lines": lines}
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def _numbers(values: Any) -> Any:
    """A number or a list; null where one is not finite."""
    return np.asarray(values).tolist() if np.isfinite(values).all() else None


def _npz(viewpoint: Float64Array, targets: Float64Array, sight: Sight, classes: Classes) -> bytes:
    file = io.BytesIO()
    arrays = {name: getattr(sight, name) for name in ("state", "blocker", *COLUMNS)}
    if classes is not None:
        arrays["blocker_class"] = classes
    np.savez(file, viewpoint=viewpoint, targets=targets, **arrays)
    return file.getvalue()


def _ply(_: Float64Array, targets: Float64Array, sight: Sight, __: Classes) -> bytes:
    fields = [(axis, "<f4") for axis in "xyz"] + [("state", "i1")]
    fields += [(name, "u1") for name in ("red", "green", "blue")] + [(n, "<f4") for n in COLUMNS]
    table = np.zeros(len(targets), fields)
    with np.errstate(over="ignore"):  # beyond float32: infinite
        for nth, axis in enumerate("xyz"):
            table[axis] = targets[:, nth]
    table["state"] = sight.state
    palette = np.array([COLOURS[state] for state in (UNKNOWN, OCCLUDED, VISIBLE)], np.uint8)
    for nth, name in enumerate(("red", "green", "blue")):
        table[name] = palette[sight.state - UNKNOWN, nth]
    for name in COLUMNS:
        table[name] = getattr(sight, name)
    kinds = {"<f4": "float", "i1": "char", "u1": "uchar"}
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(targets)}"]
    head += [f"property {kinds[kind]} {name}" for name, kind in fields]
    return ("\n".join([*head, "end_header"]) + "\n").encode() + table.tobytes()


_WRITERS = {".csv": _csv, ".json": _json, ".npz": _npz, ".ply": _ply}
