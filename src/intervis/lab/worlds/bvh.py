"""A bounding volume hierarchy over triangles, and how rays walk down it.

The tree is built with the binned surface area heuristic (Wald 2007, doi:10.1109/RT.2007.4342588):
of eleven possible cuts along each axis the one is taken for which (area times triangles) of the two
sides is least. Triangles are tested as Moeller and Trumbore do (1997,
doi:10.1080/10867651.1997.10487468), all in float64.
"""

import numpy as np

from intervis.arrays import BoolArray, Float64Array, IntArray
from intervis.kernels import kernel

BINS = 12
LEAF_TRIANGLES = 4
BOX_COST = 2.0
"""Testing two boxes, in tests of one triangle."""
DEEPEST_CUT = 40
"""Below this depth nodes are halved by count, so that 64 levels hold any soup."""
STACK = 80
EDGE_SLACK = 1e-12
"""Barycentric slack: a ray at the common edge of two triangles slips through neither."""
FAR_SLACK = 1.0 + 1e-14
"""Rounding of the slab test must not lose a box that the ray just touches."""
LEAST_COMPONENT = 1e-300


@kernel
def _bounds_of(
    lower: Float64Array,
    upper: Float64Array,
    order: IntArray,
    first: int,
    count: int,
    out: Float64Array,
) -> None:
    for axis in range(3):
        low, high = np.inf, -np.inf
        for place in range(first, first + count):
            low = min(low, lower[order[place], axis])
            high = max(high, upper[order[place], axis])
        out[axis] = low
        out[3 + axis] = high


@kernel
def _half_area(box: Float64Array) -> float:
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    area: float = x * y + y * z + z * x
    return area


@kernel
def _grow(box: Float64Array, other: Float64Array) -> None:
    for axis in range(3):
        box[axis] = min(box[axis], other[axis])
        box[3 + axis] = max(box[3 + axis], other[3 + axis])


@kernel
def _clear(box: Float64Array) -> None:
    for axis in range(3):
        box[axis] = np.inf
        box[3 + axis] = -np.inf


@kernel
def _best_cut(
    lower: Float64Array,
    upper: Float64Array,
    order: IntArray,
    first: int,
    count: int,
    axis: int,
    low: float,
    width: float,
) -> tuple[float, int]:
    """The cheapest cut along an axis: its cost, and after which bin it lies."""
    boxes = np.empty((BINS, 6))
    numbers = np.zeros(BINS, np.int64)
    for bin_ in range(BINS):
        _clear(boxes[bin_])
    for place in range(first, first + count):
        item = order[place]
        centre = 0.5 * (lower[item, axis] + upper[item, axis])
        bin_ = min(BINS - 1, int((centre - low) / width * BINS))
        numbers[bin_] += 1
        for side in range(3):
            boxes[bin_, side] = min(boxes[bin_, side], lower[item, side])
            boxes[bin_, 3 + side] = max(boxes[bin_, 3 + side], upper[item, side])
    right_costs = np.empty(BINS)
    sweep = np.empty(6)
    _clear(sweep)
    number = 0
    for bin_ in range(BINS - 1, 0, -1):
        if numbers[bin_] > 0:
            _grow(sweep, boxes[bin_])
            number += numbers[bin_]
        right_costs[bin_] = _half_area(sweep) * number if number > 0 else np.inf
    _clear(sweep)
    number = 0
    best_cost, best_bin = np.inf, -1
    for bin_ in range(BINS - 1):
        if numbers[bin_] > 0:
            _grow(sweep, boxes[bin_])
            number += numbers[bin_]
        if number == 0:
            continue
        cost = _half_area(sweep) * number + right_costs[bin_ + 1]
        if cost < best_cost:
            best_cost, best_bin = cost, bin_
    return best_cost, best_bin


@kernel
def _partition(
    lower: Float64Array,
    upper: Float64Array,
    order: IntArray,
    first: int,
    count: int,
    axis: int,
    low: float,
    width: float,
    cut: int,
) -> int:
    """Bring the items of the bins up to `cut` to the front; how many they are."""
    left, right = first, first + count - 1
    while left <= right:
        item = order[left]
        centre = 0.5 * (lower[item, axis] + upper[item, axis])
        if min(BINS - 1, int((centre - low) / width * BINS)) <= cut:
            left += 1
        else:
            order[left] = order[right]
            order[right] = item
            right -= 1
    return left - first


