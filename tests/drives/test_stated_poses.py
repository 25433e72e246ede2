"""PCD files that state the scanner's pose: the data tells where it stood, in both conventions."""

import logging
import re

import numpy as np
import pytest
from drive_layouts import pose_line, write_text
from scanned_room import scanned_room
from scipy.spatial.transform import Rotation

from intervis.drives import open_drive
from intervis.drives.viewpoint import stands_at_pose
from intervis.errors import DriveError
from intervis.transform import rigid, transform

TURN = Rotation.from_euler("zyx", [50, 4, -3], degrees=True)
WORDS = "{} {} {} {} {} {} {}"


def viewpoint(position, turn=TURN):
    x, y, z, w = turn.as_quat()
    return WORDS.format(*position, w, x, y, z)


def write_pcd(path, points, words, kind="f8"):
    path.parent.mkdir(parents=True, exist_ok=True)
    size = np.dtype(kind).itemsize
    head = (
        f"VERSION 0.7\nFIELDS x y z\nSIZE {size} {size} {size}\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT {words}\nPOINTS {len(points)}\nDATA binary\n"
    )
    path.write_bytes(head.encode() + points.astype(f"<{kind}").tobytes())
    return path


@pytest.mark.parametrize("position", [(1.5, 0.5, 0.2), (100.0, 50.0, 30.0), (4.5e5, 5.4e6, 110.0)])
@pytest.mark.parametrize("in_world", [False, True])
def test_points_come_in_the_scanners_frame_by_either_convention(
    tmp_path, caplog, position, in_world
):
    room = scanned_room()
    world_from_velo = rigid(TURN.as_matrix(), position)
    written = transform(world_from_velo, room) if in_world else room
    with caplog.at_level(logging.INFO):
        frame = open_drive(write_pcd(tmp_path / "a.pcd", written, viewpoint(position)))[0]
    assert np.allclose(frame.points, room, atol=1e-5)
    assert np.allclose(frame.pose, world_from_velo, atol=1e-9)
    where = "of their VIEWPOINT" if in_world else "of the scanner"
    assert [record.message for record in caplog.records] == [
        next(r.message for r in caplog.records if f"are in the frame {where}" in r.message)
    ]


def test_points_in_no_order_tell_it_by_what_hides_what(tmp_path, rng):
    room = rng.permutation(scanned_room(beams=24, step_deg=0.5))
    far_m = np.array([9.0, 6.0, 0.0])  # in the room, in its corner
    assert stands_at_pose(room + far_m, far_m) is True
    assert stands_at_pose(room, far_m) is False


def test_points_that_do_not_tell_are_taken_in_the_scanners_frame(tmp_path, caplog):
    points = np.random.default_rng(1).normal(size=(50, 3)) * 20
    frame = open_drive(write_pcd(tmp_path / "a.pcd", points, viewpoint((0.1, 0, 0))))[0]
    assert np.allclose(frame.points, points, atol=1e-5)
    assert "do not show whether" in caplog.text
    assert frame.pose[0, 3] == 0.1


def test_a_map_that_is_no_scan_is_told_with_its_share(tmp_path, caplog):
    """Points of a block of ground and air, seen from its middle: most stand behind others."""
    block = np.random.default_rng(2).uniform(-30, 30, (600_000, 3))
    open_drive(write_pcd(tmp_path / "a.pcd", block + 100, viewpoint((100, 100, 100))))
    assert re.search(r"[5-9]\d % of the points in .*a\.pcd are occluded by others", caplog.text)
    caplog.clear()
    open_drive(write_pcd(tmp_path / "b.pcd", scanned_room() + 100, viewpoint((100, 100, 100))))
    assert "are hidden" not in caplog.text


@pytest.mark.parametrize("words", ["0 0 0 1 0 0 0", "0 0 0 2 0 0 0", "-0 0 0 -1 0 0 0"])
def test_the_identity_is_no_pose(tmp_path, caplog, words):
    drive = open_drive(write_pcd(tmp_path / "a.pcd", scanned_room(), words))
    assert drive.poses is None
    assert not caplog.records


@pytest.mark.parametrize(
    "words",
    [
        "1 2 3",
        "1 2 3 0 0 0 0",
        "1 2 nan 1 0 0 0",
        "a b c 1 0 0 0",
        "1 2 3 1 0 0 0 0",
        "1e300 0 0 1 0 0 0",
        "1 2 3 1e300 0 0 0",
    ],
)
def test_a_viewpoint_that_is_none_is_named_and_left_out(tmp_path, caplog, words):
    drive = open_drive(write_pcd(tmp_path / "a.pcd", scanned_room(), words))
    assert drive[0].pose is None
    assert "its VIEWPOINT is not a position and a quaternion" in caplog.text


