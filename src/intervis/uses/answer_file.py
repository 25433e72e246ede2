"""Answers for many sight lines as files: CSV, JSON, NPZ, and PLY for point viewers."""

import io
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from intervis.arguments import object_of, path_of
from intervis.arrays import Float64Array, checked_point
from intervis.errors import OutputError, PointsError
from intervis.files import write_bytes
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Sight
from intervis.sight.query_checks import targets_of

WORDS = {VISIBLE: "visible", OCCLUDED: "occluded", UNKNOWN: "unknown"}
COLUMNS = ("probability", "clearance", "observed")
COLOURS = {VISIBLE: (11, 110, 143), OCCLUDED: (200, 56, 90), UNKNOWN: (198, 202, 209)}
"""Colours of the states in PLY files: those of the pictures."""


def save_answers(path: Path, viewpoint: Float64Array, targets: Float64Array, sight: Sight) -> None:
    """Write the answers for lines from a viewpoint to targets, in the format of the ending.

    ``.csv`` has a row, ``.json`` an object for each target: its place, state, probability,
    clearance, observed share and blocker; what is not defined is empty or null. ``.npz`` holds the
    arrays of `Sight` with `viewpoint` and `targets`. ``.ply`` holds the targets as vertices with
    the state as a number and as a colour, probability, clearance and observed share.

    Parameters
    ----------
    path : Path
    viewpoint : (3,) float64 array
    targets : (M, 3) float64 array
    sight : Sight
        Of shape (M,).

    Raises
    ------
    OutputError
        The ending is another one, or the file cannot be written.
    PointsError
        The targets are not as many as the answers, or as `intervis.Scene.sight`.
    """
    path = path_of(path, "path")
    object_of(sight, Sight, "sight")
    start, ends = checked_point(viewpoint), targets_of(targets)
    if sight.state.shape != (len(ends),):
        raise PointsError(
            f"{len(ends)} targets need as many answers, got a Sight of shape {sight.state.shape}."
        )
    write_bytes(path, _writer(path)(start, ends, sight))


def check_ending(path: Path | None) -> None:
    """Raise where `save_answers` cannot write a file of this name.

    Raises
    ------
    OutputError
        The ending is none of those.
    """
    if path is not None:
        _writer(path)


def _writer(path: Path) -> Callable[[Float64Array, Float64Array, Sight], bytes]:
    ending = path.suffix.lower()
    if ending not in _WRITERS:
        raise OutputError(f"the answers are written as {', '.join(_WRITERS)}: {path} is none.")
    return _WRITERS[ending]


def _csv(_: Float64Array, targets: Float64Array, sight: Sight) -> bytes:
    lines = [",".join(["x", "y", "z", "state", *COLUMNS, "blocker_x", "blocker_y", "blocker_z"])]
    numbers = np.column_stack([*(getattr(sight, name) for name in COLUMNS), sight.blocker])
    for target, state, row in zip(targets, sight.state, numbers, strict=True):
        cells = [f"{value:.6g}" if math.isfinite(value) else "" for value in row]
        lines.append(",".join([*(f"{value:.9g}" for value in target), WORDS[int(state)], *cells]))
    return ("\n".join(lines) + "\n").encode()


def _json(viewpoint: Float64Array, targets: Float64Array, sight: Sight) -> bytes:
    lines = [
        {
            "target": _numbers(target),
            "state": WORDS[int(sight.state[nth])],
            **{name: _numbers(getattr(sight, name)[nth]) for name in COLUMNS},
            "blocker": _numbers(sight.blocker[nth]),
        }
        for nth, target in enumerate(targets)
    ]
    content = {"viewpoint": _numbers(viewpoint), "lines": lines}
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def _numbers(values: Any) -> Any:
    """A number or a list; null where one is not finite."""
    return np.asarray(values).tolist() if np.isfinite(values).all() else None


def _npz(viewpoint: Float64Array, targets: Float64Array, sight: Sight) -> bytes:
    file = io.BytesIO()
    arrays = {name: getattr(sight, name) for name in ("state", "blocker", *COLUMNS)}
    np.savez(file, viewpoint=viewpoint, targets=targets, **arrays)
    return file.getvalue()


def _ply(_: Float64Array, targets: Float64Array, sight: Sight) -> bytes:
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
