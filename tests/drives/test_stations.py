"""Stations of terrestrial scanners: 3DTK and PTX."""

import logging

import numpy as np
import pytest
from drive_layouts import pose_line, write_text
from scanned_room import scanned_room
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from intervis.drives import open_drive
from intervis.errors import CalibrationError, DriveError, ScanError
from intervis.transform import rigid, transform

# --- 3DTK ---


def rows_3dtk(points):
    """Our x forward, y left, z up in metres as 3DTK's x right, y up, z ahead in centimetres."""
    return [(-100 * y, 100 * z, 100 * x) for x, y, z in points]


def text_of(rows):
    return "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in rows)


def test_axes_and_units_of_3dtk(tmp_path):
    """A return two metres to the right, one up, three ahead; another column after it."""
    write_text(tmp_path / "scan007.3d", "200 100 300 0.5\n0 0 100 0.25\n")
    write_text(tmp_path / "scan007.pose", "100 200 300\n0 0 0\n")
    frame = open_drive(tmp_path)[7]
    assert frame.points.tolist() == [[3, -2, 1], [1, 0, 0]]
    assert frame.attributes["reflectance"].tolist() == [0.5, 0.25]
    assert frame.pose.tolist() == [[1, 0, 0, 3], [0, 1, 0, -1], [0, 0, 1, 2], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    ("angles", "ahead"),
    [
        # Left-handed, about y (up): the axis z ahead turns towards x, to the right.
        ("0 90 0", [0, -1, 0]),
        # About x (right): z ahead turns towards -y, down.
        ("90 0 0", [0, 0, -1]),
        # About z (ahead): ahead stays.
        ("0 0 90", [1, 0, 0]),
        # Rx Ry: Ry first takes ahead to the right, which Rx leaves.
        ("90 90 0", [0, -1, 0]),
    ],
)
def test_angles_of_3dtk_by_hand(tmp_path, angles, ahead):
    write_text(tmp_path / "scan000.3d", "0 0 100\n" * 3)
    write_text(tmp_path / "scan000.pose", f"0 0 0\n{angles}\n")
    pose = open_drive(tmp_path)[0].pose
    assert np.allclose(pose[:3, 0], ahead, atol=1e-12)
    assert np.isclose(np.linalg.det(pose[:3, :3]), 1)


def test_a_number_of_points_and_blank_lines_of_3dtk(tmp_path):
    write_text(tmp_path / "scan000.3d", "2\n\n0 0 100\n\n0 0 200\n")
    drive = open_drive(tmp_path)
    assert drive[0].points[:, 0].tolist() == [1, 2]
    assert drive.poses is None


def test_a_single_station_of_3dtk_has_the_pose_beside_it(tmp_path):
    write_text(tmp_path / "scan003.3d", "0 0 100\n")
    write_text(tmp_path / "scan003.pose", "0 0 500\n0 0 0\n")
    drive = open_drive(tmp_path / "scan003.3d")
    assert drive[0].pose[0, 3] == 5
    before = drive.fingerprint()["digest"]
    write_text(tmp_path / "scan003.pose", "0 0 600\n0 0 0\n")
    assert open_drive(tmp_path / "scan003.3d").fingerprint()["digest"] != before


def test_poses_txt_takes_precedence_over_pose_files(tmp_path):
    write_text(tmp_path / "scan000.3d", "0 0 100\n")
    write_text(tmp_path / "scan000.pose", "0 0 500\n0 0 0\n")
    write_text(tmp_path / "poses.txt", pose_line(9))
    assert open_drive(tmp_path)[0].pose[0, 3] == 9


def test_ranges_that_pile_up_at_the_largest_are_no_returns(tmp_path, caplog):
    room = scanned_room()
    direction = room[::20] / np.linalg.norm(room[::20], axis=1)[:, None]
    beyond = direction * np.linspace(32.755, 32.767, len(direction))[:, None]
    write_text(tmp_path / "scan000.3d", text_of(rows_3dtk(np.concatenate([room, beyond]))))
    with caplog.at_level(logging.INFO):
        points = open_drive(tmp_path)[0].points
    assert np.isnan(points[len(room) :]).all()
    assert np.allclose(points[: len(room)], room, atol=1e-5)
    assert f"{len(beyond)} ranges near 32.77 m" in caplog.text


