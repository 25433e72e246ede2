"""`intervis view --rerun` and `--foxglove`: files whole or not at all, one sentence a mistake."""

import json
import subprocess
import sys

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.view.recordings.drive_clock import DriveClock
from small_drive import files_below, scan_folder

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'intervis[viewer]'")
pytest.importorskip("foxglove", reason="foxglove-sdk is not installed: intervis[viewer]")
from rerun.chunk import RrdReader

LIMITED = (
    "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000));"
    " from intervis.cli import main; main()"
)
"""The command in a process whose files cannot grow beyond 20 kB: as on a full disk."""


@pytest.fixture
def drive(tmp_path):
    return scan_folder(tmp_path / "drive", (0, 1, 2))


def recorded_frames(path):
    """Frame numbers of the returns in a recording for Rerun."""
    numbers = set()
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == "/world/sensor/returns" and not chunk.is_static:
            numbers |= set(chunk.to_record_batch().column("frame").to_pylist())
    return numbers


def recorded_measure(path, name):
    """A measure by frame number in a recording for Rerun."""
    found = {}
    for chunk in RrdReader(path).stream().to_chunks():
        if chunk.entity_path == f"/measures/{name}" and not chunk.is_static:
            batch = chunk.to_record_batch()
            values = [one[0] for one in batch.column("Scalars:scalars").to_pylist()]
            found |= dict(zip(batch.column("frame").to_pylist(), values, strict=True))
    return found


def test_both_recordings_and_a_page_are_written_at_once(drive, tmp_path, capsys):
    before = files_below(drive)
    names = {"--html": "p.html", "--rerun": "r.rrd", "--foxglove": "f.mcap"}
    places = [word for option, name in names.items() for word in (option, str(tmp_path / name))]
    asked = ["view", str(drive), *places]
    assert exit_code(asked) == 0
    out, err = capsys.readouterr()
    assert [line.split(":")[0] for line in out.splitlines()] == ["Recording", "Recording", "Page"]
    assert not err
    assert recorded_frames(tmp_path / "r.rrd") == {0, 1, 2}
    assert exit_code(asked) == 0  # our own files are replaced
    assert recorded_frames(tmp_path / "r.rrd") == {0, 1, 2}
    assert {path.name for path in tmp_path.iterdir()} == {"drive", *names.values()}
    assert files_below(drive) == before


