"""Candidates and road users from files: CSV, GeoJSON, JSON."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives.calibration import read_lines
from intervis.errors import CalibrationError, DriveError, SceneError
from intervis.sight import Scene
from intervis.uses.routes.target_file import cell_number, read_rows
from intervis.uses.routes.zone import GROUND_SCANS
from intervis.uses.sites.candidate import MAST_M, Candidate, check_candidates_in_scene

COLUMNS = ("x", "y", "z", "height", "yaw_deg", "fov_deg")


def read_candidates(path: Path, scene: Scene, mast_m: float = MAST_M) -> list[Candidate]:
    """Candidates of a file, in the frame of the scene, metres.

    - CSV: a heading with ``x``, ``y``, and any of ``name``, ``z`` of the scanner or its ``height``
      above the ground (`mast_m` if neither is given), ``yaw_deg`` and ``fov_deg``. Other columns
      are ignored.
    - JSON: a list of objects with these names.
    - GeoJSON: points; a third coordinate is ``z``, the properties have the other names.

    Raises
    ------
    DriveError
        There is no such file, or it is none of these.
    CalibrationError
        A value is no number, a row has no x or y, or a height is negative.
    SceneError
        The scene shows no ground below a candidate without z, or a candidate lies outside of it or
        below its ground.
    PointsError
        As `Candidate`; or two have one name.
    """
    if not path.exists():
        raise DriveError(f"there are no candidates at {path}: check the path.")
    is_csv = path.suffix.lower() not in (".json", ".geojson")
    rows: list[Mapping[str, Any]] = list(read_rows(path)) if is_csv else _json_rows(path)
    if not rows:
        raise CalibrationError(f"{path} holds no candidates.")
    values = [_numbers_of(path, nth, row) for nth, row in enumerate(rows, start=1)]
    xy = np.array([[one["x"], one["y"]] for one in values])
    ground_m = scene.ground_height(xy, GROUND_SCANS)
    found = [
        _candidate(row.get("name") or nth, one, float(below_m), mast_m)
        for nth, (row, one, below_m) in enumerate(zip(rows, values, ground_m, strict=True), start=1)
    ]
    check_candidates_in_scene(scene, found)
    return found


def _json_rows(path: Path) -> list[Mapping[str, Any]]:
    try:
        content: Any = json.loads("\n".join(read_lines(path)))
    except (ValueError, RecursionError):
        raise DriveError(f"{path} is no JSON: give candidates as CSV, JSON or GeoJSON.") from None
    if isinstance(content, dict) and isinstance(content.get("features"), list):
        return [_point(path, nth, one) for nth, one in enumerate(content["features"], start=1)]
    if not (isinstance(content, list) and all(isinstance(one, dict) for one in content)):
        raise DriveError(
            f"{path} holds no candidates: they are a list of objects with x and y, or points of a"
            " GeoJSON FeatureCollection."
        )
    return content


def _point(path: Path, nth: int, feature: Any) -> Mapping[str, Any]:
    """The row of a GeoJSON point."""
    try:
        geometry = feature["geometry"]
        coordinates = list(geometry["coordinates"])
        if geometry["type"] != "Point" or not 2 <= len(coordinates) <= 3:
            raise ValueError
        place = dict(zip("xyz", coordinates, strict=False))
        return dict(feature.get("properties") or {}) | place
    except (KeyError, TypeError, ValueError, AttributeError):
        raise DriveError(f"{path}: feature {nth} is no point with two or three numbers.") from None


def _numbers_of(path: Path, nth: int, row: Mapping[str, Any]) -> dict[str, float]:
    """The numbers of a row, which has x and y at least."""
    cells = {
        key: cell_number(path, f"candidate {nth}", key, row[key]) for key in COLUMNS if key in row
    }
    values = {key: value for key, value in cells.items() if value is not None}
    if not {"x", "y"} <= set(values):
        raise CalibrationError(f"{path}, candidate {nth}: it needs x and y in metres.")
    if values.get("height", 0.0) < 0.0:
        raise CalibrationError(
            f"{path}, candidate {nth}: height is above the ground and must be 0 m or more, got"
            f" {values['height']:g}; z takes a height in the frame of the drive's poses."
        )
    return values


def _candidate(
    given: object, values: Mapping[str, float], ground_m: float, mast_m: float
) -> Candidate:
    name = str(given).strip()
    z = values.get("z", ground_m + values.get("height", mast_m))
    if not np.isfinite(z):
        raise SceneError(f"the scene shows no ground below candidate {name!r}: give its z.")
    look = {key: values[key] for key in ("yaw_deg", "fov_deg") if key in values}
    return Candidate(name, [values["x"], values["y"], z], **look)


def read_users(path: Path) -> tuple[Float64Array, Float64Array]:
    """Places (U, 2) and weights (U,) of road users: a CSV with ``x``, ``y`` and maybe ``weight``.

    Raises
    ------
    DriveError
        There is no such file.
    CalibrationError
        The heading or a value is wrong.
    """
    if not path.exists():
        raise DriveError(f"there are no road users at {path}: check the path.")
    rows = read_rows(path)
    if not rows or not {"x", "y"} <= set(rows[0]):
        raise CalibrationError(f"{path}: road users need a heading with x, y, and rows below it.")
    table = np.array([_numbers(path, nth, row, "xy") for nth, row in enumerate(rows, start=1)])
    return table, read_weights(path, rows)


def read_weights(path: Path, rows: list[dict[str, str]] | None = None) -> Float64Array:
    """Weights (N,) of the rows of a CSV, by its column ``weight``; 1 without it.

    Raises
    ------
    CalibrationError
        A weight is no number, or negative.
    """
    rows = read_rows(path) if rows is None else rows
    if not rows or "weight" not in rows[0]:
        return np.ones(len(rows))
    weights = np.array(
        [_numbers(path, nth, row, ("weight",))[0] for nth, row in enumerate(rows, start=1)]
    )
    if (weights < 0.0).any():
        nth = int(np.argmax(weights < 0.0)) + 1
        raise CalibrationError(f"{path}, row {nth}: the weight is negative.")
    return weights


def _numbers(path: Path, nth: int, row: dict[str, str], columns: Any) -> list[float]:
    values = [cell_number(path, f"row {nth}", column, row[column]) for column in columns]
    if None in values:
        raise CalibrationError(f"{path}, row {nth}: {', '.join(columns)} must be numbers.")
    return [value for value in values if value is not None]
