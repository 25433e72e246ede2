"""Scan formats: files written by independent code are read back, and invalid files are refused."""

import io
import logging
import pickle
import struct
import sys
from pathlib import Path

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis.drives.scan import scan_of_table
from intervis.drives.scan_file import read_scan, scan_ending
from intervis.errors import ScanError

coordinates = st.floats(width=32, allow_nan=True, allow_infinity=True)


def rows_of(columns: int):
    """(N, columns) float32 arrays, N from 1, with NaN and infinities."""
    shapes = st.tuples(st.integers(1, 20), st.just(columns))
    return shapes.flatmap(lambda shape: hnp.arrays(np.float32, shape, elements=coordinates))


def same(scan, rows, names=()):
    """Whether the scan holds exactly these rows, bit for bit where they are numbers."""
    assert scan.points.dtype == np.float32
    assert scan.points.flags.c_contiguous
    assert scan.points.flags.writeable
    assert np.array_equal(scan.points, rows[:, :3], equal_nan=True)
    assert list(scan.attributes) == list(names)
    for column, name in enumerate(names, start=3):
        assert np.array_equal(scan.attributes[name], rows[:, column], equal_nan=True)
    return True


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("scans")


# --- .bin, .pcd.bin, .npy ---


@given(rows=rows_of(4))
def test_bin_round_trip(folder, rows):
    path = folder / "scan.bin"
    path.write_bytes(b"".join(struct.pack("<4f", *row) for row in rows.tolist()))
    assert same(read_scan(path), rows, ("intensity",))


@given(rows=rows_of(5))
def test_nuscenes_round_trip(folder, rows):
    path = folder / "sweep.pcd.bin"
    path.write_bytes(b"".join(struct.pack("<5f", *row) for row in rows.tolist()))
    turned = rows.copy()  # x right, y forward in the file; x forward, y left in the scan
    turned[:, 0], turned[:, 1] = rows[:, 1], -rows[:, 0]
    assert same(read_scan(path), turned, ("intensity", "ring"))


@given(
    rows=st.sampled_from([3, 4]).flatmap(rows_of),
    kind=st.sampled_from(["<f4", ">f4", "<f8", ">f8"]),
    order=st.sampled_from("CF"),
)
def test_npy_round_trip(folder, rows, kind, order):
    path = folder / "scan.npy"
    np.save(path, np.asarray(rows.astype(kind), order=order))
    assert same(read_scan(path), rows, ("intensity",)[: rows.shape[1] - 3])


@pytest.mark.parametrize(
    ("name", "size_bytes", "point_bytes"),
    [("a.bin", 8, 16), ("a.bin", 33, 16), ("a.pcd.bin", 32, 20), ("a.pcd.bin", 21, 20)],
)
def test_a_truncated_scan_is_named(tmp_path, name, size_bytes, point_bytes):
    (tmp_path / name).write_bytes(bytes(size_bytes))
    with pytest.raises(
        ScanError, match=rf"{name} is truncated: its {size_bytes} .* {point_bytes},"
    ):
        read_scan(tmp_path / name)


@pytest.mark.parametrize("name", ["a.bin", "a.pcd.bin", "a.npy", "a.pcd", "a.ply"])
def test_an_empty_file_holds_no_points(tmp_path, name):
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(ScanError, match=rf"{name} holds no points: the file is empty"):
        read_scan(tmp_path / name)


@pytest.mark.parametrize("name", ["a.bin", "a.npy", "a.pcd", "a.ply"])
def test_a_missing_file_and_a_folder_are_errors(tmp_path, name):
    with pytest.raises(ScanError, match=rf"{name}.*No such file"):
        read_scan(tmp_path / name)
    (tmp_path / name).mkdir()
    with pytest.raises(ScanError, match=name):
        read_scan(tmp_path / name)


def test_endings():
    assert scan_ending(Path("x.pcd.bin")) == ".pcd.bin"
    assert scan_ending(Path("x.PLY")) == ".ply"
    with pytest.raises(ScanError, match=r"x\.laz is not a scan: its name must end in"):
        read_scan(Path("x.laz"))