def test_a_room_without_such_ranges_keeps_its_farthest_returns(tmp_path):
    write_text(tmp_path / "scan000.3d", text_of(rows_3dtk(scanned_room())))
    assert np.isfinite(open_drive(tmp_path)[0].points).all()


@pytest.mark.parametrize("text", ["", "\n\n", "5\n", "1 2\n3 4\n", "a b c\n"])
def test_3dtk_without_points(tmp_path, text):
    write_text(tmp_path / "scan000.3d", text)
    with pytest.raises(ScanError, match=r"holds no points|does not parse"):
        open_drive(tmp_path / "scan000.3d")[0]


@pytest.mark.parametrize("text", ["1 2 3\n4 5\n", "1 2 3\nx 5 6\n"])
def test_3dtk_that_does_not_parse(tmp_path, text):
    write_text(tmp_path / "scan000.3d", text)
    with pytest.raises(ScanError, match="does not parse as points of 3DTK"):
        open_drive(tmp_path)[0]


@pytest.mark.parametrize("text", ["", "1 2 3", "1 2 3\n4 5 6\n7\n", "1 2 3\n4 5 1e200\n"])
def test_a_pose_of_3dtk_has_six_numbers(tmp_path, text):
    write_text(tmp_path / "scan000.3d", "0 0 100\n")
    write_text(tmp_path / "scan000.pose", text)
    with pytest.raises(CalibrationError, match=r"scan000\.pose does not hold a translation"):
        open_drive(tmp_path)


@pytest.mark.realdata
def test_real_stations_of_3dtk_fall_together(shared_data):
    """Placed by their poses, the points of both lie closer than without: walls meet walls."""
    first, second = open_drive(shared_data / "3dtk_stations")
    assert np.isclose(np.linalg.norm(second.pose[:3, 3] - first.pose[:3, 3]), 1.57, atol=0.005)
    assert np.isnan(first.points).any(axis=1).sum() > 1000  # 32.76 m: nothing came back

    def placed(frame, pose):
        points = frame.points[np.isfinite(frame.points).all(axis=1)]
        return transform(pose, points[np.linalg.norm(points, axis=1) > 0.6])

    tree = cKDTree(placed(first, first.pose))
    apart = [
        np.median(tree.query(placed(second, pose)[::5])[0]) for pose in (second.pose, np.eye(4))
    ]
    assert apart[0] < 0.04 < 0.06 < apart[1]


# --- PTX ---

TURN = Rotation.from_euler("zyx", [70, 5, -8], degrees=True).as_matrix()


