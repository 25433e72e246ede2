"""Limits of the readers: the last value that is taken, and the first that is not."""

import logging
import struct
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from drive_layouts import pose_line, write_text
from scipy.spatial.transform import Rotation

from intervis import drives
from intervis.drives import e57_stations, image_file, open_drive, ptx_stations, viewpoint
from intervis.drives.boxes import kitti_boxes
from intervis.drives.e57_stations import pose_of_node
from intervis.drives.float_columns import (
    azimuth_step_deg,
    column_distinctness,
    column_names,
    likely_width,
)
from intervis.drives.image_file import checked_image_size_px, image_file_size_px
from intervis.drives.nuscenes_sweeps import is_plain_name
from intervis.drives.nuscenes_tables import pose_of, time_ns_of
from intervis.drives.pcd_file import read_viewpoint, rotation_of_quaternion
from intervis.drives.scan_file import read_scan
from intervis.drives.threedtk import read_3d, station_poses
from intervis.drives.trajectory import poses_from_oxts, read_oxts_file, read_poses, read_seconds
from intervis.drives.viewpoint import hidden_share, stands_at_pose, step_spread
from intervis.errors import CalibrationError, DriveError, ScanError

# --- E57 ---


class File:
    """An open file as far as stations are read."""

    def __init__(self, points=3, columns=None, error=None):
        self.points, self.columns, self.error = points, columns, error
        self.closed = False

    def get_header(self, index):
        return SimpleNamespace(point_count=self.points)

    def read_scan_raw(self, index, ignore_unsupported_fields=False):
        if self.error:
            raise self.error
        if not ignore_unsupported_fields:
            raise ValueError("an extension that pye57 does not know")
        return self.columns

    def close(self):
        self.closed = True


def station(monkeypatch, file):
    """The scan of a station in an open file, which is closed after it."""
    monkeypatch.setattr(e57_stations, "_opened", lambda path: file)
    try:
        return e57_stations.StationReader(((Path("a.e57"), 0),))(0)
    finally:
        assert file.closed


def columns(names, *values):
    return {name: np.array(value) for name, value in zip(names, values, strict=True)}


def test_fields_that_pye57_does_not_know_are_left_out(monkeypatch):
    xyz = columns(e57_stations.CARTESIAN, [1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0])
    scan = station(monkeypatch, File(columns=xyz))
    assert scan.points.tolist() == [[1, 4, 7], [2, 5, 8], [3, 6, 9]]


def test_spherical_coordinates_of_e57(monkeypatch):
    """Two metres away: ahead, to the left, 30 degrees up to the left, and an invalid row."""
    names = (*e57_stations.SPHERICAL, "sphericalInvalidState", "intensity")
    quarter = np.pi / 2
    values = [2.0] * 4, [0, quarter, quarter, 0], [0, 0, np.pi / 6, 0], [0, 0, 0, 1], [5, 6, 7, 8]
    scan = station(monkeypatch, File(points=4, columns=columns(names, *values)))
    expected = [[2, 0, 0], [0, 2, 0], [0, np.sqrt(3), 1]]
    assert np.allclose(scan.points[:3], expected, atol=1e-6)
    assert np.isnan(scan.points[3]).all()
    assert list(scan.attributes) == ["intensity"]
    with pytest.raises(ScanError, match="neither cartesian nor spherical"):
        station(monkeypatch, File(columns={"intensity": np.ones(3)}))


@pytest.mark.parametrize(
    ("points", "message"),
    [(2**31 - 1, None), (2**31, "too many"), (-1, "too many"), (0, "no points"), (1, None)],
)
def test_points_of_a_station_of_e57(monkeypatch, points, message):
    xyz = columns(e57_stations.CARTESIAN, [1.0], [4.0], [7.0])
    if message is None:
        assert len(station(monkeypatch, File(points, xyz)).points) == 1
    else:
        with pytest.raises(ScanError, match=message):
            station(monkeypatch, File(points, xyz))


def test_what_pye57_raises_becomes_one_short_sentence(monkeypatch):
    for error, reason in (
        (RuntimeError("a\n long   story. " + 200 * "x"), "(a long story. " + 106 * "x" + ")"),
        (RuntimeError("broken."), "(broken)"),
        (RuntimeError(), "(RuntimeError)"),
        (OSError(5, "Input/output error"), "cannot read the scan a.e57: Input/output error."),
        (OSError(), "cannot read the scan a.e57: OSError."),
    ):
        with pytest.raises(ScanError) as caught:
            station(monkeypatch, File(error=error))
        assert reason in str(caught.value)


class Node(dict):
    """A node of E57 as far as a pose is read."""

    def isDefined(self, name):
        return name in self


def node(**numbers):
    return Node({key: SimpleNamespace(value=lambda n=n: n) for key, n in numbers.items()})


LENGTHS = [(1.1e-3, True), (1e-3, False), (1.1, True), (999.0, True), (1000.0, False)]


