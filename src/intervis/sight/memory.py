"""The scans that a scene remembers: a bounded number of charts with their poses."""

from dataclasses import dataclass, replace

import numpy as np

from intervis.arrays import Float64Array
from intervis.errors import SettingsError
from intervis.sight.atlas import Memory
from intervis.sight.chart import Chart, Int16Array
from intervis.sight.occupancy_model import AGE_M_PER_S
from intervis.transform import inverse

SAME_POSE = 1e-6
"""Poses whose entries differ by less are the same."""


@dataclass(frozen=True, eq=False)
class _Kept:
    """A remembered scan: its chart's image lies in slot `slot` of the pool."""

    slot: int
    chart: Chart
    pose: Float64Array
    timestamp_s: float


class ScanMemory:
    """Charts in one pool of memory, oldest first: by their stamps if all have one, else as added.

    When it is full, the scan that is oldest and farthest from the newest one makes room: age and
    distance, each as a share of the greatest, are added. A scan equal to a remembered one, at the
    same pose, takes its place: evidence is not counted twice.

    Parameters
    ----------
    most_scans : int
        At most so many scans are kept.
    most_bytes : int
        And no more than so much memory, with one scan at least.
    """

    def __init__(self, most_scans: int, most_bytes: int) -> None:
        if most_scans < 1:
            raise SettingsError(f"most_scans must be 1 or more, got {most_scans}.")
        if most_bytes < 1:
            raise SettingsError(f"most_bytes must be 1 or more, got {most_bytes}.")
        self.most_scans = most_scans
        self.most_bytes = most_bytes
        self._pool: Int16Array = np.zeros((0, 0), np.int16)
        self._kept: list[_Kept] = []
        self._packed: Memory | None = None

    def __len__(self) -> int:
        return len(self._kept)

    @property
    def bytes(self) -> int:
        """Memory that the remembered scans take."""
        return self._pool.nbytes + sum(kept.chart.ground_m.nbytes for kept in self._kept)

    @property
    def poses(self) -> Float64Array:
        """(S, 4, 4) scene_from_sensor of the scans kept, oldest first."""
        return np.array([kept.pose for kept in self._kept]).reshape(-1, 4, 4)

    @property
    def timestamps_s(self) -> Float64Array:
        """(S,) when the scans kept were taken, NaN where that is not known."""
        return np.array([kept.timestamp_s for kept in self._kept])

    def add(
        self, chart: Chart, scene_from_sensor: Float64Array, timestamp_s: float = float("nan")
    ) -> None:
        """Remember a scan, and forget another one if there is no room."""
        self._packed = None
        self._forget_equal(chart, scene_from_sensor)
        cells = max(chart.cells.size, self._pool.shape[1])
        room = max(1, min(self.most_scans, self.most_bytes // (2 * cells + chart.ground_m.nbytes)))
        while len(self._kept) >= room:
            self._forget_one(scene_from_sensor)
        self._make_slots(cells, room)
        used = {kept.slot for kept in self._kept}
        slot = next(slot for slot in range(len(self._pool)) if slot not in used)
        place = self._pool[slot, : chart.cells.size].reshape(chart.cells.shape)
        place[:] = chart.cells
        kept_chart = replace(chart, cells=place)
        self._kept.append(_Kept(slot, kept_chart, scene_from_sensor, timestamp_s))
        if not np.isnan(self.timestamps_s).any():
            self._kept.sort(key=lambda kept: kept.timestamp_s)

    def _forget_equal(self, chart: Chart, pose: Float64Array) -> None:
        for at, kept in enumerate(self._kept):
            if (
                kept.chart.returns == chart.returns
                and np.abs(kept.pose - pose).max() < SAME_POSE
                and np.array_equal(kept.chart.cells, chart.cells)
            ):
                del self._kept[at]
                return

    def _forget_one(self, newest: Float64Array) -> None:
        away = np.linalg.norm(self.poses[:, :3, 3] - newest[:3, 3], axis=1)
        age = np.arange(len(away), 0.0, -1.0)
        worth = age / age.max() + away / max(float(away.max()), 1e-9)
        del self._kept[int(np.argmax(worth))]

    def _make_slots(self, cells: int, room: int) -> None:
        """Let the pool have a free slot of so many cells; it grows by half, up to the room."""
        slots = len(self._pool)
        if slots <= len(self._kept):
            slots = min(room, slots * 3 // 2 + 1)
        if room < slots or (slots, cells) != self._pool.shape:
            slots = min(slots, room)
            pool = np.zeros((slots, cells), np.int16)
            for slot, kept in enumerate(self._kept):
                image = kept.chart.cells
                place = pool[slot, : image.size].reshape(image.shape)
                place[:] = image
                self._kept[slot] = replace(kept, slot=slot, chart=replace(kept.chart, cells=place))
            self._pool = pool

    def packed(self) -> Memory:
        """The scans as the engine reads them."""
        if self._packed is None:
            charts = [kept.chart for kept in self._kept]
            poses = self.poses
            self._packed = Memory(
                cells=self._pool.reshape(-1),
                unit_m=np.array([chart.unit_m for chart in charts]),
                offset=np.array([kept.slot for kept in self._kept]) * self._pool.shape[1],
                columns=np.array([chart.cells.shape[0] for chart in charts]),
                rows=np.array([chart.cells.shape[1] for chart in charts]),
                slope_from=np.array([chart.slope_from for chart in charts]),
                rows_per_slope=np.array([1.0 / chart.slope_step for chart in charts]),
                sensor_from_scene=np.array([inverse(pose)[:3] for pose in poses]),
                position=np.ascontiguousarray(poses[:, :3, 3]),
                ground=np.array([chart.ground_m for chart in charts]),
                age_m=np.zeros(len(charts)),
                later_s=np.full(len(charts), np.nan),
            )
        return self._packed

    def packed_at(self, moment_s: float) -> Memory:
        """The scans as the engine reads them when it is asked about a moment."""
        later_s = self.timestamps_s - moment_s
        return self.packed()._replace(age_m=AGE_M_PER_S * np.abs(later_s), later_s=later_s)
