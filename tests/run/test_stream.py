"""A run: its files, resuming, failing frames and full disks, refused requests, viewpoints."""

import dataclasses
import errno
import io
import json
import os
import re
import resource
import zipfile
from pathlib import Path

import numpy as np
import pytest

import intervis.files
import intervis.method.analysis
import intervis.run.stretch
from intervis.drives import open_drive
from intervis.errors import (
    DriveError,
    OutputError,
    PointsError,
    ScanError,
    SettingsError,
)
from intervis.files import write_text
from intervis.method.analysis import analyze
from intervis.method.granularity import TauHysteresis
from intervis.output_folder import MARKER
from intervis.run.frame_file import (
    FORMAT,
    FrameRecord,
    frame_path,
    load_analysis,
    load_frame,
    load_record,
)
from intervis.run.stream import RunSummary, run_drive, selected_frames
from intervis.run.stretch import FrameFailure
from intervis.run.summary import differences, same_results, summarize
from intervis.run.viewpoint import start_viewpoint_world
from intervis.settings import Settings
from intervis.transform import rigid
from small_drive import (
    CAMERA_CENTRE_VELO,
    MemoryDrive,
    files_below,
    results,
    scan_folder,
    street,
)

SETTINGS = Settings(tau=5)


def summary_of(out: Path) -> dict:
    return json.loads((out / "summary.json").read_text())


def analyzed(drive: MemoryDrive, number: int, **options):
    frame = drive[number]
    return analyze(
        frame.points,
        camera=frame.camera,
        cam_from_velo=frame.cam_from_velo,
        settings=SETTINGS,
        **options,
    )


# Files


def test_a_run_writes_one_file_a_frame_by_number_and_its_settings(tmp_path):
    summary = run_drive(MemoryDrive(), tmp_path / "out", settings=SETTINGS)
    assert set(files_below(tmp_path / "out")) == {
        MARKER,
        "summary.json",
        "settings.toml",
        *(f"frames/000000000{n}.npz" for n in (0, 1, 2, 5)),
    }
    assert [record.number for record in summary.frames] == [0, 1, 2, 5]
    assert Settings.from_toml(tmp_path / "out" / "settings.toml") == SETTINGS


def test_a_file_holds_the_whole_analysis(tmp_path):
    drive = MemoryDrive()
    run_drive(drive, tmp_path, settings=SETTINGS)
    loaded, direct = load_analysis(frame_path(tmp_path, 5)), analyzed(drive, 5)
    for field in dataclasses.fields(direct):
        there, here = getattr(loaded, field.name), getattr(direct, field.name)
        if isinstance(here, np.ndarray):
            assert there.dtype == here.dtype, field.name
            np.testing.assert_array_equal(there, here, err_msg=field.name)
        elif field.name != "times":
            assert there == here, field.name
    assert loaded.times.total == pytest.approx(
        sum(loaded.times[name] for name in ("fov", "sampling", "S1", "S2", "S3"))
    )
    assert loaded.fiedler_cut() == pytest.approx(direct.fiedler_cut())


def test_a_file_describes_its_frame_without_the_drive(tmp_path):
    pose = rigid(np.eye(3), [3.0, 2.0, 1.0])
    run_drive(MemoryDrive((7,), poses={7: pose}), tmp_path, settings=SETTINGS)
    arrays = load_frame(frame_path(tmp_path, 7))
    assert int(arrays["number"]) == 7
    assert int(arrays["timestamp_ns"]) == 700_000_000
    np.testing.assert_array_equal(arrays["world_from_velo"], pose)
    np.testing.assert_array_equal(arrays["image_size_px"], [200, 80])
    assert arrays["projection"].shape == (3, 4)


def test_a_file_is_read_once(tmp_path, monkeypatch):
    run_drive(MemoryDrive((0,)), tmp_path, settings=SETTINGS)
    read, reads = Path.read_bytes, []
    monkeypatch.setattr(Path, "read_bytes", lambda path: reads.append(path) or read(path))
    load_analysis(frame_path(tmp_path, 0))
    assert reads == [frame_path(tmp_path, 0)]


