"""How right the labels of a second scanner are, in worlds of known triangles.

Two scanners of one car scan each place of `intervis.lab.worlds.places`: the known one level on the
roof with unevenly spaced rows, the other one on its side, tilted by 45 degrees, with coarse rows
(the arrangement of `docs/accuracy.md`). Each scan labels the points of the other one
(`intervis.lab.truth.held_out`); rays cast at the triangles say which labels are right.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from intervis.lab.truth.exact_world import exact_labels
from intervis.lab.truth.held_out import held_out_labels, rule_for_scanner
from intervis.lab.truth.scores import matthews, mean_or_nan
from intervis.lab.worlds.beam_pattern import PATTERNS, PatternScan
from intervis.lab.worlds.places import PLACES, Place
from intervis.plots.tables import Table
from intervis.transform import rigid, transform

ROOF_M = 1.9
"""Height of the level scanner above the ground."""
SIDE_ROLL_PITCH_YAW_DEG, SIDE_M = (-4.2, 45.2, 92.1), (-0.01, 0.58, -0.39)
"""Pose of the tilted scanner in the frame of the level one."""


@dataclass(frozen=True)
class LabelCheck:
    """Labels of one world, reference scanner and rule.

    Attributes
    ----------
    world, reference : str
    surrounded : bool
        The rule, see `intervis.lab.truth.held_out.LabelRule`.
    labels, occluded : int
        Number of labels, and of those "occluded".
    visible_right, occluded_right : float
        Fraction of the labels that the triangles confirm; NaN without labels.
    mcc : float
        Matthews correlation of the labels with the exact answers: what a method without any error
        would score.
    """

    world: str
    reference: str
    surrounded: bool
    labels: int
    occluded: int
    visible_right: float
    occluded_right: float
    mcc: float


def check_labels(*, seed: int = 0) -> Iterator[LabelCheck]:
    """Check both rules in each world, with either scanner as the reference."""
    side = rigid(
        Rotation.from_euler("xyz", SIDE_ROLL_PITCH_YAW_DEG, degrees=True).as_matrix(), SIDE_M
    )
    for number, (world, make) in enumerate(PLACES.items()):
        place, rng = make(seed), np.random.default_rng([seed, number])
        site = place.sites[rng.integers(len(place.sites))]
        yaw = Rotation.from_euler("z", rng.uniform(0, 2 * np.pi)).as_matrix()
        roof_pose = rigid(yaw, place.ground(site[None])[0] + [0.0, 0.0, ROOF_M])
        roof = PATTERNS["pandar64"]().scan(place.caster, roof_pose, rng)
        tilted = PATTERNS["qt64"]().scan(place.caster, roof_pose @ side, rng)
        for surrounded in (False, True):
            yield _checked(world, place, roof, tilted, "tilted, coarse", surrounded)
            yield _checked(world, place, tilted, roof, "level, dense", surrounded)


def _checked(
    world: str, place: Place, known: PatternScan, other: PatternScan, name: str, surrounded: bool
) -> LabelCheck:
    rule = rule_for_scanner(other.points, surrounded=surrounded)
    labels = held_out_labels(known.points, known.pose, other.points, other.pose, rule)
    targets = transform(known.pose, known.points[labels.index].astype(np.float64))
    viewpoints = np.tile(other.pose[:3, 3], (len(targets), 1))
    every = np.ones(len(targets), np.bool_)
    visible, occluded = exact_labels(place.caster, viewpoints, targets, every)
    exact = visible | occluded
    said_visible, visible = labels.visible[exact], visible[exact]
    return LabelCheck(
        world,
        name,
        surrounded,
        len(said_visible),
        int((~said_visible).sum()),
        mean_or_nan(visible[said_visible]),
        mean_or_nan(~visible[~said_visible]),
        matthews(said_visible, visible),
    )


def label_table(checks: list[LabelCheck]) -> Table:
    """One row a check."""
    heads = (
        *("world", "reference", "occluded by", "labels", "occluded"),
        *("visible right", "occluded right", "MCC of the exact answers"),
    )
    rows = tuple(
        (
            check.world,
            check.reference,
            "surrounding returns" if check.surrounded else "any nearer returns",
            f"{check.labels:,}",
            f"{check.occluded:,}",
            *(
                "-" if np.isnan(value) else f"{value:.3f}"
                for value in (check.visible_right, check.occluded_right, check.mcc)
            ),
        )
        for check in checks
    )
    return Table("Labels of a second scanner against exact worlds", heads, rows)
