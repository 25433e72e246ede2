"""Deskewing of a recording: clouds with times, and transforms of a moving vehicle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from bag_writer import Recorder, recording_path
from scipy.spatial.transform import Rotation

from intervis import open_drive
from intervis.transform import inverse, rigid, transform

STEP_NS = 100_000_000


def world_from_vehicle(time_s: float) -> np.ndarray:
    turn = Rotation.from_euler("z", 20.0 * time_s, degrees=True).as_matrix()
    return rigid(turn, [15.0 * time_s, 0.0, 0.0])


def test_returns_of_a_recorded_sweep_come_to_lie_where_they_were(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    world = rng.uniform([-20, -20, 0], [40, 20, 5], (300, 3))
    offset_s = np.sort(rng.uniform(0, 0.1, 300))
    path = recording_path(tmp_path, "mcap")
    with Recorder(path, "mcap") as recorder:
        for nth in range(-1, 4):
            recorder.write_transform(
                "odom", "velodyne", world_from_vehicle(0.1 * nth), (nth + 1) * STEP_NS
            )
        seen = [
            transform(inverse(world_from_vehicle(0.1 + t)), p)
            for t, p in zip(offset_s, world, strict=True)
        ]
        cloud = recorder.cloud(np.column_stack([seen, offset_s]).astype(np.float32), 2 * STEP_NS)
        cloud.fields[3] = replace(cloud.fields[3], name="time")
        recorder.write("/points", cloud, 2 * STEP_NS)
        recorder.write_cloud(world[:50].astype(np.float32), 3 * STEP_NS)
    frame = open_drive(path)[0]
    deskewed = transform(frame.pose, frame.deskewed())
    assert np.linalg.norm(transform(frame.pose, frame.points) - world, axis=1).max() > 1.0
    assert np.linalg.norm(deskewed - world, axis=1).max() < 5e-3
