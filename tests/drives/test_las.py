"""LAS and LAZ with a trajectory: scans cut by time, from where the scanner was."""

import logging
import shutil
import struct
import sys

import lazrs
import numpy as np
import pytest
from drive_layouts import write_text
from scipy.spatial.transform import Rotation

from intervis.drives import las_mapping, open_drive
from intervis.drives.las_header import read_las_header
from intervis.drives.las_mapping import read_trajectory
from intervis.drives.laz_chunks import check_chunks
from intervis.errors import CalibrationError, DriveError, MissingExtraError, ScanError
from intervis.transform import transform

laspy = pytest.importorskip("laspy", reason="laspy (extra las) is not installed")
pytest.importorskip("lazrs", reason="lazrs (extra las) is not installed")
START_S = 345_600.25


def write_las(path, times_s, xyz, *, kind=6, version="1.4", unit=None, **more):
    header = laspy.LasHeader(point_format=kind, version=version)
    header.scales, header.offsets = [0.001] * 3, [600_000.0, 5_000_000.0, 0.0]
    if unit:
        header.vlrs.append(laspy.VLR("LASF_Projection", *unit))
    file = laspy.LasData(header)
    file.x, file.y, file.z = np.transpose(xyz)
    if times_s is not None:
        file.gps_time = times_s
    for name, values in more.items():
        file[name] = values
    file.write(str(path))
    return path


def world(count=4000, seed=3):
    """Points around the way of a car, and their times over two seconds, in any order."""
    rng = np.random.default_rng(seed)
    lowest, highest = [599_960, 4_999_960, 100], [600_060, 5_000_040, 112]
    xyz = rng.uniform(lowest, highest, (count, 3))
    return START_S + rng.uniform(0, 2, count), np.round(xyz, 3)


def path_of_the_car(time_s):
    """10 m/s to the north-east, from the middle of the world."""
    along_m = 10 * (np.asarray(time_s) - START_S) / np.sqrt(2)
    return np.stack([600_000 + along_m, 5_000_000 + along_m, 102 + 0 * along_m], axis=-1)


def write_trajectory(path, times_s, angles=None, head=""):
    rows = [
        [time_s, *path_of_the_car(time_s), *(() if angles is None else angles)]
        for time_s in times_s
    ]
    return write_text(path, head + "".join(",".join(map(repr, map(float, r))) + "\n" for r in rows))


EVERY_SECOND = START_S + np.arange(3)


@pytest.mark.parametrize("ending", ["las", "laz"])
@pytest.mark.parametrize("in_order", [True, False])
def test_scans_have_the_points_of_their_time_seen_from_the_scanner(tmp_path, ending, in_order):
    times_s, xyz = world()
    if in_order:
        order = np.argsort(times_s)
        times_s, xyz = times_s[order], xyz[order]
    intensity = np.arange(len(xyz), dtype=np.uint16)
    path = write_las(tmp_path / f"a.{ending}", times_s, xyz, intensity=intensity)
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    for given in (path, tmp_path):
        drive = open_drive(given)
        assert (drive.layout, drive.frame_numbers) == ("las_mapping", tuple(range(20)))
    for number, frame in enumerate(drive):
        middle_s = START_S + 0.1 * number + 0.05
        assert frame.timestamp_ns == round(1e9 * middle_s)
        own = np.floor((times_s - START_S) / 0.1).astype(int) == number
        assert np.array_equal(frame.attributes["intensity"], intensity[own])
        assert np.allclose(frame.attributes["time_s"], times_s[own] - middle_s, atol=1e-6)
        assert np.allclose(frame.pose[:3, 3], path_of_the_car(middle_s), rtol=0, atol=1e-6)
        assert np.allclose(transform(frame.pose, frame.points), xyz[own], rtol=0, atol=1e-4)
        # x points ahead, to the north-east; y to the left, z up.
        s = np.sqrt(0.5)
        assert np.allclose(frame.pose[:3, :3], [[s, -s, 0], [s, s, 0], [0, 0, 1]], atol=1e-9)


