"""Scan files as other tools write them: valid by what other readers take, and read to the value."""

import itertools
import struct
from pathlib import Path

import numpy as np
import pytest
from scanned_room import scanned_room

from intervis.drives.float_columns import TURN_DEG, azimuth_step_deg
from intervis.drives.scan import scan_of_rows
from intervis.drives.scan_file import read_scan
from intervis.errors import ScanError

ROWS = [(3.5, 6.25, -0.5, 25, 0), (3.75, 6.0, -0.5, 26, 1), (4.0, 6.5, -0.25, 27, 2)]
POINTS = [list(row[:3]) for row in ROWS]
HEADER = {
    "VERSION": ".7",
    "FIELDS": "x y z time ring",
    "SIZE": "4 4 4 8 2",
    "TYPE": "F F F F U",
    "COUNT": "1 1 1 1 1",
    "WIDTH": "3",
    "HEIGHT": "1",
    "VIEWPOINT": "0 0 0 1 0 0 0",
    "POINTS": "3",
}


def pcd_text(header, data="ascii", end="\n", blank=" "):
    lines = [f"{key} {value}" for key, value in header.items() if value is not None]
    head = "".join(line + end for line in [*lines, f"DATA {data}"])
    return head.encode() + "".join(blank.join(map(str, row)) + end for row in ROWS).encode()


def read_bytes(folder, name, content):
    path = folder / name
    path.write_bytes(content)
    return read_scan(path)


@pytest.mark.parametrize("end", ["\n", " \n", "\r\n", "\t\n", "\n\n"])
@pytest.mark.parametrize("blank", [" ", "\t", "  ", " \t"])
def test_ascii_pcd_with_any_blanks(tmp_path, end, blank):
    scan = read_bytes(tmp_path, "a.pcd", pcd_text(HEADER, end=end, blank=blank))
    assert scan.points.tolist() == POINTS
    assert scan.attributes["time"].tolist() == [25, 26, 27]
    assert scan.attributes["ring"].dtype == np.uint16


@pytest.mark.parametrize(
    "changes",
    [
        {"COUNT": None},
        {"POINTS": None},
        {"POINTS": None, "WIDTH": "1", "HEIGHT": "3"},
        {"POINTS": None, "HEIGHT": None},
        {"WIDTH": None, "HEIGHT": None},
        {"VIEWPOINT": None},
        {"VERSION": None},
        {"VERSION": ".6"},
        {"TYPE": "f f F f u"},
        {"SIZE": None, "TYPE": None, "FIELDS": "x y z time ring"},
        {"SENSOR": "roof 3"},
        {"# made by": "a tool"},
        {"FIELDS": "X Y Z time ring"},
        {"FIELDS": None, "COLUMNS": "x y z time ring"},
    ],
)
def test_pcd_headers_of_other_writers(tmp_path, changes):
    header = {**HEADER, **changes}
    if "COLUMNS" in changes:
        header = {"COLUMNS": header.pop("COLUMNS"), **header}
    assert read_bytes(tmp_path, "a.pcd", pcd_text(header)).points.tolist() == POINTS


def test_a_pcd_header_in_lower_case_or_with_a_byte_order_mark(tmp_path):
    content = b"\xef\xbb\xbf" + pcd_text(HEADER).replace(b"FIELDS", b"fields")
    assert read_bytes(tmp_path, "a.pcd", content).points.tolist() == POINTS


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_a_pcd_field_of_no_numbers_holds_nothing(tmp_path, data):
    head = (
        "FIELDS x gap y z\nSIZE 4 4 4 4\nTYPE F U F F\nCOUNT 1 0 1 1\nWIDTH 3\nHEIGHT 1\n"
        f"POINTS 3\nDATA {data}\n"
    ).encode()
    if data == "ascii":
        body = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS).encode()
    elif data == "binary":
        body = b"".join(struct.pack("<3f", *point) for point in POINTS)
    else:
        columns = struct.pack("<9f", *np.transpose(POINTS).ravel())
        body = struct.pack("<II", 36, 36) + columns
    scan = read_bytes(tmp_path, "a.pcd", head + body)
    assert scan.points.tolist() == POINTS
    assert not scan.attributes


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_a_pcd_field_of_several_numbers_keeps_them_by_point(tmp_path, data):
    """Normals (1, 2, 3), (4, 5, 6) of two points: never (1, 4) as the first of one."""
    head = (
        "FIELDS x y z normal\nSIZE 4 4 4 2\nTYPE F F F I\nCOUNT 1 1 1 3\nWIDTH 2\nHEIGHT 1\n"
        f"POINTS 2\nDATA {data}\n"
    ).encode()
    if data == "ascii":
        body = b"7 8 9 1 2 3\n10 11 12 4 5 6\n"
    elif data == "binary":
        body = struct.pack("<3f3h", 7, 8, 9, 1, 2, 3) + struct.pack("<3f3h", 10, 11, 12, 4, 5, 6)
    else:
        columns = struct.pack("<6f6h", 7, 10, 8, 11, 9, 12, 1, 2, 3, 4, 5, 6)
        body = struct.pack("<II", 36, 36) + columns
    scan = read_bytes(tmp_path, "a.pcd", head + body)
    assert scan.points.tolist() == [[7, 8, 9], [10, 11, 12]]
    assert scan.attributes["normal"].tolist() == [[1, 2, 3], [4, 5, 6]]


