"""Triangles with class, colour and reflectance for the laser."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intervis.arrays import Float32Array, Float64Array
from intervis.transform import transform

LABELS: dict[str, int] = {
    "none": 0,
    "road": 1,
    "marking": 2,
    "kerb": 3,
    "sidewalk": 4,
    "terrain": 5,
    "building": 6,
    "window": 7,
    "roof": 8,
    "fence": 9,
    "vegetation": 10,
    "trunk": 11,
    "pole": 12,
    "sign": 13,
    "car": 14,
    "person": 15,
    "bridge": 16,
    "furniture": 17,
    "glass": 18,
}
"""Class of a triangle by name; ``glass`` belongs to cars, ``window`` to houses."""


@dataclass(frozen=True)
class Material:
    """Class, colour and reflectance of a surface.

    Attributes
    ----------
    label : str
        One of `LABELS`.
    colour : three floats
        Linear red, green, blue albedo, 0 to 1.
    reflectance : float
        Fraction of near-infrared laser light reflected, 0 to 1; above 1 for retroreflectors.
    """

    label: str
    colour: tuple[float, float, float]
    reflectance: float

    def tinted(self, factor: float) -> "Material":
        """The same class with colour and reflectance times a factor."""
        red, green, blue = (min(1.0, max(0.0, part * factor)) for part in self.colour)
        return Material(self.label, (red, green, blue), self.reflectance * factor)


@dataclass(frozen=True, eq=False)
class Triangles:
    """T triangles without connectivity, each with its class, colour and reflectance.

    Attributes
    ----------
    corners : (T, 3, 3) float64 array
        Metres.
    labels : (T,) int8 array
        Class, see `LABELS`.
    colours : (T, 3) float32 array
        Linear red, green, blue albedo.
    reflectances : (T,) float32 array
        Reflectance for the laser.

    Examples
    --------
    >>> grey = Material("road", (0.2, 0.2, 0.2), 0.2)
    >>> Triangles.of(np.zeros((4, 3, 3)), grey).labels
    array([1, 1, 1, 1], dtype=int8)
    """

    corners: Float64Array = field(repr=False)
    labels: NDArray[np.int8] = field(repr=False)
    colours: Float32Array = field(repr=False)
    reflectances: Float32Array = field(repr=False)

    def __len__(self) -> int:
        return len(self.corners)

    @classmethod
    def of(cls, corners: ArrayLike, material: Material) -> "Triangles":
        """Triangles (T, 3, 3) of one material."""
        array = np.array(corners, dtype=np.float64).reshape(-1, 3, 3)
        total = len(array)
        return cls(
            array,
            np.full(total, LABELS[material.label], np.int8),
            np.tile(np.asarray(material.colour, np.float32), (total, 1)),
            np.full(total, material.reflectance, np.float32),
        )

    @classmethod
    def joined(cls, parts: "Iterable[Triangles]") -> "Triangles":
        """All triangles of several sets, in their order.

        Examples
        --------
        >>> len(Triangles.joined([]))
        0
        """
        every = list(parts) or [cls.of(np.empty((0, 3, 3)), Material("none", (0, 0, 0), 0))]
        fields: list[NDArray[Any]] = [
            np.concatenate([getattr(part, name) for part in every])
            for name in ("corners", "labels", "colours", "reflectances")
        ]
        return cls(*fields)

    def part(self, first: int, last: int) -> "Triangles":
        """The triangles from `first` up to, not including, `last`."""
        return Triangles(
            self.corners[first:last],
            self.labels[first:last],
            self.colours[first:last],
            self.reflectances[first:last],
        )

    def with_corners(self, corners: Float64Array) -> "Triangles":
        """The same surfaces with other corners (T, 3, 3)."""
        return Triangles(corners, self.labels, self.colours, self.reflectances)

    def transformed(self, pose: Float64Array) -> "Triangles":
        """Transformed by a rigid motion (4, 4)."""
        return self.with_corners(transform(pose, self.corners))

    def translated(self, x_m: float, y_m: float, z_m: float) -> "Triangles":
        """Translated by (x, y, z)."""
        return self.with_corners(self.corners + np.array([x_m, y_m, z_m]))

    def scaled(self, factor: float) -> "Triangles":
        """Scaled about the origin."""
        return self.with_corners(self.corners * factor)

    def speckled(self, rng: np.random.Generator, spread: float) -> "Triangles":
        """Colour and reflectance of each triangle times a random factor of 1 +- `spread`."""
        factor = rng.uniform(1 - spread, 1 + spread, len(self)).astype(np.float32)
        return Triangles(
            self.corners,
            self.labels,
            np.clip(self.colours * factor[:, None], 0, 1),
            self.reflectances * factor,
        )

    def rounded(self) -> "Triangles":
        """Rounded as in a file: corners to float32, colours and reflectances to float16."""
        return Triangles(
            self.corners.astype(np.float32).astype(np.float64),
            self.labels,
            self.colours.astype(np.float16).astype(np.float32),
            self.reflectances.astype(np.float16).astype(np.float32),
        )

    @property
    def normals(self) -> Float64Array:
        """(T, 3) unit normals by the right-hand rule; zero for degenerate triangles."""
        corners = self.corners
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.asarray(normals / np.where(lengths > 0, lengths, 1.0))
