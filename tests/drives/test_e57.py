"""Stations in E57 files, written by pye57."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scanned_room import scanned_room
from scipy.spatial.transform import Rotation

from intervis.drives import open_drive
from intervis.drives.e57_stations import pose_of_node
from intervis.errors import CalibrationError, DriveError, MissingExtraError, ScanError

pye57 = pytest.importorskip("pye57", reason="pye57 (extra e57) is not installed")
TURN = Rotation.from_euler("zyx", [70, 5, -8], degrees=True)


def write_e57(path, *stations):
    """Each station: points, and arguments of pye57's writer."""
    file = pye57.E57(str(path), mode="w")
    for points, more in stations:
        data = {f"cartesian{axis}": points[:, nth] for nth, axis in enumerate("XYZ")}
        further = {
            name: more[name] for name in ("intensity", "cartesianInvalidState") if name in more
        }
        placed = {name: more[name] for name in ("rotation", "translation") if name in more}
        file.write_scan_raw({**data, **further}, **placed)
    file.close()
    return path


def test_stations_have_their_points_and_poses(tmp_path):
    room = scanned_room()
    x, y, z, w = TURN.as_quat()
    place = {"rotation": np.array([w, x, y, z]), "translation": np.array([4.0, 5.0, 6.0])}
    intensity = np.linspace(0, 1, len(room)).astype(np.float32)
    write_e57(tmp_path / "a.e57", (room, {**place, "intensity": intensity}), (room[:50] + 1, {}))
    for path in (tmp_path / "a.e57", tmp_path):
        drive = open_drive(path)
        assert (drive.layout, drive.frame_numbers) == ("e57_stations", (0, 1))
        assert np.allclose(drive[0].points, room, atol=1e-5)
        assert np.allclose(drive[0].pose[:3, :3], TURN.as_matrix())
        assert drive[0].pose[:3, 3].tolist() == [4, 5, 6]
        assert np.allclose(drive[0].attributes["intensity"], intensity)
        assert np.allclose(drive[1].points, room[:50] + 1, atol=1e-5)
    with pytest.raises(DriveError, match="has no camera '2'"):
        open_drive(tmp_path, camera="2")


def test_rows_that_are_marked_invalid_become_nan(tmp_path):
    state = np.zeros(100, np.int8)
    state[[3, 50]] = 2, 1
    write_e57(tmp_path / "a.e57", (scanned_room()[:100], {"cartesianInvalidState": state}))
    points = open_drive(tmp_path)[0].points
    assert np.flatnonzero(np.isnan(points).all(axis=1)).tolist() == [3, 50]
    assert np.allclose(points[4], scanned_room()[4], atol=1e-5)


class Node(dict):
    """A node of E57 as far as a pose is read."""

    def isDefined(self, name):
        return name in self


class Leaf:
    def __init__(self, number):
        self.number = number

    def value(self):
        return self.number


def leaves(**numbers):
    return Node({name: Leaf(number) for name, number in numbers.items()})


def test_a_pose_may_lack_its_rotation_or_its_translation():
    moved = leaves(x=1.0, y=2.0, z=3.0)
    turned = leaves(w=2.0, x=0.0, y=0.0, z=2.0)  # 90 degrees about z, not of length one
    assert pose_of_node(Path("a"), Node()) is None
    only_moved = pose_of_node(Path("a"), Node(pose=Node(translation=moved)))
    assert only_moved.tolist() == [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    only_turned = pose_of_node(Path("a"), Node(pose=Node(rotation=turned)))
    assert np.allclose(only_turned, [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    "pose",
    [
        Node(rotation=leaves(w=0.0, x=0.0, y=0.0, z=0.0)),
        Node(rotation=leaves(w=np.nan, x=0.0, y=0.0, z=0.0)),
        Node(translation=leaves(x=1e300, y=0.0, z=0.0)),
        Node(translation=leaves(x=np.nan, y=0.0, z=0.0)),
    ],
)
def test_a_pose_that_is_no_motion_is_told(pose):
    with pytest.raises(CalibrationError, match="pose is not a quaternion and a translation"):
        pose_of_node(Path("a"), Node(pose=pose))


@pytest.mark.parametrize("damage", ["empty", "text", "cut", "flipped"])
def test_a_damaged_file_is_told(tmp_path, damage):
    path = write_e57(tmp_path / "a.e57", (scanned_room(), {}))
    content = path.read_bytes()
    place = len(content) // 2  # in the points, whose pages have checksums
    path.write_bytes(
        {
            "empty": b"",
            "text": b"no file of this kind",
            "cut": content[: len(content) - 2000],
            "flipped": content[:place] + bytes([content[place] ^ 4]) + content[place + 1 :],
        }[damage]
    )
    with pytest.raises(ScanError, match=r"a\.e57 (is not a readable|cannot be read)") as caught:
        open_drive(path)[0]
    assert "\n" not in str(caught.value)


def test_without_pye57_the_extra_is_named(tmp_path, monkeypatch):
    write_e57(tmp_path / "a.e57", (scanned_room(), {}))
    monkeypatch.setitem(sys.modules, "pye57", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'intervis\[e57\]'"):
        open_drive(tmp_path)


@pytest.mark.realdata
def test_a_real_station(shared_data):
    frame = open_drive(shared_data / "tls/pumpAVisualReferenceImage.e57")[0]
    assert frame.points.shape == (155_201, 3)
    assert frame.pose is None
    assert frame.attributes["colorRed"].dtype == np.uint8
    # The columns of the scanner's grid lie at rising azimuth, as seen from where it stood.
    azimuth = np.unwrap(np.arctan2(frame.points[:, 1], frame.points[:, 0]))
    column = frame.attributes["columnIndex"].astype(int)
    middle = [np.nanmedian(azimuth[column == nth]) for nth in range(0, column.max(), 20)]
    assert np.all(np.diff(middle) > 0) or np.all(np.diff(middle) < 0)


def test_a_folder_of_stations_in_two_formats_is_refused(tmp_path):
    write_e57(tmp_path / "a.E57", (scanned_room(), {}))
    (tmp_path / "b.ptx").write_text("1\n1\n")
    with pytest.raises(DriveError, match="holds stations in PTX and in E57; give the path of one"):
        open_drive(tmp_path)
    assert len(open_drive(tmp_path / "a.E57")) == 1