@pytest.mark.parametrize(("length", "valid"), LENGTHS)
def test_lengths_of_a_quaternion(tmp_path, caplog, length, valid):
    """Of E57, of a PCD's VIEWPOINT and of nuScenes: half a turn about z."""
    turned = np.diag([-1.0, -1.0, 1.0])
    write_text(
        tmp_path / "a.pcd",
        f"FIELDS x y z\nVIEWPOINT 1 2 3 0 0 0 {length}\nPOINTS 1\nDATA ascii\n1 2 3\n",
    )
    e57_node = Node(pose=Node(rotation=node(w=0.0, x=0.0, y=0.0, z=length)))
    record = {"rotation": [0, 0, 0, length], "translation": [1, 2, 3]}
    if valid:
        assert np.allclose(pose_of_node(Path("a"), e57_node)[:3, :3], turned)
        assert np.allclose(read_viewpoint(tmp_path / "a.pcd")[:3, :3], turned)
        assert np.allclose(pose_of(Path("a"), record)[:3, :3], turned)
        return
    with pytest.raises(CalibrationError, match="pose is not a quaternion"):
        pose_of_node(Path("a"), e57_node)
    with pytest.raises(CalibrationError, match="no quaternion under 'rotation'"):
        pose_of(Path("a"), record)
    assert read_viewpoint(tmp_path / "a.pcd") is None
    assert "VIEWPOINT is not a position and a quaternion" in caplog.text


@pytest.mark.parametrize(("far_m", "valid"), [(0.99e9, True), (1e9, None), (1.01e9, False)])
def test_places_of_a_billion_metres(tmp_path, far_m, valid):
    """A billion itself is taken from the lines of poses alone."""
    e57_node = Node(pose=Node(translation=node(x=0.0, y=-far_m, z=0.0)))
    record = {"rotation": [1, 0, 0, 0], "translation": [0, -far_m, 0]}
    write_text(tmp_path / "poses.txt", pose_line(0.0, -far_m))
    readers = (
        lambda: pose_of_node(Path("a"), e57_node),
        lambda: pose_of(Path("a"), record),
        lambda: read_poses(tmp_path / "poses.txt")[0],
    )
    for read, takes_the_limit in zip(readers, (False, False, True), strict=True):
        if takes_the_limit if valid is None else valid:
            assert read()[:3, 3].tolist() == [0, -far_m, 0]
        else:
            with pytest.raises(CalibrationError):
                read()


@pytest.mark.parametrize(
    ("words", "valid"),
    [
        ("0 -0.99e9 0 1 0 0 0", True),
        ("0 -1e9 0 1 0 0 0", False),
        ("1 2 3 1 0 0", False),
        ("1 2 3 1 0 0 0 0", False),
        ("1 2 3 1 0 0 x", False),
        ("1 2 3 nan 0 0 0", False),
    ],
)
def test_viewpoints_of_pcd(tmp_path, caplog, words, valid):
    write_text(
        tmp_path / "a.pcd", f"FIELDS x y z\nVIEWPOINT {words}\nPOINTS 1\nDATA ascii\n1 2 3\n"
    )
    assert (read_viewpoint(tmp_path / "a.pcd") is not None) == valid
    assert ("VIEWPOINT is not a position and a quaternion" in caplog.text) == (not valid)


def test_rotations_of_quaternions_are_those_of_scipy(rng):
    for wxyz in rng.normal(size=(50, 4)):
        expected = Rotation.from_quat(np.roll(wxyz, -1)).as_matrix()
        assert np.allclose(rotation_of_quaternion(wxyz), expected, atol=1e-12)


# --- PCD and PLY headers ---


def pcd(lines, body="1 2 3\n"):
    return ("\n".join([*lines, "DATA ascii"]) + "\n" + body).encode()


def read_bytes(folder, name, content):
    (folder / name).write_bytes(content)
    return read_scan(folder / name)


@pytest.mark.parametrize(("numbers", "valid"), [(4096, True), (4097, False)])
def test_numbers_of_a_point_of_pcd(tmp_path, numbers, valid):
    lines = ["FIELDS x y z more", f"COUNT 1 1 1 {numbers - 3}", "POINTS 1"]
    content = pcd(lines, "7 " * numbers + "\n")
    if valid:
        more = read_bytes(tmp_path, "a.pcd", content).attributes["more"]
        assert more.shape == (1, numbers - 3)
    else:
        with pytest.raises(ScanError, match="more than 4096 numbers"):
            read_bytes(tmp_path, "a.pcd", content)


@pytest.mark.parametrize(("lines", "valid"), [(200, True), (201, False)])
def test_lines_of_a_header_of_pcd(tmp_path, lines, valid):
    """FIELDS, POINTS, comments and DATA."""
    content = pcd(["FIELDS x y z", "POINTS 1", *["# a comment"] * (lines - 3)])
    if valid:
        assert read_bytes(tmp_path, "a.pcd", content).points.tolist() == [[1, 2, 3]]
    else:
        with pytest.raises(ScanError, match="its header has no DATA"):
            read_bytes(tmp_path, "a.pcd", content)


@pytest.mark.parametrize(("digits", "message"), [(15, "truncated"), (16, "the invalid line")])
def test_digits_of_a_number_in_a_header_of_pcd(tmp_path, digits, message):
    with pytest.raises(ScanError, match=message):
        read_bytes(tmp_path, "a.pcd", pcd(["FIELDS x y z", "POINTS 1" + "0" * (digits - 1)]))