@kernel
def _split(
    lower: Float64Array,
    upper: Float64Array,
    order: IntArray,
    first: int,
    count: int,
    depth: int,
    box: Float64Array,
) -> int:
    """How many of a node's items go to its left child; 0 when it had better be a leaf."""
    if count <= 1:
        return 0
    best_cost, best_axis, best_bin, best_low, best_width = np.inf, -1, -1, 0.0, 0.0
    if depth < DEEPEST_CUT:
        for axis in range(3):
            low, high = np.inf, -np.inf
            for place in range(first, first + count):
                item = order[place]
                centre = 0.5 * (lower[item, axis] + upper[item, axis])
                low, high = min(low, centre), max(high, centre)
            if not high - low > 1e-12 * max(1.0, abs(low)):
                continue
            cost, bin_ = _best_cut(lower, upper, order, first, count, axis, low, high - low)
            if cost < best_cost:
                best_cost, best_axis, best_bin = cost, axis, bin_
                best_low, best_width = low, high - low
    if (
        count <= LEAF_TRIANGLES
        and not best_cost + BOX_COST * _half_area(box) < _half_area(box) * count
    ):
        return 0
    if best_axis >= 0:
        number = _partition(
            lower, upper, order, first, count, best_axis, best_low, best_width, best_bin
        )
        if 0 < number < count:
            return number
    return count // 2


@kernel
def build(
    lower: Float64Array, upper: Float64Array, order: IntArray, boxes: Float64Array, links: IntArray
) -> int:
    """Fill the tree; how many nodes it has.

    Parameters
    ----------
    lower, upper : (T, 3) float64 arrays
        Bounds of each triangle.
    order : (T,) int64 array
        In: 0, 1, 2 ...; out: the triangles in the order of the leaves.
    boxes : (2 T, 6) float64 array
        Out: lower and upper corner of each node.
    links : (2 T, 2) int64 array
        Out: for a leaf (first place in `order`, number of triangles); for an inner node (left
        child, 0), its right child being the next node.
    """
    total = order.shape[0]
    depths = np.zeros(2 * total, np.int64)
    links[0, 0], links[0, 1] = 0, total
    used, node = 1, 0
    while node < used:
        first, count = links[node, 0], links[node, 1]
        _bounds_of(lower, upper, order, first, count, boxes[node])
        number = _split(lower, upper, order, first, count, depths[node], boxes[node])
        if number > 0:
            links[used, 0], links[used, 1] = first, number
            links[used + 1, 0], links[used + 1, 1] = first + number, count - number
            depths[used] = depths[used + 1] = depths[node] + 1
            links[node, 0], links[node, 1] = used, 0
            used += 2
        node += 1
    return used


@kernel
def _entry(
    boxes: Float64Array,
    node: int,
    ox: float,
    oy: float,
    oz: float,
    ix: float,
    iy: float,
    iz: float,
    sx: int,
    sy: int,
    sz: int,
    nearest: float,
    farthest: float,
) -> float:
    """Where a ray enters a node's box, infinity when it misses it."""
    near = max((boxes[node, sx] - ox) * ix, (boxes[node, sy + 1] - oy) * iy)
    near = max(max(near, (boxes[node, sz + 2] - oz) * iz), nearest)
    far = min((boxes[node, 3 - sx] - ox) * ix, (boxes[node, 4 - sy] - oy) * iy)
    far = min(min(far, (boxes[node, 5 - sz] - oz) * iz) * FAR_SLACK, farthest)
    return near if near <= far else np.inf


@kernel
def crossing(
    corners: Float64Array,
    place: int,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
) -> float:
    """Where along a ray it crosses a triangle (corner, edge, edge), infinity when it does not."""
    ax, ay, az = corners[place, 3], corners[place, 4], corners[place, 5]
    bx, by, bz = corners[place, 6], corners[place, 7], corners[place, 8]
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    determinant = ax * px + ay * py + az * pz
    if determinant == 0.0:
        return np.inf
    scale = 1.0 / determinant
    tx, ty, tz = ox - corners[place, 0], oy - corners[place, 1], oz - corners[place, 2]
    u = (tx * px + ty * py + tz * pz) * scale
    if not (-EDGE_SLACK <= u <= 1.0 + EDGE_SLACK):
        return np.inf
    qx, qy, qz = ty * az - tz * ay, tz * ax - tx * az, tx * ay - ty * ax
    v = (dx * qx + dy * qy + dz * qz) * scale
    if not (v >= -EDGE_SLACK and u + v <= 1.0 + EDGE_SLACK):
        return np.inf
    distance: float = (bx * qx + by * qy + bz * qz) * scale
    return distance


