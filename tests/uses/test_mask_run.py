"""Masks of many frames: stopped and taken up, changed and damaged files, files of others."""

import json
import shutil
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from intervis.drives import open_drive
from intervis.errors import DriveError, OutputError, ScanError
from intervis.output_folder import MARKER, locked
from intervis.uses.voxels.drive_masks import MaskSettings, drive_cameras
from intervis.uses.voxels.mask_layouts import LAYOUTS, FrameName
from intervis.uses.voxels.mask_record import FOLDER, read_record, record_path, write_frame
from intervis.uses.voxels.mask_run import MaskFrame, MaskRun, frame_names
from intervis.uses.voxels.voxel_grid import VoxelGrid
from labelled_sequence import write_sequence
from small_drive import files_below, scan_folder

GRID = VoxelGrid([0, -4, -2], 0.5, (24, 16, 8))


@pytest.fixture
def sequence(tmp_path) -> Path:
    return write_sequence(tmp_path / "sequences" / "00", 4, step_deg=2.0)


def written(source: Path, out: Path, layout: str = "npz", **options) -> list[MaskFrame]:
    """Masks of all frames of a drive with its cameras, as the command writes them."""
    drive = open_drive(source)
    options = {"later": 1, **options}
    cameras = drive_cameras(source, drive) if LAYOUTS[layout].has_cameras else {}
    settings = MaskSettings(GRID, **options)
    run = MaskRun(drive, drive.frame_numbers, LAYOUTS[layout], settings, cameras)
    return list(run.write(out))


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, hidden ones too."""
    return {name: (folder / name).read_bytes() for name in files_below(folder)}


def made(frames: list[MaskFrame]) -> list[int]:
    return [frame.number for frame in frames if frame.masks is not None]


def test_a_run_that_is_left_is_taken_up(sequence, tmp_path) -> None:
    drive, out = open_drive(sequence), tmp_path / "out"
    run = MaskRun(drive, drive.frame_numbers, LAYOUTS["npz"], MaskSettings(GRID, later=1))
    with closing(run.write(out)) as frames:
        assert [next(frames).number, next(frames).number] == [0, 1]
    before = files_below(out)
    again = list(run.write(out))
    assert [frame.reused for frame in again] == [True, True, False, False]
    assert made(again) == [2, 3]
    assert before.items() <= files_below(out).items()
    list(run.write(tmp_path / "whole"))
    assert contents(out) == contents(tmp_path / "whole")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_files_of_each_layout_are_known_again(sequence, tmp_path, layout) -> None:
    out = tmp_path / "out"
    assert made(written(sequence, out, layout, later=0)) == [0, 1, 2, 3]
    before = files_below(out)
    again = written(sequence, out, layout, later=0)
    assert all(frame.reused and not frame.remade for frame in again)
    assert files_below(out) == before
    assert sum(not name.startswith((".", "masks.json")) for name in before) >= 4


def shorten(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-9])


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (shorten, "voxels/000002.invalid is damaged."),
        (flip, "voxels/000002.invalid is damaged."),
        (Path.unlink, "voxels/000002.invalid is missing."),
    ],
)
def test_a_damaged_file_is_made_again(sequence, tmp_path, damage, reason) -> None:
    out = tmp_path / "out"
    written(sequence, out, "semantickitti")
    before = contents(out)
    damage(out / "voxels" / "000002.invalid")
    again = written(sequence, out, "semantickitti")
    assert [(frame.number, frame.remade) for frame in again if not frame.reused] == [(2, reason)]
    assert contents(out) == before


@pytest.mark.parametrize("damage", [shorten, flip, Path.unlink])
def test_a_damaged_record_is_made_again(sequence, tmp_path, damage) -> None:
    out = tmp_path / "out"
    written(sequence, out)
    before = contents(out)
    damage(record_path(out, 2))
    assert made(written(sequence, out)) == [2]
    assert contents(out) == before


def test_a_file_of_another_frame_is_made_again(sequence, tmp_path) -> None:
    out = tmp_path / "out"
    written(sequence, out)
    before = contents(out)
    shutil.copy(out / "000000.npz", out / "000003.npz")
    shutil.copy(record_path(out, 0), record_path(out, 1))
    again = written(sequence, out)
    assert made(again) == [1, 3]
    assert again[3].remade == "000003.npz is damaged."
    assert contents(out) == before


def test_files_of_other_settings_are_made_again(sequence, tmp_path) -> None:
    out, other = tmp_path / "out", tmp_path / "other"
    written(sequence, out)
    written(sequence, other, keep_moving=True)
    before = contents(out)
    shutil.copytree(other / FOLDER, out / FOLDER, dirs_exist_ok=True)
    again = written(sequence, out)
    assert made(again) == [0, 1, 2, 3]
    assert contents(out) == before


def test_frames_with_a_changed_scan_or_label_are_made_again(sequence, tmp_path) -> None:
    """A label of scan 2, of which frames 1 and 2 are made; the first bytes of scan 0."""
    out = tmp_path / "out"
    written(sequence, out)
    labels = np.fromfile(sequence / "labels" / "000002.label", np.uint32)
    labels[:] = 48
    labels.tofile(sequence / "labels" / "000002.label")
    rows = np.fromfile(sequence / "velodyne" / "000000.bin", np.float32)
    rows[0] += 0.25  # the drive's own digest reads the middle
    rows.tofile(sequence / "velodyne" / "000000.bin")
    again = written(sequence, out)
    assert made(again) == [0, 1, 2]
    assert all("made from another scan" in again[number].remade for number in (0, 1, 2))
    written(sequence, tmp_path / "fresh")
    assert contents(out) == contents(tmp_path / "fresh")


def test_files_that_are_no_longer_made_are_removed(sequence, tmp_path) -> None:
    """Labels that are gone: the file of labels must not stay beside new masks."""
    out = tmp_path / "out"
    written(sequence, out, "semantickitti", later=0)
    np.zeros(len(np.fromfile(sequence / "labels" / "000001.label", np.uint32)), np.uint32).tofile(
        sequence / "labels" / "000001.label"
    )
    assert (out / "voxels" / "000001.label").exists()
    assert made(written(sequence, out, "semantickitti", later=0)) == [1]
    assert not (out / "voxels" / "000001.label").exists()
    assert (out / "voxels" / "000002.label").exists()


def test_what_killed_processes_left_is_removed_with_their_frame(sequence, tmp_path) -> None:
    out = tmp_path / "out"
    written(sequence, out)
    before = contents(out)
    for name in (".000002.npz.0a.part", f"{FOLDER}/.0000000002.json.0a.part", ".masks.json.0.part"):
        (out / name).write_text("half")
    (out / "000002.npz").unlink()
    (out / ".mine.part").write_text("mine")
    written(sequence, out)
    assert contents(out) == {**before, ".mine.part": b"mine"}


def test_a_process_that_was_killed_before_its_first_frame(sequence, tmp_path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    with locked(out):
        (out / ".masks.json.0a.part").write_text("half")
    assert made(written(sequence, out)) == [0, 1, 2, 3]
    written(sequence, tmp_path / "whole")
    assert contents(out) == contents(tmp_path / "whole")


# What is not ours


def test_a_file_of_someone_else_is_not_replaced(sequence, tmp_path) -> None:
    out = tmp_path / "out"
    drive = open_drive(sequence)
    run = MaskRun(drive, (0,), LAYOUTS["npz"], MaskSettings(GRID, later=1))
    list(run.write(out))
    (out / "000001.npz").write_bytes(b"mine")
    run = MaskRun(drive, (0, 1, 2), LAYOUTS["npz"], MaskSettings(GRID, later=1))
    with pytest.raises(OutputError, match=r"000001\.npz is not of these masks and was not changed"):
        list(run.write(out))
    assert (out / "000001.npz").read_bytes() == b"mine"
    assert not record_path(out, 1).exists()
    (out / "000001.npz").unlink()
    assert made(list(run.write(out))) == [1, 2]


@pytest.mark.parametrize("name", ["voxels", "voxels/000007.bin", FOLDER])
def test_nothing_is_written_through_a_link(tmp_path, name) -> None:
    theirs, out = tmp_path / "theirs", tmp_path / "out"
    theirs.mkdir()
    (theirs / "file").write_text("theirs")
    (out / name).parent.mkdir(parents=True)
    (out / name).symlink_to(theirs / "file" if "." in name[1:] else theirs)
    with pytest.raises(OutputError, match=f"{name} is a link"):
        write_frame(out, 7, "made from this", {"voxels/000007.bin": b"masks"})
    assert contents(theirs) == {"file": b"theirs"}


@pytest.mark.parametrize("name", ["../theirs", "/theirs"])
def test_a_record_that_leads_out_of_the_folder_removes_nothing(tmp_path, name) -> None:
    (tmp_path / "theirs").write_bytes(b"x")
    out = tmp_path / "out"
    write_frame(out, 7, "made from this", {"a.bin": b"x"})
    content = json.loads(record_path(out, 7).read_text())
    name = name if name[0] == "." else f"{tmp_path}{name}"
    content["files"][name] = content["files"]["a.bin"]
    record_path(out, 7).write_text(json.dumps(content))
    assert read_record(out, 7) is None
    write_frame(out, 7, "made from this", {"b.bin": b"x"})
    assert (tmp_path / "theirs").read_bytes() == b"x"


@pytest.mark.parametrize(
    "text", ["[]", "{", '{"number": 3, "files": {}}', '{"number": 3, "fingerprint": 1, "files": 3}']
)
def test_a_record_that_is_none(tmp_path, text) -> None:
    record_path(tmp_path, 3).parent.mkdir()
    record_path(tmp_path, 3).write_text(text)
    assert read_record(tmp_path, 3) is None


@pytest.mark.parametrize(
    "files",
    [
        {},
        [],
        [["a", "b"]],
        {"a\0b": "x"},
        {"": "x"},
        {"a": 1},
        {".intervis-masks/a": "x"},
        {".": "x"},
    ],
)
def test_a_record_without_files_of_ours_counts_for_nothing(tmp_path, files) -> None:
    path = record_path(tmp_path, 3)
    path.parent.mkdir()
    path.write_text(json.dumps({"number": 3, "fingerprint": "f", "files": files}))
    assert read_record(tmp_path, 3) is None
    write_frame(tmp_path, 3, "f", {"masks/x": b"1"})
    assert (tmp_path / "masks/x").read_bytes() == b"1"
    assert read_record(tmp_path, 3).files.keys() == {"masks/x"}


def test_the_folder_of_a_run_is_refused(sequence, tmp_path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "summary.json").write_text("{}")
    (out / MARKER).write_text("")
    with pytest.raises(OutputError, match="holds files of something else"):
        written(sequence, out)
    assert set(files_below(out)) == {"summary.json", MARKER}


def test_two_cannot_write_at_once(sequence, tmp_path) -> None:
    out = tmp_path / "out"
    written(sequence, out)
    with locked(out), pytest.raises(OutputError, match="another process is writing to"):
        written(sequence, out)
    drive = open_drive(sequence)
    run = MaskRun(drive, drive.frame_numbers, LAYOUTS["npz"], MaskSettings(GRID))
    with closing(run.write(tmp_path / "other")) as frames:
        next(frames)
        with pytest.raises(OutputError, match="another process is writing to"):
            next(run.write(tmp_path / "other"))
    assert not all(frame.reused for frame in run.write(tmp_path / "other"))  # it was left


# Frames that fail


def test_a_frame_that_fails_is_told_and_the_others_are_made(sequence, tmp_path) -> None:
    scan = sequence / "velodyne" / "000002.bin"
    whole = scan.read_bytes()
    scan.write_bytes(whole[:-3])
    frames = written(sequence, tmp_path / "out")
    assert [bool(frame.failure) for frame in frames] == [False, True, True, False]
    assert "000002.bin" in frames[1].failure
    assert made(frames) == [0, 3]
    scan.write_bytes(whole[:-32])  # another length: another drive
    with pytest.raises(OutputError, match="masks of another drive"):
        written(sequence, tmp_path / "out")


def test_a_first_frame_that_fails_leaves_nothing(sequence, tmp_path) -> None:
    scan = sequence / "velodyne" / "000000.bin"
    scan.write_bytes(scan.read_bytes()[:-3])
    for is_there in (False, True):
        out = tmp_path / f"out-{is_there}"
        if is_there:
            out.mkdir()
        with pytest.raises(ScanError):
            written(sequence, out)
        assert out.exists() == is_there
        assert not is_there or not files_below(out)
    without_poses = scan_folder(tmp_path / "drive")
    with pytest.raises(DriveError, match="add poses to the drive"):
        written(without_poses, tmp_path / "none")
    assert not (tmp_path / "none").exists()


# Names and steps


def test_scans_of_one_name_have_files_of_their_own(sequence) -> None:
    drive = open_drive(sequence)
    assert frame_names(drive, [2]) == [FrameName("00", 2, "000002.bin")]
    twice = {number: Path(f"{number}") / "scan.bin" for number in drive.scan_paths}
    object.__setattr__(drive, "scan_paths", twice)
    assert [name.scan for name in frame_names(drive, [0, 2])] == ["000000", "000002"]


@pytest.mark.parametrize("later", [0, 2])
def test_progress_is_told_as_often_as_announced(sequence, tmp_path, later) -> None:
    drive = open_drive(sequence)
    run = MaskRun(drive, drive.frame_numbers, LAYOUTS["npz"], MaskSettings(GRID, later=later))
    for _ in ("made", "reused"):
        notes = []
        list(run.write(tmp_path / "out", notes.append))
        assert len(notes) == run.steps == {0: 8, 2: 4 * 2 + 2 + 2 + 1}[later]
        assert [note for note in notes if note == "frame 3"]