class Bomb:
    """Unpickling an instance would end the test run."""

    def __reduce__(self):
        return (sys.exit, ("a scan was unpickled",))


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((0, 3)), "holds no points"),
        (np.zeros((5, 2)), r"shape \(N, 3\) or \(N, 4\), not \(5, 2\)"),
        (np.zeros((5, 5)), r"not \(5, 5\)"),
        (np.zeros(3), r"not \(3,\)"),
        (np.zeros((5, 3), int), "float32 or float64 metres, not int64"),
        (np.zeros((5, 3), np.float16), "not float16"),
        (np.zeros((5, 3), complex), "not complex128"),
        (np.zeros((5, 3), bool), "not bool"),
        (np.array([[Bomb()] * 3], dtype=object), "not a readable .npy array"),
    ],
)
def test_an_npy_array_that_is_not_a_scan(tmp_path, array, message):
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    with pytest.raises(ScanError, match=message):
        read_scan(tmp_path / "a.npy")


def test_an_npy_file_of_another_format(tmp_path):
    path = tmp_path / "a.npy"
    path.write_bytes(b"\x93NUMPY\x01\x00garbage")
    with pytest.raises(ScanError, match=r"not a readable \.npy array"):
        read_scan(path)
    buffer = io.BytesIO()
    np.savez(buffer, a=np.zeros((3, 3)))
    path.write_bytes(buffer.getvalue())
    with pytest.raises(ScanError, match="an archive of arrays"):
        read_scan(path)


def test_a_pickle_under_the_name_of_a_scan_is_never_loaded(tmp_path):
    path = tmp_path / "a.npy"
    path.write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(ScanError, match=r"not a readable \.npy array"):
        read_scan(path)


def test_an_npy_header_that_declares_more_than_the_file_holds(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((100, 4), np.float32))
    path.write_bytes(path.read_bytes()[:-16])
    with pytest.raises(ScanError, match=r"not a readable \.npy array"):
        read_scan(path)
    for declared in (b"(1e9, 4)", b"(99999999999, 4)", b"((((((((", b"(-10, 4)"):
        np.save(path, np.zeros((100, 4), np.float32))
        shape = b"(100, 4), }" + b" " * (len(declared) - 8)
        content = path.read_bytes().replace(shape, declared + b", }")
        assert declared in content
        path.write_bytes(content)
        with pytest.raises(ScanError, match=r"not a readable \.npy array"):
            read_scan(path)


@pytest.mark.parametrize(
    ("far_m", "dtype", "warns"),
    [
        (16_384.0, np.float64, False),  # as far as the numbers lie less than 1 mm apart
        (16_384.5, np.float64, True),
        (-16_384.5, np.float64, True),
        (np.inf, np.float64, False),
        (1e6, np.float32, False),  # nothing is lost that the file had
    ],
)
def test_far_coordinates_cause_a_warning_where_the_file_is_finer(
    tmp_path, caplog, far_m, dtype, warns
):
    path = tmp_path / "a.npy"
    np.save(path, np.array([[1.0, 2.0, 3.0], [0.0, far_m, 1.0]], dtype))
    with caplog.at_level(logging.WARNING):
        read_scan(path)
    assert bool(caplog.records) == warns


def test_coordinates_too_large_for_float32_cause_a_warning(tmp_path, caplog):
    path = tmp_path / "a.npy"
    np.save(path, np.array([[455_000.1, 5_428_000.2, 110.0], [1e300, 0, np.nan]]))
    with caplog.at_level(logging.WARNING):
        points = read_scan(path).points
    assert "subtract the sensor's position" in caplog.text
    assert points[1, 0] == np.inf  # dropped and counted by the method, as every such row
    caplog.clear()
    np.save(path, np.array([[120.0, -80.0, 3.0]]))
    read_scan(path)
    assert not caplog.records


# --- .ply ---

PLY_TYPES = {"f4": "float", "f8": "double", "u1": "uchar", "i2": "short", "u4": "uint32"}


def ply_bytes(table, form, before="", before_data=b"", ending="\n"):
    """A PLY file of a structured array, written by hand."""
    properties = [f"property {PLY_TYPES[kind[0].str[1:]]} {name}" for name, kind in
                  table.dtype.fields.items()]  # fmt: skip
    lines = ["ply", f"format {form} 1.0", "comment made by hand", *before.splitlines()]
    lines += [f"element vertex {len(table)}", *properties, "element face 0"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    head = "".join(line + ending for line in lines).encode()
    if form == "ascii":
        text = "".join(" ".join(repr(v.item()) for v in row) + ending for row in table)
        return head + before_data + text.encode()
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}[form]
    codes = "".join({"f4": "f", "f8": "d", "u1": "B", "i2": "h", "u4": "I"}[k[0].str[1:]]
                    for k in table.dtype.fields.values())  # fmt: skip
    return head + before_data + b"".join(struct.pack(order + codes, *row.item()) for row in table)