@pytest.mark.parametrize(
    ("kind", "size"), [("F", 2), *((kind, size) for kind in "IU" for size in (1, 2, 4, 8))]
)
def test_types_of_pcd(tmp_path, kind, size):
    """A field of each type after the coordinates, in binary."""
    dtype = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f8"), ("v", f"<{kind.lower()}{size}")])
    head = f"FIELDS x y z v\nSIZE 4 4 8 {size}\nTYPE F F F {kind}\nPOINTS 2\nDATA binary\n"
    rows = np.array([(1, 2, 3, 4), (5, 6, 7, 100)], dtype)
    scan = read_bytes(tmp_path, "a.pcd", head.encode() + rows.tobytes())
    assert scan.points.tolist() == [[1, 2, 3], [5, 6, 7]]
    assert scan.attributes["v"].tolist() == [4, 100]
    assert scan.attributes["v"].dtype == dtype["v"]


@pytest.mark.parametrize(
    ("row", "columns"),
    [
        ("1 2 3 1152921504606846977 4.0 5", "1 2"),  # read as a row of its types, but for 4.0
        ("1 2 3 1152921504606846977 4 5", "1 2"),
        ("1 2 3 1152921504606846977 4 5 77 88", "1 2"),  # with surplus numbers
    ],
)
def test_whole_numbers_of_pcd_keep_their_digits_beside_surplus_ones(tmp_path, row, columns):
    """Where all are written as whole numbers; else as many as 64-bit floats have."""
    lines = ["FIELDS x y z n m", "SIZE 4 4 4 8 2", "TYPE F F F U U", f"COUNT 1 1 1 {columns}"]
    scan = read_bytes(tmp_path, "a.pcd", pcd([*lines, "POINTS 1"], row + "\n"))
    assert scan.points.tolist() == [[1, 2, 3]]
    assert scan.attributes["m"].tolist() == [[4, 5]]
    exact = "." not in row
    assert scan.attributes["n"].tolist() == [2**60 + (1 if exact else 0)]


@pytest.mark.parametrize("row", ["1 2 3#4", "1 2 3.0e0#"])
def test_points_of_pcd_have_no_comments(tmp_path, row):
    with pytest.raises(ScanError, match="its points do not parse"):
        read_bytes(tmp_path, "a.pcd", pcd(["FIELDS x y z", "POINTS 1"], row + "\n"))


@pytest.mark.parametrize(("rows", "needed"), [(7, 14), (10**9, 2 * 10**9)])
def test_a_truncated_list_of_ply_is_found_before_its_rows_are_walked(tmp_path, rows, needed):
    """A row has two bytes at least: a number, and a count of zero."""
    head = f"element face {rows}\nproperty uchar kind\nproperty list uchar double v\n"
    head += "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
    content = f"ply\nformat binary_little_endian 1.0\n{head}end_header\n".encode() + bytes(13)
    with pytest.raises(ScanError, match=f"more than {needed} bytes, but it has 13"):
        read_bytes(tmp_path, "a.ply", content)


@pytest.mark.parametrize(
    ("count", "reason"),
    [("999999999", "do not parse"), ("1000000000", "a list of '1000000000' items")],
)
def test_digits_of_the_count_of_a_list_of_ply(tmp_path, count, reason):
    head = "element vertex 1\nproperty float x\nproperty float y\nproperty list uchar int v\n"
    head = f"ply\nformat ascii 1.0\n{head}property float z\nend_header\n"
    with pytest.raises(ScanError, match=reason):
        read_bytes(tmp_path, "a.ply", f"{head}1 2 {count} 3\n".encode())


PLY_TYPES = {
    "char int8": "i1",
    "uchar uint8": "u1",
    "short int16": "i2",
    "ushort uint16": "u2",
    "int int32": "i4",
    "uint uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float float32": "f4",
    "double float64": "f8",
}


@pytest.mark.parametrize(
    ("name", "kind"), [(name, kind) for names, kind in PLY_TYPES.items() for name in names.split()]
)
def test_types_of_ply(tmp_path, name, kind):
    head = "element vertex 1\nproperty double x\nproperty float y\nproperty float z\n"
    head = f"ply\nformat binary_big_endian 1.0\n{head}property {name} v\nend_header\n"
    value = struct.pack(">dff", 1.5, 2.5, 3.5) + np.array([101], ">" + kind).tobytes()
    scan = read_bytes(tmp_path, "a.ply", head.encode() + value)
    assert scan.points.tolist() == [[1.5, 2.5, 3.5]]
    assert scan.attributes["v"].dtype == np.dtype(kind)
    assert scan.attributes["v"].tolist() == [101]


@pytest.mark.parametrize(("lines", "valid"), [(1000, True), (1001, False)])
def test_lines_of_a_header_of_ply(tmp_path, lines, valid):
    """Counted after the first; format, element, three properties, comments, end_header."""
    head = ["ply", "format ascii 1.0", "element vertex 1", *(f"property float {a}" for a in "xyz")]
    content = "\n".join([*head, *["comment"] * (lines - 6), "end_header", "1 2 3\n"]).encode()
    if valid:
        assert read_bytes(tmp_path, "a.ply", content).points.tolist() == [[1, 2, 3]]
    else:
        with pytest.raises(ScanError, match="its header has no end_header"):
            read_bytes(tmp_path, "a.ply", content)


