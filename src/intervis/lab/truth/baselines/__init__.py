"""Today's tools for visibility in point clouds, at several settings each, behind one signature.

Every rival answers yes or no (some with a rank): it never says "unknown".
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import product

from intervis.arrays import Float64Array
from intervis.lab.truth.baselines import depth_buffer, hidden_points, horizon, triangulated, voxels
from intervis.lab.truth.baselines.input_scans import Seen as Seen

Answer = Callable[[Seen, Float64Array, Float64Array], Float64Array]
"""``answer(seen, viewpoint, targets)``: probability (M,) of being visible, world frame."""


@dataclass(frozen=True)
class Rival:
    """A tool, and the settings at which it is tried.

    Attributes
    ----------
    name : str
    settings : mapping of str to callable
        An `Answer` by the setting's name.
    """

    name: str
    settings: dict[str, Answer] = field(default_factory=dict)


def rivals(*, several_scans: bool) -> list[Rival]:
    """All rivals with all their settings.

    Parameters
    ----------
    several_scans : bool
        Whether there is more than one scan to see: then surfaces can vote, and hidden point
        removal, whose hull grows dear, is tried at fewer settings and on fewer scans.

    Examples
    --------
    >>> [rival.name for rival in rivals(several_scans=False)][:2]
    ['hidden point removal', 'depth buffer']
    """
    return [
        _hidden_point_removal((1000.0,) if several_scans else (30.0, 100.0, 300.0, 1000.0, 1e4)),
        _depth_buffer(),
        _voxels(),
        _horizon(),
        _triangulated((1, 2, 3) if several_scans else (1,)),
    ]


def _hidden_point_removal(factors: tuple[float, ...]) -> Rival:
    return Rival(
        "hidden point removal",
        {
            f"radius {factor:g} x farthest": partial(
                hidden_points.answer, radius_factor=factor, each_side=1
            )
            for factor in factors
        },
    )


def _depth_buffer() -> Rival:
    cells = ((0.2, 0.4), (0.3, 0.6), (0.5, 0.5), (1.0, 1.0))
    slacks = ((0.3, 0.02), (1.0, 0.02))
    return Rival(
        "depth buffer",
        {
            f"{azimuth:g} x {elevation:g} deg, {slack:g} m + {share:.0%}": partial(
                depth_buffer.answer,
                azimuth_deg=azimuth,
                elevation_deg=elevation,
                slack_m=slack,
                slack_share=share,
            )
            for (azimuth, elevation), (slack, share) in product(cells, slacks)
        },
    )


def _voxels() -> Rival:
    return Rival(
        "occupancy voxels",
        {
            f"{edge:g} m, {slack:g} voxels free": partial(
                voxels.answer, voxel_m=edge, slack_voxels=slack
            )
            for edge, slack in product((0.2, 0.3, 0.5), (2.0, 5.0))
        },
    )


def _horizon() -> Rival:
    slacks = ((0.0, 0.0), (0.3, 0.02), (1.0, 0.02))
    return Rival(
        "2.5-D horizon",
        {
            f"{azimuth:g} deg, {slack:g} m + {share:.0%}": partial(
                horizon.answer, azimuth_deg=azimuth, slack_m=slack, slack_share=share
            )
            for azimuth, (slack, share) in product((0.2, 0.5), slacks)
        },
    )


def _triangulated(votes: tuple[int, ...]) -> Rival:
    def setting(jump: float, needed: int) -> Answer:
        return partial(
            triangulated.answer, jump_share=jump, slack_m=0.5, slack_share=0.02, votes=needed
        )

    return Rival(
        "triangulated scan",
        {
            f"jumps over {jump:.0%} cut" + (f", {needed} vote(s)" if votes != (1,) else ""): (
                setting(jump, needed)
            )
            for jump, needed in product((0.2, 0.4, 0.6, 1.0), votes)
        },
    )
