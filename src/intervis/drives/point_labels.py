"""Labels of points as SemanticKITTI writes them: ``NNNNNN.label`` beside the scan or in ``labels``.

A label is one little-endian uint32 for each point of the scan, in its order: the class in the lower
16 bits, the instance in the upper 16. Source: SemanticKITTI's development kit.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intervis.drives.regular_file import open_regular, rest_as_numbers
from intervis.errors import ScanError

ENDING = ".label"
CLASS_NAMES: Mapping[int, str] = {
    1: "outlier",
    10: "car",
    11: "bicycle",
    13: "bus",
    15: "motorcycle",
    16: "on-rails",
    18: "truck",
    20: "other-vehicle",
    30: "person",
    31: "bicyclist",
    32: "motorcyclist",
    40: "road",
    44: "parking",
    48: "sidewalk",
    49: "other-ground",
    50: "building",
    51: "fence",
    52: "other-structure",
    60: "lane-marking",
    70: "vegetation",
    71: "trunk",
    72: "terrain",
    80: "pole",
    81: "traffic-sign",
    99: "other-object",
    252: "moving-car",
    253: "moving-bicyclist",
    254: "moving-person",
    255: "moving-motorcyclist",
    256: "moving-on-rails",
    257: "moving-bus",
    258: "moving-truck",
    259: "moving-other-vehicle",
}
"""SemanticKITTI's names of its classes; 0 is a point without a label."""


def label_files(scan_paths: Mapping[int, Path]) -> dict[int, Path]:
    """Label files by frame number: beside the scan, or in the folder ``labels`` beside its folder.

    Parameters
    ----------
    scan_paths : mapping of int to Path
        Scan files by frame number.
    """

    @cache
    def listed(folder: Path) -> dict[str, Path]:
        if not folder.is_dir():
            return {}
        return {path.name: path for path in folder.iterdir() if path.name.endswith(ENDING)}

    found = {}
    for number, path in scan_paths.items():
        name = path.name.split(".")[0] + ENDING
        for folder in (path.parent, path.parent.parent / "labels"):
            if name in listed(folder):
                found[number] = listed(folder)[name]
                break
    return found


def read_labels(path: Path, count: int) -> NDArray[np.uint32]:
    """Read a label file.

    Parameters
    ----------
    path : Path
    count : int
        Number of points of the scan.

    Returns
    -------
    (count,) uint32 array

    Raises
    ------
    ScanError
        The file cannot be read, or has another number of labels.
    """
    try:
        with open_regular(path) as file:
            labels = rest_as_numbers(file, "<u4")
            size_bytes = file.seek(0, 2)
    except OSError as error:
        raise ScanError(f"cannot read the labels {path}: {error.strerror}.") from None
    if size_bytes != 4 * count:
        raise ScanError(
            f"the labels {path} have {size_bytes} bytes, but the {count} points of the scan need"
            f" {4 * count}."
        )
    return labels.astype(np.uint32, copy=False)