@pytest.mark.parametrize(("digits", "message"), [(12, "truncated"), (13, "the invalid line")])
def test_digits_of_a_count_in_a_header_of_ply(tmp_path, digits, message):
    head = f"ply\nformat ascii 1.0\nelement vertex {'9' * digits}\nproperty float x\nend_header\n"
    with pytest.raises(ScanError, match=message):
        read_bytes(tmp_path, "a.ply", head.encode())


# --- columns of a .bin ---


def ring(count, width=4, step_deg=1.0):
    """Returns one step of azimuth apart, with whole numbers behind the coordinates."""
    azimuth = np.radians(step_deg * np.arange(count))
    others = np.ones((count, width - 3))
    rows = np.column_stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth, others])
    return rows.astype(np.float32).ravel()


def test_sixty_four_rows_tell_an_azimuth_step():
    assert azimuth_step_deg(ring(63), 4) == np.inf
    assert azimuth_step_deg(ring(64), 4) == pytest.approx(1.0, rel=1e-3)
    assert azimuth_step_deg(ring(65)[:-1], 4) == pytest.approx(1.0, rel=1e-3), "a row cut off"
    assert azimuth_step_deg(ring(100, step_deg=350.0), 4) == pytest.approx(10.0, rel=1e-3)


def test_rows_without_a_direction_do_not_count():
    rows = ring(70).reshape(-1, 4)
    rows[:7, :2] = 0.0
    assert azimuth_step_deg(rows.ravel(), 4) == np.inf
    rows[6, 1] = -1.0
    assert np.isfinite(azimuth_step_deg(rows.ravel(), 4)), "on an axis"
    rows[6, 2] = np.nan
    assert azimuth_step_deg(rows.ravel(), 4) == np.inf


def test_numbers_that_are_all_equal_tell_nothing_of_columns():
    assert column_distinctness(np.full(4000, 2.5, np.float32), 4) == 0.0


def test_fewer_than_sixty_four_rows_tell_nothing_of_columns():
    values = np.random.default_rng(0).uniform(size=4 * 64).astype(np.float32)
    values[3::4] = 7.0
    assert column_distinctness(values, 4) > 0.9
    assert column_distinctness(values[:-1], 4) == 0.0
    assert likely_width(values[: 4 * 63], 4) == (4, True)
    assert likely_width(values[: 4 * 63 - 1], 4) == (None, True)


@pytest.mark.parametrize(("step_deg", "turning"), [(2.9, True), (3.1, False)])
def test_a_scanner_turns_less_than_three_degrees(step_deg, turning):
    """Rows of five numbers: proven by the azimuth, or by their columns alone."""
    width, certain = likely_width(ring(500, 5, step_deg), 4)
    assert (width, certain) == (5, turning)


@pytest.mark.parametrize(("highest", "name"), [(1023, "ring"), (1024, "column_5")])
def test_a_ring_is_below_1024(highest, name):
    rows = np.ones((4, 6), np.float32)
    rows[2, 4] = highest
    assert column_names(rows.ravel(), 6) == ("intensity", name, "column_6")
    rows[2, 4] = -1
    assert column_names(rows.ravel(), 6)[1] == "column_5"
    assert column_names(rows[:, :3].ravel(), 3) == ()


# --- images ---


def png_start(width_px, height_px):
    return b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">II", width_px, height_px)


def test_eighty_million_pixels_are_decoded(tmp_path):
    path = tmp_path / "a.png"
    path.write_bytes(png_start(8000, 10_000))
    assert checked_image_size_px(path) == (8000, 10_000)
    for width_px, height_px in ((8000, 10_001), (80_000_001, 1)):
        path.write_bytes(png_start(width_px, height_px))
        assert image_file_size_px(path) == (width_px, height_px)
        with pytest.raises(DriveError, match="more than this program decodes"):
            checked_image_size_px(path)


@pytest.mark.parametrize(("segments", "valid"), [(999, True), (1000, False)])
def test_segments_before_the_size_of_a_jpeg(tmp_path, segments, valid):
    other = b"\xff\xfe" + struct.pack(">H", 9) + b"comment"
    frame = b"\xff\xc0" + struct.pack(">HBHH", 17, 8, 30, 40) + bytes(10)
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8" + other * segments + frame)
    if valid:
        assert image_file_size_px(tmp_path / "a.jpg") == (40, 30)
    else:
        with pytest.raises(DriveError, match="neither a PNG nor a JPEG"):
            image_file_size_px(tmp_path / "a.jpg")


def test_an_empty_segment_before_the_size_of_a_jpeg(tmp_path):
    frame = b"\xff\xc2" + struct.pack(">HBHH", 17, 8, 30, 40) + bytes(10)
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8" + b"\xff\xe1\0\2" + b"\xff\xfe\0\3x" + frame)
    assert image_file_size_px(tmp_path / "a.jpg") == (40, 30)


def test_the_first_image_that_can_be_read_tells_the_size(tmp_path):
    for name, content in (("1", b""), ("2", png_start(5, 6)), ("3", png_start(7, 8))):
        (tmp_path / name).write_bytes(content)
    images = {number: tmp_path / str(number) for number in (3, 2, 1)}
    assert image_file.first_image_size_px(images) == (5, 6)
    with pytest.raises(DriveError, match=r"/1 is neither"):
        image_file.first_image_size_px({4: tmp_path / "4", 1: tmp_path / "1"})