@pytest.mark.parametrize("kind", [1, 3, 6, 7, 8, 9, 10])
def test_points_of_other_formats(tmp_path, kind):
    """Colours, infrared and extra bytes are parts of a compressed point with own layers."""
    times_s, xyz = world(500)
    header = laspy.LasHeader(point_format=kind, version="1.4")
    header.scales, header.offsets = [0.001] * 3, [600_000.0, 5_000_000.0, 0.0]
    header.add_extra_dim(laspy.ExtraBytesParams("echo", "float32"))
    header.add_extra_dim(laspy.ExtraBytesParams("mark", "3uint8"))
    file = laspy.LasData(header)
    file.x, file.y, file.z = xyz.T
    file.gps_time = times_s
    file.echo = np.linspace(-1, 1, 500)
    file.mark = np.arange(1500).reshape(500, 3) % 200
    if kind in (3, 7, 8, 10):
        file.green = np.arange(500)
    file.write(str(tmp_path / "a.copc.laz"))
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    frame = open_drive(tmp_path)[4]
    own = np.floor((times_s - START_S) / 0.1).astype(int) == 4
    assert np.allclose(frame.attributes["echo"], np.linspace(-1, 1, 500)[own])
    assert np.array_equal(frame.attributes["mark"], (np.arange(1500).reshape(500, 3) % 200)[own])
    if kind in (3, 7, 8, 10):
        assert np.array_equal(frame.attributes["green"], np.arange(500)[own])
    assert np.allclose(transform(frame.pose, frame.points), xyz[own], rtol=0, atol=1e-3)


@pytest.mark.parametrize("ending", ["las", "laz"])
def test_a_file_is_read_in_parts(tmp_path, monkeypatch, ending):
    path = write_las(tmp_path / f"a.{ending}", *world())
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    whole = list(open_drive(path))
    monkeypatch.setattr(las_mapping, "PART_BYTES", 10_000)
    sizes = [len(part) for part in las_mapping._parts(path)]
    assert len(sizes) > 10
    assert sum(sizes) == 4000
    for one, other in zip(whole, open_drive(path), strict=True):
        assert np.array_equal(one.points, other.points)
        assert np.array_equal(one.attributes["time_s"], other.attributes["time_s"])


@pytest.mark.parametrize(
    ("angles", "ahead", "left", "up"),
    [
        ([0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, 0, 1]),  # north
        ([0, 0, 90], [1, 0, 0], [0, 1, 0], [0, 0, 1]),  # east
        ([90, 0, 90], [1, 0, 0], [0, 0, 1], [0, -1, 0]),  # on its right side
        ([0, 90, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0]),  # nose up
    ],
)
def test_angles_turn_the_scanner(tmp_path, angles, ahead, left, up):
    times_s, xyz = world(300)
    write_las(tmp_path / "a.las", times_s, xyz)
    write_trajectory(tmp_path / "trajectory.csv", EVERY_SECOND, angles, "time,x,y,z,roll,p,h\n")
    pose = open_drive(tmp_path / "a.las")[7].pose
    assert np.allclose(pose[:3, :3].T, [ahead, left, up], atol=1e-9)


def test_a_scanner_that_stands_keeps_its_heading(tmp_path):
    rows = [(0, 5, 5), (1, 5, 5), (2, 5, 7), (3, 5, 9), (4, 5, 9), (5, 5, 9)]
    text = "".join(f"{time} {x} {y} 2\n" for time, x, y in rows)
    track = read_trajectory(write_text(tmp_path / "a.txt", text)).track
    yaw = [
        Rotation.from_matrix(pose[:3, :3]).as_euler("ZYX", degrees=True)[0] for pose in track.poses
    ]
    assert np.allclose(yaw, 90)


def test_what_the_trajectory_does_not_cover_is_left_out(tmp_path, caplog):
    times_s, xyz = world()
    write_las(tmp_path / "a.las", times_s, xyz)
    rows = [*np.arange(0, 0.5, 0.1), *np.arange(10, 11, 0.1)]
    write_trajectory(tmp_path / "a.txt", START_S + 0.5 + np.array(rows))
    with caplog.at_level(logging.WARNING):
        drive = open_drive(tmp_path / "a.las")
    assert drive.frame_numbers == (0, 1, 2, 3)  # of 0.1 s from the start of the trajectory
    early = int((times_s < START_S + 0.5).sum())
    assert [record.getMessage().split(" of ")[0] for record in caplog.records] == [
        str(early),
        f"the trajectory {tmp_path / 'a.txt'} has gaps: 11",
    ]


