"""Triangles with what they are and how they look, to light and to a laser."""

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
"""Class of a triangle by name; ``glass`` is that of cars, ``window`` that of houses."""


@dataclass(frozen=True)
class Material:
    """What a surface is made of.

    Attributes
    ----------
    label : str
        One of `LABELS`.
    colour : three floats
        Linear red, green, blue albedo, 0 to 1.
    reflectance : float
        Share of near-infrared laser light thrown back, 0 to 1; above 1 for retroreflectors.
    """

    label: str
    colour: tuple[float, float, float]
    reflectance: float

    def tinted(self, factor: float) -> "Material":
        """The same, lighter or darker to the eye and to the laser."""
        red, green, blue = (min(1.0, max(0.0, part * factor)) for part in self.colour)
        return Material(self.label, (red, green, blue), self.reflectance * factor)


@dataclass(frozen=True, eq=False)
class Soup:
    """T triangles without connectivity.

    Attributes
    ----------
    triangles : (T, 3, 3) float64 array
        Corners, metres.
    labels : (T,) int8 array
        Class, see `LABELS`.
    colours : (T, 3) float32 array
        Linear albedo.
    reflectances : (T,) float32 array
        To the laser.

    Examples
    --------
    >>> grey = Material("road", (0.2, 0.2, 0.2), 0.2)
    >>> Soup.of(np.zeros((4, 3, 3)), grey).labels
    array([1, 1, 1, 1], dtype=int8)
    """

    triangles: Float64Array = field(repr=False)
    labels: NDArray[np.int8] = field(repr=False)
    colours: Float32Array = field(repr=False)
    reflectances: Float32Array = field(repr=False)

    def __len__(self) -> int:
        return len(self.triangles)

    @classmethod
    def of(cls, triangles: ArrayLike, material: Material) -> "Soup":
        """Triangles that are all of one material."""
        corners = np.array(triangles, dtype=np.float64).reshape(-1, 3, 3)
        total = len(corners)
        return cls(
            corners,
            np.full(total, LABELS[material.label], np.int8),
            np.tile(np.asarray(material.colour, np.float32), (total, 1)),
            np.full(total, material.reflectance, np.float32),
        )

    @classmethod
    def joined(cls, soups: "Iterable[Soup]") -> "Soup":
        """All triangles of several soups, in their order.

        Examples
        --------
        >>> len(Soup.joined([]))
        0
        """
        parts = list(soups) or [cls.of(np.empty((0, 3, 3)), Material("none", (0, 0, 0), 0))]
        fields: list[NDArray[Any]] = [
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("triangles", "labels", "colours", "reflectances")
        ]
        return cls(*fields)

    def part(self, first: int, last: int) -> "Soup":
        """The triangles from `first` up to, not including, `last`."""
        return Soup(
            self.triangles[first:last],
            self.labels[first:last],
            self.colours[first:last],
            self.reflectances[first:last],
        )

    def moved(self, pose: Float64Array) -> "Soup":
        """Carried by a rigid motion."""
        return self.placed(transform(pose, self.triangles))

    def placed(self, triangles: Float64Array) -> "Soup":
        """The same surfaces with other corners (T, 3, 3)."""
        return Soup(triangles, self.labels, self.colours, self.reflectances)

    def shifted(self, x_m: float, y_m: float, z_m: float) -> "Soup":
        """Carried by a shift."""
        return self.placed(self.triangles + np.array([x_m, y_m, z_m]))

    def scaled(self, factor: float) -> "Soup":
        """Larger or smaller, about the origin."""
        return self.placed(self.triangles * factor)

    def speckled(self, rng: np.random.Generator, spread: float) -> "Soup":
        """Each triangle a little lighter or darker, by a factor of 1 +- `spread`."""
        factor = rng.uniform(1 - spread, 1 + spread, len(self)).astype(np.float32)
        return Soup(
            self.triangles,
            self.labels,
            np.clip(self.colours * factor[:, None], 0, 1),
            self.reflectances * factor,
        )

    def stored(self) -> "Soup":
        """Rounded to numbers that a file holds exactly: corners float32, looks float16."""
        return Soup(
            self.triangles.astype(np.float32).astype(np.float64),
            self.labels,
            self.colours.astype(np.float16).astype(np.float32),
            self.reflectances.astype(np.float16).astype(np.float32),
        )

    @property
    def normals(self) -> Float64Array:
        """(T, 3) unit normals by the right-hand rule; zero for degenerate triangles."""
        corners = self.triangles
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        flat: Float64Array = np.where(lengths > 0, lengths, 1.0)
        return np.asarray(normals / flat)