def test_whole_numbers_of_a_pcd_written_as_decimals(tmp_path):
    head = b"FIELDS x y z ring\nSIZE 4 4 4 1\nTYPE F F F U\nWIDTH 3\nDATA ascii\n"
    scan = read_bytes(tmp_path, "a.pcd", head + b"1 2 3 7.0\nnan nan nan nan\n4 5 6 1e3\n")
    assert scan.attributes["ring"].tolist() == [7, 0, 255]
    assert np.isnan(scan.points[1]).all()


def test_compressed_pcd_with_a_block_stored_as_it_is(tmp_path):
    points = np.random.default_rng(0).normal(size=(50, 3)).astype("<f4")
    raw = points.T.tobytes()
    head = b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 50\nDATA binary_compressed\n"
    scan = read_bytes(tmp_path, "a.pcd", head + struct.pack("<II", len(raw), len(raw)) + raw)
    assert np.array_equal(scan.points, points)


def test_compressed_pcd_refers_back_also_over_what_it_writes(tmp_path):
    """By hand: 4 bytes of 1.0, then 20 bytes from 4 bytes back: six times 1.0."""
    one = struct.pack("<f", 1.0)
    # Literal run of 4: control 3. Back reference: length 20 = 7 + 11 + 2, distance 4 = 3 + 1.
    packed = bytes([3]) + one + bytes([7 << 5, 11, 3])
    head = b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nDATA binary_compressed\n"
    scan = read_bytes(tmp_path, "a.pcd", head + struct.pack("<II", len(packed), 24) + packed)
    assert scan.points.tolist() == [[1, 1, 1], [1, 1, 1]]


@pytest.mark.parametrize(
    "packed",
    [
        bytes([23]) + bytes(22),  # a literal run that ends early
        bytes([3]) + bytes(4) + bytes([7 << 5]),  # a reference without its length
        bytes([3]) + bytes(4) + bytes([7 << 5, 11]),  # without its distance
        bytes([3]) + bytes(4) + bytes([7 << 5, 11, 4]),  # to before the start
        bytes([3]) + bytes(4) + bytes([7 << 5, 12, 3]),  # beyond the end
        bytes([24]) + bytes(25),  # a literal run beyond the end
        bytes([3]) + bytes(4),  # too little
    ],
)
def test_invalid_compression_is_told(tmp_path, packed):
    head = b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nDATA binary_compressed\n"
    with pytest.raises(ScanError, match="its compressed data is invalid"):
        read_bytes(tmp_path, "a.pcd", head + struct.pack("<II", len(packed), 24) + packed)


def test_compressed_pcd_whose_writer_left_the_padding_out(tmp_path):
    head = b"FIELDS _ x y z _\nSIZE 1 4 4 4 1\nTYPE U F F F U\nCOUNT 4 1 1 1 8\nWIDTH 2\n"
    columns = struct.pack("<6f", 7, 10, 8, 11, 9, 12)
    body = b"DATA binary_compressed\n" + struct.pack("<II", 24, 24) + columns
    scan = read_bytes(tmp_path, "a.pcd", head + body)
    assert scan.points.tolist() == [[7, 8, 9], [10, 11, 12]]
    assert not scan.attributes


# --- PLY ---

XYZ = [(1.5, 2.25, -0.5), (10.0, -3.0, 1.0), (4.0, 4.0, 4.0)]
VERTEX = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACE = "element face 2\nproperty uchar kind\nproperty list uchar int vertex_indices\n"
ENDIAN = {"binary_little_endian": "<", "binary_big_endian": ">"}


def ply(form, header, body):
    return f"ply\nformat {form} 1.0\n{header}end_header\n".encode() + body


def vertices(form):
    if form == "ascii":
        return "".join(f"{x} {y} {z}\n" for x, y, z in XYZ).encode()
    return b"".join(struct.pack(ENDIAN[form] + "3f", *row) for row in XYZ)


