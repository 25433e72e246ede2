"""On which side of a line, and inside which circle, a position lies: filtered, exact, without ties.

Both tests first evaluate a determinant in doubles. Its rounding error is bounded by a share of the
sum of the absolute values of its terms (Shewchuk 1997); where the determinant is larger, its sign
is right. Elsewhere `exact` decides.

Of four positions on one circle, two triangulations are valid. The tie is decreed by a symbolic
perturbation: the last of the four in the order of x, then y, lies outside the circle of the
others. Then exactly one Delaunay triangulation exists, whatever algorithm finds it.
"""

from intervis.delaunay.exact import exact_incircle, exact_turn
from intervis.kernels import kernel

ROUNDING = 2.0**-53
"""Largest relative rounding error of an operation."""

TURN_BOUND = (3.0 + 16.0 * ROUNDING) * ROUNDING
INCIRCLE_BOUND = (10.0 + 96.0 * ROUNDING) * ROUNDING


@kernel
def turn(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Positive if a, b, c turn left (counter-clockwise), negative if right, 0 if collinear."""
    left = (ax - cx) * (by - cy)
    right = (ay - cy) * (bx - cx)
    det = left - right
    if abs(det) >= TURN_BOUND * (abs(left) + abs(right)):
        return det
    return exact_turn(ax, ay, bx, by, cx, cy)


@kernel
def incircle(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> bool:
    """Whether d lies inside the circle through a, b, c, which turn left; ties as decreed."""
    adx, ady = ax - dx, ay - dy
    bdx, bdy = bx - dx, by - dy
    cdx, cdy = cx - dx, cy - dy
    bdx_cdy, cdx_bdy = bdx * cdy, cdx * bdy
    cdx_ady, adx_cdy = cdx * ady, adx * cdy
    adx_bdy, bdx_ady = adx * bdy, bdx * ady
    a_lift, b_lift, c_lift = adx * adx + ady * ady, bdx * bdx + bdy * bdy, cdx * cdx + cdy * cdy
    det = a_lift * (bdx_cdy - cdx_bdy) + b_lift * (cdx_ady - adx_cdy) + c_lift * (adx_bdy - bdx_ady)
    size = (
        a_lift * (abs(bdx_cdy) + abs(cdx_bdy))
        + b_lift * (abs(cdx_ady) + abs(adx_cdy))
        + c_lift * (abs(adx_bdy) + abs(bdx_ady))
    )
    if abs(det) > INCIRCLE_BOUND * size:
        return det > 0.0
    return incircle_by_exact_numbers(ax, ay, bx, by, cx, cy, dx, dy)


@kernel
def incircle_by_exact_numbers(
    ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float
) -> bool:
    """The same without a filter."""
    det = exact_incircle(ax, ay, bx, by, cx, cy, dx, dy)
    if det != 0.0:
        return det > 0.0
    # The determinant's derivative by the squared length of the last of the four decides.
    if not (_before(dx, dy, ax, ay) or _before(dx, dy, bx, by) or _before(dx, dy, cx, cy)):
        return False
    if not (_before(ax, ay, bx, by) or _before(ax, ay, cx, cy)):
        return turn(dx, dy, bx, by, cx, cy) > 0.0
    if _before(bx, by, cx, cy):
        return turn(ax, ay, bx, by, dx, dy) > 0.0
    return turn(ax, ay, dx, dy, cx, cy) > 0.0


@kernel
def _before(ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether a comes before b in the order of x, then y."""
    return ax < bx or (ax == bx and ay < by)