FORMS = ["ascii", "binary_little_endian", "binary_big_endian"]
PLY_ROW = np.dtype([("ring", "u1"), ("x", "f4"), ("y", "f8"), ("z", "f4"), ("time", "i2")])
ply_tables = hnp.arrays(
    PLY_ROW,
    st.integers(1, 12),
    elements=st.tuples(
        st.integers(0, 255),
        coordinates,
        st.floats(width=32),  # what a double holds comes back as float32
        coordinates,
        st.integers(-32768, 32767),
    ),
)


@pytest.mark.parametrize("form", FORMS)
@given(table=ply_tables, ending=st.sampled_from(["\n", "\r\n"]))
@settings(max_examples=40)
def test_ply_round_trip(folder, form, table, ending):
    path = folder / "scan.ply"
    path.write_bytes(ply_bytes(table, form, ending=ending))
    scan = read_scan(path)
    xyz = np.column_stack([table[axis] for axis in "xyz"]).astype(np.float32)
    assert np.array_equal(scan.points, xyz, equal_nan=True)
    assert list(scan.attributes) == ["ring", "time"]
    assert np.array_equal(scan.attributes["ring"], table["ring"])
    assert np.array_equal(scan.attributes["time"], table["time"])
    assert scan.attributes["time"].dtype == np.int16


def test_signalling_nans_are_read_without_a_warning(tmp_path):
    table = np.ones(2, PLY_ROW)
    content = ply_bytes(table, "binary_little_endian")
    nan32, nan64 = struct.pack("<I", 0x7F800001), struct.pack("<Q", 0x7FF0000000000001)
    row = struct.pack("<B", 1) + nan32 + nan64 + struct.pack("<fh", 1.0, 1)
    path = tmp_path / "a.ply"
    path.write_bytes(content[: -PLY_ROW.itemsize] + row)
    points = read_scan(path).points
    assert np.array_equal(points, [[1, 1, 1], [np.nan, np.nan, 1]], equal_nan=True)


def small_table(count=3):
    table = np.zeros(count, PLY_ROW)
    table["x"] = np.arange(count) + 1
    return table


@pytest.mark.parametrize("form", FORMS)
def test_ply_elements_before_the_vertices_are_skipped(tmp_path, form):
    before = "element camera 2\nproperty float view_px\nproperty uchar kind"
    order = ">" if form == "binary_big_endian" else "<"
    data = b"1.5 7\n2.5 8\n" if form == "ascii" else struct.pack(order + "fBfB", 1.5, 7, 2.5, 8)
    path = tmp_path / "a.ply"
    path.write_bytes(ply_bytes(small_table(), form, before, data))
    assert read_scan(path).points[:, 0].tolist() == [1, 2, 3]


@pytest.mark.parametrize("form", FORMS)
def test_truncated_ply(tmp_path, form):
    whole = ply_bytes(small_table(), form)
    path = tmp_path / "a.ply"
    path.write_bytes(whole[: -len("3 3.0 0.0 0.0 0\n") if form == "ascii" else -1])
    with pytest.raises(
        ScanError, match=r"a\.ply is not a readable PLY file: it is truncated: .*3 ver"
    ):
        read_scan(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("ply\n", "plu\n", 'its first line is not "ply"'),
        ("ascii 1.0", "utf8 1.0", "its header has the invalid line 'format utf8 1.0'"),
        ("format ascii 1.0\n", "", "its header names no format"),
        ("vertex 3", "vertex three", "its header has the invalid line 'element vertex three'"),
        (
            "vertex 3",
            "vertex 99999999999999999",
            "its header has the invalid line 'element vertex 9",
        ),
        ("vertex 3", "vertex 999999999999", "it is truncated: it declares 999999999999 vertices"),
        ("vertex 3", "vertex 0", None),
        ("element vertex", "element point", 'its header has no element "vertex"'),
        ("float x", "floating x", "its header has the invalid line 'property floating x'"),
        ("float x", "float x1", "has no x: its fields are ring x1 y z time"),
        ("short time", "float x", "its vertex names a property twice"),
        ("short time", "list float int time", "its header has the invalid line 'property list fl"),
        ("short time", "list uchar int time", None),
        ("short time", "list char int time", None),
        ("end_header", "end_head", "its header has the invalid line 'end_head'"),
        ("1.0 0.0 0.0 0", "1.0 0.0 zero 0", "its vertices do not parse"),
        ("1.0 0.0 0.0 0", "1.0 0.0 0.0", "its vertices do not parse"),
        ("1.0 0.0 0.0 0", "1.0 0.0 0.0 99999", "its vertices do not parse"),
    ],
)
def test_invalid_ply(tmp_path, old, new, message):
    text = ply_bytes(small_table(), "ascii").decode()
    assert old in text
    path = tmp_path / "a.ply"
    path.write_text(text.replace(old, new, 1))
    if "list uchar" in new or "list char" in new:  # a list of 0 items in each row
        assert read_scan(path).points[:, 0].tolist() == [1, 2, 3]
        return
    with pytest.raises(ScanError, match=message or "holds no points"):
        read_scan(path)