def faces(form):
    """A triangle and a quad."""
    if form == "ascii":
        return b"5 3 0 1 2\n6 4 0 1 2 0\n"
    order = ENDIAN[form]
    return struct.pack(order + "BB3i", 5, 3, 0, 1, 2) + struct.pack(
        order + "BB4i", 6, 4, 0, 1, 2, 0
    )


FORMS = ["ascii", *ENDIAN]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("first", ["vertex", "face"])
def test_ply_with_faces_before_or_after_the_vertices(tmp_path, form, first):
    parts = [(VERTEX, vertices(form)), (FACE, faces(form))]
    header, body = zip(*(parts if first == "vertex" else parts[::-1]), strict=True)
    scan = read_bytes(tmp_path, "a.ply", ply(form, "".join(header), b"".join(body)))
    assert scan.points.tolist() == [list(row) for row in XYZ]


@pytest.mark.parametrize("form", FORMS)
def test_ply_with_lists_in_the_vertices(tmp_path, form):
    """Lists of 2, 0 and 1 items stand between the coordinates."""
    header = (
        "element vertex 3\nproperty float x\nproperty list ushort short near\nproperty float y\n"
        "property float z\nproperty list uchar double far\nproperty uchar ring\n"
    )
    near, far = [(8, -9), (), (3,)], [(), (2.5,), (1.0, 2.0)]
    body = b""
    for number, ((x, y, z), a, b) in enumerate(zip(XYZ, near, far, strict=True)):
        if form == "ascii":
            words = [x, len(a), *a, y, z, len(b), *b, number]
            body += " ".join(map(str, words)).encode() + b"\n"
        else:
            kinds = f"{ENDIAN[form]}fH{len(a)}hffB{len(b)}dB"
            body += struct.pack(kinds, x, len(a), *a, y, z, len(b), *b, number)
    scan = read_bytes(tmp_path, "a.ply", ply(form, header, body))
    assert scan.points.tolist() == [list(row) for row in XYZ]
    assert {name: values.tolist() for name, values in scan.attributes.items()} == {
        "ring": [0, 1, 2]
    }
    with pytest.raises(ScanError, match=r"is truncated|do not parse|a list of '' items"):
        read_bytes(tmp_path, "a.ply", ply(form, header, body[:-2]))


def test_ply_with_blank_lines_in_header_and_data(tmp_path):
    body = vertices("ascii").replace(b"\n", b"\n \n\n")
    scan = read_bytes(tmp_path, "a.ply", ply("ascii", "\n" + VERTEX + "  \n", b"\n" + body))
    assert scan.points.tolist() == [list(row) for row in XYZ]


def test_ply_with_numbers_of_eight_bytes(tmp_path):
    header = VERTEX + "property int64 t\n"
    body = b"".join(struct.pack("<3fq", *row, 2**60 + 1) for row in XYZ)
    scan = read_bytes(tmp_path, "a.ply", ply("binary_little_endian", header, body))
    assert scan.attributes["t"].tolist() == [2**60 + 1] * 3


def test_a_list_of_a_negative_length_is_told(tmp_path):
    header = "element face 1\nproperty list char int v\n" + VERTEX
    body = struct.pack("<b", -1) + vertices("binary_little_endian")
    with pytest.raises(ScanError, match="a list of its face has -1 items"):
        read_bytes(tmp_path, "a.ply", ply("binary_little_endian", header, body))


@pytest.mark.parametrize("form", FORMS)
def test_ply_vertices_without_properties(tmp_path, form):
    with pytest.raises(ScanError, match="its vertices have no coordinates"):
        read_bytes(tmp_path, "a.ply", ply(form, "element vertex 3\n", b"\0" * 12))


# --- .bin ---


def columns(rows, *further):
    return np.column_stack([rows, *further]).astype("<f4")


def extra_columns(count, number):
    """Intensity, ring, then times."""
    ring = np.arange(count) % 32
    return [np.arange(count) * 7 % 256 / 255, ring, *(np.arange(count) * 1e-6,) * 5][:number]


@pytest.mark.parametrize("width", [3, 4, 5, 6, 7, 8])
@pytest.mark.parametrize("beams", [8, 9])
@pytest.mark.parametrize("order", ["rings", "firings"])
def test_the_columns_of_a_bin_are_recognised(tmp_path, caplog, width, beams, order):
    points = scanned_room(beams)
    if order == "firings":  # all beams of one azimuth, then the next
        points = points.reshape(beams, -1, 3).swapaxes(0, 1).reshape(-1, 3)
    rows = columns(points, *extra_columns(len(points), width - 3))
    scan = read_bytes(tmp_path, "a.bin", rows.tobytes())
    assert np.array_equal(scan.points, rows[:, :3])
    names = ["intensity", "ring", "column_6", "column_7", "column_8"][: width - 3]
    assert list(scan.attributes) == names
    for place, name in enumerate(names, start=3):
        assert np.array_equal(scan.attributes[name], rows[:, place])
    assert bool(caplog.records) == (width != 4)
    assert f"is read with {width} columns" in caplog.text or width == 4


