"""The scan buffer: a bounded number of posed range images, and which of them to evict."""

import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from intervis.arrays import Float64Array, Int16Array
from intervis.errors import SettingsError
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.occupancy_model import AGE_COST_M_PER_S
from intervis.sight.range_image import RangeImage
from intervis.transform import inverse

SPARE_SLOTS = 4
"""Slots beyond the capacity: for evicted scans that packed scans in use still refer to."""

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

    Packed scans are immutable: a slot that packed scans in use refer to is not written to. Any
    thread may call; `lock` is held while the buffer changes, which is short, not while a scan is
    projected or lines are answered.

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
        self._lent: list[tuple[weakref.ref[Any], frozenset[int]]] = []
        """Packed scans in use (their `offset`), and the slots of the pool that they refer to."""
        self._level_from_scene: Float64Array | None = None
        self._spare = 0
        self._borrowed = False
        """Whether the pool is another buffer's, and must be copied before it is written to."""
        self.lock = threading.RLock()

    def __getstate__(self) -> dict[str, Any]:
        with self.lock:
            return {**self.__dict__, "lock": None, "_packed": None, "_lent": []}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, lock=threading.RLock())

    def snapshot(self) -> "ScanBuffer":
        """A buffer with the scans of this moment, which later additions to this one leave alone."""
        with self.lock:
            copy = ScanBuffer(self.max_scans, self.max_bytes)
            copy._pool, copy._borrowed = self._pool, True
            copy._entries = list(self._entries)
            copy._level_from_scene = self._level_from_scene
            copy._packed = self.packed() if self._entries else None  # which keeps the slots
            return copy

    def __len__(self) -> int:
        with self.lock:  # while a scan replaces the only one, there is none for a moment
            return len(self._entries)

    @property
    def bytes(self) -> int:
        """Memory of the pool and the ground maps."""
        with self.lock:
            return self._pool.nbytes + sum(entry.image.ground_m.nbytes for entry in self._entries)

    @property
    def level_from_scene(self) -> Float64Array:
        """(3, 3) rotation of the scene's axes to those of the ground maps, whose z is up."""
        return np.eye(3) if self._level_from_scene is None else self._level_from_scene

    def level_with(self, of_first_scan: Callable[[], Float64Array]) -> Float64Array:
        """The same; the first call sets it, once for all scans."""
        if self._level_from_scene is None:
            found = of_first_scan()
            with self.lock:
                if self._level_from_scene is None:
                    self._level_from_scene = found
        return self.level_from_scene

    @property
    def poses(self) -> Float64Array:
        """(S, 4, 4) scene_from_sensor of the scans, oldest first."""
        with self.lock:
            return np.array([entry.pose for entry in self._entries]).reshape(-1, 4, 4)

    @property
    def timestamps_s(self) -> Float64Array:
        """(S,) times of the scans, seconds; NaN if not known."""
        with self.lock:
            return np.array([entry.timestamp_s for entry in self._entries])

    def add(
        self, image: RangeImage, scene_from_sensor: Float64Array, timestamp_s: float = float("nan")
    ) -> None:
        """Add a scan; evict others if the buffer is full."""
        with self.lock:
            self._add(image, scene_from_sensor, timestamp_s)

    def _add(self, image: RangeImage, scene_from_sensor: Float64Array, timestamp_s: float) -> None:
        if self._borrowed:  # while `_packed` still keeps the slots from being written to
            self._replace_pool(*self._pool.shape)
        self._packed = None
        self._remove_equal(image, scene_from_sensor)
        pixels = max(image.pixels.size, self._pool.shape[1])
        bytes_per_scan = 2 * pixels + image.ground_m.nbytes
        capacity = max(1, min(self.max_scans, self.max_bytes // bytes_per_scan))
        while len(self._entries) >= capacity:
            self._evict(scene_from_sensor)
        slot = self._free_slot(pixels, capacity)
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

    def _free_slot(self, pixels: int, capacity: int) -> int:
        """A slot of so many pixels; the pool grows by half, up to the capacity."""
        self._lent = [(packed, slots) for packed, slots in self._lent if packed() is not None]
        taken = {entry.slot for entry in self._entries}.union(*(slots for _, slots in self._lent))
        limit = capacity + self._spare
        fits = self._pool.shape[1] == pixels and len(self._pool) <= limit
        free = next((slot for slot in range(len(self._pool)) if slot not in taken), None)
        if fits and free is not None:
            return free
        self._spare = SPARE_SLOTS if self._lent else self._spare
        slots = len(self._pool)
        if slots <= len(taken):
            slots = slots * 3 // 2 + 1
        self._replace_pool(min(slots, capacity + self._spare), pixels)
        return len(self._entries)

    def _replace_pool(self, slots: int, pixels: int) -> None:
        """A new pool with the scans in its first slots; packed scans in use keep the old one."""
        pool = np.zeros((slots, pixels), np.int16)
        for slot, entry in enumerate(self._entries):
            image = entry.image.pixels
            place = pool[slot, : image.size].reshape(image.shape)
            place[:] = image
            moved = replace(entry.image, pixels=place)
            self._entries[slot] = replace(entry, slot=slot, image=moved)
        self._pool, self._lent, self._borrowed = pool, [], False

    @property
    def _contributing(self) -> list[_Entry]:
        """The scans with returns. One without any would only take a weight from the others."""
        return [entry for entry in self._entries if entry.image.returns] or self._entries

    def packed(self) -> PackedScans:
        """The scans as kernels read them, without a query time."""
        with self.lock:
            if self._packed is None:
                self._packed = self._pack()
            return self._packed

    def _pack(self) -> PackedScans:
        entries = self._contributing
        images = [entry.image for entry in entries]
        poses = np.array([entry.pose for entry in entries])
        packed = PackedScans(
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
            level_from_scene=self.level_from_scene,
            age_cost_m=np.zeros(len(images)),
            time_offset_s=np.full(len(images), np.nan),
        )
        slots = frozenset(entry.slot for entry in entries)
        self._lent.append((weakref.ref(packed.offset), slots))
        return packed

    def packed_at(self, moment_s: float) -> PackedScans:
        """The scans as kernels read them, for a query time."""
        with self.lock:
            offset_s = np.array([entry.timestamp_s for entry in self._contributing]) - moment_s
            cost_m = AGE_COST_M_PER_S * np.abs(offset_s)
            return self.packed()._replace(age_cost_m=cost_m, time_offset_s=offset_s)
