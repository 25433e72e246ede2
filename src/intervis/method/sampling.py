"""Sampling with a spherical kernel of granularity tau (paper Sec. 2.1).

tau is a number of points: the paper's tables give n = ceil(n_fov / tau) in every row. A (sampling)
kernel is a compact group of tau neighbouring returns; each gives one node, which is one of them.
"""

import numpy as np

from intervis.arrays import Float64Array, IntArray
from intervis.kernels import kernel
from intervis.method.ranks import room_for, split

HISTOGRAM_REACH = 1.5
"""Standard deviations from the mean within which the cut of a split is looked for. The median is
never more than one away from the mean."""

MOST_SQUARINGS = 64
"""Then eigenvalues that differ by rounding alone are told apart."""

NEAR_TIE = 1e-9
"""Squared distances that differ by less than this share are equal."""


def sample_kernels(points: Float64Array, tau: int, viewpoint: Float64Array) -> IntArray:
    """One node for each kernel of tau neighbouring points: exactly ceil(n / tau) nodes.

    The points are split recursively in two halves across their first principal axis, the half
    nearer to the viewpoint first, each time at a whole number of kernels. So every kernel but the
    last holds exactly tau points, kernels are compact, consecutive kernels are neighbours, the cost
    is O(n log n), and the result depends neither on the order of the points nor on a rotation of
    the frame.

    Parameters
    ----------
    points : (n, 3) float64 array
        Points in view, metres.
    tau : int
        Points in one kernel.
    viewpoint : (3,) float64 array
        The meta-viewpoint P0.

    Returns
    -------
    (ceil(n / tau),) int64 array
        Rows of `points`, ascending: the member of each kernel nearest to the kernel's mean (of
        several at one distance, the one nearest to the viewpoint).

    Examples
    --------
    >>> line = np.array([[float(x), 0.0, 0.0] for x in range(7)])
    >>> sample_kernels(line, 3, np.zeros(3))
    array([1, 4, 6])
    """
    if tau == 1 or len(points) == 0:
        return np.arange(len(points))
    order = np.arange(len(points))
    starts = _partition(points, order, tau, viewpoint)
    nodes = _nearest_to_mean(points, order, starts, viewpoint)
    nodes.sort()
    return nodes


def sample_stride(count: int, tau: int) -> IntArray:
    """Every tau-th return: ceil(count / tau) nodes, the cheapest sampling that fits the tables.

    Examples
    --------
    >>> sample_stride(7, 3)
    array([0, 3, 6])
    """
    return np.arange(0, count, tau)


def sample_radius(points: Float64Array, radius_m: float, viewpoint: Float64Array) -> IntArray:
    """One node for each ball of a metric radius, assigned greedily in scan order.

    The first point without a ball is the centre of the next ball, which takes all points within
    `radius_m` that have none. The node is the member nearest to the mean of the ball's points.

    Returns
    -------
    (V,) int64 array
        Rows of `points`, ascending.

    Examples
    --------
    >>> sample_radius(np.array([[0.0, 0, 0], [0.1, 0, 0], [5, 0, 0]]), 1.0, np.zeros(3))
    array([0, 2])
    """
    if len(points) == 0:
        return np.arange(0)
    cell = np.floor((points - points.min(axis=0)) / radius_m).astype(np.int64)
    # One empty cell on each side, so that no neighbour of a cell wraps to another row.
    strides = np.cumprod(np.array([1, *(cell.max(axis=0)[:2] + 3)]))
    key = (cell + 1) @ strides
    by_cell = np.argsort(key, kind="stable")
    cells, first = np.unique(key[by_cell], return_index=True)
    offsets = (
        np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]) @ strides
    )
    ball = _cover(points, radius_m, key, by_cell, cells, np.append(first, len(key)), offsets)
    order = np.argsort(ball, kind="stable")
    starts = np.searchsorted(ball[order], np.arange(ball.max() + 2))
    nodes = _nearest_to_mean(points, order, starts, viewpoint)
    nodes.sort()
    return nodes


