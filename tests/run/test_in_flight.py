"""Frames in flight: results of a plain loop, in order, in bounded memory, whole when stopped."""

import errno
import gc
import os
import threading
import weakref

import numpy as np
import pytest

import intervis.run.stretch
from intervis.errors import OutputError, ScanError
from intervis.method.analysis import analyze
from intervis.run.frame_file import FrameFile, frame_file, frame_fingerprint, frame_path
from intervis.run.stream import run_drive
from intervis.run.stretch import FrameFailure
from intervis.settings import Settings
from small_drive import MemoryDrive, files_below, results

SETTINGS = Settings(tau=5)
LONGEST_S = 60.0
"""What waits for another thread gives up after this, and the test fails."""


@pytest.fixture(params=["1", "2"])
def threads(request, monkeypatch):
    monkeypatch.setenv("INTERVIS_THREADS", request.param)
    return int(request.param)


@pytest.fixture
def two_threads(monkeypatch):
    monkeypatch.setenv("INTERVIS_THREADS", "2")


def in_turn(drive, out, settings):
    """A run as a plain loop: read, analyse, write."""
    (out / "frames").mkdir(parents=True)
    for number in drive.frame_numbers:
        frame = drive[number]
        camera = {"camera": frame.camera, "cam_from_velo": frame.cam_from_velo}
        analysis = analyze(frame.points, settings=settings, **camera)
        fingerprint = frame_fingerprint(frame, settings, "camera")
        frame_file(frame_path(out, number), frame, analysis, fingerprint).write()


@pytest.mark.parametrize("tau", [1, 5])
def test_results_are_those_of_a_plain_loop(tmp_path, threads, tau):
    drive = MemoryDrive(tuple(range(9)), poses={n: np.eye(4) for n in range(9)})
    in_turn(drive, tmp_path / "loop", Settings(tau=tau))
    summary = run_drive(drive, tmp_path / "run", settings=Settings(tau=tau))
    assert results(tmp_path / "run") == results(tmp_path / "loop")
    assert [record.number for record in summary.frames] == list(range(9))


def test_the_next_frame_is_read_and_the_last_one_written_during_the_analysis(
    tmp_path, monkeypatch, two_threads
):
    """Each analysis ends only when the next frame was read, each writing when it goes on."""
    read = {number: threading.Event() for number in range(5)}
    analysed = {number: threading.Event() for number in range(5)}
    plain_write = FrameFile.write

    class Watched(MemoryDrive):
        def __getitem__(self, number):
            frame = super().__getitem__(number)
            read[number].set()
            return frame

    def patient_outcome(self, number, ahead):
        outcome = plain_outcome(self, number, ahead)
        if number < 4:
            assert read[number + 1].wait(LONGEST_S)
        analysed[number].set()
        return outcome

    def patient_write(self):
        if self.record.number < 4:
            assert analysed[self.record.number + 1].wait(LONGEST_S)
        return plain_write(self)

    plain_outcome = intervis.run.stretch._Analyst.outcome
    monkeypatch.setattr(intervis.run.stretch._Analyst, "outcome", patient_outcome)
    monkeypatch.setattr(FrameFile, "write", patient_write)
    summary = run_drive(Watched(tuple(range(5))), tmp_path, settings=SETTINGS)
    assert len(summary.frames) == 5


def test_two_scans_and_two_files_are_held_at_a_time(tmp_path, monkeypatch, threads):
    frames, files = weakref.WeakSet(), weakref.WeakSet()
    most = {"frames": 0, "files": 0}
    plain = intervis.run.stretch.frame_file

    class Watched(MemoryDrive):
        def __getitem__(self, number):
            frame = super().__getitem__(number)
            frames.add(frame)
            gc.collect()
            most["frames"] = max(most["frames"], len(frames))
            return frame

    def watched_file(*arguments, **options):
        file = plain(*arguments, **options)
        files.add(file)
        gc.collect()
        most["files"] = max(most["files"], len(files))
        return file

    monkeypatch.setattr(intervis.run.stretch, "frame_file", watched_file)
    run_drive(Watched(tuple(range(12))), tmp_path, settings=SETTINGS)
    assert most["frames"] <= 2
    assert most["files"] <= 2