def test_compressed_files_are_smaller_and_hold_the_same(tmp_path):
    run_drive(MemoryDrive((0,)), tmp_path / "stored", settings=SETTINGS)
    run_drive(MemoryDrive((0,)), tmp_path / "deflated", settings=SETTINGS, compress=True)
    stored, deflated = (frame_path(tmp_path / name, 0) for name in ("stored", "deflated"))
    assert deflated.stat().st_size < 0.7 * stored.stat().st_size
    assert results(tmp_path / "stored") == results(tmp_path / "deflated")


def test_no_file_holds_a_pickle(tmp_path):
    run_drive(MemoryDrive((0,)), tmp_path, settings=SETTINGS)
    with zipfile.ZipFile(frame_path(tmp_path, 0)) as archive:
        for name in archive.namelist():
            with archive.open(name) as member:
                np.lib.format.read_array(member, allow_pickle=False)


def test_the_summary_holds_input_settings_machine_measures_and_times(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, viewpoint=(0.0, 0.5, 1.0))
    content = summary_of(tmp_path)
    assert content["complete"] is True
    assert content["settings"]["tau"] == 5
    assert content["viewpoint"] == [0.0, 0.5, 1.0]
    assert content["input"]["name"] == "memory"
    assert set(content["versions"]) == {"intervis", "python", "numpy", "scipy", "numba"}
    assert content["machine"]["cpus"] >= 1
    assert content["machine"]["processor"]
    assert [frame["number"] for frame in content["frames"]] == [0, 1, 2, 5]
    first = content["frames"][0]
    assert first["measures"]["n_raw"] == 440
    assert first["measures"]["n"] == -(-first["measures"]["n_fov"] // 5)
    assert set(content["times_s"]) == {"fov", "sampling", "S1", "S2", "S3", "total"}
    assert set(content["times_s"]["total"]) == {"p50", "p99", "mean", "sample_std", "min", "max"}


def test_summary_statistics_calculated_by_hand():
    records = [
        FrameRecord(n, {"TPI": float(t)}, {"total": t / 100})
        for n, t in enumerate((1, 2, 3, 4, 10))
    ]
    content = summarize({}, records, [(9, "broken")])
    # Sorted 1 2 3 4 10: the 99th percentile lies 0.96 of the way from 4 to 10.
    assert content["times_s"]["total"]["p50"] == pytest.approx(0.03)
    assert content["times_s"]["total"]["p99"] == pytest.approx(0.04 + 0.96 * 0.06)
    # Mean 4; squared deviations 9 + 4 + 1 + 0 + 36 = 50, over n - 1 = 4.
    assert content["measures"]["TPI"] == {
        "mean": 4,
        "sample_std": pytest.approx(12.5**0.5),
        "min": 1,
        "max": 10,
    }
    assert content["failures"] == [{"number": 9, "reason": "broken"}]
    assert summarize({}, records[:1], [])["measures"]["TPI"]["sample_std"] is None


def test_the_summary_counts_the_cpus_of_the_process(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 5, 6}, raising=False)
    assert summarize({}, [], [])["machine"]["cpus"] == 3


def test_nan_becomes_null():
    content = summarize({}, [FrameRecord(0, {"TPI": float("nan")}, {"total": 1.0})], [])
    assert content["frames"][0]["measures"]["TPI"] is None
    json.dumps(content, allow_nan=False)


def test_dropped_returns_are_counted(tmp_path):
    folder = scan_folder(tmp_path / "drive", (0,))
    rows = np.fromfile(folder / "000000.bin", "<f4").reshape(-1, 4)
    rows[3, 0], rows[7, 2] = np.nan, np.inf
    rows.tofile(folder / "000000.bin")
    summary = run_drive(open_drive(folder), tmp_path / "out", settings=SETTINGS)
    assert summary.frames[0].measures["n_dropped"] == 2
    assert summary.frames[0].measures["n_raw"] == 438


