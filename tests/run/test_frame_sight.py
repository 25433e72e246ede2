"""Sight lines of a run: against lines of the scene, resumed, in shards and workers, refused."""

import dataclasses
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.errors import DriveError, OutputError, SettingsError
from intervis.run import SightRequest, load_analysis, load_sight, run_drive
from intervis.run.frame_file import frame_path, load_frame
from intervis.run.frame_sight import sight_of_scan
from intervis.run.workers import process_workers
from intervis.settings import Settings
from intervis.sight import Scene
from intervis.transform import rigid
from small_drive import CAMERA_CENTRE_VELO, MemoryDrive, results, scan_folder, street

SETTINGS = Settings(tau=5)
NUMBERS = tuple(range(40))
ASKED = SightRequest()
TURNED = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
POSES = {
    0: rigid(np.eye(3), [0.0, 0, 0]),
    1: rigid(TURNED, [4.0, 1, 0]),
    2: rigid(TURNED, [4.0, 8, 0.5]),
    5: rigid(np.eye(3), [9.0, 8, 0]),
}


def test_every_return_is_asked_from_the_viewpoint_by_its_own_scan(tmp_path):
    far = (12.0, 1.0, 0.5)
    for viewpoint, start in (("camera", CAMERA_CENTRE_VELO), (far, far)):
        out = tmp_path / str(len(str(viewpoint)))
        run_drive(MemoryDrive(), out, settings=SETTINGS, viewpoint=viewpoint, sight=ASKED)
        for number in (0, 1, 2, 5):
            got, points = load_sight(frame_path(out, number)), street(number)
            one = Scene.from_scan(points).sight(start, points)
            np.testing.assert_allclose(got.viewpoint, start, atol=1e-9)
            np.testing.assert_array_equal(got.state, one.state)
            np.testing.assert_allclose(got.probability, one.probability, atol=1e-6)
            assert got.state.dtype == np.int8
            assert got.probability.dtype == np.float32
    assert len(set(got.state.tolist())) >= 2  # from afar not all is visible


def test_the_next_place_follows_from_the_poses(tmp_path):
    asked = SightRequest("next", risk=0.1)
    run_drive(MemoryDrive(poses=POSES), tmp_path, settings=SETTINGS, sight=asked)
    # In the frame that looks along y: 7 m ahead and 0.5 m up; then 5 m to the right and down.
    expected = {0: [4.0, 1, 0], 1: [7.0, 0, 0.5], 2: [0.0, -5, -0.5]}
    for number, start in expected.items():
        got, points = load_sight(frame_path(tmp_path, number)), street(number)
        np.testing.assert_allclose(got.viewpoint, start, atol=1e-9)
        one = Scene.from_scan(points).sight(start, points, risk=0.1)
        np.testing.assert_array_equal(got.state, one.state)
    last = load_sight(frame_path(tmp_path, 5))
    assert np.isnan(last.viewpoint).all()
    assert (last.state == -1).all()
    assert np.isnan(last.probability).all()
    content = json.loads((tmp_path / "summary.json").read_text())
    assert content["sight"] == {"from": "next", "risk": 0.1}
    shares = [frame["sight"] for frame in content["frames"]]
    assert sum(shares[0].values()) == pytest.approx(1.0)
    assert set(shares[-1].values()) == {None}


def test_rows_that_are_no_return_are_unknown():
    points = street(3)
    points[7], points[9], points[11, 2] = np.nan, 0.0, np.inf
    before = points.copy()
    got = sight_of_scan(points, np.zeros(3), 0.05)
    no_return = np.isin(np.arange(len(points)), [7, 9, 11])
    assert (got.state[no_return] == -1).all()
    assert np.isnan(got.probability[no_return]).all()
    assert np.isfinite(got.probability[~no_return]).all()
    np.testing.assert_array_equal(points, before)
    asked = got.state[~no_return]
    assert got.shares["visible"] == pytest.approx((asked == 1).mean())
    assert sum(got.shares.values()) == pytest.approx(1.0)


def test_the_results_of_the_method_stay_as_they_are(tmp_path):
    run_drive(MemoryDrive(), tmp_path / "with", settings=SETTINGS, sight=ASKED)
    run_drive(MemoryDrive(), tmp_path / "without", settings=SETTINGS)
    with_sight, without = results(tmp_path / "with"), results(tmp_path / "without")
    for name, arrays in without.items():
        more = set(with_sight[name]) - set(arrays)
        assert more == {"sight_viewpoint", "sight_state", "sight_probability"}
        for key in set(arrays) - {"fingerprint"}:
            assert with_sight[name][key] == arrays[key], key
    loaded = load_analysis(frame_path(tmp_path / "with", 1))
    assert loaded.measures == load_analysis(frame_path(tmp_path / "without", 1)).measures
    with pytest.raises(OutputError, match="holds no sight lines: run with sight lines"):
        load_sight(frame_path(tmp_path / "without", 1))


def test_a_run_resumes_and_another_request_is_another_run(tmp_path):
    first = run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, sight=ASKED)
    frame_path(tmp_path, 2).unlink()
    again = run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, sight=ASKED)
    assert [record.reused for record in again.frames] == [True, True, False, True]
    assert [record.sight for record in again.frames] == [record.sight for record in first.frames]
    for other in (None, SightRequest(risk=0.1)):
        with pytest.raises(OutputError, match=r"holds another run \(sight "):
            run_drive(MemoryDrive(), tmp_path, settings=SETTINGS, sight=other)
    changed = run_drive(
        MemoryDrive(), tmp_path, settings=SETTINGS, sight=SightRequest(risk=0.1), overwrite=True
    )
    assert changed.reused == 0