def refused(path, reason, kind=DriveError):
    with pytest.raises(kind, match=reason) as caught:
        open_drive(path)
    assert "\n" not in str(caught.value)


def test_what_is_missing_is_said(tmp_path):
    times_s, xyz = world(50)
    path = write_las(tmp_path / "a.las", times_s, xyz)
    for given in (path, tmp_path):
        refused(given, r"a\.las has no trajectory: a file a\.txt or trajectory\.txt beside it")
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND + 1e6)
    refused(
        path,
        r"covers the times 1345600\.250 to 1345602\.250 s, .* have 34560.* to 34560[12]\.",
    )
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    with pytest.raises(DriveError, match="has no camera 'left'"):
        open_drive(path, camera="left")
    refused(write_las(path, None, xyz, kind=0, version="1.2"), "has no times of its points")
    refused(write_las(path, [], np.zeros((0, 3))), "holds no points")
    feet = np.array([1, 1, 0, 1, 3076, 0, 1, 9003], "<u2").tobytes()
    refused(write_las(path, times_s, xyz, unit=(34735, "", feet)), "has coordinates in feet")
    wkt = b'PROJCS["a",UNIT["US survey foot",0.3048006]]'
    refused(write_las(path, times_s, xyz, unit=(2112, "", wkt)), "has coordinates in feet")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "it has 0 lines"),
        ("1 2 3 4\n", "it has 1 lines"),
        ("1 2 3 4\n1 2 3 4\n", "none of a trajectory"),
        ("1 2 3\n2 3 4\n", r"line 1: expected time x y z"),
        ("1 2 3 4\n2 3 4 5 6 7 8\n", r"line 2: expected time x y z"),
        ("t x y z\n1 2 3 4\nb 3 4 5\n", r"line 3: 'b' is not a finite number"),
        ("1 2 3 4\n2 nan 4 5\n", "not a finite number"),
        ("1 2 3 4\n2 1e300 4 5\n", "none of a trajectory"),
        ("1 2 3 4\n1e8 3 4 5\n", "none of a trajectory"),
        ("0 2 3 4\n10000001 3 4 5\n", "none of a trajectory"),
    ],
)
def test_damaged_trajectories_are_told(tmp_path, text, reason):
    with pytest.raises(CalibrationError, match=reason):
        read_trajectory(write_text(tmp_path / "a.txt", text))


def test_a_trajectory_as_long_and_as_far_as_it_may_be(tmp_path):
    track = read_trajectory(write_text(tmp_path / "a.txt", "0 2 -1e9 4\n1e7 3 4 5\n")).track
    assert track.times_ns.tolist() == [0, 10**16]
    assert track.poses[0][:3, 3].tolist() == [2, -1e9, 4]


@pytest.mark.parametrize(
    ("ending", "place", "value", "reason"),
    [
        ("las", 0, b"LASX", "is no LAS file"),
        ("las", 96, struct.pack("<I", 2**31), "declares 50 points behind"),
        ("las", 100, struct.pack("<I", 2**32 - 1), "declares 4294967295 records"),
        ("las", 104, b"\x0b", "points of format 11"),
        ("las", 105, struct.pack("<H", 3), "in 3 bytes, which is none"),
        ("las", 247, struct.pack("<Q", 2**60), "declares 1152921504606846976 points"),
        ("las", 131, struct.pack("<d", np.inf), "scales or offsets"),
        ("laz", 247, struct.pack("<Q", 2**60), "declares 1152921504606846976 points"),
        ("laz", 104, b"\x86", None),
    ],
)
def test_garbage_in_the_header_is_refused_before_it_is_believed(
    tmp_path, ending, place, value, reason
):
    times_s, xyz = world(50)
    path = write_las(tmp_path / f"a.{ending}", times_s, xyz)
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    content = bytearray(path.read_bytes())
    content[place : place + len(value)] = value
    path.write_bytes(content)
    if reason is None:  # the value is what was there
        assert len(open_drive(path)) > 0
    else:
        refused(path, reason, ScanError)


