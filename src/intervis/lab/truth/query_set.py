"""Query sets: targets with known labels, seen from one viewpoint."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.truth.baselines.input_scans import InputScans


@dataclass(frozen=True, eq=False)
class QuerySet:
    """Targets seen from one viewpoint, their labels, and the scans that a method gets.

    Attributes
    ----------
    label : str
        Names the pair of frames, or the frame and the viewpoint.
    inputs : InputScans
        The scans that a method gets.
    viewpoint : (3,) float64 array
        World frame, metres.
    targets : (K, 3) float64 array
        World frame, metres.
    visible : (K,) bool array
        Ground truth.
    subsets : dict of str to (K,) bool array
        Subsets of the targets that are also scored separately; may be empty.
    overall : (K,) bool array or None
        Targets that the overall scores include; None for all.
    """

    label: str
    inputs: InputScans
    viewpoint: Float64Array
    targets: Float64Array
    visible: BoolArray
    subsets: dict[str, BoolArray] = field(default_factory=dict)
    overall: BoolArray | None = None


QuerySets = Iterator[QuerySet]