# --- labels of boxes ---

LABEL = "Car 0 0 0 1 2 3 4 1.5 1.6 3.9 {x} 2 9 0.5"


@pytest.mark.parametrize(("x", "valid"), [("-1000000", True), ("1000001", False)])
def test_places_of_boxes(tmp_path, x, valid):
    write_text(tmp_path / "a.txt", LABEL.format(x=x))
    if valid:
        (box,) = kitti_boxes(tmp_path / "a.txt", np.eye(4), None)
        assert box.velo_from_box[:3, 3].tolist() == [-1000000, 1.25, 9]
        assert (box.size_m.tolist(), box.track, box.returns) == ([3.9, 1.6, 1.5], "", None)
    else:
        with pytest.raises(CalibrationError, match="line 1: expected a label"):
            kitti_boxes(tmp_path / "a.txt", np.eye(4), None)


def test_a_label_has_fourteen_numbers_and_may_have_a_score(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, LABEL.format(x=1) + " 0.9\n\n" + LABEL.format(x=2))
    assert [box.velo_from_box[0, 3] for box in kitti_boxes(path, np.eye(4), None)] == [1, 2]
    write_text(path, LABEL.format(x=1).rsplit(maxsplit=1)[0])
    with pytest.raises(CalibrationError, match="line 1: expected a label"):
        kitti_boxes(path, np.eye(4), None)
    write_text(path, "3 7 " + LABEL.format(x=1) + "\n3 -1 DontCare\n4\n4 8 " + LABEL.format(x=2))
    assert [box.track for box in kitti_boxes(path, np.eye(4), 3)] == ["7"]
    assert [box.track for box in kitti_boxes(path, np.eye(4), 4)] == ["8"]
    write_text(path, "3 7 " + LABEL.format(x=1).rsplit(maxsplit=1)[0])
    with pytest.raises(CalibrationError, match="line 1: expected a label"):
        kitti_boxes(path, np.eye(4), 3)


# --- stations ---


def centimetres(ranges_m):
    return "".join(f"0 0 {100 * range_m:.6f}\n" for range_m in ranges_m)


@pytest.mark.parametrize(
    ("others", "pile", "removed"),
    [
        (100, [32.76] * 8, True),
        (100, [32.76] * 7, False),
        (100, [32.767] + [32.7475] * 7, True),  # all within 2 cm of the largest
        (100, [32.767] + [32.7465] * 7, False),
        (11_900, [32.76] * 12, True),  # one in a thousand of 11,912 are 11.9
        (12_100, [32.76] * 12, False),
        (100, [32.76] * 8 + [31.75] * 7, True),  # fewer in the metre before
        (100, [32.76] * 8 + [31.75] * 8, False),
        (100, [32.76] * 8 + [31.73] * 8, True),  # farther than a metre before the pile
    ],
)
def test_ranges_that_mean_no_return(tmp_path, others, pile, removed):
    """Ranges up to 20 m, and those that pile up at the largest one."""
    ranges_m = [*np.linspace(1.0, 20.0, others), *pile]
    rows = centimetres(ranges_m).replace("\n", " 99\n", others)  # a reflectance is no length
    write_text(tmp_path / "scan000.3d", rows.replace("0\n", "0 0\n"))
    missing = np.isnan(read_3d(tmp_path / "scan000.3d").points).any(axis=1)
    at_largest = np.array(ranges_m) > max(pile) - 0.02
    assert (missing == (at_largest if removed else False)).all()


def test_huge_coordinates_of_3dtk_leave_no_warning(tmp_path):
    write_text(tmp_path / "scan000.3d", "0 0 1e300\n0 0 100\n")
    points = read_3d(tmp_path / "scan000.3d").points
    assert points[1].tolist() == [1, 0, 0]
    assert points[0, 0] == np.inf


@pytest.mark.parametrize(("far", "valid"), [("1e11", True), ("-1.01e11", False)])
def test_places_of_stations_of_3dtk(tmp_path, far, valid):
    write_text(tmp_path / "scan000.pose", f"0 0 {far}\n0 0 0\n")
    scans = {5: tmp_path / "scan000.3d"}
    if valid:
        assert station_poses(scans)[0][5][0, 3] == pytest.approx(1e9)
    else:
        with pytest.raises(CalibrationError, match="does not hold a translation"):
            station_poses(scans)


def ptx(points, position="0 0 0", translation="1 2 3", width=4):
    axes = "1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
    rows = "".join(" ".join(map(str, range(1, width + 1))) + "\n" for _ in range(points))
    return f"{points}\n1\n{position}\n{axes}{translation} 1\n{rows}"


def test_a_broken_second_station_of_ptx_is_found_by_its_line(tmp_path):
    """The first takes 10 + 3 lines: the counts of the second stand in the lines 14 and 15."""
    write_text(tmp_path / "a.ptx", ptx(3) + ptx(2).replace("2\n1\n", "2\nx\n", 1))
    with pytest.raises(CalibrationError, match=r"a\.ptx, line 15: 'x' is not"):
        open_drive(tmp_path)
    write_text(tmp_path / "a.ptx", ptx(3) + ptx(2).replace("2\n1\n", "2\n1.5\n", 1))
    with pytest.raises(CalibrationError, match=r"a\.ptx, line 14: expected the ten lines"):
        open_drive(tmp_path)