def test_ply_header_without_end(tmp_path):
    path = tmp_path / "a.ply"
    path.write_bytes(b"ply\nformat ascii 1.0\n" + b"comment more\n" * 5000)
    with pytest.raises(ScanError, match="its header has no end_header"):
        read_scan(path)


@pytest.mark.parametrize("form", FORMS[1:])
def test_huge_ply_counts_are_refused_before_allocation(tmp_path, form):
    whole = ply_bytes(small_table(), form)
    path = tmp_path / "a.ply"
    path.write_bytes(whole.replace(b"element vertex 3", b"element vertex 999999999999"))
    with pytest.raises(ScanError, match=r"999999999999 vertices need \d+ bytes, but it has 57"):
        read_scan(path)
    before = "element camera 999999999999\nproperty double view_px"
    path.write_bytes(ply_bytes(small_table(), form, before))
    with pytest.raises(ScanError, match="but it has 0"):
        read_scan(path)


# --- .pcd ---


def pcd_header(data, points, fields="x y z intensity ring", sizes="4 4 4 4 2", types="F F F F U"):
    counts = " ".join("1" for _ in fields.split())
    return (
        f"# .PCD v0.7 - made by hand\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\n"
        f"COUNT {counts}\nWIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\n"
        f"DATA {data}\n"
    ).encode()


def lzf_literals(content: bytes) -> bytes:
    """LZF without any compression: runs of up to 32 literal bytes, each after its length less 1."""
    runs = [content[start : start + 32] for start in range(0, len(content), 32)]
    return b"".join(bytes([len(run) - 1]) + run for run in runs)


def pcd_bytes(table, data):
    """A PCD file of the five fields above, written by hand."""
    head = pcd_header(data, len(table))
    if data == "ascii":
        text = "".join(" ".join(repr(v.item()) for v in row) + "\n" for row in table)
        return head + text.encode()
    if data == "binary":
        return head + b"".join(struct.pack("<4fH", *row.item()) for row in table)
    columns = b"".join(table[name].tobytes() for name in table.dtype.names)
    packed = lzf_literals(columns)
    return head + struct.pack("<II", len(packed), len(columns)) + packed


PCD_ROW = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2")]
)
ENCODINGS = ["ascii", "binary", "binary_compressed"]


def pcd_table(count=7):
    rng = np.random.default_rng(4)
    table = np.zeros(count, PCD_ROW)
    for name in "xyz":
        table[name] = rng.normal(scale=30, size=count)
    table["intensity"] = rng.random(count)
    table["ring"] = np.arange(count) * 9
    if count > 2:
        table["y"][2] = np.nan
    return table


def assert_pcd(scan, table):
    xyz = np.column_stack([table[axis] for axis in "xyz"])
    assert np.array_equal(scan.points, xyz, equal_nan=True)
    assert scan.points.flags.c_contiguous
    assert list(scan.attributes) == ["intensity", "ring"]
    assert np.array_equal(scan.attributes["intensity"], table["intensity"])
    assert np.array_equal(scan.attributes["ring"], table["ring"])
    assert scan.attributes["ring"].dtype == np.uint16


@pytest.fixture
def pypcd4():
    return pytest.importorskip("pypcd4", reason="pypcd4 (extra dev) is not installed")


@pytest.mark.parametrize("data", ENCODINGS)
@pytest.mark.parametrize("count", [1, 7, 500])
def test_pcd_written_by_hand(tmp_path, data, count):
    path = tmp_path / "a.pcd"
    path.write_bytes(pcd_bytes(pcd_table(count), data))
    assert_pcd(read_scan(path), pcd_table(count))


