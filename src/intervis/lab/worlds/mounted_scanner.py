"""A scanner on its mount, and the sweeps that it makes of a world while both move."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from intervis.arrays import BoolArray, Float32Array, Float64Array
from intervis.errors import SettingsError
from intervis.lab.worlds.beam_pattern import BeamPattern
from intervis.lab.worlds.echoes import INTENSITY_NOISE, intensity, loss_probability
from intervis.lab.worlds.mounts import BODY_M, GROUND_MOUNTS, MOUNTS, VEHICLE_MOUNTS
from intervis.lab.worlds.presets import PRESETS, Preset
from intervis.lab.worlds.world import World
from intervis.transform import rigid

FIRING_STEP_S = 50e-6
"""Beams are fired in such steps: 0.5 mm at 10 m/s."""

PoseAt = Callable[[float], Float64Array]


@dataclass(frozen=True, eq=False)
class MountedScanner:
    """A preset on a mount.

    Attributes
    ----------
    preset : Preset
    mount : str
    ego_from_scanner : (4, 4) float64 array
        The frame of the vehicle, or of the foot of mast or tripod, from the scanner's.
    """

    preset: Preset
    mount: str
    ego_from_scanner: Float64Array = field(repr=False)

    @property
    def is_on_ground(self) -> bool:
        """Whether it stands beside the street instead of on the vehicle."""
        return self.mount in GROUND_MOUNTS

    @property
    def model(self) -> str:
        """Name of the model that it resembles."""
        return self.preset.sweep_at(0.0).name

    @property
    def rows(self) -> int:
        """Number of its rows; 0 where it has none."""
        ring = self.preset.sweep_at(0.0).ring
        return 0 if ring is None else int(ring.max()) + 1

    def sweep(
        self,
        world: World,
        world_from_ego: PoseAt,
        time_s: float,
        rng: np.random.Generator,
        *,
        motion: bool,
    ) -> tuple[Float32Array, dict[str, NDArray[Any]]]:
        """One sweep.

        Parameters
        ----------
        world : World
        world_from_ego : function of a float to (4, 4) array
            Pose of the vehicle at a time in seconds.
        time_s : float
            At which the sweep begins.
        rng : numpy Generator
            Source of noise and loss; the same state gives the same sweep.
        motion : bool
            Whether vehicle and actors move during the sweep; otherwise all beams are fired at once.

        Returns
        -------
        points : (N, 3) float32 array
            In the scanner's frame, each at its own time, metres, in firing order.
        attributes : dict of (N,) arrays
            ``intensity`` float32 (0 to 0.99), ``ring`` int64 (0 the highest; absent without rows),
            ``offset_ns`` int64 (after `time_s`; absent without motion), ``label`` int8 and
            ``object`` int64 of the surface, ``range`` float64 (metres, without noise).
        """
        pattern = self.preset.sweep_at(time_s)
        steps = np.round(pattern.time_s / FIRING_STEP_S).astype(np.int64)
        if not motion:
            steps[:] = 0
        origins, directions = self._rays(pattern, world_from_ego, time_s, steps)
        times_s = time_s + steps.astype(np.float64) * FIRING_STEP_S
        hits = world.cast(origins, directions, times_s, pattern.farthest_m)
        # Every beam draws random numbers, hit or not, so that one loss does not change the rest.
        noise_m = pattern.noise_m * rng.standard_normal(len(steps))
        draws = rng.random(len(steps))
        factors = 1 + INTENSITY_NOISE * rng.standard_normal(len(steps))
        seen = np.isfinite(hits.ranges_m) & (hits.ranges_m >= pattern.nearest_m)
        beams = np.flatnonzero(seen & ~self._hits_vehicle(pattern.directions))
        lost = loss_probability(
            hits.reflectances[beams],
            hits.labels[beams],
            hits.ranges_m[beams],
            hits.cosines[beams],
            dropout=pattern.dropout,
        )
        beams = beams[draws[beams] >= lost]
        points = pattern.directions[beams] * (hits.ranges_m + noise_m)[beams, None]
        attributes: dict[str, NDArray[Any]] = {
            "intensity": intensity(hits.reflectances[beams], hits.cosines[beams], factors[beams]),
            "label": hits.labels[beams],
            "object": hits.objects[beams],
            "range": hits.ranges_m[beams],
        }
        if pattern.ring is not None:
            attributes["ring"] = pattern.ring[beams]
        if motion:
            attributes["offset_ns"] = steps[beams] * round(FIRING_STEP_S * 1e9)
        return points.astype(np.float32), attributes

    def _rays(
        self,
        pattern: BeamPattern,
        world_from_ego: PoseAt,
        time_s: float,
        steps: NDArray[np.int64],
    ) -> tuple[Float64Array, Float64Array]:
        """Origins and directions (B, 3) of the beams, world frame."""
        fired, which = np.unique(steps, return_inverse=True)
        poses = np.array(
            [
                world_from_ego(time_s + step * FIRING_STEP_S) @ self.ego_from_scanner
                for step in fired.tolist()
            ]
        )
        directions = np.einsum("bij,bj->bi", poses[which, :3, :3], pattern.directions)
        return poses[which, :3, 3], directions

    def _hits_vehicle(self, directions: Float64Array) -> BoolArray:
        """Which beams (B,) meet the own vehicle; they give no return."""
        blocked = np.zeros(len(directions), np.bool_)
        if self.is_on_ground:
            return blocked
        start = self.ego_from_scanner[:3, 3]
        in_ego = directions @ self.ego_from_scanner[:3, :3].T
        with np.errstate(divide="ignore", invalid="ignore"):
            for lower, upper in BODY_M:
                one, two = ((np.array(corner) - start) / in_ego for corner in (lower, upper))
                enter, leave = np.minimum(one, two), np.maximum(one, two)
                first, last = np.nanmax(enter, axis=1), np.nanmin(leave, axis=1)
                blocked |= (first < last) & (last > 0)
        return blocked


def mounted(text: str) -> MountedScanner:
    """The scanner that ``PRESET`` or ``PRESET@MOUNT`` names.

    Raises
    ------
    SettingsError
        There is no such preset or mount, or it cannot stand there.

    Examples
    --------
    >>> mounted("qt64").mount, mounted("pandar64@mast").is_on_ground
    ('left', True)
    """
    name, at, place = text.partition("@")
    if name not in PRESETS:
        raise SettingsError(
            f"there is no scanner {name!r:.60}: choose from {', '.join(sorted(PRESETS))}."
        )
    preset = PRESETS[name]
    mount = place if at else preset.mount
    if mount not in VEHICLE_MOUNTS and mount not in GROUND_MOUNTS:
        names = ", ".join([*VEHICLE_MOUNTS, *GROUND_MOUNTS])
        raise SettingsError(f"there is no mount {mount!r:.60}: choose from {names}.")
    if mount in VEHICLE_MOUNTS:
        if preset.mount == "tripod":
            raise SettingsError(
                f"{name} takes {preset.period_s:.0f} s for a scan and stands on a tripod or a mast,"
                f" not on the vehicle ({mount})."
            )
        return MountedScanner(preset, mount, VEHICLE_MOUNTS[mount].ego_from_scanner)
    return MountedScanner(preset, mount, MOUNTS[mount].pose([0.0, 0.0, 0.0]))


def checked_scanners(scanners: list[MountedScanner]) -> None:
    """Check that several scanners can be used together.

    Raises
    ------
    SettingsError
        There is none, two share a mount, or one rides while another stands beside the street.
    """
    if not scanners:
        raise SettingsError("a drive needs a scanner.")
    mounts = [scanner.mount for scanner in scanners]
    for mount in mounts:
        if mounts.count(mount) > 1:
            names = " and ".join(one.preset.name for one in scanners if one.mount == mount)
            raise SettingsError(
                f"{names} cannot both stand at {mount}: name their mounts as in"
                f" {scanners[0].preset.name}@roof."
            )
    if len({scanner.is_on_ground for scanner in scanners}) > 1:
        raise SettingsError(
            "scanners on the vehicle and beside the street cannot be in one drive: simulate two."
        )


EGO_FROM_VELO = rigid(np.eye(3), [0.8, 0.0, 1.73])
"""The vehicle's frame from that of the 64-beam scanner, whose pose `World` gives."""


def upright(pose: Float64Array) -> Float64Array:
    """The yaw of a rotation (3, 3) alone."""
    yaw_rad = float(np.arctan2(pose[1, 0], pose[0, 0]))
    return np.asarray(Rotation.from_euler("z", yaw_rad).as_matrix())