def test_a_truncated_station_of_ptx_is_found_before_its_points_are_read(tmp_path):
    """Three points need 17 bytes at least: three times "0 0 0", with two line ends."""
    head = ptx(3, width=3).rsplit("1 2 3\n" * 3, 1)[0]
    path = tmp_path / "a.ptx"
    write_text(path, head + "0 0 1\n0 1 0\n1 0 0")
    assert ptx_stations.read_stations(path)[0].points == 3
    write_text(path, head + "0 0 1\n0 1 0\n1 0 ")
    with pytest.raises(CalibrationError, match=r"line 1: .* is truncated: .* 3 points"):
        ptx_stations.read_stations(path)


def test_one_point_and_what_follows_a_station_of_ptx(tmp_path):
    write_text(tmp_path / "a.ptx", ptx(1))
    assert open_drive(tmp_path)[0].points.tolist() == [[1, 2, 3]]
    write_text(tmp_path / "a.ptx", ptx(3) + "2")  # a station cut off, without an end of line
    with pytest.raises(CalibrationError, match="line 14: expected the ten lines"):
        open_drive(tmp_path)


@pytest.mark.parametrize("place", ["position", "translation"])
@pytest.mark.parametrize(("far", "valid"), [("-1e9", True), ("-1.01e9", False)])
def test_places_of_stations_of_ptx(tmp_path, place, far, valid):
    write_text(tmp_path / "a.ptx", ptx(2, **{place: f"0 {far} 0"}))
    if valid:
        assert len(ptx_stations.read_stations(tmp_path / "a.ptx")) == 1
    else:
        with pytest.raises(CalibrationError, match="lengths must be metres"):
            ptx_stations.read_stations(tmp_path / "a.ptx")


# --- trajectories and times ---


@pytest.mark.parametrize(
    ("record", "valid"),
    [
        ("89.9 -360 0 0 0 0", True),
        ("90 0 0 0 0 0", False),
        ("-90 0 0 0 0 0", False),
        ("0 361 0 0 0 0", False),
        ("0 -361 0 0 0 0", False),
        ("0 0 1e9 0 0 0", True),
        ("0 0 -1.1e9 0 0 0", False),
        ("0 0 0 0 0", False),
        ("0 0 0 0 0 0 1e30", True),
    ],
)
def test_records_of_oxts(tmp_path, record, valid):
    write_text(tmp_path / "a.txt", record)
    if valid:
        assert read_oxts_file(tmp_path / "a.txt") == tuple(map(float, record.split()[:6]))
    else:
        with pytest.raises(CalibrationError, match="line 1: expected latitude"):
            read_oxts_file(tmp_path / "a.txt")


def test_a_degree_of_longitude_is_111_kilometres_times_the_cosine_of_the_latitude():
    """6,378,137 m times pi / 180, at a latitude of 60 degrees half of it."""
    records = {3: (60.0, 8.0, 100.0, 0.0, 0.0, 0.0), 7: (60.0, 9.0, 90.0, 0.0, 0.0, np.pi / 2)}
    poses = poses_from_oxts(records, np.eye(4))
    assert np.allclose(poses[3], np.eye(4))
    assert np.allclose(poses[7][:3, 3], [111_319.4908 / 2, 0, -10], atol=1e-3)
    assert np.allclose(poses[7][:3, :3], Rotation.from_euler("z", 90, degrees=True).as_matrix())


def test_a_degree_of_latitude_north_of_the_equator():
    """By Mercator 6,378,137 m times asinh(tan(1 degree)), and times the cosine at the start."""
    poses = poses_from_oxts({0: (0.0, 0, 0, 0, 0, 0), 1: (1.0, 0, 0, 0, 0, 0)}, np.eye(4))
    north_m = 6_378_137 * np.arcsinh(np.tan(np.radians(1.0)))
    assert poses[1][:3, 3] == pytest.approx([0, north_m, 0], abs=1e-6)
    assert north_m == pytest.approx(111_325, abs=1)
    back = poses_from_oxts({0: (1.0, 0, 0, 0, 0, 0), 1: (0.0, 0, 0, 0, 0, 0)}, np.eye(4))
    assert back[1][1, 3] == pytest.approx(-north_m * np.cos(np.radians(1.0)))


@pytest.mark.parametrize("numbers", [11, 13, 15, 17])
def test_numbers_of_a_pose(tmp_path, numbers):
    write_text(tmp_path / "poses.txt", " ".join(["0"] * numbers))
    with pytest.raises(CalibrationError, match=rf"a pose needs 12 numbers, .* has {numbers}"):
        read_poses(tmp_path / "poses.txt")


@pytest.mark.parametrize(("time_s", "valid"), [("-9e9", True), ("9.1e9", False)])
def test_seconds_that_64_bits_of_nanoseconds_hold(tmp_path, time_s, valid):
    write_text(tmp_path / "times.txt", time_s)
    if valid:
        assert read_seconds(tmp_path / "times.txt") == [-9_000_000_000 * 10**9]
    else:
        with pytest.raises(CalibrationError, match="which 64 bits of"):
            read_seconds(tmp_path / "times.txt")