def test_the_first_frame_is_analysed_once_before_it_is_timed(tmp_path, monkeypatch):
    calls = []
    monkeypatch.setattr(
        intervis.run.stretch, "analyze", lambda *a, **k: calls.append(1) or analyze(*a, **k)
    )
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    assert len(calls) == 4 + 1


# Resuming


def test_a_second_run_touches_nothing(tmp_path, monkeypatch):
    drive = MemoryDrive()
    first = run_drive(drive, tmp_path, settings=SETTINGS)
    before = files_below(tmp_path)
    monkeypatch.setattr(intervis.run.stretch, "analyze", None)  # calling it would fail
    second = run_drive(drive, tmp_path, settings=SETTINGS)
    assert files_below(tmp_path) == before
    assert second.reused == 4
    assert [r.measures for r in second.frames] == [r.measures for r in first.frames]
    assert [r.times_s for r in second.frames] == [r.times_s for r in first.frames]


def test_an_interrupted_run_resumes(tmp_path):
    done = []

    def stop_after_two(note):
        done.append(note)
        if len(done) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, progress=stop_after_two)
    assert summary_of(tmp_path)["complete"] is False
    before = files_below(tmp_path)
    assert {name for name in before if name.endswith("npz")} == {
        "frames/0000000000.npz",
        "frames/0000000001.npz",
    }
    summary = run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    after = files_below(tmp_path)
    assert all(after[name] == before[name] for name in before if name != "summary.json")
    assert summary.reused == 2
    whole = run_drive(MemoryDrive(), tmp_path / "whole", settings=SETTINGS)
    assert [r.measures for r in summary.frames] == [r.measures for r in whole.frames]
    assert summary_of(tmp_path)["complete"] is True


def test_an_interruption_in_the_middle_of_a_file_leaves_no_part(tmp_path, monkeypatch):
    replace, calls = os.replace, []

    def interrupted(source, target):
        calls.append(target)
        if len(calls) == 4:  # settings, summary, first frame, second frame
            raise KeyboardInterrupt
        replace(source, target)

    monkeypatch.setattr(intervis.files.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    left = {MARKER, "settings.toml", "summary.json", "frames/0000000000.npz"}
    assert set(files_below(tmp_path)) == left


def bomb() -> bytes:
    """A small archive that declares three arrays of 0.8 GB."""
    buffer = io.BytesIO(
        archive(format=np.array(FORMAT), a=np.zeros(1), b=np.zeros(1), c=np.zeros(1))
    )
    content = bytearray(buffer.getvalue())
    place = content.find(b"PK\x01\x02")
    while place >= 0:  # the size before compression stands at byte 24 of each directory entry
        content[place + 24 : place + 28] = (800_000_000).to_bytes(4, "little")
        place = content.find(b"PK\x01\x02", place + 1)
    return bytes(content)


def archive(**arrays) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "damage", ["truncated", "flipped", "empty", "foreign", "several", "text", "array", "bomb"]
)
def test_a_damaged_frame_is_computed_again(tmp_path, damage):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    path = frame_path(tmp_path, 1)
    whole = path.read_bytes()
    middle = len(whole) // 2
    path.write_bytes(
        {
            "truncated": whole[:middle],
            "flipped": whole[:middle] + bytes([whole[middle] ^ 0xFF]) + whole[middle + 1 :],
            "empty": b"",
            "foreign": b"not an archive",
            "several": archive(format=np.array([FORMAT, FORMAT])),
            "text": archive(format=np.array("two")),
            "array": archive(
                format=np.array(FORMAT), number=np.array([1, 2]), measure_names=np.array(3)
            ),
            "bomb": bomb(),
        }[damage]
    )
    with pytest.raises(OutputError):
        load_record(path)
    summary = run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    assert summary.reused == 3
    assert len(load_frame(path)["nodes"]) == summary.frames[1].measures["n"]


def test_more_frames_of_the_same_drive_are_added(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, frames=(0, 2))
    assert [f["number"] for f in summary_of(tmp_path)["frames"]] == [0, 1]
    assert run_drive(MemoryDrive(), tmp_path, settings=SETTINGS).reused == 2
    assert [f["number"] for f in summary_of(tmp_path)["frames"]] == [0, 1, 2, 5]


