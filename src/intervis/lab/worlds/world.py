"""A world: static triangles, actors that move, and the pose of everything at a given time."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.lab.worlds.triangles import Triangles
from intervis.transform import transform


@dataclass(frozen=True, eq=False)
class Actor:
    """A rigid body that moves.

    Attributes
    ----------
    name : str
        For example ``car 3``.
    triangles : Triangles
        In the actor's own frame.
    pose_at : callable
        world_from_actor (4, 4) at a time in seconds.
    """

    name: str
    triangles: Triangles = field(repr=False)
    pose_at: Callable[[float], Float64Array] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A world at one time.

    Attributes
    ----------
    triangles : (T, 3, 3) float64 array
        Corners, static triangles first, then the actors in their order; metres, world frame.
    labels : (T,) int8 array
        Class, see `intervis.lab.worlds.triangles.LABELS`.
    objects : (T,) int64 array
        0 for static triangles, 1 and up for the actors.
    normals : (T, 3) float64 array
        Unit normals; their sign has no meaning.
    colours, reflectances : (T, 3), (T,) float32 arrays
        Linear albedo, and reflectance for the laser.
    caster : RayCaster
        Over the triangles, with their indices.
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
    """Known triangles, static and moving, and the vehicle that carries the scanner.

    Attributes
    ----------
    static : Triangles
        World frame, metres.
    actors : tuple of Actor
    vehicle_pose_at : callable
        world_from_velo (4, 4) of the vehicle's scanner at a time in seconds.
    last_s : float
        Time at which the vehicle reaches the end of its route.
    """

    static: Triangles = field(repr=False)
    actors: tuple[Actor, ...]
    vehicle_pose_at: Callable[[float], Float64Array] = field(repr=False)
    last_s: float = np.inf

    @cached_property
    def _all(self) -> Triangles:
        return Triangles.joined([self.static, *(actor.triangles for actor in self.actors)])

    @cached_property
    def _objects(self) -> IntArray:
        sizes = [len(self.static), *(len(actor.triangles) for actor in self.actors)]
        return np.repeat(np.arange(len(sizes)), sizes)

    @cached_property
    def _static_normals(self) -> Float64Array:
        return self.static.normals

    @cached_property
    def _static_caster(self) -> RayCaster:
        return RayCaster(self.static.corners)

    def triangles_at(self, time_s: float) -> tuple[Float64Array, NDArray[np.int8], IntArray]:
        """Triangles (T, 3, 3), labels (T,) and objects (T,) at a time: see `Snapshot`."""
        moving = [
            transform(actor.pose_at(time_s), actor.triangles.corners) for actor in self.actors
        ]
        triangles = np.concatenate([self.static.corners, *moving])
        return triangles, self._all.labels, self._objects

    def at(self, time_s: float) -> Snapshot:
        """The world at a time, with a ray caster."""
        triangles, labels, objects = self.triangles_at(time_s)
        moving = RayCaster(triangles[len(self.static) :])
        normals = [self._static_normals]
        for actor in self.actors:
            normals.append(actor.triangles.normals @ actor.pose_at(time_s)[:3, :3].T)
        return Snapshot(
            triangles,
            labels,
            objects,
            np.concatenate(normals),
            self._all.colours,
            self._all.reflectances,
            RayCaster.joined([self._static_caster, moving]),
        )