@kernel
def _partition(
    points: Float64Array, order: IntArray, tau: int, viewpoint: Float64Array
) -> IntArray:
    """Sort `order` into kernels in place; the offset of each kernel, and n as the last entry."""
    n = order.shape[0]
    kernels = (n + tau - 1) // tau
    starts = np.empty(kernels + 1, np.int64)
    starts[kernels] = n
    x, y, z, along, room = np.empty(n), np.empty(n), np.empty(n), np.empty(n), room_for(n)
    # An explicit stack instead of recursion: (first kernel, number of kernels) still to be split.
    # The nearer half is split first, so it holds at most 1 + log2(kernels) entries, rounded up.
    stack = np.empty((64, 2), np.int64)
    stack[0, 0] = 0
    stack[0, 1] = kernels
    depth = 1
    while depth > 0:
        depth -= 1
        first = stack[depth, 0]
        count = stack[depth, 1]
        start = first * tau
        if count == 1:
            starts[first] = start
            continue
        rows = order[start : min((first + count) * tau, n)]
        near, size = count // 2, len(rows)
        mean, deviation = _project(
            points, rows, viewpoint, x[:size], y[:size], z[:size], along[:size]
        )
        low, high = mean - HISTOGRAM_REACH * deviation, mean + HISTOGRAM_REACH * deviation
        split(rows, along[:size], low, high, near * tau, room)
        stack[depth, 0] = first + near
        stack[depth, 1] = count - near
        stack[depth + 1, 0] = first
        stack[depth + 1, 1] = near
        depth += 2
    return starts


@kernel
def _project(
    points: Float64Array,
    rows: IntArray,
    viewpoint: Float64Array,
    x: Float64Array,
    y: Float64Array,
    z: Float64Array,
    along: Float64Array,
) -> tuple[float, float]:
    """Coordinates along the first principal axis of some points, pointing away from P0.

    Writes the points' coordinates to x, y and z, and those along the axis to `along`; returns the
    mean and the standard deviation of the latter.
    """
    # Relative to one of the points: then one pass is as accurate as one for the mean and another.
    near_x, near_y, near_z = points[rows[0]]
    mx = my = mz = 0.0
    xx = xy = xz = yy = yz = zz = 0.0
    for k in range(len(rows)):
        i = np.uint64(rows[k])
        dx, dy, dz = points[i, 0] - near_x, points[i, 1] - near_y, points[i, 2] - near_z
        x[k], y[k], z[k] = dx, dy, dz
        mx += dx
        my += dy
        mz += dz
        xx += dx * dx
        xy += dx * dy
        xz += dx * dz
        yy += dy * dy
        yz += dy * dz
        zz += dz * dz
    n = len(rows)
    mx, my, mz = mx / n, my / n, mz / n
    xx, xy, xz = xx - n * mx * mx, xy - n * mx * my, xz - n * mx * mz
    yy, yz, zz = yy - n * my * my, yz - n * my * mz, zz - n * mz * mz
    ax, ay, az = _first_axis(xx, xy, xz, yy, yz, zz)
    away = (
        ax * (near_x + mx - viewpoint[0])
        + ay * (near_y + my - viewpoint[1])
        + az * (near_z + mz - viewpoint[2])
    )
    if away < 0.0:
        ax, ay, az = -ax, -ay, -az
    for k in range(len(rows)):
        along[k] = ax * x[k] + ay * y[k] + az * z[k]
    squares = (
        ax * (ax * xx + 2 * ay * xy) + ay * (ay * yy + 2 * az * yz) + az * (az * zz + 2 * ax * xz)
    )
    return ax * mx + ay * my + az * mz, np.sqrt(max(squares, 0.0) / n)