class CrowdedDrive(MemoryDrive):
    """Without a camera; frame k has `returns[k]` returns and 40 of the posts."""

    def __init__(self, **returns: int) -> None:
        self.returns = {int(name[1:]): count for name, count in returns.items()}
        super().__init__(tuple(self.returns), with_camera=False)

    def __getitem__(self, number):
        points = street(number, self.returns[number])
        return dataclasses.replace(super().__getitem__(number), points=points)


AUTO = Settings(tau="auto", tpi_tolerance=12.0)


def test_tau_auto_has_hysteresis_and_is_recorded_per_frame(tmp_path):
    summary = run_drive(CrowdedDrive(n0=2000, n1=1900, n2=6000), tmp_path, settings=AUTO)
    steady = TauHysteresis(AUTO)
    taus = [record.tau for record in summary.frames]
    assert taus == [steady.choose(n) for n in (2040, 1940, 6040)]
    assert taus[0] == taus[1] < taus[2]
    assert [frame["tau"] for frame in summary_of(tmp_path)["frames"]] == taus
    for record in summary.frames:
        assert record.measures["n"] == -(-record.measures["n_fov"] // record.tau)
        assert load_analysis(frame_path(tmp_path, record.number)).settings.tau == record.tau


def test_the_field_of_view_of_a_frame_is_computed_once(tmp_path, monkeypatch):
    calls, original = [], intervis.method.analysis.field_of_view

    def counted(*arguments):
        calls.append(len(arguments[0]))
        return original(*arguments)

    monkeypatch.setattr(intervis.method.analysis, "field_of_view", counted)
    run_drive(CrowdedDrive(n0=2000, n1=2300, n2=2600), tmp_path, settings=AUTO)
    # The first frame is analysed twice: its first analysis compiles the kernels.
    assert calls == [2040, 2040, 2340, 2640]


def test_a_resumed_run_chooses_tau_as_an_uninterrupted_one(tmp_path):
    frames = {"n0": 2000, "n1": 2300, "n2": 2600}
    whole = run_drive(CrowdedDrive(**frames), tmp_path / "whole", settings=AUTO)
    run_drive(CrowdedDrive(**frames), tmp_path / "parts", settings=AUTO, frames=(0, 2))
    parts = run_drive(CrowdedDrive(**frames), tmp_path / "parts", settings=AUTO)
    assert parts.reused == 2
    assert [r.tau for r in parts.frames] == [r.tau for r in whole.frames]
    # Tau depends on the frames before: alone, the last frame is sampled more coarsely.
    alone = run_drive(CrowdedDrive(n2=2600), tmp_path / "alone", settings=AUTO)
    assert alone.frames[0].tau > whole.frames[2].tau


def test_nodes_by_radius_have_no_granularity(tmp_path):
    settings = Settings(tau="auto", sampling="radius", radius_m=1.0)
    assert run_drive(MemoryDrive((0,)), tmp_path, settings=settings).frames[0].tau is None


# Failures


def test_failed_frames_are_listed_and_the_others_are_written(tmp_path):
    failing = {1: ScanError("frame 1 is truncated."), 2: ZeroDivisionError("by zero")}
    notes = []
    summary = run_drive(
        MemoryDrive(failing=failing), tmp_path, settings=SETTINGS, progress=notes.append
    )
    assert [record.number for record in summary.frames] == [0, 5]
    assert summary.failures == (
        FrameFailure(1, "frame 1 is truncated."),
        FrameFailure(2, "unexpected ZeroDivisionError: by zero"),
    )
    assert notes == ["frame 0", "frame 1", "frame 2", "frame 5"]
    assert summary_of(tmp_path)["failures"] == [
        {"number": 1, "reason": "frame 1 is truncated."},
        {"number": 2, "reason": "unexpected ZeroDivisionError: by zero"},
    ]


def test_a_failed_frame_is_tried_again(tmp_path):
    run_drive(MemoryDrive(failing={1: ScanError("gone.")}), tmp_path, settings=SETTINGS)
    summary = run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    assert (summary.reused, len(summary.frames), summary.failures) == (3, 4, ())
    assert summary_of(tmp_path)["failures"] == []


def test_a_failing_first_frame_does_not_stop_the_run(tmp_path):
    summary = run_drive(MemoryDrive(failing={0: ScanError("gone.")}), tmp_path, settings=SETTINGS)
    assert [record.number for record in summary.frames] == [1, 2, 5]


def test_a_full_disk_stops_the_run_and_loses_nothing(tmp_path, monkeypatch):
    open_member, frames = zipfile.ZipFile.open, []

    def full_in_the_third_frame(archive, name, mode="r", **options):
        frames.append(name) if (name, mode) == ("nodes.npy", "w") else None
        if len(frames) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return open_member(archive, name, mode, **options)

    with monkeypatch.context() as patch:
        patch.setattr(zipfile.ZipFile, "open", full_in_the_third_frame)
        with pytest.raises(OutputError, match=r"0000000002\.npz: the disk is full; free some"):
            run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    assert set(files_below(tmp_path)) == {
        MARKER,
        "settings.toml",
        "summary.json",
        "frames/0000000000.npz",
        "frames/0000000001.npz",
    }
    assert run_drive(MemoryDrive(), tmp_path, settings=SETTINGS).reused == 2


def test_a_write_that_exceeds_a_size_limit_leaves_no_part(tmp_path):
    # A real limit on the size of files: the kernel refuses in the middle of the first frame.
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    write_text(tmp_path / "small.txt", "x")
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4000, hard))
        with pytest.raises(OutputError, match="file too large"):
            run_drive(MemoryDrive(), tmp_path / "out", settings=Settings(tau=1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not [name for name in files_below(tmp_path) if "part" in name or "npz" in name]
    assert len(run_drive(MemoryDrive(), tmp_path / "out", settings=Settings(tau=1)).frames) == 4


# Refused requests


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"settings": Settings(tau=6)}, "settings tau is 5 there and 6 here"),
        ({"settings": Settings(tau=5, chart="polar")}, "settings chart is ground there"),
        ({"viewpoint": "sensor"}, "viewpoint is camera there and sensor here"),
        ({"drive": MemoryDrive(name="other")}, "input name is memory there and other here"),
    ],
)
def test_another_run_in_the_same_folder_is_refused_by_what_differs(tmp_path, change, said):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    before = files_below(tmp_path)
    request = {"drive": MemoryDrive(), "settings": SETTINGS, "viewpoint": "camera"} | change
    with pytest.raises(OutputError, match=said):
        run_drive(request.pop("drive"), tmp_path, **request)
    assert files_below(tmp_path) == before