@pytest.mark.parametrize("kind", range(11))
def test_points_have_at_least_the_bytes_of_their_format(tmp_path, kind):
    """Sizes of all formats, as laspy has them; the header alone, without points."""
    size = laspy.PointFormat(kind).size
    for point_bytes, is_enough in ((size, True), (size + 1, True), (size - 1, False)):
        head = bytearray(375)
        head[:4], head[24:26] = b"LASF", bytes([1, 4])
        struct.pack_into("<HIIBHI", head, 94, 375, 375, 0, kind, point_bytes, 0)
        path = tmp_path / "a.las"
        path.write_bytes(head)
        if is_enough:
            header = read_las_header(path)
            assert (header.points, header.point_bytes, header.start) == (0, point_bytes, 375)
            assert header.has_time == ("gps_time" in laspy.PointFormat(kind).dimension_names)
        else:
            with pytest.raises(ScanError, match=f"format {kind} in {size - 1} bytes, which is"):
                read_las_header(path)


@pytest.mark.parametrize("nth", range(6))
def test_scales_and_offsets_are_numbers_of_metres(tmp_path, nth):
    path = write_las(tmp_path / "a.las", *world(50))
    content = path.read_bytes()
    for value in (1.1e12, -1.1e12, np.nan):
        at = 131 + 8 * nth
        path.write_bytes(content[:at] + struct.pack("<d", value) + content[at + 8 :])
        with pytest.raises(ScanError, match="scales or offsets that are no numbers of metres"):
            read_las_header(path)


def test_the_unit_of_a_short_header_is_read(tmp_path):
    """The header of LAS 1.2 has 227 bytes; the records behind it say that the unit is the foot."""
    feet = np.array([1, 1, 0, 1, 3076, 0, 1, 9003], "<u2").tobytes()
    path = write_las(
        *(tmp_path / "a.las", *world(50)), kind=1, version="1.2", unit=(34735, "", feet)
    )
    header = read_las_header(path)
    assert (header.points, header.in_feet) == (50, True)


@pytest.mark.parametrize(
    ("place", "value", "reason"),
    [
        (18, struct.pack("<H", 22205), "is compressed, and its header does not say how"),
        (20, struct.pack("<H", 33), "is compressed, and its header does not say how"),
        (20, struct.pack("<H", 2000), "has a record that is longer than its header"),
        (54 + 12, bytes(4), "has a damaged record of its compression"),
        (54 + 32, struct.pack("<H", 2), "has a damaged record of its compression"),
        (54 + 34 + 2, struct.pack("<H", 31), "has compressed points of 31 bytes, not 30"),
    ],
)
def test_a_damaged_record_of_the_compression_is_told(tmp_path, place, value, reason):
    """It holds one item: points of 30 bytes."""
    path = write_las(tmp_path / "a.laz", *world(50))
    content = bytearray(path.read_bytes())
    at = content.index(b"laszip encoded") - 2 + place
    content[at : at + len(value)] = value
    path.write_bytes(content)
    with pytest.raises(ScanError, match=reason):
        read_las_header(path)


def test_a_trajectory_without_gaps_is_no_warning(tmp_path, caplog):
    write_las(tmp_path / "a.las", *world())
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    with caplog.at_level(logging.WARNING):
        open_drive(tmp_path / "a.las")
    assert caplog.records == []


def chunks_of(path, header):
    """Points and bytes of each chunk, by lazrs."""
    with path.open("rb") as file:
        file.seek(header.start)
        return lazrs.read_chunk_table(file, lazrs.LazVlr(header.compression))


