"""A world: what stands, what moves, and where everything is at a given time."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.lab.worlds.triangles import Soup
from intervis.transform import transform


@dataclass(frozen=True, eq=False)
class Mover:
    """Something that moves as one rigid body.

    Attributes
    ----------
    name : str
        For example ``car 3``.
    soup : Soup
        Its triangles in its own frame.
    pose_at : callable
        world_from_mover (4, 4) at a time in seconds.
    """

    name: str
    soup: Soup = field(repr=False)
    pose_at: Callable[[float], Float64Array] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Moment:
    """A world that stands still at one time.

    Attributes
    ----------
    triangles : (T, 3, 3) float64 array
        What stands first, then the movers in their order, metres, world frame.
    labels : (T,) int8 array
        Class, see `intervis.lab.worlds.triangles.LABELS`.
    objects : (T,) int64 array
        0 for what stands, 1 and up for the movers.
    normals : (T, 3) float64 array
        Unit normals; their side is not meant.
    colours, reflectances : (T, 3), (T,) float32 arrays
        Looks, to the eye and to the laser.
    caster : RayCaster
        Casts rays at the triangles, with their indices.
    """

    triangles: Float64Array = field(repr=False)
    labels: NDArray[np.int8] = field(repr=False)
    objects: IntArray = field(repr=False)
    normals: Float64Array = field(repr=False)
    colours: Float32Array = field(repr=False)
    reflectances: Float32Array = field(repr=False)
    caster: RayCaster = field(repr=False)


@dataclass(frozen=True, eq=False)
class World:
    """Known triangles, some of them moving, and a vehicle that drives among them.

    Attributes
    ----------
    static : Soup
        What stands, world frame, metres.
    movers : tuple of Mover
        What moves.
    vehicle_pose_at : callable
        world_from_velo (4, 4) of the scanning vehicle's sensor at a time in seconds.
    last_s : float
        The vehicle reaches the end of its way then.
    """

    static: Soup = field(repr=False)
    movers: tuple[Mover, ...]
    vehicle_pose_at: Callable[[float], Float64Array] = field(repr=False)
    last_s: float = np.inf

    @cached_property
    def _everything(self) -> Soup:
        return Soup.joined([self.static, *(mover.soup for mover in self.movers)])

    @cached_property
    def _objects(self) -> IntArray:
        sizes = [len(self.static), *(len(mover.soup) for mover in self.movers)]
        return np.repeat(np.arange(len(sizes)), sizes)

    @cached_property
    def _static_normals(self) -> Float64Array:
        return self.static.normals

    @cached_property
    def _static_caster(self) -> RayCaster:
        return RayCaster(self.static.triangles)

    def triangles_at(self, time_s: float) -> tuple[Float64Array, NDArray[np.int8], IntArray]:
        """Triangles (T, 3, 3), labels (T,) and objects (T,) at a time: see `Moment`."""
        moved = [transform(mover.pose_at(time_s), mover.soup.triangles) for mover in self.movers]
        triangles = np.concatenate([self.static.triangles, *moved])
        return triangles, self._everything.labels, self._objects

    def at(self, time_s: float) -> Moment:
        """The world as it is at a time, ready to be scanned and looked at."""
        triangles, labels, objects = self.triangles_at(time_s)
        moving = RayCaster(triangles[len(self.static) :])
        soup, normals = self._everything, [self._static_normals]
        for mover in self.movers:
            normals.append(mover.soup.normals @ mover.pose_at(time_s)[:3, :3].T)
        return Moment(
            triangles,
            labels,
            objects,
            np.concatenate(normals),
            soup.colours,
            soup.reflectances,
            RayCaster.joined([self._static_caster, moving]),
        )
