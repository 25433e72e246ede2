"""The scan buffer: a bounded number of posed range images, and which of them to evict."""

from dataclasses import dataclass, replace

import numpy as np

from intervis.arrays import Float64Array, Int16Array
from intervis.errors import SettingsError
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.occupancy_model import AGE_COST_M_PER_S
from intervis.sight.range_image import RangeImage
from intervis.transform import inverse

SAME_POSE = 1e-6
"""Poses whose entries differ by less are equal."""


@dataclass(frozen=True, eq=False)
class _Entry:
    """A scan of the buffer. The pixels of its range image lie in slot `slot` of the pool."""

    slot: int
    image: RangeImage
    pose: Float64Array
    timestamp_s: float


class ScanBuffer:
    """Range images in one pool, oldest first: by timestamp if all scans have one, else as added.

    A full buffer evicts the scan with the largest age / max(age) + distance / max(distance), the
    distance measured from the newest scan. A scan that equals a scan of the buffer, at the same
    pose, replaces it, so that no observation counts twice.

    Parameters
    ----------
    max_scans : int
        Maximum number of scans.
    max_bytes : int
        Maximum memory; one scan is always kept.
    """

    def __init__(self, max_scans: int, max_bytes: int) -> None:
        if max_scans < 1:
            raise SettingsError(f"max_scans must be 1 or more, got {max_scans}.")
        if max_bytes < 1:
            raise SettingsError(f"max_bytes must be 1 or more, got {max_bytes}.")
        self.max_scans = max_scans
        self.max_bytes = max_bytes
        self._pool: Int16Array = np.zeros((0, 0), np.int16)
        self._entries: list[_Entry] = []
        self._packed: PackedScans | None = None

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def bytes(self) -> int:
        """Memory of the pool and the ground maps."""
        return self._pool.nbytes + sum(entry.image.ground_m.nbytes for entry in self._entries)

    @property
    def poses(self) -> Float64Array:
        """(S, 4, 4) scene_from_sensor of the scans, oldest first."""
        return np.array([entry.pose for entry in self._entries]).reshape(-1, 4, 4)

    @property
    def timestamps_s(self) -> Float64Array:
        """(S,) times of the scans, seconds; NaN if not known."""
        return np.array([entry.timestamp_s for entry in self._entries])

    def add(
        self, image: RangeImage, scene_from_sensor: Float64Array, timestamp_s: float = float("nan")
    ) -> None:
        """Add a scan; evict others if the buffer is full."""
        self._packed = None
        self._remove_equal(image, scene_from_sensor)
        pixels = max(image.pixels.size, self._pool.shape[1])
        bytes_per_scan = 2 * pixels + image.ground_m.nbytes
        capacity = max(1, min(self.max_scans, self.max_bytes // bytes_per_scan))
        while len(self._entries) >= capacity:
            self._evict(scene_from_sensor)
        self._grow_pool(pixels, capacity)
        used = {entry.slot for entry in self._entries}
        slot = next(slot for slot in range(len(self._pool)) if slot not in used)
        place = self._pool[slot, : image.pixels.size].reshape(image.pixels.shape)
        place[:] = image.pixels
        self._entries.append(
            _Entry(slot, replace(image, pixels=place), scene_from_sensor, timestamp_s)
        )
        if not np.isnan(self.timestamps_s).any():
            self._entries.sort(key=lambda entry: entry.timestamp_s)

    def _remove_equal(self, image: RangeImage, pose: Float64Array) -> None:
        for at, entry in enumerate(self._entries):
            if (
                entry.image.returns == image.returns
                and np.abs(entry.pose - pose).max() < SAME_POSE
                and np.array_equal(entry.image.pixels, image.pixels)
            ):
                del self._entries[at]
                return

    def _evict(self, newest: Float64Array) -> None:
        distance = np.linalg.norm(self.poses[:, :3, 3] - newest[:3, 3], axis=1)
        age = np.arange(len(distance), 0.0, -1.0)
        cost = age / age.max() + distance / max(float(distance.max()), 1e-9)
        del self._entries[int(np.argmax(cost))]

    def _grow_pool(self, pixels: int, capacity: int) -> None:
        """Provide a free slot of so many pixels; the pool grows by half, up to the capacity."""
        slots = len(self._pool)
        if slots <= len(self._entries):
            slots = min(capacity, slots * 3 // 2 + 1)
        if capacity < slots or (slots, pixels) != self._pool.shape:
            slots = min(slots, capacity)
            pool = np.zeros((slots, pixels), np.int16)
            for slot, entry in enumerate(self._entries):
                image = entry.image.pixels
                place = pool[slot, : image.size].reshape(image.shape)
                place[:] = image
                moved = replace(entry.image, pixels=place)
                self._entries[slot] = replace(entry, slot=slot, image=moved)
            self._pool = pool

    @property
    def _contributing(self) -> list[_Entry]:
        """The scans with returns. One without any would only take a weight from the others."""
        return [entry for entry in self._entries if entry.image.returns] or self._entries

    def packed(self) -> PackedScans:
        """The scans as kernels read them, without a query time."""
        if self._packed is None:
            entries = self._contributing
            images = [entry.image for entry in entries]
            poses = np.array([entry.pose for entry in entries])
            self._packed = PackedScans(
                pixels=self._pool.reshape(-1),
                unit_m=np.array([image.unit_m for image in images]),
                offset=np.array([entry.slot for entry in entries]) * self._pool.shape[1],
                columns=np.array([image.pixels.shape[0] for image in images]),
                rows=np.array([image.pixels.shape[1] for image in images]),
                elevation_from=np.array([image.elevation_from for image in images]),
                rows_per_unit=np.array([1.0 / image.elevation_step for image in images]),
                sensor_from_scene=np.array([inverse(pose)[:3] for pose in poses]),
                position=np.ascontiguousarray(poses[:, :3, 3]),
                ground=np.array([image.ground_m for image in images]),
                age_cost_m=np.zeros(len(images)),
                time_offset_s=np.full(len(images), np.nan),
            )
        return self._packed

    def packed_at(self, moment_s: float) -> PackedScans:
        """The scans as kernels read them, for a query time."""
        offset_s = np.array([entry.timestamp_s for entry in self._contributing]) - moment_s
        cost_m = AGE_COST_M_PER_S * np.abs(offset_s)
        return self.packed()._replace(age_cost_m=cost_m, time_offset_s=offset_s)
