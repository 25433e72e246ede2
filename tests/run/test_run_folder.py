"""Ownership of a run's folder: other runs, shards, links, foreign files, changed input."""

import dataclasses
import json
import shutil

import numpy as np
import pytest

from intervis.drives import open_drive
from intervis.errors import OutputError, SettingsError
from intervis.output_folder import MARKER, locked
from intervis.run.frame_file import frame_fingerprint, frame_path, load_frame
from intervis.run.stream import run_drive
from intervis.run.stretch import FRAMES, Stretch, stretches_of
from intervis.run.viewpoint import MetaViewpoint
from intervis.settings import Settings
from small_drive import MemoryDrive, files_below, results, scan_folder

SETTINGS = Settings(tau=5)
MANY = tuple(range(2 * FRAMES + 3))


# Two at once


def test_two_runs_cannot_meet(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, frames=(0, 1))
    before = files_below(tmp_path)
    for shard in (None, (1, 2)):
        with locked(tmp_path), pytest.raises(OutputError, match="another process is writing"):
            run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, shard=shard)
    assert files_below(tmp_path) == before
    with locked(tmp_path, shared=True), pytest.raises(OutputError, match="another process"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)


def test_a_run_holds_its_folder_while_it_writes(tmp_path):
    refused = []

    def second(note):
        with pytest.raises(OutputError, match="another process is writing"):
            run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
        refused.append(note)

    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, progress=second)
    assert len(refused) == 4


def test_a_shard_does_not_meet_itself_and_meets_others(tmp_path):
    met = []

    def others(note):
        with pytest.raises(OutputError, match="another process is writing"):
            run_drive(MemoryDrive(MANY), tmp_path, settings=SETTINGS, shard=(1, 3))
        met.append(run_drive(MemoryDrive(MANY), tmp_path, settings=SETTINGS, shard=(3, 3)))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_drive(MemoryDrive(MANY), tmp_path, settings=SETTINGS, shard=(1, 3), progress=others)
    assert [record.number for record in met[0].frames] == [32, 33, 34]


# Shards


def test_shards_have_all_frames_once_and_give_the_results_of_one_run(tmp_path):
    drive = MemoryDrive(MANY)
    shards = [
        run_drive(drive, tmp_path / "parts", settings=SETTINGS, shard=(number, 2))
        for number in (2, 1)
    ]
    numbers = [record.number for shard in shards for record in shard.frames]
    assert sorted(numbers) == list(MANY)
    assert not any(shard.content["complete"] for shard in shards)
    together = run_drive(drive, tmp_path / "parts", settings=SETTINGS)
    assert together.reused == len(MANY)
    assert together.content["complete"]
    run_drive(drive, tmp_path / "whole", settings=SETTINGS)
    assert results(tmp_path / "parts") == results(tmp_path / "whole")


def test_more_shards_than_stretches_leave_some_empty(tmp_path):
    summary = run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, shard=(2, 2))
    assert summary.frames == ()


def test_frames_that_choose_tau_from_each_other_are_one_stretch():
    drive = MemoryDrive(MANY)
    for settings, count in (
        (Settings(tau="auto"), 1),
        (Settings(tau="auto", sampling="radius"), 3),
    ):
        whole = Stretch(drive, MANY, None, settings, MetaViewpoint(drive, "sensor"))
        parts = stretches_of(whole)
        assert len(parts) == count
        assert [number for part in parts for number in part.numbers] == list(MANY)


@pytest.mark.parametrize("shard", [(0, 2), (3, 2), (-1, -1)])
def test_an_impossible_shard_is_refused(tmp_path, shard):
    with pytest.raises(SettingsError, match="a shard is i/n"):
        run_drive(MemoryDrive(), tmp_path / "out", settings=SETTINGS, shard=shard)
    assert not (tmp_path / "out").exists()


def test_a_shard_does_not_overwrite(tmp_path):
    with pytest.raises(SettingsError, match="a shard cannot overwrite"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, shard=(1, 2), overwrite=True)


# What is not ours


def test_a_refused_folder_is_not_marked_as_ours(tmp_path):
    (tmp_path / "settings.toml").write_text("mine")
    for overwrite in (False, True):
        with pytest.raises(OutputError, match=r"was not written by a run .* another folder\.$"):
            run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, overwrite=overwrite)
    assert set(files_below(tmp_path)) == {"settings.toml"}


@pytest.mark.parametrize("content", ["{", '{"tool": 1}'])
def test_a_foreign_summary_is_not_overwritten(tmp_path, content):
    (tmp_path / "summary.json").write_text(content)
    with pytest.raises(OutputError, match=r"not the summary of a run: choose another folder\.$"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, overwrite=True)
    assert (tmp_path / "summary.json").read_text() == content


def test_frames_of_others_are_not_removed(tmp_path):
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "0000000001.npz").write_bytes(b"mine")
    with pytest.raises(OutputError, match=r"summary\.json is missing"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, overwrite=True)
    assert (tmp_path / "frames" / "0000000001.npz").read_bytes() == b"mine"