def test_a_fifth_column_that_is_no_ring_is_not_called_one(tmp_path):
    points = scanned_room()
    rows = columns(points, np.ones(len(points)), np.linspace(0, 0.1, len(points)))
    assert list(read_bytes(tmp_path, "a.bin", rows.tobytes()).attributes) == [
        "intensity",
        "column_5",
    ]


@pytest.mark.parametrize(("width", "count"), [(5, 400), (5, 401), (6, 400), (7, 400)])
def test_columns_that_are_not_four_and_not_proven_are_told(tmp_path, rng, width, count):
    """Random points with an intensity and a ring: nothing of a scanner's order is in them."""
    rows = rng.uniform(-40, 40, (count, width))
    rows[:, 3] = rng.integers(0, 256, count)
    rows[:, 4] = np.arange(count) % 32
    with pytest.raises(
        ScanError, match=rf"not have the 4 columns .* perhaps {width} \({4 * width} b"
    ):
        read_bytes(tmp_path, "a.bin", rows.astype("<f4").tobytes())


@pytest.mark.parametrize("intensity", ["fraction", "byte", "zero"])
@pytest.mark.parametrize("count", [60, 400, 5000])
def test_points_in_no_order_with_four_columns_are_read(tmp_path, rng, caplog, intensity, count):
    rows = rng.uniform(-40, 40, (count, 4)).astype("<f4")
    if intensity != "fraction":
        rows[:, 3] = rng.integers(0, 256, count) * (intensity == "byte")
    scan = read_bytes(tmp_path, "a.bin", rows.tobytes())
    assert np.array_equal(scan.points, rows[:, :3])
    assert not caplog.records


@pytest.mark.parametrize("cut", [4, 8, 12, 7])
def test_a_scan_cut_off_is_truncated_whatever_divides_its_size(tmp_path, cut):
    points = scanned_room()
    content = columns(points, np.ones(len(points))).tobytes()
    for rows_less in range(5):
        with pytest.raises(ScanError, match="is truncated"):
            read_bytes(tmp_path, "a.bin", content[: len(content) - 16 * rows_less - cut])


def test_signalling_nans_in_any_column_leave_no_warning(tmp_path):
    """Found by fuzzing: numpy warns when it rounds or casts one."""
    points = scanned_room()
    values = columns(points, *extra_columns(len(points), 2)).ravel().view("<u4")
    values[:50] = 0x7F800001
    scan = read_bytes(tmp_path, "a.bin", values.tobytes())
    assert np.isnan(scan.points[:10]).all()
    assert np.array_equal(scan.points[10:], points[10:].astype("<f4"))


def test_a_sweep_under_another_name_is_read_as_what_it_is(tmp_path, caplog):
    """nuScenes names five columns .pcd.bin, Lyft and others .bin; some write four to .pcd.bin."""
    points = scanned_room()
    five, four = columns(points, *extra_columns(len(points), 2)), columns(points, points[:, 0])
    assert not caplog.records
    for name, rows in (("a.pcd.bin", five), ("a.bin", five), ("b.pcd.bin", four)):
        x, y, z = rows[:, :3].T
        expected = np.column_stack([y, -x, z] if ".pcd" in name else [x, y, z])
        assert np.array_equal(read_bytes(tmp_path, name, rows.tobytes()).points, expected)
    assert len(caplog.records) == 2


def test_every_width_is_tried_on_every_room():
    """The test data would say nothing if wrong widths were as regular as the right one."""
    points = scanned_room()
    for right, wrong in itertools.product((3, 4, 5, 6), (3, 4, 5, 6)):
        values = columns(points, *extra_columns(len(points), right - 3)).ravel()
        regular = azimuth_step_deg(values, wrong) < TURN_DEG
        assert regular == (wrong % right == 0)


def test_a_turn_by_right_angles_changes_no_bit_and_spreads_no_nan():
    rows = np.array([[1e-30, np.nan, 3], [np.inf, -0.1, 7]], np.float32)
    turn = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    points = scan_of_rows(Path("a"), rows, (), turn).points
    expected = np.column_stack([rows[:, 2], -rows[:, 0], -rows[:, 1]])
    assert np.array_equal(points, expected, equal_nan=True)
    turn[0, 3] = 2  # with a translation it is a motion as any other
    moved = scan_of_rows(Path("a"), np.array([[1.0, 2, 3]]), (), turn).points
    assert moved.tolist() == [[5, -1, -2]]