@pytest.mark.parametrize(("time_us", "valid"), [(8.9e15, True), (-9e15, False), (1.5, True)])
def test_microseconds_that_64_bits_of_nanoseconds_hold(time_us, valid):
    if valid:
        assert time_ns_of(Path("a"), {"timestamp": time_us}) == int(time_us * 1000)
    else:
        with pytest.raises(CalibrationError, match="no time in microseconds"):
            time_ns_of(Path("a"), {"timestamp": time_us})


# --- points ---


@pytest.mark.parametrize(("far_m", "warned"), [(16_384.0, False), (-16_385.0, True)])
def test_coordinates_where_float32_is_coarser_than_a_millimetre(tmp_path, caplog, far_m, warned):
    np.save(tmp_path / "a.npy", np.array([[1.0, far_m, 2.0], [np.inf, 0.0, 0.0]]))
    read_scan(tmp_path / "a.npy")
    assert ("coarser than 1 mm" in caplog.text) == warned


def test_points_of_any_size_are_seen_from_a_place_without_a_warning():
    points = np.array([[1e200, 0, 0], [np.inf, 1, 1], [-np.inf, 1, 1], [np.nan, 0, 0], [1, 2, 3]])
    assert hidden_share(points, np.zeros(3)) == 0.0
    assert hidden_share(points, np.full(3, np.inf)) == 0.0
    stands_at_pose(points, np.array([1.0, 2.0, 3.0]))


@pytest.mark.parametrize(
    ("range_m", "behind"),
    [(10.0, False), (10.0 * 1.02 + 0.99, False), (10.0 * 1.02 + 1.01, True), (2.0, True)],
)
def test_a_point_is_hidden_that_lies_clearly_behind_another(range_m, behind):
    """One point 10 m away, or behind the other; by more than 2 % and a metre."""
    points = np.array([[10.0, 0.01, 0.01], [range_m, 0.01 * range_m / 10, 0.01 * range_m / 10]])
    assert hidden_share(points, np.zeros(3)) == (0.5 if behind else 0.0)


def seen_from_origin(*azimuth_elevation_range):
    """Points from degrees, degrees and metres."""
    a, e, r = np.array(azimuth_elevation_range, float).T
    a, e = np.radians(a), np.radians(e)
    return np.stack([r * np.cos(a) * np.cos(e), r * np.sin(a) * np.cos(e), r * np.sin(e)], axis=1)


@pytest.mark.parametrize("apart_deg", [(0.6, 0.0), (0.0, 0.6), (-0.6, 0.0), (0.0, -0.6)])
def test_points_in_different_directions_hide_nothing(apart_deg):
    """Directions fall into cells of half a degree."""
    near, far = (0.1, 0.1, 10.0), (0.1 + apart_deg[0], 0.1 + apart_deg[1], 20.0)
    assert hidden_share(seen_from_origin(near, far), np.zeros(3)) == 0.0
    assert hidden_share(seen_from_origin(far, near), np.zeros(3)) == 0.0
    behind = (0.4, 0.4, 20.0)
    assert hidden_share(seen_from_origin(near, far, behind), np.zeros(3)) == pytest.approx(1 / 3)


def test_doubled_returns_do_not_change_the_spread_of_angular_steps(rng):
    azimuth_deg = np.cumsum(rng.uniform(0.3, 0.5, 400))
    points = seen_from_origin(*((a, 0.0, 9.0) for a in azimuth_deg))
    spread = step_spread(points, np.zeros(3))
    assert 0.1 < spread < 0.6
    assert step_spread(np.repeat(points, 2, axis=0), np.zeros(3)) == pytest.approx(spread)


def ring_text(*ranges_m):
    """Returns in every direction, one behind the other."""
    azimuth = np.radians(np.arange(0.25, 360.0, 1.0))  # amid cells of half a degree
    return "".join(f"{r * np.cos(a)} {r * np.sin(a)} 0\n" for r in ranges_m for a in azimuth)


def test_one_scan_among_others_that_is_a_map_is_told(tmp_path, caplog):
    head = "FIELDS x y z\nVIEWPOINT {} 0 0 1 0 0 0\nPOINTS {}\nDATA ascii\n"
    for number, ranges_m in enumerate([(9,), (9, 20, 40), (9,)]):
        content = head.format(3000 + number, 360 * len(ranges_m)) + ring_text(*ranges_m)
        write_text(tmp_path / f"{number}.pcd", content)
    assert len(open_drive(tmp_path).poses) == 3
    assert "67 % of the points in" in caplog.text


def test_a_scan_of_which_half_the_points_are_hidden_is_none_of_a_map(tmp_path, caplog):
    """Two returns in each direction: just the share from which on a warning tells it."""
    head = "FIELDS x y z\nVIEWPOINT 3000 0 0 1 0 0 0\nPOINTS 720\nDATA ascii\n"
    write_text(tmp_path / "a.pcd", head + ring_text(9, 20))
    assert open_drive(tmp_path).poses[0][0, 3] == 3000
    assert "% of the points in" not in caplog.text