def test_frames_of_another_request_are_made_again(tmp_path):
    near = {**POSES, 1: rigid(np.eye(3), [3.0, 0, 0])}
    asked = SightRequest("next")
    for name, poses, sight in (
        ("without", POSES, None),
        ("risk", POSES, dataclasses.replace(asked, risk=0.1)),
        ("poses", near, asked),  # the next place is another one
    ):
        other, out = tmp_path / name, tmp_path / f"{name} again"
        run_drive(MemoryDrive(poses=poses), other, settings=SETTINGS, sight=sight, frames=(0, 1))
        run_drive(MemoryDrive(poses=POSES), out, settings=SETTINGS, sight=asked)
        good = frame_path(out, 0).read_bytes()
        shutil.copy(frame_path(other, 0), frame_path(out, 0))
        again = run_drive(MemoryDrive(poses=POSES), out, settings=SETTINGS, sight=asked)
        assert [bool(record.remade) for record in again.frames] == [True, False, False, False]
        kept = load_frame(frame_path(out, 0))
        frame_path(out, 0).write_bytes(good)
        for key, array in load_frame(frame_path(out, 0)).items():
            if key != "times_s":
                np.testing.assert_array_equal(kept[key], array)


def test_workers_and_shards_give_the_results_of_a_serial_run(tmp_path):
    drive = open_drive(scan_folder(tmp_path / "scans", NUMBERS))
    run = {"settings": SETTINGS, "sight": ASKED, "viewpoint": (9.0, 1.0, 0.4)}
    serial = run_drive(drive, tmp_path / "serial", **run)
    with process_workers(2) as executor:
        run_drive(drive, tmp_path / "workers", executor=executor, **run)
    for number in (2, 1):
        run_drive(drive, tmp_path / "shards", shard=(number, 2), **run)
    joined = run_drive(drive, tmp_path / "shards", **run)
    expected = results(tmp_path / "serial")
    assert results(tmp_path / "workers") == results(tmp_path / "shards") == expected
    assert joined.reused == len(NUMBERS)
    assert [record.sight for record in joined.frames] == [one.sight for one in serial.frames]


def test_a_frame_whose_next_has_no_pose_fails_alone(tmp_path):
    poses = {number: pose for number, pose in POSES.items() if number != 2}
    summary = run_drive(
        MemoryDrive(poses=poses), tmp_path, settings=SETTINGS, sight=SightRequest("next")
    )
    assert [failure.number for failure in summary.failures] == [1, 2]
    assert summary.failures[0].reason == (
        "frame 2 has no pose, so it is not known where the frame after 1 was scanned."
    )


def test_damaged_sight_lines_are_told(tmp_path):
    run_drive(MemoryDrive((0,)), tmp_path, settings=SETTINGS, sight=ASKED)
    path = frame_path(tmp_path, 0)
    arrays = load_frame(path)
    arrays["sight_state"] = arrays["sight_state"][:-1]
    np.savez(path, **arrays)
    with pytest.raises(OutputError, match="is damaged: its sight lines do not fit together"):
        load_sight(path)


def test_requests_that_make_no_sense(tmp_path):
    with pytest.raises(SettingsError, match="start at viewpoint or next, and 'camera' was given"):
        SightRequest("camera")  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match="risk, the allowed share of wrong answers"):
        SightRequest(risk=0.5)
    with pytest.raises(DriveError, match="memory has no poses, which tell where the next frame"):
        run_drive(MemoryDrive(), tmp_path / "out", settings=SETTINGS, sight=SightRequest("next"))
    assert not (tmp_path / "out").exists()


def test_the_command(tmp_path: Path, capsys):
    scans = scan_folder(tmp_path / "scans")
    command = ["run", str(scans), "--out", str(tmp_path / "out"), "--tau", "5"]
    assert exit_code([*command, "--sight", "--viewpoint", "12,1,0.5", "--risk", "0.1"]) == 0
    said = capsys.readouterr().out
    assert "Sight lines to every return: " in said
    assert "in the mean over 3 frames." in said
    content = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert content["sight"] == {"from": "viewpoint", "risk": 0.1}
    for more, message in (
        (["--sight-from", "next"], "--sight-from is about the sight lines of --sight"),
        (["--risk", "0.1"], "--risk is about the sight lines of --sight"),
        (["--sight", "--sight-from", "here"], "sight lines start at viewpoint or next"),
        (["--sight", "--sight-from", "next"], "has no poses, which tell where the next frame"),
        (["--sight", "--risk", "0.9"], "risk, the allowed share of wrong answers"),
        ([], "holds another run (sight is {'from': 'viewpoint', 'risk': 0.1} there and None here"),
    ):
        given = [*command, *more] if more else [*command, "--viewpoint", "12,1,0.5"]
        assert exit_code(given) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("intervis: ") == 1


def test_a_drive_of_one_frame_has_no_next(tmp_path: Path, capsys):
    scans = scan_folder(tmp_path / "scans", (0,))
    (scans / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    out = tmp_path / "out"
    command = [
        "run",
        str(scans),
        "--out",
        str(out),
        "--tau",
        "5",
        "--sight",
        "--sight-from",
        "next",
    ]
    assert exit_code(command) == 0
    assert "1 without: there is no next frame." in capsys.readouterr().out
