"""Colours of states and scales, for a light and a dark ground."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, REGION

VIRIDIS = (
    *("#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c"),
    *("#28ae80", "#5ec962", "#addc30", "#fde725"),
)

COLOURS: dict[str, dict[str, Any]] = {
    "light": {
        "visible": INTERVISIBLE,
        "occluded": NODE,
        "unknown": FAINT,
        "region": REGION,
        "ink": INK,
        "line": "#59616b",
        "faint": "#8a9099",
        "background": "#ffffff",
    },
    "dark": {
        "visible": "#3fa7cc",
        "occluded": "#f0587a",
        "unknown": "#6b737e",
        "region": REGION,
        "ink": "#e6e9ed",
        "line": "#c6cad1",
        "faint": "#7d858f",
        "background": "#14171b",
    },
}
"""The colours of `intervis.plots.style`, and lighter ones of the same hues on a dark ground."""

ON_IMAGE = {"visible": "#3fa7cc", "occluded": "#ff4f7b", "unknown": "#e6e9ed"}


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue from 0 to 255 of ``#rrggbb``.

    Examples
    --------
    >>> rgb("#3fa7cc")
    (63, 167, 204)
    """
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def on_scale(share: Float64Array) -> NDArray[np.uint8]:
    """(N, 3) colours of shares (N,) from 0 to 1 on `VIRIDIS`; NaN is grey.

    Examples
    --------
    >>> on_scale(np.array([0.0, 1.0, np.nan])).tolist()
    [[68, 1, 84], [253, 231, 37], [128, 128, 128]]
    """
    scale = np.array([rgb(colour) for colour in VIRIDIS], np.float64)
    known = np.isfinite(share)
    at = np.clip(np.where(known, share, 0.0), 0.0, 1.0) * (len(scale) - 1)
    channels = [np.interp(at, np.arange(len(scale)), scale[:, k]) for k in range(3)]
    mixed = np.rint(np.column_stack(channels))
    return np.where(known[:, None], mixed, 128.0).astype(np.uint8)
