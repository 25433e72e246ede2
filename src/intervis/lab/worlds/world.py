"""A world: static triangles, actors that move, and the pose of everything at a given time."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array, IntArray
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.lab.worlds.triangles import Triangles
from intervis.transform import transform

ACTOR_STEP_S = 0.0025
"""Actors move in such steps: 4 cm at 17 m/s between two cars."""


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
class Hits:
    """What R rays hit first; the rows of rays that hit nothing have no meaning but in `ranges_m`.

    Attributes
    ----------
    ranges_m : (R,) float64 array
        Infinite where nothing is hit.
    cosines : (R,) float64 array
        Between the ray and the normal of the surface.
    labels, objects : (R,) arrays
        Of the triangles, as in `Snapshot`.
    reflectances : (R,) float32 array
    """

    ranges_m: Float64Array
    cosines: Float64Array
    labels: NDArray[np.int8]
    objects: IntArray
    reflectances: Float32Array


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

    def seen_from(self, velo_from_scanner: Float64Array) -> "World":
        """The same world, whose vehicle carries its scanner elsewhere: (4, 4)."""
        pose_at = self.vehicle_pose_at
        return replace(self, vehicle_pose_at=lambda time_s: pose_at(time_s) @ velo_from_scanner)

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

    def cast(
        self,
        origins: Float64Array,
        directions: Float64Array,
        times_s: Float64Array,
        farthest_m: float,
    ) -> Hits:
        """The first hits of rays at various times.

        Parameters
        ----------
        origins, directions : (R, 3) float64 arrays
            World frame; directions of unit length.
        times_s : (R,) float64 array
            Actors stand where they are at the time of each ray, to `ACTOR_STEP_S`.
        farthest_m : float
        """
        ranges_m, hits = self._static_caster.closest(origins, directions, farthest_m)
        normals = np.zeros_like(directions)
        normals[hits >= 0] = self._static_normals[hits[hits >= 0]]
        steps = np.round(times_s / ACTOR_STEP_S).astype(np.int64)
        for step in np.unique(steps) if self.actors else ():
            rays = np.flatnonzero(steps == step)
            corners, own_normals = self._moving_at(float(step) * ACTOR_STEP_S)
            own_m, own = RayCaster(corners).closest(origins[rays], directions[rays], farthest_m)
            nearer = own_m < ranges_m[rays]
            rays, own = rays[nearer], own[nearer]
            ranges_m[rays], hits[rays] = own_m[nearer], own + len(self.static)
            normals[rays] = own_normals[own]
        cosines = np.abs(np.einsum("ij,ij->i", normals, directions))
        every = self._all
        return Hits(
            ranges_m, cosines, every.labels[hits], self._objects[hits], every.reflectances[hits]
        )

    def _moving_at(self, time_s: float) -> tuple[Float64Array, Float64Array]:
        """Corners and normals of the actors' triangles, world frame."""
        poses = [actor.pose_at(time_s) for actor in self.actors]
        corners = [
            transform(pose, actor.triangles.corners)
            for pose, actor in zip(poses, self.actors, strict=True)
        ]
        normals = [
            own @ pose[:3, :3].T for pose, own in zip(poses, self._actor_normals, strict=True)
        ]
        return np.concatenate(corners), np.concatenate(normals)

    @cached_property
    def _actor_normals(self) -> list[Float64Array]:
        return [actor.triangles.normals for actor in self.actors]
