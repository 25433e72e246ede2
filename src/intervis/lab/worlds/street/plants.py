"""Trees, bushes and hedges, with leaves as small triangles between which beams can pass."""

import numpy as np

from intervis.lab.worlds import materials, shapes
from intervis.lab.worlds.triangles import Material, Triangles


def _crown(
    rng: np.random.Generator,
    material: Material,
    radii_m: tuple[float, float, float],
    number: int,
    leaf_m: float = 0.2,
    core: tuple[int, int] = (6, 9),
) -> Triangles:
    """A clump about the origin: an irregular opaque core with `number` leaves around it."""
    radii = np.asarray(radii_m)
    body = shapes.perturbed(rng, shapes.ellipsoid(radii * 0.86, *core), 0.16)
    cloud = shapes.leaves(rng, number, radii * 1.03, leaf_m)
    return Triangles.joined(
        [
            Triangles.of(body, material.tinted(0.8)).speckled(rng, 0.34),
            Triangles.of(cloud, material).speckled(rng, 0.36),
        ]
    )


def tree(rng: np.random.Generator, height_m: float = 8.0, near: bool = True) -> Triangles:
    """A broad-leaved tree at the origin.

    Parameters
    ----------
    rng : numpy Generator
        Selects shape and colour.
    height_m : float
        Height of the tree.
    near : bool
        False gives few leaves, for distant trees.
    """
    girth = 0.022 * height_m * rng.uniform(0.85, 1.25)
    fork = height_m * rng.uniform(0.3, 0.38)
    trunk = shapes.tube(
        [girth * 1.35, girth, girth * 0.85, girth * 0.35],
        [-0.1, 0.35, fork, height_m * 0.72],
        sides=8 if near else 5,
        closed=False,
    )
    leaf = Material(
        "vegetation",
        (rng.uniform(0.07, 0.17), rng.uniform(0.17, 0.26), rng.uniform(0.025, 0.06)),
        rng.uniform(0.4, 0.52),
    )
    parts = [Triangles.of(trunk, materials.BARK).speckled(rng, 0.15)]
    spread = height_m * rng.uniform(0.24, 0.31)
    clumps = 7 if near else 3
    for clump in range(clumps):
        azimuth_rad = 2 * np.pi * (clump + rng.uniform(-0.3, 0.3)) / max(1, clumps - 1)
        top = clump == clumps - 1
        out = 0.0 if top else spread * rng.uniform(0.45, 0.7)
        level = height_m * (0.84 if top else rng.uniform(0.52, 0.7))
        size = spread * rng.uniform(0.6, 0.8)
        radii = (size, size, size * 0.85)
        crown = (
            _crown(rng, leaf, radii, 75, 0.19)
            if near
            else _crown(rng, leaf, radii, 14, 0.5, core=(5, 7))
        )
        place = [out * np.cos(azimuth_rad), out * np.sin(azimuth_rad), level]
        parts.append(crown.transformed(shapes.upright_rotation(azimuth_rad, place)))
        if near and not top:
            branch = shapes.quad([0, 0, fork], [0, 0, fork + 0.12], place, place)[:1]
            parts.append(Triangles.of(branch, materials.BARK))
    return Triangles.joined(parts)


def conifer(rng: np.random.Generator, height_m: float = 9.0) -> Triangles:
    """A conifer at the origin: tiers of conical skirts."""
    parts = [
        Triangles.of(
            shapes.tube([0.16, 0.05], [0.0, height_m * 0.9], 6, closed=False), materials.BARK
        )
    ]
    green = Material("vegetation", (0.035, rng.uniform(0.09, 0.13), 0.04), 0.36)
    for tier in range(9):
        level = height_m * (0.1 + 0.1 * tier)
        radius = height_m * 0.21 * (1 - tier / 9.5)
        skirt = shapes.tube([radius, 0.02], [level, level + height_m * 0.16], 11, closed=False)
        skirt = skirt + rng.normal(scale=0.09, size=skirt.shape) * [1, 1, 0.6]
        parts.append(Triangles.of(skirt, green).speckled(rng, 0.35))
    return Triangles.joined(parts)


def bush(rng: np.random.Generator, size_m: float = 0.8) -> Triangles:
    """A bush on the ground at the origin."""
    leaf = materials.LEAF.tinted(rng.uniform(0.6, 1.2))
    radii = (size_m * rng.uniform(0.8, 1.2), size_m * rng.uniform(0.8, 1.2), size_m * 0.8)
    crown = _crown(rng, leaf, radii, 40, 0.11, core=(5, 8))
    return crown.transformed(shapes.upright_rotation(rng.uniform(0, 6.28), [0, 0, size_m * 0.6]))


def hedge(rng: np.random.Generator, length_m: float, height_m: float, width_m: float) -> Triangles:
    """A clipped hedge along x from the origin, half its width on either side."""
    cells = max(2, int(length_m / 0.45))
    along = np.linspace(0, length_m, cells)
    half = width_m / 2
    across = [-half, -half, -half * 0.92, 0.0, half * 0.92, half, half]
    above = [0.0, height_m * 0.5, height_m * 0.96, height_m, height_m * 0.96, height_m * 0.5, 0.0]
    points = np.empty((cells, len(across), 3))
    points[:, :, 0] = along[:, None]
    points[:, :, 1] = across
    points[:, :, 2] = above
    points[1:-1, 1:-1] += rng.normal(scale=0.045, size=(cells - 2, len(across) - 2, 3))
    ends = [shapes.fan(points[0]), shapes.fan(points[-1, ::-1])]
    body = Triangles.of(np.concatenate([shapes.grid(points), *ends]), materials.HEDGE).speckled(
        rng, 0.3
    )
    tufts = shapes.leaves(rng, int(length_m * 16), [length_m / 2, half * 1.12, height_m / 2], 0.1)
    tufts += np.array([length_m / 2, 0.0, height_m * 0.54])
    return Triangles.joined(
        [body, Triangles.of(tufts, materials.HEDGE.tinted(1.35)).speckled(rng, 0.35)]
    )
