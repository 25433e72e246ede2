"""The frames of a simulated drive: sweeps of its scanners, images, boxes and poses.

Sweeps begin at the frame's time, images are taken 0.02 s later.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.drives.drive_writer import (
    BoxRecord,
    FrameRecord,
    ImageRecord,
    Rig,
    RigCamera,
    RigScanner,
    ScanRecord,
)
from intervis.drives.pose_track import PoseTrack
from intervis.errors import SettingsError
from intervis.lab.worlds.mounted_scanner import EGO_FROM_VELO, MountedScanner, PoseAt, upright
from intervis.lab.worlds.renderer import render
from intervis.lab.worlds.world import World
from intervis.transform import inverse, rigid

START_NS = 1_317_042_145_000_000_000
"""Time of the first frame: that of the drives in KITTI's layout, as UTC."""

POSE_STEP_NS = 10_000_000
"""Time between two poses of the vehicle."""

IMAGE_SHARE = 0.2
"""When images are taken within a frame: nearer to its time than to that of the next frame."""

BOXES_WITHIN_M = 80.0
_IMAGE_PX, _FOCAL_PX = (800, 450), 633.0
_CAMERA_PLACES_M = {"front": (1.72, 0.0, 1.49), "rear": (0.05, 0.0, 1.56)}
_CAM_AXES = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
"""ego_from_cam of a camera that looks ahead."""


def rig_of(scanners: Sequence[MountedScanner], with_cameras: bool) -> Rig:
    """Scanners on their mounts, and the cameras of the vehicle."""
    width_px, height_px = _IMAGE_PX
    cameras = []
    for name, place_m in _CAMERA_PLACES_M.items() if with_cameras else ():
        cx_px, cy_px = (width_px - 1) / 2, (height_px - 1) / 2
        projection = np.array(
            [[_FOCAL_PX, 0, cx_px, 0], [0, _FOCAL_PX, cy_px, 0], [0, 0, 1, 0]], np.float64
        )
        turn = np.diag([-1.0, -1.0, 1.0]) if name == "rear" else np.eye(3)
        camera = Camera(projection, width_px, height_px, name=name)
        cameras.append(RigCamera(name, camera, rigid(turn @ _CAM_AXES, place_m)))
    return Rig(
        tuple(RigScanner(one.mount, one.model, one.ego_from_scanner, one.rows) for one in scanners),
        tuple(cameras),
    )


@dataclass(frozen=True, eq=False)
class SimulatedDrive:
    """The frames of a drive, each simulated when it is asked for."""

    world: World
    scanners: tuple[MountedScanner, ...]
    rig: Rig
    seed: int
    motion: bool
    world_from_ego: PoseAt = field(init=False)

    @classmethod
    def of(
        cls,
        world: World,
        scanners: Sequence[MountedScanner],
        *,
        seed: int = 0,
        cameras: bool = False,
        motion: bool = False,
    ) -> Self:
        """The drive of some scanners, with or without cameras."""
        return cls(world, tuple(scanners), rig_of(scanners, cameras), seed, motion)

    def __post_init__(self) -> None:
        if self.scanners[0].is_on_ground:
            site = roadside_site(self.world)
            object.__setattr__(self, "world_from_ego", lambda time_s: site)
        else:
            object.__setattr__(self, "world_from_ego", self._vehicle_pose)

    def _vehicle_pose(self, time_s: float) -> Float64Array:
        return np.asarray(self.world.vehicle_pose_at(time_s) @ inverse(EGO_FROM_VELO))

    @property
    def period_s(self) -> float:
        """Time between frames: the longest sweep."""
        return max(scanner.preset.period_s for scanner in self.scanners)

    def check_length(self, frames: int) -> None:
        """Check that the street is long enough; scanners beside it have no end."""
        most = int(self.world.last_s / self.period_s)
        if frames > most and not self.scanners[0].is_on_ground:
            raise SettingsError(
                f"frames must be at most {most}, where the street ends, got {frames}."
            )

    def frame(self, number: int) -> FrameRecord:
        """A frame by its number."""
        time_s = number * self.period_s
        time_ns = START_NS + round(time_s * 1e9)
        scans = []
        for nth, scanner in enumerate(self.scanners):
            rng = np.random.default_rng([self.seed, number, nth])
            points, attributes = scanner.sweep(
                self.world, self.world_from_ego, time_s, rng, motion=self.motion
            )
            ring, offset_ns = attributes.get("ring"), attributes.get("offset_ns")
            scans.append(ScanRecord(points, attributes["intensity"], ring, offset_ns))
        return FrameRecord(
            time_ns,
            self._track(time_s, time_ns),
            tuple(scans),
            tuple(self._images(time_s + IMAGE_SHARE * self.period_s)),
            tuple(self._boxes(time_s)),
        )

    def _track(self, time_s: float, time_ns: int) -> PoseTrack:
        """Poses from the beginning of the frame to its end."""
        steps_ns = np.arange(0, round(self.period_s * 1e9) + 1, POSE_STEP_NS)
        if self.scanners[0].is_on_ground:
            steps_ns = steps_ns[[0, -1]]
        poses = [self.world_from_ego(time_s + step_ns * 1e-9) for step_ns in steps_ns.tolist()]
        return PoseTrack.over_gaps(time_ns + steps_ns, poses)

    def _images(self, time_s: float) -> Iterator[ImageRecord]:
        if not self.rig.cameras:
            return
        snapshot, pose = self.world.at(time_s), self.world_from_ego(time_s)
        time_ns = START_NS + round(time_s * 1e9)
        for camera in self.rig.cameras:
            cam_from_ego = inverse(camera.ego_from_cam)
            pixels = render(snapshot, camera.camera, cam_from_ego, pose)
            yield ImageRecord(pixels, time_ns, pose)

    def _boxes(self, time_s: float) -> Iterator[BoxRecord]:
        """Boxes around the actors near the vehicle."""
        here = self.world_from_ego(time_s)[:3, 3]
        for actor in self.world.actors:
            corners = actor.triangles.corners
            lower, upper = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
            pose = actor.pose_at(time_s) @ rigid(np.eye(3), (lower + upper) / 2)
            if np.linalg.norm(pose[:3, 3] - here) <= BOXES_WITHIN_M:
                category = actor.name.partition(" ")[0]
                yield BoxRecord(actor.name, category, pose, upper - lower)


def roadside_site(world: World) -> Float64Array:
    """world_from_ego (4, 4) of a place on the right pavement: level, x along the street.

    The first place along the vehicle's way with a metre of space around it up to 3 m.
    """
    caster = world.at(0.0).caster
    angle_rad = np.arange(0, 2 * np.pi, 0.2)
    around = np.column_stack([np.cos(angle_rad), np.sin(angle_rad), 0 * angle_rad])
    for time_s in np.arange(2.0, 12.0, 0.5):
        pose = world.vehicle_pose_at(float(time_s)) @ rigid(np.eye(3), [0.0, -5.2, 1.0])
        depth_m, _ = caster.closest(pose[:3, 3], [[0.0, 0.0, -1.0]], 6.0)
        foot = pose[:3, 3] - [0.0, 0.0, float(depth_m[0])]
        starts = foot + np.array([0.0, 0.0, 1.0]) * np.array([0.5, 1.2, 1.8, 3.0])[:, None]
        free = [not np.isfinite(caster.closest(start, around, 1.0)[0]).any() for start in starts]
        if np.isfinite(depth_m[0]) and all(free):
            return rigid(upright(pose[:3, :3]), foot)
    raise SettingsError("there is no free place beside this street: choose another seed.")