def test_overwriting_leaves_names_that_no_run_writes(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    for name in ("best.npz", "00000001.npz"):
        (tmp_path / "frames" / name).write_bytes(b"mine")
    run_drive(MemoryDrive((0,)), tmp_path, settings=SETTINGS, overwrite=True)
    left = {name for name in files_below(tmp_path) if name.startswith("frames/")}
    assert left == {"frames/best.npz", "frames/00000001.npz", "frames/0000000000.npz"}


def test_a_damaged_summary_of_ours_can_be_overwritten(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    (tmp_path / "summary.json").write_text("{")
    with pytest.raises(OutputError, match="or overwrite it"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    assert len(run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, overwrite=True).frames) == 4


@pytest.mark.parametrize("name", ["frames", "summary.json", "settings.toml", MARKER])
@pytest.mark.parametrize("overwrite", [False, True])
def test_nothing_is_written_or_removed_through_a_link(tmp_path, name, overwrite):
    theirs, out = tmp_path / "theirs", tmp_path / "out"
    run_drive(MemoryDrive(), theirs, settings=SETTINGS)
    out.mkdir()
    (out / name).symlink_to(theirs / name)
    before = files_below(theirs)
    with pytest.raises(OutputError, match="is a link"):
        run_drive(MemoryDrive(), out, settings=Settings(tau=6), overwrite=overwrite)
    assert files_below(theirs) == before


def test_a_link_to_the_folder_itself_is_followed(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to("disk")
    assert len(run_drive(MemoryDrive((0,)), tmp_path / "out", settings=SETTINGS).frames) == 1
    assert frame_path(tmp_path / "disk", 0).is_file()


def test_parts_of_killed_processes_are_removed_by_the_next_run(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    for name in (".summary.json.0a.part", "frames/.0000000001.npz.0a.part", ".mine.part"):
        (tmp_path / name).write_text("half")
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    assert [name for name in files_below(tmp_path) if name.endswith("part")] == [".mine.part"]


# Changed input


def test_a_changed_byte_of_a_scan_is_seen_wherever_it_is(tmp_path):
    folder = scan_folder(tmp_path / "drive", tuple(range(3)))
    path = folder / "000001.bin"
    rows = np.fromfile(path, "<f4")
    rows = np.tile(rows, 8)  # longer than what the digest of the drive reads
    rows.tofile(path)
    run_drive(open_drive(folder), tmp_path / "out", settings=SETTINGS)
    rows[0] += 0.25
    rows.tofile(path)
    summary = run_drive(open_drive(folder), tmp_path / "out", settings=SETTINGS)
    assert [bool(record.remade) for record in summary.frames] == [False, True, False]
    assert "made from another scan" in summary.frames[1].remade
    run_drive(open_drive(folder), tmp_path / "fresh", settings=SETTINGS)
    assert results(tmp_path / "out") == results(tmp_path / "fresh")


def test_a_file_copied_over_another_is_made_again(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    before = results(tmp_path)
    shutil.copy(frame_path(tmp_path, 0), frame_path(tmp_path, 2))
    summary = run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    assert [record.number for record in summary.frames if record.remade] == [2]
    assert results(tmp_path) == before


def test_a_file_of_other_settings_is_made_again(tmp_path):
    run_drive(MemoryDrive(), tmp_path / "a", settings=SETTINGS)
    run_drive(MemoryDrive(), tmp_path / "b", settings=Settings(tau=6))
    shutil.copy(frame_path(tmp_path / "b", 1), frame_path(tmp_path / "a", 1))
    before = results(tmp_path / "a")
    summary = run_drive(MemoryDrive(), tmp_path / "a", settings=SETTINGS)
    assert summary.reused == 3
    assert "made again" in repr(summary.frames[1])
    assert results(tmp_path / "a") != before
    assert int(load_frame(frame_path(tmp_path / "a", 1))["tau"]) == 5


def test_the_fingerprint_of_a_frame_changes_with_each_input():
    frame = MemoryDrive((3,), poses={3: np.eye(4)})[3]
    moved = np.eye(4)
    moved[0, 3] = 1e-9
    points = frame.points.copy()
    points[-1, 2] = np.nextafter(points[-1, 2], np.float32(9))
    seen = {
        frame_fingerprint(
            MemoryDrive((3,), poses=poses, with_camera=camera)[3], settings, viewpoint
        )
        for poses in ({3: np.eye(4)}, {3: moved})
        for camera in (True, False)
        for settings in (SETTINGS, Settings(tau=6))
        for viewpoint in ("camera", [0.0, 0.0, 1.0])
    }
    assert len(seen) == 16
    changed = dataclasses.replace(frame, points=points)
    assert frame_fingerprint(changed, SETTINGS, "camera") not in seen
    assert frame_fingerprint(frame, SETTINGS, "camera") in seen


def test_a_run_notes_where_its_drive_is_and_follows_it(tmp_path):
    out = tmp_path / "out"
    first = scan_folder(tmp_path / "here" / "drive")
    assert run_drive(open_drive(first), out).content["source"] == str(first)
    moved = tmp_path / "there" / "drive"
    moved.parent.mkdir()
    first.rename(moved)
    again = run_drive(open_drive(moved), out)
    assert again.reused == len(again.frames) == 3
    assert json.loads((out / "summary.json").read_text())["source"] == str(moved)
