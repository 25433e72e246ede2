"""Real scans: counts known from other readers, and consistency of scan, camera and image."""

import numpy as np
import pytest

from intervis.drives import open_drive

pytestmark = pytest.mark.realdata


def in_view(frame) -> int:
    """Number of returns in the image: positive depth, pixel inside."""
    homogeneous = np.column_stack([frame.points, np.ones(len(frame.points))])
    u, v, depth = frame.camera.projection @ frame.cam_from_velo @ homogeneous.T
    ahead = depth > 0
    u, v = u[ahead] / depth[ahead], v[ahead] / depth[ahead]
    inside = (u >= 0) & (u < frame.camera.width_px) & (v >= 0) & (v < frame.camera.height_px)
    return int(inside.sum())


def test_kitti_raw(shared_data):
    drive = open_drive(shared_data / "kitti_raw")
    assert drive.layout == "kitti_raw"
    assert drive.frame_numbers == tuple(range(24))
    first = drive[0]
    assert (len(first.points), in_view(first)) == (114_278, 16_333)
    for frame in drive:
        assert 15_000 < in_view(frame) < 17_000
        assert frame.image.shape == (375, 1242, 3)
        assert frame.attributes["intensity"].shape == (len(frame.points),)
        assert frame.pose.shape == (4, 4)
    assert np.array_equal(first.pose, np.eye(4))


@pytest.mark.parametrize("number", [0, 11, 23])
def test_edges_of_the_scan_project_to_edges_of_the_image(shared_data, number):
    # Tests matching, calibration and projection together: where the range jumps, the image gradient
    # is larger than 20 pixels beside it.
    frame = open_drive(shared_data / "kitti_raw")[number]
    homogeneous = np.column_stack([frame.points, np.ones(len(frame.points))])
    u, v, depth = frame.camera.projection @ frame.cam_from_velo @ homogeneous.T
    range_m = np.linalg.norm(frame.points, axis=1)
    jumps = (depth > 0) & (np.abs(np.diff(range_m, append=range_m[-1])) > 1)
    column, row = (u[jumps] / depth[jumps]), (v[jumps] / depth[jumps])
    inside = (column >= 40) & (column < 1202) & (row >= 0) & (row < 375)
    column, row = column[inside].astype(int), row[inside].astype(int)
    edge = np.abs(np.gradient(frame.image.mean(axis=2), axis=1))
    on_edges = edge[row, column].mean()
    for shift_px in (-40, -20, 20, 40):
        assert on_edges > 1.4 * edge[row, column + shift_px].mean()


def test_pcd_drive(shared_data):
    drive = open_drive(shared_data / "pcd_drive")
    assert drive.frame_numbers == tuple(range(22))
    assert drive.camera is None
    first = drive[0]
    assert first.points.shape == (119_978, 3)
    # The file is binary with four floats a point: read it by hand.
    content = first.scan_path.read_bytes()
    start = content.index(b"DATA binary\n") + len(b"DATA binary\n")
    rows = np.frombuffer(content, "<f4", 4 * 119_978, start).reshape(-1, 4)
    assert np.array_equal(first.points, rows[:, :3])
    assert np.array_equal(first.attributes["intensity"], rows[:, 3])
    path_m = sum(
        np.linalg.norm(drive.poses[n + 1][:3, 3] - drive.poses[n][:3, 3]) for n in range(21)
    )
    assert 16 < path_m < 18  # "the car moves 17 m"
    assert all(len(frame.points) > 100_000 for frame in drive)


def test_kitti_object(shared_data):
    drive = open_drive(shared_data / "kitti_object")
    assert drive.frame_numbers == (0, 1, 2)
    assert [len(frame.points) for frame in drive] == [115_384, 120_268, 126_891]
    assert in_view(drive[2]) == 20_210
    assert [drive[n].camera.width_px for n in (0, 1, 2)] == [1224, 1242, 1242]
    assert all(frame.image.shape[:2] == (frame.camera.height_px, frame.camera.width_px)
               for frame in drive)  # fmt: skip
    assert drive.poses is None


def test_nuscenes_sweep(shared_data):
    drive = open_drive(shared_data / "nuscenes_sweep")
    assert len(drive) == 1
    (path,) = drive.scan_paths.values()
    frame = open_drive(path)[0]
    assert frame.points.shape == (34_688, 3)
    assert set(np.unique(frame.attributes["ring"])) == set(range(32))
    assert 0 <= frame.attributes["intensity"].min() <= frame.attributes["intensity"].max() <= 255