def test_overwriting_removes_the_run_and_nothing_else(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    (tmp_path / "notes.txt").write_text("mine")
    run_drive(MemoryDrive((0, 1)), tmp_path, settings=Settings(tau=6), overwrite=True)
    assert set(files_below(tmp_path)) == {
        MARKER,
        "notes.txt",
        "settings.toml",
        "summary.json",
        "frames/0000000000.npz",
        "frames/0000000001.npz",
    }
    assert summary_of(tmp_path)["settings"]["tau"] == 6


def test_frames_without_a_summary_are_refused(tmp_path):
    run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)
    (tmp_path / "summary.json").unlink()
    with pytest.raises(OutputError, match=r"summary\.json is missing"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)


@pytest.mark.parametrize("content", ["{", "[1]", '{"tool": 1}', "\udcff", "[" * 99999, "9" * 5000])
def test_a_foreign_summary_is_refused(tmp_path, content):
    (tmp_path / "summary.json").write_bytes(content.encode(errors="surrogateescape"))
    with pytest.raises(OutputError, match="is not the summary of a run"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)


def test_an_output_that_is_a_file_or_below_one_is_refused(tmp_path):
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(OutputError, match="is a file: choose a folder"):
        run_drive(MemoryDrive(), tmp_path / "taken", settings=SETTINGS)
    with pytest.raises(OutputError, match="cannot"):
        run_drive(MemoryDrive(), tmp_path / "taken" / "below", settings=SETTINGS)
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_folder_without_permission_is_refused(tmp_path, monkeypatch):
    def refuse(self, *_, **__):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "mkdir", refuse)  # a chmod would not stop root
    with pytest.raises(OutputError, match=r"cannot write in .*out: permission denied\."):
        run_drive(MemoryDrive(), tmp_path / "out", settings=SETTINGS)


