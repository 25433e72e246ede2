"""Baselines: established visibility methods for point clouds, each at several settings.

The modules share one signature, ``predict(inputs, viewpoint, targets, **settings)``:

inputs : InputScans
    The scans that the method gets.
viewpoint : (3,) float64 array
    World frame, z up, metres.
targets : (M, 3) float64 array
    World frame, metres.

It returns the (M,) float64 probability of being visible. Most baselines are binary and return 1
or 0; none has a state "unknown". Each ``predict`` documents its own settings only.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

from intervis.arrays import Float64Array
from intervis.lab.truth.baselines import depth_buffer, hidden_points, horizon, triangulated, voxels
from intervis.lab.truth.baselines.input_scans import InputScans as InputScans

Predict = Callable[[InputScans, Float64Array, Float64Array], Float64Array]
"""``predict(inputs, viewpoint, targets)`` with fixed settings."""


@dataclass(frozen=True)
class Baseline:
    """A method and the settings at which it is evaluated.

    Attributes
    ----------
    name : str
    settings : dict of str to Predict
        By the name of the setting.
    """

    name: str
    settings: dict[str, Predict]


def all_baselines(*, several_scans: bool) -> list[Baseline]:
    """All baselines with all their settings.

    Parameters
    ----------
    several_scans : bool
        Whether the inputs hold more than one scan. Then the triangulated surfaces vote, and hidden
        point removal, whose convex hull gets slow, runs at one setting and on fewer scans.

    Examples
    --------
    >>> [baseline.name for baseline in all_baselines(several_scans=False)][:2]
    ['hidden point removal', 'depth buffer']
    """
    return [
        _hidden_point_removal((1000.0,) if several_scans else (30.0, 100.0, 300.0, 1000.0, 1e4)),
        _depth_buffer(),
        _voxels(),
        _horizon(),
        _triangulated((1, 2, 3) if several_scans else (1,)),
    ]


def _hidden_point_removal(factors: tuple[float, ...]) -> Baseline:
    return Baseline(
        "hidden point removal",
        {
            f"radius {factor:g} x farthest": partial(
                hidden_points.predict, radius_factor=factor, each_side=1
            )
            for factor in factors
        },
    )


def _depth_buffer() -> Baseline:
    cells = ((0.2, 0.4), (0.3, 0.6), (0.5, 0.5), (1.0, 1.0))
    tolerances = ((0.3, 0.02), (1.0, 0.02))
    return Baseline(
        "depth buffer",
        {
            f"{azimuth:g} x {elevation:g} deg, {tolerance:g} m + {fraction:.0%}": partial(
                depth_buffer.predict,
                azimuth_deg=azimuth,
                elevation_deg=elevation,
                tolerance_m=tolerance,
                tolerance_fraction=fraction,
            )
            for (azimuth, elevation), (tolerance, fraction) in product(cells, tolerances)
        },
    )


def _voxels() -> Baseline:
    return Baseline(
        "occupancy voxels",
        {
            f"{edge:g} m, {tolerance:g} voxels free": partial(
                voxels.predict, voxel_m=edge, tolerance_voxels=tolerance
            )
            for edge, tolerance in product((0.2, 0.3, 0.5), (2.0, 5.0))
        },
    )


def _horizon() -> Baseline:
    tolerances = ((0.0, 0.0), (0.3, 0.02), (1.0, 0.02))
    return Baseline(
        "2.5-D horizon",
        {
            f"{azimuth:g} deg, {tolerance:g} m + {fraction:.0%}": partial(
                horizon.predict,
                azimuth_deg=azimuth,
                tolerance_m=tolerance,
                tolerance_fraction=fraction,
            )
            for azimuth, (tolerance, fraction) in product((0.2, 0.5), tolerances)
        },
    )


def _triangulated(votes: tuple[int, ...]) -> Baseline:
    def setting(jump: float, needed: int) -> Predict:
        return partial(
            triangulated.predict,
            jump_fraction=jump,
            tolerance_m=0.5,
            tolerance_fraction=0.02,
            votes=needed,
        )

    return Baseline(
        "triangulated scan",
        {
            f"jumps over {jump:.0%} cut" + (f", {needed} vote(s)" if votes != (1,) else ""): (
                setting(jump, needed)
            )
            for jump, needed in product((0.2, 0.4, 0.6, 1.0), votes)
        },
    )
