"""Where along sight lines no scan observed."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import in_parts
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.kernels.profile import add_unobserved_parts
from intervis.sight.occupancy_model import MODEL

_MIN_LINES_PER_THREAD = 256


def unobserved_parts(
    scans: PackedScans, starts: Float64Array, ends: Float64Array, parts: int
) -> Float64Array:
    """Metres that no scan observed, in each of several equal parts of each line.

    Parameters
    ----------
    scans : PackedScans
        From `Scene.packed_scans`.
    starts, ends : (L, 3) float64 arrays
        Finite points of the scene.
    parts : int
        How many equal parts a line is cut into.

    Returns
    -------
    (L, parts) float64 array
        From start to end. A row's sum is `Scene.unobserved_length`: 0.4 m at either end of the
        line are not counted.

    Examples
    --------
    >>> from intervis.sight import Scene
    >>> y, z = np.meshgrid(np.arange(-5, 5, 0.04), np.arange(-1.5, 1.5, 0.06))
    >>> wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    >>> scans = Scene.from_scan(wall).packed_scans()
    >>> ends = np.array([[20.0, 0.0, 0.0]])
    >>> (unobserved_parts(scans, np.zeros((1, 3)), ends, 4) > 2.5).tolist()
    [[False, False, True, True]]
    """
    first, second = (np.ascontiguousarray(points, np.float64) for points in (starts, ends))
    parts_m = np.zeros((len(first), parts))

    def work(begin: int, stop: int) -> None:
        add_unobserved_parts(scans, first, second, MODEL, begin, stop, parts_m)

    in_parts(work, len(first), least=_MIN_LINES_PER_THREAD)
    return parts_m