@kernel
def _walk(
    boxes: Float64Array,
    links: IntArray,
    corners: Float64Array,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    nearest: float,
    farthest: float,
    first: bool,
    nodes: IntArray,
    entries: Float64Array,
) -> tuple[int, float]:
    """Nearest (or, with `first`, any) crossing in [nearest, farthest): its place, its distance."""
    dx = dx if dx != 0.0 else LEAST_COMPONENT
    dy = dy if dy != 0.0 else LEAST_COMPONENT
    dz = dz if dz != 0.0 else LEAST_COMPONENT
    ix, iy, iz = 1.0 / dx, 1.0 / dy, 1.0 / dz
    sx = 0 if dx > 0.0 else 3
    sy = 0 if dy > 0.0 else 3
    sz = 0 if dz > 0.0 else 3
    best = -1
    if _entry(boxes, 0, ox, oy, oz, ix, iy, iz, sx, sy, sz, nearest, farthest) == np.inf:
        return best, farthest
    depth, node = 0, 0
    while True:
        if links[node, 1] > 0:
            for place in range(links[node, 0], links[node, 0] + links[node, 1]):
                distance = crossing(corners, place, ox, oy, oz, dx, dy, dz)
                if nearest <= distance < farthest:
                    best, farthest = place, distance
                    if first:
                        return best, farthest
        else:
            left = links[node, 0]
            one = _entry(boxes, left, ox, oy, oz, ix, iy, iz, sx, sy, sz, nearest, farthest)
            two = _entry(boxes, left + 1, ox, oy, oz, ix, iy, iz, sx, sy, sz, nearest, farthest)
            closer = left if one <= two else left + 1
            if max(one, two) != np.inf:
                nodes[depth] = 2 * left + 1 - closer
                entries[depth] = max(one, two)
                depth += 1
            if min(one, two) != np.inf:
                node = closer
                continue
        while True:
            if depth == 0:
                return best, farthest
            depth -= 1
            if entries[depth] < farthest:
                node = nodes[depth]
                break


@kernel
def closest(
    boxes: Float64Array,
    links: IntArray,
    corners: Float64Array,
    order: IntArray,
    origins: Float64Array,
    directions: Float64Array,
    shift: int,
    ranges: Float64Array,
    hits: IntArray,
    start: int,
    stop: int,
) -> None:
    """Shorten `ranges` and set `hits` (plus `shift`) wherever a ray meets a nearer triangle."""
    nodes, entries = np.empty(STACK, np.int64), np.empty(STACK)
    for ray in range(start, stop):
        place, distance = _walk(
            boxes, links, corners,
            origins[ray, 0], origins[ray, 1], origins[ray, 2],
            directions[ray, 0], directions[ray, 1], directions[ray, 2],
            0.0, ranges[ray], False, nodes, entries,
        )  # fmt: skip
        if place >= 0:
            ranges[ray] = distance
            hits[ray] = order[place] + shift


@kernel
def blocked(
    boxes: Float64Array,
    links: IntArray,
    corners: Float64Array,
    origins: Float64Array,
    directions: Float64Array,
    nearest: Float64Array,
    farthest: Float64Array,
    out: BoolArray,
    start: int,
    stop: int,
) -> None:
    """Set `out` wherever anything lies on a ray between `nearest` and `farthest`."""
    nodes, entries = np.empty(STACK, np.int64), np.empty(STACK)
    for ray in range(start, stop):
        if out[ray]:
            continue
        place, _ = _walk(
            boxes, links, corners,
            origins[ray, 0], origins[ray, 1], origins[ray, 2],
            directions[ray, 0], directions[ray, 1], directions[ray, 2],
            nearest[ray], farthest[ray], True, nodes, entries,
        )  # fmt: skip
        out[ray] = place >= 0


def built(triangles: Float64Array) -> tuple[Float64Array, IntArray, Float64Array, IntArray]:
    """Boxes, links, corners (corner, edge, edge; in leaf order) and order of a soup's tree."""
    total = len(triangles)
    lower, upper = triangles.min(axis=1), triangles.max(axis=1)
    order = np.arange(total, dtype=np.int64)
    boxes = np.empty((max(1, 2 * total), 6))
    links = np.empty((max(1, 2 * total), 2), np.int64)
    used = build(lower, upper, order, boxes, links)
    corners = np.empty((total, 9))
    corners[:, :3] = triangles[order, 0]
    corners[:, 3:6] = triangles[order, 1] - triangles[order, 0]
    corners[:, 6:] = triangles[order, 2] - triangles[order, 0]
    return boxes[:used].copy(), links[:used].copy(), corners, order
