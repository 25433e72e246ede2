"""The answers for many sight lines, as a user reads them: states, probabilities, blockers."""

from __future__ import annotations  # help() shows the names of the array types

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arguments import shown
from intervis.arrays import BoolArray, Float64Array
from intervis.result_table import result_table, share
from intervis.sight.answers import OCCLUDED, UNKNOWN, VISIBLE


@dataclass(frozen=True, eq=False, repr=False)
class Sight:
    """Answers for sight lines. Every array has the shape of the lines, (M,) or (N, M).

    ``len(sight)`` is the length of the first axis, and iteration runs along it; ``sight[key]``
    indexes all arrays alike. A Sight has no truth value.

    Attributes
    ----------
    state : int8 array
        1 visible, 0 occluded, -1 unknown (see `intervis.sight.occupancy_model`). Use the masks
        `visible`, `occluded` and `unknown` in conditions: -1 is truthy.
    probability : float64 array
        P(visible); ``docs/accuracy.md`` states where it is calibrated. NaN if an end of the line is
        not finite or the line is longer than `max_range_m`.
    blocker : (..., 3) float64 array
        Where an occluded line meets the surface that most likely occludes it, scene frame, metres;
        NaN for other states. It does not depend on which end is the viewpoint.
    clearance : float64 array
        Metres. Of a line that is not occluded: the smallest distance between its samples in free
        space and the surface behind them, along the beam of a scan, or their height above ground
        if that is smaller; inf if nothing was observed beside the line. Of an occluded line: minus
        the shift, up, down or sideways, that would clear the occluding surface.
    observed : float64 array
        Share of the line's length that some beam crossed or ended in, 0 to 1; 0.4 m at either end
        do not count. NaN where `probability` is.

    Examples
    --------
    >>> sight = Sight(np.array([1, -1, 1], np.int8), np.array([0.9, 0.5, 0.97]),
    ...               np.full((3, 3), np.nan), np.array([0.4, np.inf, 1.2]), np.ones(3))
    >>> sight
    <Sight: 3 lines, 2 visible, 0 occluded, 1 unknown>
    >>> sight[sight.visible].probability
    array([0.9 , 0.97])
    """

    state: NDArray[np.int8]
    probability: Float64Array
    blocker: Float64Array
    clearance: Float64Array
    observed: Float64Array

    @property
    def visible(self) -> BoolArray:
        """Mask of the visible lines."""
        return np.asarray(self.state == VISIBLE)

    @property
    def occluded(self) -> BoolArray:
        """Mask of the occluded lines."""
        return np.asarray(self.state == OCCLUDED)

    @property
    def unknown(self) -> BoolArray:
        """Mask of the unknown lines."""
        return np.asarray(self.state == UNKNOWN)

    def __len__(self) -> int:
        return len(self._lines())

    def __iter__(self) -> Iterator[Sight]:
        return (self[nth] for nth in range(len(self)))

    def __bool__(self) -> bool:
        raise TypeError("a Sight has no truth value: use its masks visible, occluded and unknown.")

    def __getitem__(self, key: Any) -> Sight:
        # One index for the lines, so that no key reaches the coordinates of `blocker`.
        try:
            at = np.arange(self.state.size).reshape(self.state.shape)[key]
        except (IndexError, OverflowError, ValueError):
            lines = " x ".join(map(str, self.state.shape))
            raise IndexError(f"a Sight of {lines} lines has none at {shown(key)}.") from None
        return Sight(
            np.asarray(self.state.reshape(-1)[at]),
            np.asarray(self.probability.reshape(-1)[at]),
            np.asarray(self.blocker.reshape(-1, 3)[at]),
            np.asarray(self.clearance.reshape(-1)[at]),
            np.asarray(self.observed.reshape(-1)[at]),
        )

    def _lines(self) -> NDArray[np.int8]:
        if self.state.ndim == 0:
            raise TypeError("this Sight is the answer of one line: it has no length or order.")
        return self.state

    def _repr_html_(self) -> str:
        """The counts of the states, as a notebook shows them."""
        masks = {"visible": self.visible, "occluded": self.occluded, "unknown": self.unknown}
        counts = {name: share(int(mask.sum()), self.state.size) for name, mask in masks.items()}
        return result_table(f"{self.state.size:,} sight lines", counts)

    def __repr__(self) -> str:
        counts = (("visible", self.visible), ("occluded", self.occluded), ("unknown", self.unknown))
        lines = " x ".join(f"{length:,}" for length in self.state.shape) or "1"
        parts = [f"{np.count_nonzero(mask):,} {name}" for name, mask in counts]
        return f"<Sight: {lines} line{'' if lines == '1' else 's'}, {', '.join(parts)}>"