def test_a_scanner_that_is_turned_at_the_origin_hides_nothing(tmp_path, caplog):
    """No scan shows the frame of the points: origin and stated position are one place."""
    head = "FIELDS x y z\nVIEWPOINT 0 0 0 0 0 0 1\nPOINTS 1080\nDATA ascii\n"
    write_text(tmp_path / "a.pcd", head + ring_text(9, 20, 40))
    assert np.allclose(open_drive(tmp_path).poses[0], np.diag([-1.0, -1.0, 1.0, 1.0]))
    assert "do not show whether" in caplog.text
    assert "% of the points in" not in caplog.text


def test_a_scan_whose_points_are_cut_off_is_no_witness(tmp_path, caplog):
    """The farthest of the posed scans, which is asked first."""
    caplog.set_level(logging.INFO)
    head = "FIELDS x y z\nVIEWPOINT {} 0 0 1 0 0 0\nPOINTS 360\nDATA ascii\n"
    write_text(tmp_path / "0.pcd", head.format(3002) + "1 2 3\n")
    for number in (1, 2):
        write_text(tmp_path / f"{number}.pcd", head.format(3000 + number) + ring_text(9))
    drive = open_drive(tmp_path)
    assert "are in the frame of the scanner" in caplog.text
    assert np.allclose(np.linalg.norm(drive[1].points, axis=1), 9.0, atol=1e-3)
    with pytest.raises(ScanError, match="is truncated"):
        drive[0]


def test_three_scans_are_asked_for_the_frame_of_points(tmp_path, monkeypatch):
    """Those with the farthest poses first."""
    head = "FIELDS x y z\nVIEWPOINT {} 0 0 1 0 0 0\nPOINTS 360\nDATA ascii\n"
    for number in range(5):
        write_text(tmp_path / f"{number}.pcd", head.format(3000 + number) + ring_text(9))
    read, asked = viewpoint.read_table, []
    monkeypatch.setattr(
        viewpoint, "read_table", lambda path: (asked.append(path.name), read(path))[1]
    )
    open_drive(tmp_path)
    assert asked == ["4.pcd", "3.pcd", "2.pcd"]


def test_a_broken_file_among_posed_scans_fails_alone(tmp_path):
    head = "FIELDS x y z\nVIEWPOINT {} 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n1 2 3\n"
    write_text(tmp_path / "0.pcd", "no header")
    write_text(tmp_path / "1.pcd", head.format(5))
    write_text(tmp_path / "2.pcd", head.format(6))
    drive = open_drive(tmp_path)
    assert {number: pose[0, 3] for number, pose in drive.poses.items()} == {1: 5, 2: 6}
    with pytest.raises(ScanError, match=r"0\.pcd is not a readable PCD file"):
        drive[0]


def test_messages_about_the_frame_of_points_are_for_those_who_ask(tmp_path, caplog):
    """A scan 3 km from its stated pose: the points tell, and only the log says so."""
    caplog.set_level(logging.INFO)
    azimuth = np.radians(np.arange(0, 360, 1.0))
    rows = "".join(f"{3000 + 9 * np.cos(a)} {9 * np.sin(a)} 0\n" for a in azimuth)
    head = "FIELDS x y z\nVIEWPOINT 3000 0 0 1 0 0 0\nPOINTS 360\nDATA ascii\n"
    write_text(tmp_path / "a.pcd", head + rows)
    frame = open_drive(tmp_path / "a.pcd")[0]
    assert np.allclose(np.linalg.norm(frame.points, axis=1), 9.0, atol=1e-3)
    assert [record.levelname for record in caplog.records] == ["INFO"]


# --- folders and names ---


@pytest.mark.parametrize(
    "layout", drives._LAYOUTS, ids=[layout.expected_files[:20] for layout in drives._LAYOUTS]
)
def test_a_folder_of_other_files_holds_no_drive(tmp_path, layout):
    """A table of scenes alone is none of nuScenes."""
    (tmp_path / "empty").mkdir()
    write_text(tmp_path / "scene.json", "[]")
    write_text(tmp_path / "velodyne/notes.txt", "")
    assert layout.find_roots(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "plain"),
    [
        ("x" * 1000, True),
        ("...", True),
        ("x" * 1001, False),
        *((name, False) for name in ("", ".", "..", "a/b", "a\nb")),
    ],
)
def test_names_of_scenes_and_channels(name, plain):
    assert is_plain_name(name) == plain


@pytest.mark.parametrize(("entries", "more"), [(8, False), (9, True)])
def test_a_message_names_eight_entries_of_a_folder(tmp_path, entries, more):
    for number in range(entries):
        write_text(tmp_path / f"{number}.txt", "")
    with pytest.raises(DriveError) as caught:
        open_drive(tmp_path)
    shown = str(caught.value).rpartition("Found: ")[2]
    assert shown == ", ".join(f"{n}.txt" for n in range(8)) + (", ..." if more else "") + "."


def test_a_message_names_eight_drives_of_a_folder(tmp_path):
    for number in range(9):
        write_text(tmp_path / f"drive{number}/velodyne_points/data/1.bin", "")
    with pytest.raises(DriveError, match=r"holds 9 drives; .*: drive0, .*drive7\.$"):
        open_drive(tmp_path)
