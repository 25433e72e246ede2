"""Scanners of one moment: the TOML file, folders with poses, and their pairs."""

import numpy as np
import pytest
from yard import YARD, write_drive

from intervis import open_drive
from intervis.errors import DriveError, PoseError, ScanError, SettingsError
from intervis.lab.truth.scanner_set import (
    parsed_scanner_pairs,
    read_scanners,
    scanners_of_drive,
)
from intervis.transform import transform

TWO = """
[[scanner]]
name = "roof"
scan = "roof.npy"

[[scanner]]
name = "left"
scan = "left.npy"
"""


@pytest.fixture
def folder(tmp_path):
    for name in ("roof", "left"):
        np.save(tmp_path / f"{name}.npy", np.full((3, 3), len(name), np.float32))
    return tmp_path


def listed(folder, text):
    path = folder / "together.toml"
    path.write_text(text)
    return read_scanners(path)


def test_scanners_and_default_pairs(folder):
    found = listed(folder, TWO)
    assert found.name == "together"
    assert [scanner.name for scanner in found.scanners] == ["roof", "left"]
    assert found.pairs == (("roof", "left"), ("left", "roof"))
    np.testing.assert_array_equal(found.scanner("roof").pose, np.eye(4))
    assert found.scanner("roof").points.tolist() == [[4.0] * 3] * 3
    assert listed(folder, 'pairs = ["left:roof"]' + TWO).pairs == (("left", "roof"),)


def test_angles_turn_about_fixed_axes_roll_first(folder):
    # Roll 90 takes y to z; the yaw of 90 that follows about the scene's z leaves it there. About
    # the turned axes instead, y would end in -x.
    text = TWO + "translation_m = [1, 2, 3]\nroll_pitch_yaw_deg = [90, 0, 90]\n"
    pose = listed(folder, text).scanner("left").pose
    axes = transform(pose, np.eye(3)) - pose[:3, 3]
    np.testing.assert_allclose(axes, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-12)
    assert pose[:3, 3].tolist() == [1.0, 2.0, 3.0]


def test_a_matrix_gives_the_pose(folder):
    matrix = "scene_from_scanner = [[0,-1,0,5],[1,0,0,6],[0,0,1,7],[0,0,0,1]]\n"
    pose = listed(folder, TWO + matrix).scanner("left").pose
    assert pose.tolist() == [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("scanner = 3", SettingsError, "scanner"),
        ("[[scanner]]\nname = 'roof'\nscan = 'roof.npy'\n", SettingsError, "at least 2"),
        (TWO + "yaw = 3\n", SettingsError, "scanner 1 yaw: extra"),
        (TWO + "translation_m = [1, 2]\n", SettingsError, "translation_m"),
        (TWO.replace("left", "roof"), SettingsError, "two scanners of one name"),
        (TWO.replace('name = "left"', 'name = "a:b"'), SettingsError, "name"),
        ("not toml", SettingsError, "not valid TOML"),
        (TWO + "scene_from_scanner = [[1, 0], [0, 1]]\n", PoseError, "'left'"),
        (
            TWO + "scene_from_scanner = [[1,0,0,0],[0,1,0,0],[0,0,1,0]]\ntranslation_m=[0,0,0]\n",
            PoseError,
            "given twice",
        ),
        (TWO.replace("left.npy", "none.npy"), ScanError, "none.npy"),
        ('pairs = ["roof:right"]' + TWO, DriveError, "no scanner 'right'"),
        ('pairs = ["roof:roof"]' + TWO, DriveError, "own reference"),
        ('pairs = ["roof"]' + TWO, SettingsError, "KNOWN:REFERENCE"),
    ],
)
def test_wrong_files_are_refused(folder, text, error, message):
    with pytest.raises(error, match=message):
        listed(folder, text)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="cannot read"):
        read_scanners(tmp_path / "none.toml")


@pytest.mark.parametrize("text", ["", "a", "a:", ":b", "a:b,", "a:b:c"])
def test_wrong_pairs_are_refused(text):
    with pytest.raises(SettingsError, match="KNOWN:REFERENCE"):
        parsed_scanner_pairs(text)


def test_a_folder_with_poses(tmp_path):
    write_drive(tmp_path, YARD, [0.0, 1.5], step_deg=6.0)
    drive = open_drive(tmp_path)
    found = scanners_of_drive(drive)
    assert found.pairs == (("0", "1"), ("1", "0"))
    np.testing.assert_array_equal(found.scanner("1").pose, drive[1].pose)
    assert scanners_of_drive(drive, ((1, 0),)).pairs == (("1", "0"),)
    with pytest.raises(DriveError, match="no frame 7"):
        scanners_of_drive(drive, ((1, 7),))
    (tmp_path / "poses.txt").unlink()
    with pytest.raises(DriveError, match="no pose"):
        scanners_of_drive(open_drive(tmp_path))


def test_pairs_of_a_drive_must_be_named(tmp_path):
    write_drive(tmp_path, YARD, np.arange(7.0), step_deg=20.0)
    with pytest.raises(DriveError, match="holds 7 scans"):
        scanners_of_drive(open_drive(tmp_path))


def test_the_fingerprint_depends_on_points_and_poses(folder):
    one = listed(folder, TWO).fingerprint()
    assert one == listed(folder, TWO).fingerprint()
    turned = listed(folder, TWO + "roll_pitch_yaw_deg = [0, 0, 1]\n").fingerprint()
    np.save(folder / "left.npy", np.full((3, 3), 9.0, np.float32))
    other = listed(folder, TWO).fingerprint()
    assert len({one["digest"], turned["digest"], other["digest"]}) == 3
    assert one["points"] == [3, 3]
