"""A monotone substitute for the azimuth angle that needs no arc tangent."""

from intervis.kernels import kernel

FULL_CIRCLE = 8.0
"""`pseudo_azimuth` of a full turn."""


@kernel
def pseudo_azimuth(x: float, y: float) -> float:
    """Azimuth as a number from 0 (x axis) to 8, one unit per octant, monotone in the angle.

    Within an octant it is linear in the angle to 0.1 degrees. Range images are written and read
    with the same function, so the error only makes some columns a few percent wider than others.
    """
    ax = abs(x)
    ay = abs(y)
    most = max(ax, ay)
    m = min(ax, ay) / (most if most > 0.0 else 1.0)
    u = m * (1.3147 - m * (0.2343 + 0.0804 * m))
    u = u if ay <= ax else 2.0 - u
    u = u if x >= 0.0 else 4.0 - u
    return u if y >= 0.0 else 8.0 - u
