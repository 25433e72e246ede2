"""`intervis objects`: labelled cars behind a wall of a drive in KITTI's object layout."""

import json
import shutil
from csv import DictReader
from pathlib import Path

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.sight import Scene
from intervis.uses import objects_of_frame
from intervis.uses.object_figure import object_picture

CALIBRATION = """P2: 700 0 600 0 0 700 180 0 0 0 1 0
R0_rect: 1 0 0 0 1 0 0 0 1
Tr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0
"""
# Type, truncation, occlusion, alpha, four edges, height, width, length, x right, y down, z ahead.
LABELS = """Car 0 3 0 0 0 9 9 1.5 1.8 4.2 -4 1.8 20 -1.57
Car 0 0 0 0 0 9 9 1.5 1.8 4.2 4 1.8 20 -1.57
Van 0 0 0 0 0 9 9 2.8 0.5 3 -3 1.8 10 0
"""


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """The side of a van at x = 10, from y = 1.5 to 4.5; a car behind it, and one beside it."""
    y, z = np.meshgrid(np.arange(1.5, 4.5, 0.04), np.arange(-1.75, 1.0, 0.05))
    side = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel()], axis=1)
    azimuth, range_m = np.meshgrid(np.radians(np.arange(-50, 50, 0.3)), np.geomspace(4, 40, 60))
    ground = np.stack([range_m * np.cos(azimuth), range_m * np.sin(azimuth)], -1).reshape(-1, 2)
    behind = (ground[:, 0] > 10) & (np.abs(ground[:, 1] / ground[:, 0] - 0.3) < 0.15)
    ground = np.column_stack([ground, np.full(len(ground), -1.8)])[~behind]
    y, z = np.meshgrid(np.arange(-40, 40, 0.2), np.arange(-1.8, 6, 0.2))
    backdrop = np.stack([np.full(y.size, 45.0), y.ravel(), z.ravel()], axis=1)
    shadow = (np.abs(backdrop[:, 1] / 45 - 0.3) < 0.15) & (backdrop[:, 2] < 4.5)
    points = np.concatenate([side, ground, backdrop[~shadow]]).astype(np.float32)
    root = tmp_path / "training"
    for folder in ("velodyne", "calib", "label_2"):
        (root / folder).mkdir(parents=True)
    np.column_stack([points, np.zeros(len(points), np.float32)]).astype(np.float32).tofile(
        root / "velodyne" / "000007.bin"
    )
    (root / "calib" / "000007.txt").write_text(CALIBRATION)
    (root / "label_2" / "000007.txt").write_text(LABELS)
    return root


def test_the_van_hides_one_car(drive: Path) -> None:
    frame = open_drive(drive)[7]
    scene = Scene.from_scan(frame.points)
    van, *cars = objects_of_frame(frame, scene, [0, 0, 0])
    assert [one.box.category for one in (van, *cars)] == ["Van", "Car", "Car"]
    hidden, free = sorted(cars, key=lambda one: one.visible)
    assert hidden.box.visibility == "occlusion 3"
    assert hidden.occluded > 0.8
    assert hidden.blocked_by == "Van"
    assert hidden.blocker[0] == pytest.approx(10.0, abs=0.3)
    assert free.visible > 0.9
    assert van.visible > 0.9
    assert van.range_m == pytest.approx(np.linalg.norm([10, 3, 0.4]), abs=0.01)


def test_the_command_writes_tables_and_a_picture(drive: Path, tmp_path: Path, capsys) -> None:
    csv, numbers, picture = tmp_path / "o.csv", tmp_path / "o.json", tmp_path / "o.png"
    command = ["objects", str(drive), "--csv", str(csv), "--json", str(numbers)]
    assert exit_code([*command, "--picture", str(picture)]) == 0
    out = capsys.readouterr().out
    assert "blocked by" in out
    assert "occlusion 3" in out
    content = json.loads(numbers.read_text())
    rows = list(DictReader(csv.read_text().splitlines()))
    assert len(rows) == len(content) == 3
    for row, one in zip(rows, content, strict=True):
        assert row["category"] == one["category"]
        assert row["track"] == one["track"]
        assert [float(row[f"centre_{axis}"]) for axis in "xyz"] == one["centre"]
        for name in ("range_m", "visible", "occluded", "unknown", "probability", "in_image"):
            assert float(row[name]) == one[name]
        assert row["blocker_z"] == ("" if one["blocker"][2] is None else str(one["blocker"][2]))
    assert [one["category"] for one in content] == ["Van", "Car", "Car"]
    assert {one["blocked_by"] for one in content} >= {"Van"}
    assert picture.stat().st_size > 10_000


def test_what_lies_outside_the_image_is_truncated(drive: Path) -> None:
    # The image is 1242 px wide at 700 px focal length: its right edge is at -42.5 degrees.
    label = drive / "label_2" / "000007.txt"
    label.write_text(LABELS + "Car 0 0 0 0 0 9 9 1.5 1.8 4.2 30 1.8 10 0\n")
    frame = open_drive(drive)[7]
    shares = [
        one.in_image for one in objects_of_frame(frame, Scene.from_scan(frame.points), [0, 0, 0])
    ]
    assert shares[-1] == 0.0
    assert shares[0] == pytest.approx(1.0)


def test_a_drive_without_labels_is_told(drive: Path, capsys) -> None:
    shutil.rmtree(drive / "label_2")
    assert exit_code(["objects", str(drive)]) == 2
    assert "has labelled objects: choose a labelled drive" in capsys.readouterr().err


def test_the_star_stands_at_the_viewpoint(drive: Path) -> None:
    frame, viewpoint = open_drive(drive)[7], (3.0, 2.0, 0.0)
    objects = objects_of_frame(frame, Scene.from_scan(frame.points), viewpoint)
    axes = object_picture(frame, objects, viewpoint).axes[-1]
    (star,) = [dots for dots in axes.collections if len(dots.get_offsets()) == 1]
    assert np.asarray(star.get_offsets()).tolist() == [[3.0, 2.0]]
    left, right = axes.get_xlim()
    assert left < 3.0 < right