def test_a_file_holds_no_scan(tmp_path, monkeypatch):
    held = []
    monkeypatch.setattr(FrameFile, "write", lambda self: held.append(self) or self.record)
    drive = MemoryDrive((0, 1))
    run_drive(drive, tmp_path, settings=SETTINGS)
    assert len(held) == 2
    for file in held:
        scan = drive[file.record.number].points
        for name, array in file.arrays.items():
            whole = array if array.base is None else array.base
            assert not hasattr(whole, "nbytes") or whole.nbytes < scan.nbytes * 3, name


def test_outcomes_come_in_order_when_frames_fail(tmp_path, threads):
    failing = {1: ScanError("frame 1 is truncated."), 4: MemoryError("none left")}
    notes = []
    drive = MemoryDrive((0, 1, 2, 3, 4), failing=failing)
    summary = run_drive(drive, tmp_path, settings=SETTINGS, progress=notes.append)
    assert notes == [f"frame {n}" for n in range(5)]
    assert [record.number for record in summary.frames] == [0, 2, 3]
    assert summary.failures == (
        FrameFailure(1, "frame 1 is truncated."),
        FrameFailure(4, "unexpected MemoryError: none left"),
    )


@pytest.mark.parametrize("when", [1, 2, 4])
def test_a_file_that_is_being_written_is_completed_when_the_run_is_stopped(
    tmp_path, monkeypatch, threads, when
):
    """Stopped in the analysis of a frame, while the file before is written: it ends whole."""
    stopped, plain_write = threading.Event(), FrameFile.write

    def stops(self, number, ahead):
        if number == when:
            stopped.set()
            raise KeyboardInterrupt
        return plain_outcome(self, number, ahead)

    def late(self):
        if threads > 1 and self.record.number == when - 1:
            assert stopped.wait(LONGEST_S)
        return plain_write(self)

    plain_outcome = intervis.run.stretch._Analyst.outcome
    with monkeypatch.context() as patch:
        patch.setattr(intervis.run.stretch._Analyst, "outcome", stops)
        patch.setattr(FrameFile, "write", late)
        with pytest.raises(KeyboardInterrupt):
            run_drive(MemoryDrive(tuple(range(6))), tmp_path, settings=SETTINGS)
    left = {name for name in files_below(tmp_path) if name.startswith("frames/")}
    assert left == {f"frames/{n:010d}.npz" for n in range(when)}
    resumed = run_drive(MemoryDrive(tuple(range(6))), tmp_path, settings=SETTINGS)
    assert (resumed.reused, len(resumed.frames)) == (when, 6)
    in_turn(MemoryDrive(tuple(range(6))), tmp_path / "loop", SETTINGS)
    assert results(tmp_path) == results(tmp_path / "loop")


def test_no_thread_stays_after_a_run(tmp_path, two_threads):
    def ours():
        return [t for t in threading.enumerate() if t.name.startswith("intervis-files")]

    run_drive(MemoryDrive((0, 1)), tmp_path / "whole", settings=SETTINGS)
    assert not ours()

    def stop(note):
        assert ours()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_drive(MemoryDrive((0, 1)), tmp_path / "part", settings=SETTINGS, progress=stop)
    assert not ours()


def test_a_disk_that_fills_up_stops_the_run_by_the_frame_whose_file_failed(
    tmp_path, monkeypatch, threads
):
    plain_write = FrameFile.write

    def full(self):
        if self.record.number == 2:
            raise OutputError(f"cannot write {self.path}: {os.strerror(errno.ENOSPC)}.")
        return plain_write(self)

    notes = []
    with monkeypatch.context() as patch:
        patch.setattr(FrameFile, "write", full)
        with pytest.raises(OutputError, match=r"0000000002\.npz: No space left"):
            run_drive(
                MemoryDrive(tuple(range(5))), tmp_path, settings=SETTINGS, progress=notes.append
            )
    assert notes == ["frame 0", "frame 1"]
    assert run_drive(MemoryDrive(tuple(range(5))), tmp_path, settings=SETTINGS).reused == 2
