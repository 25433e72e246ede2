"""What the value of a pixel of a range image (int16) says about its direction.

The planar range in units is that of

    > 0         a surface
    < 0, even   minus: a volumetric return
    < 0, odd    minus: the surface that a dropout interrupts
    0           nothing: no beam, or a beam without a return

A dropout is a beam without a return between two returns of one surface.
"""

from typing import Any

import numpy as np

from intervis.kernels import kernel


@kernel
def is_dropout(value: int | np.integer[Any]) -> bool:
    """Whether the direction has no return, but returns of one surface below and above."""
    return bool((value < 0) & ((value & 1) == 1))


@kernel
def is_observed(value: int | np.integer[Any]) -> bool:
    """Whether the direction has a return."""
    return bool((value > 0) | ((value < 0) & ((value & 1) == 0)))