@pytest.mark.parametrize("data", ENCODINGS)
def test_pcd_written_by_pypcd4(tmp_path, pypcd4, data):
    table = pcd_table(3000)
    columns = [table[name] for name in table.dtype.names]
    cloud = pypcd4.PointCloud.from_points(
        columns, table.dtype.names, [table.dtype[name] for name in table.dtype.names]
    )
    path = tmp_path / "a.pcd"
    cloud.save(path, encoding=pypcd4.Encoding(data))
    scan = read_scan(path)
    if data == "ascii":  # pypcd4 prints ten decimals: not every bit of a small float32
        assert np.allclose(scan.points, np.column_stack(columns[:3]), atol=1e-9, equal_nan=True)
        assert np.array_equal(scan.attributes["ring"], table["ring"])
    else:
        assert_pcd(scan, table)


def test_pcd_padding_is_left_out_and_doubles_become_floats(tmp_path):
    head = pcd_header("binary", 2, "_ x y z", "1 8 8 8", "U F F F")
    path = tmp_path / "a.pcd"
    path.write_bytes(head + struct.pack("<BdddBddd", 1, 2, 3, 4, 5, 6, 7, 8))
    scan = read_scan(path)
    assert scan.points.tolist() == [[2, 3, 4], [6, 7, 8]]
    assert scan.points.dtype == np.float32
    assert not scan.attributes


@pytest.mark.parametrize("data", ENCODINGS)
def test_truncated_pcd(tmp_path, data):
    whole = pcd_bytes(pcd_table(40), data)
    head = len(pcd_header(data, 40))
    for kept in (0, 4, 9, (len(whole) - head) // 2, len(whole) - head - 12):
        path = tmp_path / "a.pcd"
        path.write_bytes(whole[: head + kept])
        with pytest.raises(
            ScanError,
            match=r"a\.pcd is not a readable PCD file: (it is trunc|its .* parse|its \d+ po)",
        ):
            read_scan(path)


def test_the_shortest_pcd_text_is_read(tmp_path):
    path = tmp_path / "a.pcd"
    path.write_bytes(pcd_header("ascii", 2, "x y z", "4 4 4", "F F F") + b"1 2 3\n4 5 6")
    assert read_scan(path).points.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_pcd_text_with_fewer_lines_than_declared(tmp_path):
    body = pcd_bytes(pcd_table(8), "ascii").splitlines(keepends=True)[-8:]
    path = tmp_path / "a.pcd"
    path.write_bytes(pcd_header("ascii", 7) + b"".join(body[:6]))
    with pytest.raises(ScanError, match="its header declares 7 points, but it holds 6"):
        read_scan(path)


def test_pcd_text_beyond_the_header_is_left_out_with_a_warning(tmp_path, caplog):
    """As other readers do: the header counts."""
    path = tmp_path / "a.pcd"
    whole = pcd_header("ascii", 2, "x y z", "4 4 4", "F F F") + b"1 2 3 9\n4 5 6 9\n7 8 9 9\n"
    path.write_bytes(whole)
    assert read_scan(path).points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert "declares 2 points of 3 numbers, and it holds 3 of 4" in caplog.text


@pytest.mark.parametrize("data", ENCODINGS)
def test_pcd_without_points(tmp_path, data):
    path = tmp_path / "a.pcd"
    path.write_bytes(pcd_header(data, 0))
    with pytest.raises(ScanError, match="holds no points"):
        read_scan(path)


@pytest.mark.parametrize("data", ENCODINGS)
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"POINTS 7", b"POINTS 999999999999", r"is truncated|need \d+ bytes, but its compressed"),
        (b"POINTS 7", b"POINTS many", "invalid line 'POINTS ... many ...'"),
        (b"POINTS 7", b"POINTS -7", "invalid line 'POINTS ... -7 ...'"),
        (
            b"WIDTH 7\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 7\n",
            b"",
            "neither POINTS nor WIDTH",
        ),
        (b"FIELDS x y z", b"FIELDS x y w", "has no z: its fields are x y w intensity ring"),
        (b"FIELDS x y z intensity ring", b"", "its header has no FIELDS"),
        (b"DATA ", b"DATA\n", "its header has no DATA"),
        (b"SIZE 4 4 4 4 2", b"SIZE 4 4 4 4", "5 FIELDS and 4 of SIZE"),
        (b"SIZE 4 4 4 4 2", b"SIZE 3 4 4 4 2", "unknown type F of 3 bytes"),
        (b"TYPE F F F F U", b"TYPE Q F F F U", "unknown type Q of 4 bytes"),
        (b"TYPE F F F F U", b"TYPE F F F F", "5 FIELDS and 4 of TYPE"),
        (b"COUNT 1 1 1 1 1", b"COUNT 2 1 1 1 1", "its field x has 2 numbers instead of one"),
        (b"COUNT 1 1 1 1 1", b"COUNT 1 1 1 1 5000", "more than 4096 numbers for each point"),
        (b"FIELDS x y z", b"FIELDS x x z", "has no y"),
        (b"DATA ", b"DATA un", "unknown encoding 'un"),
    ],
)
def test_invalid_pcd_header(tmp_path, data, old, new, message):
    whole = pcd_bytes(pcd_table(), data)
    assert old in whole
    path = tmp_path / "a.pcd"
    path.write_bytes(whole.replace(old, new, 1))
    with pytest.raises(ScanError, match=message):
        read_scan(path)