def ptx(points, columns, world_from_velo=None, position=None, extra="0.5"):
    """A station; points of NaN are written as nothing."""
    pose = np.eye(4) if world_from_velo is None else world_from_velo
    position = pose[:3, 3] if position is None else np.asarray(position)
    lines = [str(columns), str(len(points) // columns), " ".join(map(str, position))]
    lines += [" ".join(map(str, axis)) for axis in pose[:3, :3].T]
    lines += [" ".join(map(str, row)) for row in pose.T]
    for point in points:
        known = point if np.isfinite(point).all() else (0, 0, 0)
        lines.append(" ".join(f"{value:.9g}" for value in known) + f" {extra}")
    return "\n".join(lines) + "\n"


def with_gaps(count=40):
    points = scanned_room()[:count]
    points[::7] = np.nan
    return points


def test_a_ptx_file_with_two_stations(tmp_path):
    poses = [rigid(TURN, [100.0, 200.0, 30.0]), rigid(np.eye(3), [101.0, 203.0, 30.5])]
    text = ptx(with_gaps(40), 8, poses[0]) + ptx(with_gaps(30), 6, poses[1], extra="0.25 1 2 3")
    drive = open_drive(write_text(tmp_path / "a.ptx", text))
    assert (drive.layout, drive.frame_numbers) == ("ptx_stations", (0, 1))
    for frame, pose, count in zip(drive, poses, (40, 30), strict=True):
        assert np.allclose(frame.pose, pose)
        assert np.allclose(frame.points, with_gaps(count), equal_nan=True, atol=1e-6)
    assert drive[0].attributes["intensity"].tolist() == [0.5] * 40
    assert drive[1].attributes["blue"].tolist() == [3] * 30
    assert open_drive(tmp_path)[1].points.shape == (30, 3)  # the folder, too


def test_stations_of_several_files_are_numbered_through(tmp_path):
    write_text(tmp_path / "b.ptx", ptx(with_gaps(10), 5))
    write_text(tmp_path / "a.PTX", ptx(with_gaps(20), 5) + "\n\n" + ptx(with_gaps(30), 5) + "\n")
    drive = open_drive(tmp_path)
    assert [len(frame.points) for frame in drive] == [20, 30, 10]
    assert drive.poses is None
    with pytest.raises(DriveError, match="has no camera '2'"):
        open_drive(tmp_path, camera="2")


@pytest.mark.parametrize("moved", [False, True])
def test_a_position_beside_the_identity_is_where_the_scanner_stood(tmp_path, moved):
    """Points of the world are moved to the scanner; points of the scanner's frame are not."""
    room, position = scanned_room(), np.array([300.0, 100.0, 20.0])
    text = ptx(room + position if moved else room, 36, position=position)
    frame = open_drive(write_text(tmp_path / "a.ptx", text))[0]
    assert np.allclose(frame.points, room, atol=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("8\n5\n", "8\n6\n", "is truncated: its station declares 48 points, and 40"),
        ("8\n5\n", "8.5\n5\n", "line 1: expected the ten lines"),
        ("8\n5\n", "-8\n5\n", "line 1: expected the ten lines"),
        ("8\n5\n", "8 5\n5\n", "line 1: expected the ten lines"),
        ("8\n5\n", "many\n5\n", "line 1: 'many' is not a finite number"),
        ("8\n5\n", "99999999\n99999999\n", "line 1: the station is truncated"),
        ("1.0 0.0 0.0 0.0\n", "2.0 0.0 0.0 0.0\n", "line 7: the matrix of the station is not a r"),
        ("1.0 0.0 0.0 0.0\n", "1.0 0.0 0.0\n", "line 1: expected the ten lines"),
        ("0.0 0.0 0.0 1.0\n", "1e10 0.0 0.0 1.0\n", "line 1: the station has a number beyond 1e"),
        (" 0.5\n", "\n", None),
        (" 0.5\n", " 0.5 1\n", "has 5 numbers a point"),
        (" 0.5\n", " half\n", "does not parse as points of PTX"),
    ],
)
def test_invalid_ptx(tmp_path, old, new, message):
    text = ptx(with_gaps(40), 8)
    assert old in text
    path = write_text(tmp_path / "a.ptx", text.replace(old, new))
    if message is None:  # without intensity
        assert np.allclose(open_drive(path)[0].points, with_gaps(40), equal_nan=True)
        return
    with pytest.raises(DriveError, match=message):
        open_drive(path)[0]


def test_a_ptx_file_without_a_station(tmp_path):
    with pytest.raises(ScanError, match="holds no station"):
        open_drive(write_text(tmp_path / "a.ptx", "\n\n"))


@pytest.mark.realdata
def test_a_real_ptx_file(shared_data):
    frame = open_drive(shared_data / "tls" / "1.2-with-color.ptx")[0]
    assert len(frame.points) == 15 * 71
    # Its first line is "637012.240000 849028.310000 431.660000 0.034912 68 77 88".
    assert np.allclose(frame.points[0], [637012.24, 849028.31, 431.66], rtol=1e-7)
    assert frame.attributes["intensity"][0] == 0.034912
    assert [int(frame.attributes[name][0]) for name in ("red", "green", "blue")] == [68, 77, 88]