@kernel
def _first_axis(
    xx: float, xy: float, xz: float, yy: float, yz: float, zz: float
) -> tuple[float, float, float]:
    """Unit eigenvector of the largest eigenvalue of a positive semi-definite matrix.

    The matrix is squared again and again. That squares the ratios of its eigenvalues, so that what
    is left is the largest one's share: every column is a multiple of its eigenvector.
    """
    for _ in range(MOST_SQUARINGS):
        trace = xx + yy + zz
        if not trace > 0.0:
            return 1.0, 0.0, 0.0
        scale = 1.0 / trace
        xx, xy, xz, yy, yz, zz = (
            xx * scale,
            xy * scale,
            xz * scale,
            yy * scale,
            yz * scale,
            zz * scale,
        )
        xx, xy, xz, yy, yz, zz = (
            xx * xx + xy * xy + xz * xz,
            xx * xy + xy * yy + xz * yz,
            xx * xz + xy * yz + xz * zz,
            xy * xy + yy * yy + yz * yz,
            xy * xz + yy * yz + yz * zz,
            xz * xz + yz * yz + zz * zz,
        )
        if xx + yy + zz > 1.0 - 1e-8:  # the others' share was below 1e-8, and is now below 1e-16
            break
    x, y, z = xz, yz, zz
    if xx >= yy and xx >= zz:
        x, y, z = xx, xy, xz
    elif yy >= zz:
        x, y, z = xy, yy, yz
    size = np.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


@kernel
def _nearest_to_mean(
    points: Float64Array, order: IntArray, starts: IntArray, viewpoint: Float64Array
) -> IntArray:
    """For each kernel order[starts[k]:starts[k + 1]], its member nearest to its mean.

    The two members of a kernel of two differ in distance only by rounding. So near ties are decided
    by the distance to the viewpoint, which depends neither on a rotation of the frame nor on the
    order of the points.
    """
    nodes = np.empty(starts.shape[0] - 1, np.int64)
    for k in range(nodes.shape[0]):
        count = starts[k + 1] - starts[k]
        mx = my = mz = 0.0
        for m in range(starts[k], starts[k + 1]):
            mx += points[order[m], 0]
            my += points[order[m], 1]
            mz += points[order[m], 2]
        mx /= count
        my /= count
        mz /= count
        best = np.inf
        best_sight = np.inf
        node = order[starts[k]]
        for m in range(starts[k], starts[k + 1]):
            i = order[m]
            dx = points[i, 0] - mx
            dy = points[i, 1] - my
            dz = points[i, 2] - mz
            square = dx * dx + dy * dy + dz * dz
            if square > best * (1.0 + NEAR_TIE):
                continue
            sx = points[i, 0] - viewpoint[0]
            sy = points[i, 1] - viewpoint[1]
            sz = points[i, 2] - viewpoint[2]
            sight = sx * sx + sy * sy + sz * sz
            nearer = square < best * (1.0 - NEAR_TIE)
            if nearer or sight < best_sight or (sight == best_sight and i < node):
                best = square
                best_sight = sight
                node = i
        nodes[k] = node
    return nodes


@kernel
def _cover(
    points: Float64Array,
    radius_m: float,
    key: IntArray,
    by_cell: IntArray,
    cells: IntArray,
    first: IntArray,
    offsets: IntArray,
) -> IntArray:
    """(n,) number of the ball of each point.

    `key` is the cell of each point, `by_cell` the points sorted by cell, `cells` and `first` the
    occupied cells and their offsets in `by_cell` (CSR), `offsets` the 27 cells around a cell.
    """
    n = points.shape[0]
    ball = np.full(n, -1, np.int64)
    balls = 0
    for i in range(n):
        if ball[i] >= 0:
            continue
        for offset in offsets:
            c = np.searchsorted(cells, key[i] + offset)
            if c == cells.shape[0] or cells[c] != key[i] + offset:
                continue
            for m in range(first[c], first[c + 1]):
                j = by_cell[m]
                if ball[j] >= 0:
                    continue
                dx = points[j, 0] - points[i, 0]
                dy = points[j, 1] - points[i, 1]
                dz = points[j, 2] - points[i, 2]
                if dx * dx + dy * dy + dz * dz <= radius_m * radius_m:
                    ball[j] = balls
        balls += 1
    return ball