def test_invalid_settings_stop_the_run(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise SettingsError("never.")

    monkeypatch.setattr(intervis.run.stretch, "analyze", refuse)
    with pytest.raises(SettingsError, match="never"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS)


def test_impossible_requests_are_refused_before_anything_is_written(tmp_path):
    out = tmp_path / "out"
    for request, error in (
        ({"viewpoint": (0.0, float("nan"), 0.0)}, PointsError),
        ({"viewpoint": "driver"}, SettingsError),
        ({"frames": (90, 99)}, DriveError),
    ):
        with pytest.raises(error):
            run_drive(MemoryDrive(), out, settings=SETTINGS, **request)
    assert not out.exists()


def test_a_range_without_frames_names_what_there_is():
    with pytest.raises(DriveError, match=r"range 6:9 .* 4 frames, from 0 to 5"):
        selected_frames((0, 1, 2, 5), (6, 9))
    assert selected_frames((0, 1, 2, 5), (None, 2)) == [0, 1]
    assert selected_frames((0, 1, 2, 5), (2, None)) == [2, 5]
    assert selected_frames((0, 1, 2, 5), None) == [0, 1, 2, 5]


# Viewpoints

QUARTER_TURN_LEFT = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
POSES = {
    0: rigid(np.eye(3), [10.0, 0.0, 0.0]),
    1: rigid(QUARTER_TURN_LEFT, [12.0, 1.0, 0.0]),
    2: rigid(np.eye(3), [13.0, 1.0, 0.5]),
}


@pytest.mark.parametrize(
    ("viewpoint", "expected"),
    [
        ("camera", CAMERA_CENTRE_VELO),
        ("sensor", [0.0, 0.0, 0.0]),
        ((-1.0, 0.5, 2.0), [-1.0, 0.5, 2.0]),
    ],
)
def test_viewpoints_in_the_sensor_frame(tmp_path, viewpoint, expected):
    run_drive(MemoryDrive((0,)), tmp_path, settings=SETTINGS, viewpoint=viewpoint)
    np.testing.assert_allclose(
        load_frame(frame_path(tmp_path, 0))["viewpoint"], expected, atol=1e-12
    )


def test_without_a_camera_the_default_viewpoint_is_the_sensor(tmp_path):
    run_drive(MemoryDrive((0,), with_camera=False), tmp_path, settings=SETTINGS)
    np.testing.assert_array_equal(load_frame(frame_path(tmp_path, 0))["viewpoint"], 0.0)


def test_the_viewpoint_start_is_transformed_by_the_poses(tmp_path):
    drive = MemoryDrive((0, 1, 2), poses=POSES)
    # In the world: the first pose is a shift of 10 m along x.
    np.testing.assert_allclose(start_viewpoint_world(drive), [10.3, 0.06, -0.08])
    run_drive(drive, tmp_path, settings=SETTINGS, viewpoint="start", frames=(1, 3))
    # From frame 1 at (12, 1, 0): offset (-1.7, -0.94, -0.08); forward is world y, left is -x.
    np.testing.assert_allclose(
        load_frame(frame_path(tmp_path, 1))["viewpoint"], [-0.94, 1.7, -0.08], atol=1e-12
    )
    # From frame 2 at (13, 1, 0.5), not turned.
    np.testing.assert_allclose(
        load_frame(frame_path(tmp_path, 2))["viewpoint"], [-2.7, -0.94, -0.58], atol=1e-12
    )


def test_the_viewpoint_start_needs_poses(tmp_path):
    with pytest.raises(DriveError, match="needs poses, and this drive has none"):
        run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, viewpoint="start")
    poses = {n: POSES[n] for n in (0, 2)}
    summary = run_drive(
        MemoryDrive((0, 1, 2), poses=poses), tmp_path, settings=SETTINGS, viewpoint="start"
    )
    assert [failure.number for failure in summary.failures] == [1]
    assert "no pose" in summary.failures[0].reason