def test_signalling_nans_leave_no_warning(tmp_path):
    """Found by fuzzing."""
    position = (100.0, 50.0, 30.0)
    path = write_pcd(tmp_path / "b.pcd", scanned_room() + position, viewpoint(position), "f4")
    content = bytearray(path.read_bytes())
    content[-12:] = np.full(3, 0x7F800001, "<u4").tobytes()
    path.write_bytes(content)
    points = open_drive(path)[0].points
    assert np.isnan(points[-1]).all()
    assert np.isfinite(points[:-1]).all()


def test_a_rotation_at_the_origin_is_a_pose_in_the_world(tmp_path, caplog):
    room = scanned_room()
    frame = open_drive(write_pcd(tmp_path / "a.pcd", room, viewpoint((0, 0, 0))))[0]
    assert np.allclose(frame.points, room, atol=1e-5)
    assert np.allclose(frame.pose, rigid(TURN.as_matrix(), np.zeros(3)))
    assert "do not show whether" in caplog.text


def drive_of_three(root, in_world, first=(0.0, 0.0, 0.0)):
    """The scanner moves by 2 m along y: scans of the same room, which therefore moves with it."""
    poses = []
    for number in range(3):
        pose = rigid(TURN.as_matrix() if number else np.eye(3), np.add(first, [0, 2.0 * number, 0]))
        words = viewpoint(pose[:3, 3], TURN if number else Rotation.identity())
        points = transform(pose, scanned_room()) if in_world else scanned_room()
        write_pcd(root / f"{number:06d}.pcd", points, words)
        poses.append(pose)
    return poses


@pytest.mark.parametrize("in_world", [False, True])
def test_all_scans_of_a_folder_follow_one_convention(tmp_path, in_world):
    """The first stands at the origin, where nothing can be told, and the others tell."""
    poses = drive_of_three(tmp_path, in_world)
    drive = open_drive(tmp_path)
    for number, frame in enumerate(drive):
        assert np.allclose(frame.pose, poses[number])
        assert np.allclose(frame.points, scanned_room(), atol=1e-5)


@pytest.mark.parametrize("in_world", [False, True])
def test_poses_txt_takes_precedence_over_stated_poses(tmp_path, in_world):
    drive_of_three(tmp_path, in_world)
    write_text(tmp_path / "poses.txt", "\n".join(pose_line(n) for n in (5, 6, 7)))
    drive = open_drive(tmp_path)
    assert [frame.pose[0, 3] for frame in drive] == [5, 6, 7]
    assert np.allclose(drive[2].points, scanned_room(), atol=1e-5)


@pytest.mark.parametrize("in_world", [False, True])
def test_one_pose_for_all_scans_is_how_the_scanner_is_mounted(tmp_path, caplog, in_world):
    pose = rigid(TURN.as_matrix(), [1.0, 0.0, 1.8])
    for number in range(3):
        points = transform(pose, scanned_room()) if in_world else scanned_room()
        write_pcd(tmp_path / f"{number}.pcd", points, viewpoint((1.0, 0.0, 1.8)))
    drive = open_drive(tmp_path)
    assert drive.poses is None
    assert np.allclose(drive[1].points, scanned_room(), atol=1e-5)
    assert "share one VIEWPOINT" in caplog.text


def test_a_broken_file_of_a_folder_fails_alone(tmp_path):
    drive_of_three(tmp_path, in_world=True)
    (tmp_path / "000002.pcd").write_bytes(b"nothing")
    drive = open_drive(tmp_path)
    with pytest.raises(DriveError, match="has no FIELDS DATA"):
        drive[2]
    assert np.allclose(drive[1].points, scanned_room(), atol=1e-5)
    assert np.allclose(drive[1].pose[:3, 3], [0, 2, 0])


@pytest.mark.realdata
@pytest.mark.parametrize(
    "name",
    [
        "kitti_object/training/velodyne/000000.bin",
        "semantickitti/000000.bin",
        "opencalib/p64_qt_pair/qt.pcd",
    ],
)
@pytest.mark.parametrize("position", [(1.0, 0, 0), (10.0, 2, 0), (50.0, 0, 1), (300.0, 100, 2)])
def test_real_scans_tell_where_they_were_made(shared_data, name, position):
    points = open_drive(shared_data / name)[0].points.astype(np.float64)
    assert stands_at_pose(points + position, np.array(position)) is True
    assert stands_at_pose(points, np.array(position)) is False