def test_a_recording_alone_holds_all_frames_unless_fewer_are_asked_for(tmp_path):
    drive = scan_folder(tmp_path / "drive", tuple(range(30)))
    path = tmp_path / "r.rrd"
    quick = ["--returns", "50", "--no-blind-spots", "--rerun", str(path)]
    assert exit_code(["view", str(drive), *quick]) == 0
    assert recorded_frames(path) == set(range(30))
    assert exit_code(["view", str(drive), *quick, "--most", "2"]) == 0
    assert recorded_frames(path) == {0, 29}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--rerun", "r.mcap"], "a recording for Rerun must be named .rrd at its end"),
        (["--foxglove", "f.rrd"], "a recording for Foxglove must be named .mcap at its end"),
        (["--rerun", "other.rrd"], "was not written by 'intervis view' and was not changed"),
        (["--foxglove", "other.mcap"], "was not written by 'intervis view' and was not changed"),
        (["--rerun", "drive/r.rrd"], "which this command reads and never changes"),
        (["--foxglove", "no/f.mcap"], "there is no folder"),
        (["--rerun", "same.rrd", "--html", "same.rrd"], "--html and --rerun both name"),
        (["--rerun", "r.rrd", "--from", "camera"], "no camera: give --from as X,Y,Z, or sensor"),
        (["--rerun", "r.rrd", "--foxglove", "f.mcap", "--frames", "9:"], "no frame lies in"),
    ],
)
def test_mistakes_get_one_sentence_and_change_nothing(
    drive, tmp_path, capsys, monkeypatch, words, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other.rrd").write_bytes(b"RRF2 of someone else")
    (tmp_path / "other.mcap").write_bytes(b"\x89MCAP0\r\n of someone else")
    before = files_below(tmp_path)
    assert exit_code(["view", str(drive), *words]) == 2
    out, err = capsys.readouterr()
    assert said in err
    assert err.count("\n") == 1
    assert not out
    assert files_below(tmp_path) == before


def test_the_size_of_a_large_recording_is_said_before(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("intervis.cli.recordings.LARGE_RECORDING_MB", 3)
    drive = scan_folder(tmp_path / "drive", (0, 1, 2))
    asked = ["view", str(drive), "--rerun", str(tmp_path / "r.rrd"), "--no-blind-spots"]
    assert exit_code(asked) == 0
    assert "recordings of 3 frames will take up to 4 MB" in capsys.readouterr().err
    assert exit_code([*asked, "--returns", "100"]) == 0
    assert not capsys.readouterr().err


def test_rerun_switched_off_is_told(drive, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("RERUN", "off")
    assert exit_code(["view", str(drive), "--rerun", str(tmp_path / "r.rrd")]) == 2
    assert "unset it to record" in capsys.readouterr().err
    assert not list(tmp_path.glob("*r.rrd*"))


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
@pytest.mark.parametrize("option", ["--rerun r.rrd", "--foxglove f.mcap"])
def test_a_file_that_cannot_be_written_ends_in_one_sentence(drive, tmp_path, option):
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, "view", str(drive), *option.split()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 2, done.stderr
    assert "cannot write" in done.stderr.splitlines()[-1]
    assert "panicked" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["drive"]


def test_a_broken_scan_is_left_out_and_told(drive, tmp_path, caplog):
    (drive / "000001.bin").write_bytes(b"123")
    path = tmp_path / "r.rrd"
    assert exit_code(["view", str(drive), "--rerun", str(path)]) == 0
    assert recorded_frames(path) == {0, 2}
    assert "frame 1 is left out: " in caplog.text


def test_a_run_is_recorded_with_its_drive_and_not_without(drive, tmp_path, capsys):
    run, path = tmp_path / "run", tmp_path / "r.rrd"
    asked = ["run", str(drive), "--out", str(run), "--sight", "--viewpoint", "6,1,0.5"]
    assert exit_code(asked) == 0
    shares = json.loads((run / "summary.json").read_text())["frames"][2]["sight"]
    assert exit_code(["view", str(run), "--rerun", str(path), "--returns", "100"]) == 0
    assert recorded_frames(path) == {0, 1, 2}
    assert recorded_measure(path, "visible_percent")[2] == pytest.approx(100 * shares["visible"])
    drive.rename(tmp_path / "moved")
    capsys.readouterr()
    path.unlink()
    assert exit_code(["view", str(run), "--rerun", str(path)]) == 2
    err = capsys.readouterr().err
    assert "--rerun needs the drive of the run, which is missing: there is nothing at" in err
    assert err.count("\n") == 1
    assert not path.exists()


def test_a_frame_without_returns_is_recorded_empty(drive, tmp_path):
    np.full((30, 4), np.nan, "<f4").tofile(drive / "000001.bin")
    places = ["--rerun", str(tmp_path / "r.rrd"), "--foxglove", str(tmp_path / "f.mcap")]
    assert exit_code(["view", str(drive), *places]) == 0
    assert recorded_frames(tmp_path / "r.rrd") == {0, 1, 2}


def test_times_are_the_drives_or_ten_frames_a_second(drive):
    read = open_drive(drive)
    clock = DriveClock(read, (0, 2))
    assert not clock.is_measured
    assert [clock.time_ns(number) for number in (0, 2)] == [0, 200_000_000]
    object.__setattr__(read, "timestamps_ns", {0: 5, 2: 1_700_000_000_000_000_000})
    clock = DriveClock(read, (0, 2))
    assert (clock.is_measured, clock.is_epoch, clock.time_ns(0)) == (True, False, 5)
    assert DriveClock(read, (2,)).is_epoch
    assert not DriveClock(read, (0, 1)).is_measured
