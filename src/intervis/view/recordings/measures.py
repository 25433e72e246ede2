"""The numbers of a judged frame that viewers draw over time."""

import numpy as np

from intervis.sight import Sight
from intervis.view.judged_frame import JudgedFrame

STATES = ("occluded", "visible", "unknown")
"""Names of the states; their places are the class numbers of a recording for Rerun."""


def state_counts(sight: Sight) -> dict[str, int]:
    """How many lines have which state, in the order of `STATES`."""
    return {name: int(getattr(sight, name).sum()) for name in STATES}


def frame_measures(judged: JudgedFrame) -> dict[str, float]:
    """Shares of the states, per cent, and what else changes over the frames; by name.

    ``visible_percent``, ``occluded_percent``, ``unknown_percent`` of the judged returns, or of all
    as a run stored them;
    ``blind_area_m2`` where blind spots were judged; ``TPI`` where the paper's method has a result;
    ``sight_line_K_percent``, the probability of line K, where it has one.
    """
    counts = state_counts(judged.sight)
    total = max(1, sum(counts.values()))
    shares = {name: count / total for name, count in counts.items()}
    if judged.record is not None and judged.record.sight is not None:
        shares = {name: one for name, one in judged.record.sight.items() if np.isfinite(one)}
    found = {f"{name}_percent": 100.0 * share for name, share in shares.items()}
    if judged.grid is not None:
        found["blind_area_m2"] = float(sum(spot.area_m2 for spot in judged.spots))
    if judged.analysis is not None:
        found["TPI"] = judged.analysis.measures.TPI
    for k, line in enumerate(judged.lines, start=1):
        if np.isfinite(line.explanation.probability):
            found[f"sight_line_{k}_percent"] = 100.0 * line.explanation.probability
    return found
