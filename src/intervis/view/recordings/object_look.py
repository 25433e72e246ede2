"""How labelled objects are coloured and named in a recording."""

import numpy as np

from intervis.uses.objects import HALF, ObjectSight


def state_of_object(one: ObjectSight) -> str:
    """What at least half of an object is, as the page colours it; unknown otherwise."""
    if one.visible >= HALF:
        return "visible"
    return "occluded" if one.occluded >= HALF else "unknown"


def object_label(one: ObjectSight) -> str:
    """Category and visible share of an object."""
    share = "" if np.isnan(one.visible) else f", {100 * one.visible:.0f} % visible"
    return f"{one.box.category}{share}"
