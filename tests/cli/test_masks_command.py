"""`intervis masks`: files of a small labelled sequence and of real scans, and each mistake."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.errors import SettingsError
from intervis.plots import style
from intervis.uses.voxels.drive_masks import MaskSettings, frame_masks, on_own_car, read_classes
from intervis.uses.voxels.voxel_grid import VoxelGrid
from labelled_sequence import ring, write_sequence
from small_drive import files_below, scan_folder

SMALL = ["--layout", "npz", "--corner", "0,-4,-2", "--cell", "0.5", "--shape", "24,16,8"]


@pytest.fixture(scope="module")
def sequence(tmp_path_factory) -> Path:
    """Three labelled scans, 1 m apart."""
    return write_sequence(tmp_path_factory.mktemp("kitti") / "sequences" / "00", 3)


def test_a_labelled_sequence_in_semantickitti_layout(sequence, tmp_path, capsys) -> None:
    out = tmp_path / "masks"
    command = ["masks", str(sequence), "--out", str(out), "--definition", "semantickitti"]
    assert exit_code([*command, "--frames", "0", "--later", "2"]) == 0
    said = capsys.readouterr()
    first, *_ = said.out.splitlines()
    assert first == "Drive 00, 1 frame; layout semantickitti, definition semantickitti."
    assert "no labels" not in said.out
    assert "Moving things of later frames, by their labels: left out" in said.out
    assert not said.err
    files = {path.name: path.stat().st_size for path in (out / "voxels").iterdir()}
    assert files == {
        "000000.bin": 262_144,
        "000000.occluded": 262_144,
        "000000.invalid": 262_144,
        "000000.label": 4_194_304,
    }
    label = np.fromfile(out / "voxels" / "000000.label", "<u2").reshape(256, 256, 32)
    assert set(np.unique(label)) == {0, 40, 50}
    # The road lies 1.7 m below the scanner, the wall 12.2 m ahead.
    assert set(np.argwhere(label == 40)[:, 2]) == {1}
    assert set(np.argwhere(label == 50)[:, 0]) <= {60, 61}  # on the border of two voxels
    metadata = json.loads((out / "masks.json").read_text())
    assert (metadata["layout"], metadata["later"]) == ("semantickitti", 2)


def test_more_frames_go_into_the_same_folder(sequence, tmp_path, capsys) -> None:
    command = ["masks", str(sequence), "--out", str(tmp_path / "m"), *SMALL, "--no-cameras"]
    assert exit_code([*command, "--frames", "0"]) == 0
    assert exit_code([*command, "--frames", "1:3", "--stride", "2"]) == 0
    assert sorted(files_below(tmp_path / "m")) == [
        ".intervis",
        ".intervis-masks/0000000000.json",
        ".intervis-masks/0000000001.json",
        "000000.npz",
        "000001.npz",
        "masks.json",
    ]
    assert exit_code([*command, "--definition", "occ3d"]) == 2
    assert "holds masks of another drive, layout, definition or grid" in capsys.readouterr().err


def test_the_command_writes_what_the_library_makes(sequence, tmp_path) -> None:
    command = ["masks", str(sequence), "--out", str(tmp_path / "m"), *SMALL, "--frames", "0"]
    assert exit_code([*command, "--later", "2", "--picture", str(tmp_path / "m.png")]) == 0
    drive = open_drive(sequence)
    settings = MaskSettings(VoxelGrid([0, -4, -2], 0.5, (24, 16, 8)), later=2)
    masks = frame_masks(drive, 0, settings)
    with np.load(tmp_path / "m" / "000000.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["state"], masks.state)
        np.testing.assert_array_equal(arrays["label"], masks.label)
        assert arrays[
            "mask_camera_image_2" if "mask_camera_image_2" in arrays else "mask_camera"
        ].any()
    assert (tmp_path / "m.png").stat().st_size > 10_000


def test_a_camera_restricts_the_masks_to_itself(sequence, tmp_path, capsys) -> None:
    held = {}
    for name, options in (("all", []), ("one", ["--camera", "image_3"])):
        command = ["masks", str(sequence), "--out", str(tmp_path / name), *SMALL, *options]
        assert exit_code([*command, "--frames", "0", "--later", "0"]) == 0
        with np.load(tmp_path / name / "000000.npz", allow_pickle=False) as arrays:
            held[name] = {key for key in arrays.files if key.startswith("mask_camera_")}
    assert held == {
        "all": {"mask_camera_image_2", "mask_camera_image_3"},
        "one": {"mask_camera_image_3"},
    }
    command = ["masks", str(sequence), "--out", str(tmp_path / "one"), *SMALL, "--later", "0"]
    assert exit_code([*command, "--frames", "1"]) == 2
    assert "or of other cameras (see masks.json)" in capsys.readouterr().err


def test_the_states_that_are_told_sum_to_all_voxels(sequence, tmp_path, capsys) -> None:
    command = ["masks", str(sequence), "--out", str(tmp_path / "m"), *SMALL, "--later", "2"]
    assert exit_code([*command, "--frames", "1", "--no-cameras"]) == 0
    said = capsys.readouterr()
    (states,) = [line for line in said.out.splitlines() if line.startswith("Frame 1, ")]
    shares = dict(reversed(part) for part in re.findall(r"([\d.]+) % (\w+)", states))
    assert list(shares) == ["free", "occupied", "occluded", "unknown"]
    assert sum(map(float, shares.values())) == pytest.approx(100, abs=0.2)  # rounded
    assert "1 frame has fewer than 2 later scans in the drive to add." in said.err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "Scanner at (0.94, 0.00, 1.84) m in the vehicle's frame, that of nuScenes, assumed"),
        (["--lidar-at", "1,0,2"], "Scanner at (1.00, 0.00, 2.00) m in the vehicle's frame, as --"),
        (["--layout", "occ3d-waymo"], "(1.43, 0.00, 2.18) m in the vehicle's frame, that of Waymo"),
        (["--layout", "surroundocc"], ""),
    ],
)
def test_whose_mounting_is_told(sequence, tmp_path, capsys, options, said) -> None:
    command = ["masks", str(sequence), "--out", str(tmp_path / "m"), "--frames", "0"]
    command += ["--layout", "occ3d-nuscenes", "--no-cameras", *options]
    assert exit_code(command) == 0
    out = capsys.readouterr().out
    assert said in out
    assert ("Scanner at" in out) == bool(said)


def test_classes_are_mapped(sequence, tmp_path) -> None:
    (tmp_path / "c.json").write_text('{"40": 9, "50": 13}')
    out = tmp_path / "m"
    command = ["masks", str(sequence), "--out", str(out), "--layout", "occ3d-nuscenes"]
    command += ["--lidar-at", "0,0,1.7", "--frames", "0", "--classes", str(tmp_path / "c.json")]
    assert exit_code([*command, "--no-cameras"]) == 0
    with np.load(out / "gts" / "00" / "000000" / "labels.npz", allow_pickle=False) as arrays:
        semantics, lidar = arrays["semantics"], arrays["mask_lidar"]
    assert set(np.unique(semantics)) <= {0, 9, 13, 17}
    # The vehicle's frame stands on the road: 10 m ahead, between -0.2 and 0.2 m.
    assert semantics[125, 100, 2] == 9
    assert lidar[125, 100, 2] == 1
    assert semantics[130, 104, 5] == 13  # the wall


def test_the_level_slice_lies_above_the_road(sequence, tmp_path, monkeypatch) -> None:
    drawn = []
    monkeypatch.setattr(style, "save_figure", lambda figure, *_: drawn.append(figure))
    command = ["masks", str(sequence), "--frames", "0", "--later", "0", "--no-cameras"]
    command += ["--picture", str(tmp_path / "m.png")]
    occ3d = ["--layout", "occ3d-nuscenes", "--lidar-at", "0,0,1.7"]
    for name, options in (("scanner", ["--layout", "surroundocc"]), ("vehicle", occ3d)):
        assert exit_code([*command, "--out", str(tmp_path / name), *options]) == 0
    titles = [figure.axes[0].get_title("left") for figure in drawn]
    # 0.9 m below the scanner is -0.9 m in its own frame and 0.8 m in the vehicle's.
    assert titles == ["level slice at z = -0.8 m", "level slice at z = 0.8 m"]


def test_the_own_vehicle_is_left_out() -> None:
    points = np.array([[1, 0, -1], [1, 1.3, -1], [1, 0, 0.5], [4, 0, -1], [np.nan, 0, 0]])
    assert on_own_car(points).tolist() == [True, False, False, False, False]


MISTAKES = [
    (["--layout", "kitti"], "there is no layout 'kitti'; choose one of semantickitti"),
    (["--definition", "kitti"], "there is no definition 'kitti'; choose one of exact"),
    (["--layout", "occ3d-nuscenes", "--definition", "semantickitti"], "has no room for masks"),
    (["--cell", "0.1"], "the grid of semantickitti is fixed"),
    (["--layout", "npz", "--shape", "9000,9000,9"], "would take 17.5 GB"),
    (["--layout", "npz", "--shape", "a,b"], "--shape must be three whole numbers"),
    (["--layout", "npz", "--cell", "-1"], "cell_m must be a positive length"),
    (["--later", "-1"], "--later must be 0 or more"),
    (["--stride", "0"], "--stride must be 1 or more"),
    (["--lidar-at", "0,0,0"], "--lidar-at has no use"),
    (["--frames", "9"], "no frame lies in the range"),
    (["--classes", "{folder}/none.json"], "cannot read the classes"),
    (["--picture", "a.gif"], "a picture must be named .png or .svg"),
]


@pytest.mark.parametrize(("options", "message"), MISTAKES, ids=[m for _, m in MISTAKES])
def test_a_mistake_is_one_line_and_writes_nothing(
    sequence, tmp_path, capsys, options, message
) -> None:
    out = tmp_path / "m"
    options = [option.format(folder=tmp_path) for option in options]
    assert exit_code(["masks", str(sequence), "--out", str(out), *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_drive_without_labels_or_poses(tmp_path, capsys) -> None:
    (tmp_path / "drive").mkdir()
    for number in range(2):
        np.save(tmp_path / "drive" / f"{number:06d}.npy", ring(0.0))
    command = ["masks", str(tmp_path / "drive"), "--out", str(tmp_path / "m")]
    assert exit_code([*command, "--definition", "semantickitti", "--later", "0"]) == 2
    assert "needs labels of points for every scan" in capsys.readouterr().err
    assert exit_code(command) == 2
    assert "frame 0 has none: add poses to the drive, or give --later 0." in capsys.readouterr().err
    assert not (tmp_path / "m").exists()


def test_a_folder_with_other_files_is_refused(sequence, tmp_path, capsys) -> None:
    (tmp_path / "photo.jpg").write_text("mine")
    command = ["masks", str(sequence), *SMALL, "--frames", "0", "--out"]
    assert exit_code([*command, str(tmp_path)]) == 2
    assert "holds files of something else" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["photo.jpg"]
    assert exit_code([*command, str(tmp_path / "photo.jpg")]) == 2
    assert "is a file: give the path of a folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text", ["[]", "{", '{"a": 1}', '{"1": 70000}', '{"1": "x"}', '{"1": null}']
)
def test_a_map_of_classes_that_is_none(tmp_path, text) -> None:
    (tmp_path / "c.json").write_text(text)
    with pytest.raises(Exception, match="must be a JSON object of whole numbers"):
        read_classes(tmp_path / "c.json")


@pytest.mark.realdata
def test_a_real_scan_of_semantickitti(shared_data, tmp_path, capsys) -> None:
    source = shared_data / "semantickitti" / "000000.bin"
    for definition in ("semantickitti", "exact"):
        out = tmp_path / definition
        command = ["masks", str(source), "--out", str(out), "--definition", definition]
        assert exit_code([*command, "--later", "0"]) == 0
    capsys.readouterr()
    tool, exact = (
        {
            end: np.unpackbits(np.fromfile(tmp_path / name / "voxels" / f"000000.{end}", np.uint8))
            for end in ("bin", "occluded", "invalid")
        }
        for name in ("semantickitti", "exact")
    )
    frame = open_drive(source)[0]
    points, labels = frame.points, frame.point_classes
    index = np.floor((points - np.array([0, -25.6, -2], np.float32)) / np.float32(0.2)).astype(int)
    inside = ((index >= 0) & (index < [256, 256, 32])).all(axis=1) & (labels > 0)
    inside &= np.linalg.norm(points, axis=1) > 3.7  # beyond the car that the tool leaves out
    flat = np.ravel_multi_index(tuple(index[inside].T), (256, 256, 32))
    assert tool["bin"][flat].mean() > 0.999
    assert exact["bin"][flat].mean() > 0.999
    # Where the tool sees a voxel blocked, exact knows a surface before it, or nothing at all.
    assert (
        np.mean(exact["occluded"][tool["invalid"] > 0] | exact["invalid"][tool["invalid"] > 0])
        > 0.9
    )
    assert exact["invalid"].mean() > 2 * tool["invalid"].mean()  # the sky is nobody's


@pytest.mark.realdata
def test_a_real_drive_without_labels(shared_data, tmp_path, capsys) -> None:
    out = tmp_path / "m"
    command = ["masks", str(shared_data / "kitti_raw"), "--out", str(out), "--frames", "0"]
    assert exit_code([*command, "--layout", "occ3d-nuscenes", "--lidar-at", "0,0,1.73"]) == 0
    assert "seen by image_02" in capsys.readouterr().out
    (path,) = out.glob("gts/*/*/labels.npz")
    drive = open_drive(shared_data / "kitti_raw")
    with np.load(path, allow_pickle=False) as arrays:
        camera, lidar = arrays["mask_camera"], arrays["mask_lidar"]
        assert (camera <= lidar).all()
        assert camera.any()
        index = np.argwhere(camera)
    centres = (index + 0.5) * 0.4 + [-40, -40, -1] - [0, 0, 1.73]
    frame = drive[0]
    u, _, depth = (
        frame.camera.projection @ frame.cam_from_velo @ np.c_[centres, np.ones(len(centres))].T
    )
    margin_px = 60  # four cameras stand up to half a metre apart
    far = depth > 8.0
    column = u[far] / depth[far]
    assert ((column > -margin_px) & (column < 1242 + margin_px)).all()


def test_masks_of_another_drive_of_the_same_name_are_not_replaced(tmp_path, capsys):
    for name, numbers in (("a", (0, 1)), ("b", (0, 2))):
        scan_folder(tmp_path / name / "drive", numbers)
    out = str(tmp_path / "out")
    asked = ["--frames", "0", "--later", "0", "--layout", "npz", "--shape", "9,9,9", "--out", out]
    assert exit_code(["masks", str(tmp_path / "a" / "drive"), *asked]) == 0
    before = files_below(tmp_path / "out")
    assert exit_code(["masks", str(tmp_path / "b" / "drive"), *asked]) == 2
    assert "holds masks of another drive" in capsys.readouterr().err
    assert files_below(tmp_path / "out") == before


@pytest.mark.parametrize("content", ['{"10": 4.7}', '{"10": true}', '{"10": 70000}', "[1]"])
def test_classes_that_are_no_whole_numbers_are_refused(tmp_path, content):
    path = tmp_path / "classes.json"
    path.write_text(content)
    with pytest.raises(SettingsError, match="whole numbers from 0 to 65535"):
        read_classes(path)


# Stopped and taken up


def program(*words: object) -> list[str]:
    """The command as a process of its own; SIGINT is ignored in whatever runs in the background."""
    start = "import signal; signal.signal(2, signal.default_int_handler);"
    code = f"{start} from intervis.cli import main; main()"
    return [sys.executable, "-c", code, "masks", *map(str, words)]


@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("layout", [["--layout", "occ3d-nuscenes"], SMALL])
def test_stopped_masks_are_taken_up(tmp_path, stop, layout) -> None:
    """The process is stopped as soon as three frames are begun, at whatever it does then."""
    drive = write_sequence(tmp_path / "sequences" / "00", 12, step_deg=2.0, distance_m=0.1)
    out, whole = tmp_path / "out", tmp_path / "whole"
    command = [*layout, "--later", "1"]
    with subprocess.Popen(
        program(drive, "--out", out, *command), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        while process.poll() is None and len(list(out.glob(".intervis-masks/*.json"))) < 3:
            time.sleep(0.001)
        process.send_signal(stop)
        err = process.communicate()[1].decode()
    there = files_below(out)
    if process.returncode == 0:
        pytest.skip("all masks were made before the process could be stopped")
    if stop == signal.SIGINT:
        assert process.returncode == 130
        assert err == f"intervis: interrupted: the same command resumes the masks in {out}.\n"
        assert not [name for name in there if name.endswith(".part")]
    resumed = subprocess.run(program(drive, "--out", out, *command), capture_output=True, text=True)
    assert resumed.returncode == 0, resumed.stderr
    reused = int(re.search(r"Written by an earlier run: (\d+) of 12 frames\.", resumed.stdout)[1])
    assert 2 <= reused < 12
    assert exit_code(["masks", str(drive), "--out", str(whole), *command]) == 0
    after = files_below(out)
    assert {name: (out / name).read_bytes() for name in after} == {
        name: (whole / name).read_bytes() for name in files_below(whole)
    }
    untouched = [name for name in there if after.get(name) == there[name]]
    assert len(untouched) >= 2 * reused  # file and record


def test_masks_made_again_are_told(sequence, tmp_path, capsys) -> None:
    out = tmp_path / "m"
    command = ["masks", str(sequence), "--out", str(out), *SMALL, "--no-cameras", "--later", "0"]
    assert exit_code(command) == 0
    first = capsys.readouterr().out
    (out / "000001.npz").write_bytes(b"half")
    picture = tmp_path / "m.png"
    assert exit_code([*command, "--picture", str(picture)]) == 0
    said = capsys.readouterr()
    assert "note: frame 1 was made again: 000001.npz is damaged.\n" in said.err
    assert "Written by an earlier run: 2 of 3 frames.\n" in said.out
    assert picture.exists()
    # What is told of the first frame is the same as before, for the picture it is made again.
    assert set(first.splitlines()) < set(said.out.splitlines())
    assert exit_code(command) == 0
    assert "Written by an earlier run: 3 of 3 frames.\n" in capsys.readouterr().out


def test_a_frame_that_fails_is_listed(tmp_path, capsys) -> None:
    drive = write_sequence(tmp_path / "sequences" / "00", 3, step_deg=2.0)
    scan = drive / "velodyne" / "000001.bin"
    scan.write_bytes(scan.read_bytes()[:-3])
    command = ["masks", str(drive), "--out", str(tmp_path / "m"), *SMALL, "--later", "0"]
    assert exit_code(command) == 1
    said = capsys.readouterr()
    assert said.err.startswith("intervis: frame 1 failed: ")
    assert said.err.count("\n") == 1
    assert "3 frames" in said.out
    assert (tmp_path / "m" / "000002.npz").exists()
