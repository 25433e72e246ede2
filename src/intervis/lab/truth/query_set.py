"""Questions with known answers: what both truths ask, and every method answers."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from intervis.arrays import BoolArray, Float64Array
from intervis.lab.truth.baselines.input_scans import Seen


@dataclass(frozen=True, eq=False)
class Question:
    """Targets to be seen from one viewpoint, the scans that may be used, and the truth.

    Attributes
    ----------
    label : str
        Which pair of frames, or which frame and viewpoint.
    seen : Seen
        What a method may see.
    viewpoint : (3,) float64 array
        World frame, metres.
    targets : (K, 3) float64 array
        World frame, metres.
    visible : (K,) bool array
        The truth.
    parts : dict of str to (K,) bool array
        Kinds of targets that are scored apart as well; may be empty.
    counted : (K,) bool array or None
        Targets that the scores of the whole are about; None for all.
    """

    label: str
    seen: Seen
    viewpoint: Float64Array
    targets: Float64Array
    visible: BoolArray
    parts: dict[str, BoolArray] = field(default_factory=dict)
    counted: BoolArray | None = None


Questions = Iterator[Question]
