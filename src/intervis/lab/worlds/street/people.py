"""Pedestrians and cyclists."""

import numpy as np
from scipy.spatial.transform import Rotation

from intervis.arrays import Float64Array
from intervis.lab.worlds import shapes
from intervis.lab.worlds.triangles import Material, Triangles
from intervis.transform import rigid, transform

SKIN = ((0.52, 0.34, 0.25), (0.62, 0.42, 0.32), (0.28, 0.17, 0.11), (0.42, 0.27, 0.18))
CLOTHES = (
    (0.05, 0.07, 0.16), (0.35, 0.05, 0.05), (0.10, 0.10, 0.11), (0.55, 0.53, 0.48),
    (0.10, 0.24, 0.16), (0.50, 0.33, 0.06), (0.16, 0.26, 0.42), (0.30, 0.28, 0.25),
)  # fmt: skip
HAIR = ((0.04, 0.03, 0.02), (0.16, 0.09, 0.04), (0.35, 0.27, 0.14), (0.3, 0.3, 0.3))


def _limb(top: Float64Array, foot: Float64Array, thick_m: float, thin_m: float) -> Float64Array:
    """A tapered tube between two points."""
    way = top - foot
    length = float(np.linalg.norm(way))
    up = way / length
    side = np.cross(up, [0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    rotation = np.stack([side, np.cross(up, side), up], axis=1)
    tube = shapes.tube([thin_m, thick_m], [0.0, length], 6)
    return transform(rigid(rotation, foot), tube)


def person(
    rng: np.random.Generator, height_m: float | None = None, stride: float = 0.3
) -> Triangles:
    """A person on the ground at the origin, facing x.

    Parameters
    ----------
    rng : numpy Generator
        Selects height, clothes, skin and hair.
    height_m : float, optional
        Instead of a random one.
    stride : float
        Distance between the feet along x, metres.
    """
    tall = float(rng.uniform(1.58, 1.86)) if height_m is None else height_m
    cloth = [Material("person", CLOTHES[int(k)], 0.38) for k in rng.integers(len(CLOTHES), size=2)]
    skin = Material("person", SKIN[int(rng.integers(len(SKIN)))], 0.42)
    hair = Material("person", HAIR[int(rng.integers(len(HAIR)))], 0.3)
    hip, shoulder = 0.5 * tall, 0.81 * tall
    torso = shapes.tube(
        [0.10, 0.125, 0.115, 0.15, 0.145, 0.07],
        [hip - 0.06, hip + 0.04, hip + 0.2, shoulder - 0.12, shoulder - 0.02, shoulder + 0.05],
        10,
    ) * [0.85, 1.3, 1.0]
    legs, shoes, arms, hands = [], [], [], []
    for side in (1, -1):
        foot = np.array([side * stride / 2, side * 0.09, 0.06])
        legs.append(_limb(np.array([0.0, side * 0.085, hip + 0.02]), foot, 0.088, 0.05))
        shoes.append(shapes.box([-0.07, -0.045, -0.06], [0.17, 0.045, 0.03]) + foot)
        hand = np.array([-side * stride * 0.55, side * 0.25, hip - 0.02])
        arms.append(_limb(np.array([0.0, side * 0.19, shoulder - 0.03]), hand, 0.056, 0.036))
        hands.append(shapes.ellipsoid([0.045, 0.03, 0.07], 4, 6) + hand)
    head = np.array([0.02, 0.0, tall - 0.115])
    neck = shapes.tube([0.055, 0.05], [shoulder, tall - 0.2], 6, closed=False)
    return Triangles.joined(
        [
            Triangles.of(np.concatenate(legs), cloth[0]),
            Triangles.of(np.concatenate([torso, *arms]), cloth[1]),
            Triangles.of(np.concatenate([neck, *hands]), skin),
            Triangles.of(shapes.ellipsoid([0.095, 0.078, 0.115], 6, 9) + head, skin),
            Triangles.of(
                shapes.ellipsoid([0.10, 0.085, 0.10], 6, 9) + head + [-0.025, 0, 0.03], hair
            ),
            Triangles.of(np.concatenate(shoes), Material("person", (0.04, 0.035, 0.03), 0.1)),
        ]
    )


def cyclist(rng: np.random.Generator) -> Triangles:
    """A cyclist riding along x, wheels on the ground at the origin."""
    frame = Material("person", CLOTHES[int(rng.integers(len(CLOTHES)))], 0.35)
    black = Material("person", (0.02, 0.02, 0.02), 0.08)
    wheels = []
    for x in (0.52, -0.52):
        angle_rad = np.linspace(0, 2 * np.pi, 17)
        rings = [
            np.stack(
                [x + r * np.cos(angle_rad), np.full(17, y), 0.34 + r * np.sin(angle_rad)],
                axis=1,
            )
            for r, y in ((0.34, 0.0), (0.315, 0.018), (0.295, 0.0), (0.315, -0.018), (0.34, 0.0))
        ]
        wheels.append(shapes.grid(np.stack(rings)))
    joints = np.array(
        [[0.52, 0, 0.34], [0.38, 0, 0.92], [-0.52, 0, 0.34], [-0.15, 0, 0.88], [-0.05, 0, 0.3]]
    )
    bars = [
        _limb(joints[a], joints[b], 0.02, 0.02)
        for a, b in ((1, 0), (3, 2), (1, 4), (3, 4), (1, 3), (2, 4))
    ]
    bars.append(_limb(np.array([0.4, 0.28, 1.0]), np.array([0.4, -0.28, 1.0]), 0.018, 0.018))
    rider = person(rng, 1.76, stride=0.28)
    leaning = Rotation.from_euler("y", 14.0, degrees=True).as_matrix()
    return Triangles.joined(
        [
            Triangles.of(np.concatenate(wheels), black),
            Triangles.of(np.concatenate(bars), frame),
            rider.transformed(rigid(leaning, [-0.32, 0.0, 0.14])),
        ]
    )
