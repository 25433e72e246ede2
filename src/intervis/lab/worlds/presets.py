"""Presets: scanners by name, each with its usual mount, and the time of a sweep."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from intervis.lab.worlds.beam_pattern import PATTERNS, BeamPattern, fan_ahead, rosette

LIVOX_S = 0.1


@dataclass(frozen=True)
class Preset:
    """A scanner with its usual mount.

    Attributes
    ----------
    name : str
    mount : str
        A name of `intervis.lab.worlds.mounts`.
    period_s : float
        Time between two sweeps.
    sweep_at : function of a float to BeamPattern
        The beams of the sweep that begins at a time in seconds.
    """

    name: str
    mount: str
    period_s: float
    sweep_at: Callable[[float], BeamPattern]


def _preset(name: str, mount: str, make: Callable[[], BeamPattern], period_s: float) -> Preset:
    """A preset whose sweeps are all alike."""
    made = lru_cache(maxsize=1)(make)
    return Preset(name, mount, period_s, lambda time_s: made())


def _livox(time_s: float) -> BeamPattern:
    return rosette(LIVOX_S, start_s=time_s)


USUAL_MOUNTS = {"qt64": "left", "ring": "front", "terrestrial": "tripod"}
"""Of the scanners of the matrix; the others stand on the roof."""

PRESETS: dict[str, Preset] = {
    **{
        name: _preset(
            name, USUAL_MOUNTS.get(name, "roof"), make, 120.0 if name == "terrestrial" else 0.1
        )
        for name, make in PATTERNS.items()
        if name != "livox"
    },
    "at128": _preset("at128", "front", fan_ahead, 0.1),
    "livox": Preset("livox", "front", LIVOX_S, _livox),
}
"""The presets by name."""