def test_random_bytes_are_not_a_pcd_file(tmp_path):
    path = tmp_path / "a.pcd"
    path.write_bytes(bytes(range(256)) * 50)
    with pytest.raises(
        ScanError, match=r"a\.pcd is not a readable PCD file: its header has no FIELDS DATA"
    ):
        read_scan(path)


def test_invalid_pcd_compression(tmp_path):
    whole = bytearray(pcd_bytes(pcd_table(200), "binary_compressed"))
    start = len(pcd_header("binary_compressed", 200)) + 8
    whole[start : start + 400] = b"\xff" * 400
    path = tmp_path / "a.pcd"
    path.write_bytes(whole)
    with pytest.raises(ScanError, match=r"a\.pcd is not a readable PCD file"):
        read_scan(path)


def assert_points_or_one_sentence(path, content):
    """A file with noise is read as points, or raises a one-line ScanError that names it."""
    path.write_bytes(content)
    message = ""
    try:
        assert read_scan(path).points.shape[1] == 3
    except ScanError as error:
        message = str(error)
    assert not message or (path.name in message and "\n" not in message)


def with_noise(whole, noise, place):
    return whole[:place] + noise + whole[place + len(noise) :]


noises = st.binary(max_size=200)


@given(noise=noises, data=st.sampled_from(ENCODINGS), place=st.integers(0, 400))
@settings(max_examples=150, deadline=None)
def test_pcd_noise(folder, noise, data, place):
    content = with_noise(pcd_bytes(pcd_table(), data), noise, place)
    assert_points_or_one_sentence(folder / "noise.pcd", content)


@given(noise=noises, form=st.sampled_from(FORMS), place=st.integers(0, 300))
@settings(max_examples=150, deadline=None)
def test_ply_noise(folder, noise, form, place):
    content = with_noise(ply_bytes(small_table(), form), noise, place)
    assert_points_or_one_sentence(folder / "noise.ply", content)


@given(noise=noises | st.text("(),:' {}[]0123456789f<O", max_size=40).map(str.encode),
       place=st.integers(0, 150))  # fmt: skip
@settings(max_examples=300, deadline=None)
def test_npy_noise(folder, noise, place):
    buffer = io.BytesIO()
    np.save(buffer, np.ones((5, 4), np.float32))
    content = with_noise(buffer.getvalue(), noise, place)
    assert_points_or_one_sentence(folder / "noise.npy", content)


@pytest.mark.parametrize(("far_m", "warned"), [(16_380.0, False), (16_390.0, True)])
def test_coordinates_that_float32_resolves_to_a_millimetre_need_no_warning(
    tmp_path, caplog, far_m, warned
):
    """The spacing of float32 numbers is 0.98 mm below 2^14 and 1.95 mm from there on."""
    assert (np.spacing(np.float32(far_m)) > 1e-3) == warned
    points = np.zeros((4, 3))
    points[1, 0] = -far_m
    np.save(tmp_path / "0.npy", points)
    read_scan(tmp_path / "0.npy")
    assert ("float32 is coarser than 1 mm" in caplog.text) == warned


def test_a_field_named_like_two_axes_is_an_attribute():
    table = np.zeros(3, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("xy", "f4")])
    assert list(scan_of_table(Path("made"), table).attributes) == ["xy"]