# Parts


def test_differences_name_every_field():
    there = {"intervis": "1", "viewpoint": "camera", "settings": {"tau": 1, "a": 2}, "input": {}}
    here = {"intervis": "2", "viewpoint": "camera", "settings": {"tau": 3}, "input": {}}
    assert differences(there, here) == [
        "intervis is 1 there and 2 here",
        "settings a is 2 there and None here",
        "settings tau is 1 there and 3 here",
    ]
    assert differences(there, there) == []


def test_summaries_of_different_machines_have_the_same_results():
    records = [FrameRecord(0, {"TPI": 1.0}, {"total": 1.0})]
    one = summarize({}, records, [])
    assert same_results(one, one | {"machine": "another"})
    assert not same_results(one, summarize({}, records, [(1, "broken")]))
    assert not same_results(one, summarize({}, records, [], complete=False))


def test_a_record_and_a_summary_print_on_one_line(tmp_path):
    record = FrameRecord(17, {"n": 467.0, "TPI": 34.612}, {"total": 0.00721}, reused=True)
    assert repr(record) == "<FrameRecord 17: n 467, TPI 34.61 %, total 7.2 ms, reused>"
    drive = MemoryDrive((0, 1, 2), failing={2: ScanError("frame 2 is truncated.")})
    first = run_drive(drive, tmp_path, settings=SETTINGS, frames=(0, 1))
    assert repr(first) == f"<RunSummary: 1 frame, in {tmp_path}>"
    second = run_drive(drive, tmp_path, settings=SETTINGS)
    assert repr(second) == f"<RunSummary: 2 frames, 1 reused, 1 failed, in {tmp_path}>"


@pytest.mark.parametrize(
    "result",
    [
        FrameRecord(0, {"TPI": 1.0}, {"total": 1.0}),
        FrameFailure(0, "broken"),
        RunSummary(Path("out"), (), (), {}),
    ],
)
def test_results_cannot_be_changed(result):
    for field in dataclasses.fields(result):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, field.name, None)


def test_a_run_is_reached_from_the_package(tmp_path):
    summary = intervis.run.run_drive(MemoryDrive((0,)), tmp_path, settings=SETTINGS)
    assert isinstance(summary, intervis.run.RunSummary)
    analysis = intervis.run.load_analysis(frame_path(tmp_path, 0))
    assert analysis.measures.TPI == summary.frames[0].measures["TPI"]


@pytest.mark.realdata
def test_real_drives_run(tmp_path, shared_data):
    for name, frames in (("kitti_raw", (0, 2)), ("pcd_drive", (3, 4)), ("kitti_object", None)):
        summary = run_drive(open_drive(shared_data / name), tmp_path / name, frames=frames)
        assert not summary.failures, name
        for record in summary.frames:
            m = record.measures
            assert m["n"] == -(-m["n_fov"] // 35)
            assert 100_000 < m["n_raw"] < 130_000


def test_the_guide_lists_every_array_and_entry_of_a_run(tmp_path):
    guide = (Path(__file__).parents[2] / "docs" / "run.md").read_text()
    named = set(re.findall(r"`(\w+)`", guide))
    run_drive(MemoryDrive((0,), poses={0: np.eye(4)}), tmp_path)
    arrays = load_frame(frame_path(tmp_path, 0))
    assert {"cam_from_velo", "world_from_velo", "timestamp_ns", "tau"} <= set(arrays)
    assert set(arrays) <= named
    assert set(json.loads((tmp_path / "summary.json").read_text())) <= named