def test_every_chunk_is_checked_where_it_lies(tmp_path):
    """A layer that is larger than its chunk, in each of three chunks; layers are counted in it."""
    path = write_las(tmp_path / "a.laz", *world(110_000))
    header = read_las_header(path)
    chunks, content = chunks_of(path, header), path.read_bytes()
    assert len(chunks) == 3
    check_chunks(path, header, len(content), 0)
    place = header.start + 8
    for nth, (_, chunk_bytes) in enumerate(chunks, start=1):
        sizes_at = place + header.point_bytes + 4
        sizes = np.frombuffer(content, "<u4", 9, sizes_at)  # of the nine layers of format 6
        assert header.point_bytes + 4 + 36 + sizes.sum() == chunk_bytes
        for layer in (0, 8):
            damaged, at = bytearray(content), sizes_at + 4 * layer
            damaged[at : at + 4] = struct.pack("<I", sizes[layer] + 1)
            path.write_bytes(damaged)
            with pytest.raises(ScanError, match=rf"has a damaged chunk at {place}\."):
                check_chunks(path, header, len(content), 10 * nth + layer)
        place += chunk_bytes
    path.write_bytes(content)
    check_chunks(path, header, place, 1)
    with pytest.raises(ScanError, match="one lies outside of it"):
        check_chunks(path, header, place - 1, 1)


def test_chunks_with_fewer_points_than_declared_are_refused(tmp_path):
    """Two chunks, each of 50,000 points at most."""
    path = write_las(tmp_path / "a.laz", *world(60_000))
    header = read_las_header(path)
    size = path.stat().st_size
    assert len(chunks_of(path, header)) == 2
    check_chunks(path, header._replace(points=100_000), size, 0)
    with pytest.raises(ScanError, match="declares 100001 points, its chunks hold 100000"):
        check_chunks(path, header._replace(points=100_001), size, 0)


def test_a_file_that_was_written_as_a_stream(tmp_path):
    """The place of the table of chunks stands at the end of the file, not before the points."""
    times_s, xyz = world(2000)
    path = write_las(tmp_path / "a.laz", times_s, xyz)
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    whole, start = [frame.points for frame in open_drive(path)], read_las_header(path).start
    content = bytearray(path.read_bytes())
    table = content[start : start + 8]
    content[start : start + 8] = struct.pack("<q", -1)
    path.write_bytes(content + table)
    assert read_las_header(path).points == 2000
    for points, frame in zip(whole, open_drive(path), strict=True):
        assert np.array_equal(frame.points, points)
    for place in (-2, start, len(content) + 1, 2**62):
        path.write_bytes(content + struct.pack("<q", place))
        refused(path, f"has a damaged table of chunks: it would lie at byte {place}", ScanError)


