"""How many numbers a point has in a file of bare float32 numbers: the data tells.

A `.bin` file has no header. KITTI writes four numbers a point, others write three, five (ring or
time) or more. Two properties hold only with the right number: successive returns lie in nearly the
same azimuth, as a scanner turns; and each column has values of its own kind.
"""

import numpy as np

from intervis.arrays import Float32Array, Float64Array

WIDTHS = (4, 5, 6, 3, 7, 8, 9, 10)
"""Numbers of columns that are looked for."""

SAMPLE = 2520 * 16
"""Numbers that are looked at: a multiple of every width."""

FEWEST_ROWS = 64
"""Rows below which nothing is concluded."""

TURN_DEG = 3.0
"""Median change of azimuth between successive returns: that of a scanner is smaller."""

DISTINCT = 0.1
"""Share of the variance that columns must explain beyond those of the usual width."""


def azimuth_step_deg(values: Float32Array, width: int) -> float:
    """Median change of azimuth from one point to the next, if points have `width` numbers.

    Infinite where there are too few points to tell.

    Examples
    --------
    >>> angle = np.radians(np.arange(0, 360, 0.5))
    >>> rows = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), 0 * angle, angle, angle])
    >>> values = rows.astype(np.float32).ravel()
    >>> round(azimuth_step_deg(values, 5), 3), azimuth_step_deg(values, 4) > 10
    (0.5, True)
    """
    with np.errstate(invalid="ignore"):  # casting a signalling NaN
        rows = values[: len(values) // width * width].reshape(-1, width)[:, :3].astype(np.float64)
    rows = rows[np.isfinite(rows).all(axis=1) & (rows[:, :2] != 0).any(axis=1)]
    if len(rows) < FEWEST_ROWS:
        return np.inf
    azimuth_deg = np.degrees(np.arctan2(rows[:, 1], rows[:, 0]))
    step_deg = np.abs(np.diff(azimuth_deg))
    return float(np.median(np.minimum(step_deg, 360 - step_deg)))


def column_distinctness(values: Float32Array, width: int) -> float:
    """Share of the variance of the numbers' kinds that columns explain, from 0 to 1.

    The kinds are: whole or not, the sign, and the order of magnitude. With the right width each
    column has kinds of its own; with a wrong one every column holds a mixture.

    Examples
    --------
    >>> numbers = np.random.default_rng(0).uniform(size=4000)
    >>> numbers[4::5] = np.arange(800) % 32
    >>> values = numbers.astype(np.float32)
    >>> column_distinctness(values, 5) > 0.5 > 0.05 > column_distinctness(values, 4)
    True
    """
    if len(values) // width < FEWEST_ROWS:
        return 0.0
    with np.errstate(invalid="ignore"):
        used = values[: len(values) // width * width].astype(np.float64)
    used = np.nan_to_num(used, nan=0.0, posinf=1e9, neginf=-1e9)
    kinds = (used == np.rint(used), np.sign(used), np.log(np.abs(used) + 1e-3))
    return max(_explained(np.asarray(kind, np.float64), width) for kind in kinds)


def _explained(kind: Float64Array, width: int) -> float:
    total = float(kind.var())
    return float(kind.reshape(-1, width).mean(axis=0).var()) / total if total > 0 else 0.0


def likely_width(values: Float32Array, usual: int) -> tuple[int | None, bool]:
    """Numbers of a point in a file, and whether it may be read so.

    Parameters
    ----------
    values : (V,) float32 array
        All numbers of the file.
    usual : int
        What the ending of its name promises.

    Returns
    -------
    width : int or None
        None where the file is cut off, and the data shows no other width.
    certain : bool
        False where the columns show that `usual` is wrong, but not that the points come as a
        scanner sends them: another width is then a guess.
    """
    sample = values[:SAMPLE]
    if azimuth_step_deg(sample, usual) < TURN_DEG or len(sample) // usual < FEWEST_ROWS:
        return (usual, True) if len(values) % usual == 0 else (None, True)
    whole = sorted(width for width in WIDTHS if len(values) % width == 0)
    turning = [width for width in whole if azimuth_step_deg(sample, width) < TURN_DEG]
    if turning and all(width % turning[0] == 0 for width in turning):
        return turning[0], True
    distinct = {width: column_distinctness(sample, width) for width in whole}
    best = max(distinct.values(), default=0.0)
    if best < column_distinctness(sample, usual) + DISTINCT:
        return (usual, True) if len(values) % usual == 0 else (None, True)
    return next(width for width in whole if distinct[width] > 0.9 * best), False


def column_names(values: Float32Array, width: int) -> tuple[str, ...]:
    """Names of the columns after x, y, z: intensity; ring where the fifth has small whole numbers.

    Examples
    --------
    >>> rows = np.array([[1, 2, 3, 0.5, 7, 0.1], [1, 2, 4, 0.5, 8, 0.2]], np.float32)
    >>> column_names(rows.ravel(), 6)
    ('intensity', 'ring', 'column_6')
    """
    names = ["intensity", *(f"column_{number}" for number in range(5, width + 1))][: width - 3]
    if width >= 5:
        fifth = values[4::width]
        with np.errstate(invalid="ignore"):  # a signalling NaN
            small = np.all((fifth == np.rint(fifth)) & (fifth >= 0) & (fifth < 1024))
        if small:
            names[1] = "ring"
    return tuple(names)
