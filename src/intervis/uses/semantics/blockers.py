"""What blocks, by class: shares of the occluded lines, as numbers and as a table."""

import numpy as np
from numpy.typing import ArrayLike

from intervis.arrays import array_of
from intervis.errors import PointsError
from intervis.plots.tables import Table


def blocker_shares(classes: ArrayLike) -> dict[str, float]:
    """Share of each class of blocker among the occluded lines, the largest first; they sum to 1.

    Parameters
    ----------
    classes : array of str
        Of `intervis.uses.LabelledScene.blocker_classes`: empty where a line is not occluded.

    Returns
    -------
    dict of str to float
        Empty where no line is occluded.

    Raises
    ------
    PointsError
        They are no texts.

    Examples
    --------
    >>> blocker_shares(["car", "", "building", "car", "car"])
    {'car': 0.75, 'building': 0.25}
    """
    counts = blocker_counts(classes)
    total = sum(counts.values())
    return {name: count / total for name, count in counts.items()}


def blocker_counts(classes: ArrayLike) -> dict[str, int]:
    """Number of the lines that each class occludes, the largest first; see `blocker_shares`."""
    names = array_of(classes, "classes")
    if names.size and names.dtype.kind != "U":
        raise PointsError(f"classes must be names, got an array of {names.dtype}.")
    found, counts = np.unique(names[names != ""], return_counts=True)
    pairs = zip(found.tolist(), counts.tolist(), strict=True)
    return dict(sorted(pairs, key=lambda pair: (-pair[1], pair[0])))


def blocker_table(classes: ArrayLike) -> Table:
    """One row for each class of blocker: how many lines it occludes, and their share."""
    counts, shares = blocker_counts(classes), blocker_shares(classes)
    rows = tuple(
        (name, f"{count:,}", f"{100 * shares[name]:.1f} %") for name, count in counts.items()
    )
    return Table("What occludes", ("class", "lines", "share"), rows)