def test_a_table_of_too_many_chunks_is_refused(tmp_path):
    times_s, xyz = world(50)
    path = write_las(tmp_path / "a.laz", times_s, xyz)
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    content = bytearray(path.read_bytes())
    start = struct.unpack_from("<I", content, 96)[0]
    table = struct.unpack_from("<q", content, start)[0]
    # A chunk has one point of 30 bytes at least.
    for chunks in (2**32 - 1, len(content) // 30 + 1):
        content[table + 4 : table + 8] = struct.pack("<I", chunks)
        path.write_bytes(content)
        refused(path, f"a damaged table of {chunks} chunks", ScanError)


@pytest.mark.parametrize("ending", ["las", "laz"])
def test_a_cut_file_is_told(tmp_path, ending):
    path = write_las(tmp_path / f"a.{ending}", *world())
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    content = path.read_bytes()
    for length in (0, 100, 300, 400, len(content) // 2, len(content) - 1):
        path.write_bytes(content[:length])
        refused(path, "LAS file|cut within|declares|damaged|longer", ScanError)


def test_a_file_that_changed_is_told(tmp_path):
    path = write_las(tmp_path / "a.las", *world())
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    drive = open_drive(path)
    write_las(path, *world(seed=4))
    with pytest.raises(ScanError, match="has changed since it was opened"):
        drive[3]


@pytest.mark.realdata
@pytest.mark.parametrize(
    "name", ["aerial/Megaplot.laz", "aerial/Topography.laz", "airborne_las/sample_c.las"]
)
def test_real_files_with_a_made_trajectory(shared_data, tmp_path, name):
    """Where the aeroplane was is not known: points come back whole from any place."""
    path = tmp_path / name.split("/")[1]
    shutil.copy(shared_data / name, path)
    file = laspy.read(path)
    times_s, xyz = np.asarray(file.gps_time), np.asarray(file.xyz)
    x, y, z = xyz.mean(axis=0)
    rows = [
        f"{time_s:.6f} {x + 60 * nth} {y} {z + 900}\n"
        for nth, time_s in enumerate(np.arange(times_s.min() - 1, times_s.max() + 2, 1.0))
    ]
    write_text(path.with_suffix(".txt"), "".join(rows))
    drive = open_drive(path)
    found = [(transform(frame.pose, frame.points), frame.attributes) for frame in drive]
    found_s = np.concatenate(
        [values["time_s"] + 1e-9 * time for (_, values), time in
         zip(found, drive.timestamps_ns.values(), strict=True)]
    )  # fmt: skip
    order, found_order = np.argsort(times_s, kind="stable"), np.argsort(found_s, kind="stable")
    assert np.allclose(found_s[found_order], times_s[order], rtol=0, atol=1e-6)
    points = np.concatenate([points for points, _ in found])
    assert len(points) == len(xyz)
    for axis in range(3):
        assert np.allclose(np.sort(points[:, axis]), np.sort(xyz[:, axis]), rtol=0, atol=0.01)


@pytest.mark.realdata
def test_real_files_without_a_trajectory_say_so(shared_data):
    refused(shared_data / "aerial", "Megaplot.laz has no trajectory")
    refused(shared_data / "airborne_las", "has no trajectory")
    copc = shared_data / "airborne_las/lone-star.copc.laz"
    refused(copc, r"a file lone-star\.txt")
    assert read_las_header(copc).points == 518_862


@pytest.mark.parametrize(("length", "valid"), [(226, False), (227, True)])
def test_bytes_of_the_shortest_header(tmp_path, length, valid):
    """Of LAS 1.2, without a record or a point."""
    head = bytearray(227)
    head[:4], head[24:26] = b"LASF", bytes([1, 2])
    struct.pack_into("<HIIBHI", head, 94, 227, 227, 0, 1, 28, 0)
    (tmp_path / "a.las").write_bytes(head[:length])
    if valid:
        header = read_las_header(tmp_path / "a.las")
        assert header == (0, 28, 227, b"", True, False)
    else:
        with pytest.raises(ScanError, match="does not start like one"):
            read_las_header(tmp_path / "a.las")


@pytest.mark.parametrize(
    ("key", "unit", "in_feet"),
    [
        *((3076, 9002, True), (3076, 9003, True), (4099, 9002, True), (4099, 9003, True)),
        *((3076, 9001, False), (3076, 9004, False), (4098, 9002, False), (3077, 9003, False)),
        (4100, 9003, False),
    ],
)
def test_keys_that_say_feet(tmp_path, key, unit, in_feet):
    """The unit of lengths (3076) and of heights (4099): the foot and the US survey foot."""
    keys = np.array([1, 1, 0, 1, key, 0, 1, unit], "<u2").tobytes()
    path = write_las(tmp_path / "a.las", *world(5), unit=(34735, "", keys))
    assert read_las_header(path).in_feet == in_feet


def test_bytes_between_the_records_and_the_points(tmp_path):
    """The table of chunks is looked for where the points start, not behind the last record."""
    path = write_las(tmp_path / "a.laz", *world(50))
    content = path.read_bytes()
    start = int.from_bytes(content[96:100], "little")
    table = int.from_bytes(content[start : start + 8], "little")
    before = read_las_header(path)
    moved = content[:96] + struct.pack("<I", start + 8) + content[100:start] + b"\x01" * 8
    path.write_bytes(moved + struct.pack("<q", table + 8) + content[start + 8 :])
    assert read_las_header(path) == before._replace(start=start + 8)


def test_without_laspy_the_extra_is_named(tmp_path, monkeypatch):
    path = write_las(tmp_path / "a.las", *world(50))
    write_trajectory(tmp_path / "a.txt", EVERY_SECOND)
    monkeypatch.setitem(sys.modules, "laspy", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'intervis\[las\]'"):
        open_drive(path)[0]


def test_lines_of_a_trajectory_that_are_passed_over(tmp_path):
    """Blank lines and comments anywhere, names of columns before the first numbers."""
    text = "# made by hand\n\nt;x;y;z\n  \n1;2;3;4\n\n# turned back\n2;3;4;5\n\n"
    track = read_trajectory(write_text(tmp_path / "a.txt", text)).track
    assert [pose[:3, 3].tolist() for pose in track.poses] == [[2, 3, 4], [3, 4, 5]]
