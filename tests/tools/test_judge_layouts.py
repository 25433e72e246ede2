"""The judges of layouts: differences are found; tables of many scenes open."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from intervis.drives import nuscenes_tables as tables_of_readers
from intervis.drives import open_drive
from intervis.drives.drive_writer import FrameRecord, Rig, RigScanner, ScanRecord
from intervis.drives.nuscenes_table_writer import VERSION
from intervis.drives.pcd_writer import PcdWriter
from intervis.drives.pose_track import PoseTrack
from intervis.transform import rigid

TOOLS = Path(__file__).resolve().parents[2] / "tools"
sys.path.insert(0, str(TOOLS))
judge_layouts = importlib.import_module("judge_layouts")
dump_drive = importlib.import_module("dump_drive")
nuscenes_tables = importlib.import_module("nuscenes_tables")

RNG = np.random.default_rng(0)
CORNERS = RNG.uniform(-9, 9, (2, 8, 3))
OURS = {
    "time_ns": np.array(7),
    "scan/A/points_world": RNG.uniform(-9, 9, (50, 3)),
    "scan/A/intensity": RNG.random(50),
    "scan/A/origin_world": np.array([1.0, 2, 3]),
    "camera/C/pixels": RNG.uniform(0, 500, (50, 2)),
    "camera/C/depth_m": RNG.uniform(2, 9, 50),
    "camera/C/image": np.array("digest"),
    "boxes/corners_world": CORNERS,
    "boxes/category": np.array(["car", "person"]),
    "boxes/track": np.array(["a", "b"]),
    "boxes/returns": np.array([3, 4]),
}


def seen(**changes) -> object:
    arrays = {name: one.copy() for name, one in OURS.items() if name != "time_ns"}
    return judge_layouts.Seen(7, arrays | changes)


def test_equal_moments_do_not_differ() -> None:
    turned = CORNERS[:, ::-1]  # the corners of a box have no order
    found = judge_layouts.differences(OURS, seen(**{"boxes/corners_world": turned}))
    assert set(found) == {"points_m", "origin_m", "pixels", "corners_m"}
    assert set(found.values()) == {0.0}


@pytest.mark.parametrize(
    ("name", "kind", "size"),
    [
        ("scan/A/points_world", "points_m", 1e-3),
        ("scan/A/origin_world", "origin_m", 1e-5),
        ("camera/C/pixels", "pixels", 0.5),
        ("boxes/corners_world", "corners_m", 1e-5),
    ],
)
def test_differences_exceed_their_tolerance(name: str, kind: str, size: float) -> None:
    changed = OURS[name].copy()
    changed.flat[0] += size
    found = judge_layouts.differences(OURS, seen(**{name: changed}))
    assert np.isclose(found[kind], size)
    assert found[kind] > judge_layouts.TOLERANCES[kind]


@pytest.mark.parametrize("name", ["scan/A/intensity", "boxes/returns", "boxes/track"])
def test_what_must_be_equal_is_compared(name: str, capsys) -> None:
    changed = OURS[name].copy()
    changed[1] = changed[0]
    found = judge_layouts.differences(OURS, seen(**{name: changed}))
    assert found[name] == np.inf
    assert name in capsys.readouterr().out


def test_what_is_missing_on_either_side_is_told() -> None:
    less = {name: one for name, one in OURS.items() if name != "scan/A/origin_world"}
    assert judge_layouts.differences(less, seen())["origin_m"] == np.inf
    more = seen(**{"scan/B/points_world": np.zeros((1, 3))})
    assert judge_layouts.differences(OURS, more)["points_m"] == np.inf
    short = seen(**{"scan/A/points_world": OURS["scan/A/points_world"][:49]})
    assert judge_layouts.differences(OURS, short)["points_m"] == np.inf


def test_a_drive_is_dumped_in_the_world(tmp_path: Path) -> None:
    pose = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [10.0, 20, 0])
    writer = PcdWriter(tmp_path, Rig((RigScanner("roof", "made", np.eye(4), 1),)))
    points = np.array([[1.0, 0, 0], [0, 2, 0]], np.float32)
    scan = ScanRecord(points, np.array([0.5, 1], np.float32))
    writer.add(FrameRecord(3 * 10**9, PoseTrack(np.array([3 * 10**9]), [pose]), (scan,)))
    writer.close()
    arrays = dump_drive.dumped(open_drive(tmp_path))
    assert arrays["frames"].tolist() == [0]
    assert int(arrays["0/time_ns"]) == 3 * 10**9
    assert np.allclose(arrays["0/scan/main/points_world"], [[10, 21, 0], [8, 20, 0]])
    assert arrays["0/scan/main/intensity"].tolist() == [0.5, 1]


@pytest.mark.parametrize("block_bytes", [3000, 16_000_000])
def test_a_scene_among_many_is_found_in_large_tables(tmp_path, monkeypatch, block_bytes) -> None:
    monkeypatch.setattr(nuscenes_tables, "SAMPLES", 3)
    nuscenes_tables.write(tmp_path, 4)
    whole = open_drive(tmp_path / VERSION / "scene-0003")
    monkeypatch.setattr(tables_of_readers, "WHOLE_BYTES", 0)
    monkeypatch.setattr(tables_of_readers, "BLOCK_BYTES", block_bytes)
    searched = open_drive(tmp_path / VERSION / "scene-0003")
    assert searched.frame_numbers == whole.frame_numbers == (0,)
    assert searched.timestamps_ns == whole.timestamps_ns
    assert searched.timestamps_ns[0] == nuscenes_tables.START_NS + 2 * nuscenes_tables.SCENE_NS
    assert len(searched.camera_names) == 6
    assert np.array_equal(searched.poses[0], whole.poses[0])
    boxes = searched.read_boxes(0)
    assert len(boxes) == nuscenes_tables.BOXES
    assert len({box.track for box in boxes}) == nuscenes_tables.BOXES
