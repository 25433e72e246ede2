"""Runs over worker processes and dask: the results of a serial run, lost workers, messages."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from pathlib import Path

import pytest

import intervis.run.workers
from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.errors import MissingExtraError, SettingsError
from intervis.run.stream import WorkersLostError, run_drive
from intervis.run.workers import dask_workers, process_workers
from intervis.settings import Settings
from small_drive import MemoryDrive, results, scan_folder

SETTINGS = Settings(tau=5)
NUMBERS = tuple(range(40))


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return open_drive(scan_folder(tmp_path_factory.mktemp("drive") / "scans", NUMBERS))


@pytest.fixture(scope="module")
def serial(drive, tmp_path_factory):
    out = tmp_path_factory.mktemp("serial")
    run_drive(drive, out, settings=SETTINGS)
    return results(out)


def has_ended(process, within_s=30.0):
    """Whether a process ends; one that nobody has asked for its result counts."""
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline:
        try:
            if Path(f"/proc/{process}/stat").read_text().split()[2] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.02)
    return False


def test_processes_give_the_results_of_a_serial_run(drive, serial, tmp_path):
    notes = []
    with process_workers(2) as executor:
        summary = run_drive(
            drive, tmp_path, settings=SETTINGS, executor=executor, progress=notes.append
        )
        again = run_drive(drive, tmp_path, settings=SETTINGS, executor=executor)
    assert results(tmp_path) == serial
    assert [record.number for record in summary.frames] == list(NUMBERS)
    assert sorted(notes) == sorted(f"frame {number}" for number in NUMBERS)
    assert again.reused == len(NUMBERS)


def test_dask_gives_the_results_of_a_serial_run(drive, serial, tmp_path):
    with dask_workers(None, 1) as executor:
        run_drive(drive, tmp_path, settings=SETTINGS, executor=executor)
    assert results(tmp_path) == serial


def test_failed_frames_come_back_from_workers_by_number(tmp_path):
    failing = {1: SettingsError("no."), 5: ValueError("odd")}
    with ThreadPoolExecutor(1) as executor, pytest.raises(SettingsError, match=r"^no\.$"):
        run_drive(MemoryDrive(failing=failing), tmp_path, settings=SETTINGS, executor=executor)
    del failing[1]
    with ThreadPoolExecutor(1) as executor:
        summary = run_drive(
            MemoryDrive(failing=failing), tmp_path, settings=SETTINGS, executor=executor
        )
    assert [failure.number for failure in summary.failures] == [5]


def test_a_killed_worker_is_one_sentence_and_costs_nothing(drive, serial, tmp_path):
    with process_workers(1) as executor:
        worker = executor.submit(os.getpid).result()
        executor.submit(time.sleep, 60)
        os.kill(worker, signal.SIGKILL)
        with pytest.raises(WorkersLostError, match="the same command resumes the run"):
            run_drive(drive, tmp_path, settings=SETTINGS, executor=executor)
    run_drive(drive, tmp_path, settings=SETTINGS)
    assert results(tmp_path) == serial


def test_a_worker_that_does_not_end_is_ended(monkeypatch):
    monkeypatch.setattr(intervis.run.workers, "GRACE_S", 0.1)
    with process_workers(1) as executor:
        worker = executor.submit(os.getpid).result()
        os.kill(worker, signal.SIGSTOP)
    assert has_ended(worker)


def test_the_command_replaces_workers_that_are_lost(drive, serial, tmp_path, capsys, monkeypatch):
    pools = []

    @contextmanager
    def first_is_lost(count):
        pools.append(count)
        with process_workers(count) as executor:
            if len(pools) == 1:
                os.kill(executor.submit(os.getpid).result(), signal.SIGKILL)
                with pytest.raises(BrokenExecutor):
                    executor.submit(time.sleep, 60).result()
            yield executor

    monkeypatch.setattr(intervis.run.workers, "process_workers", first_is_lost)
    out = tmp_path / "out"
    command = ["run", str(drive.root), "--out", str(out), "--tau", "5", "--workers", "2"]
    assert exit_code(command) == 0
    assert len(pools) == 2
    assert "new ones go on" in capsys.readouterr().err
    assert results(out) == serial


@pytest.mark.parametrize(
    ("options", "is_noted"),
    [
        (["--workers", "2", "--budget", "50"], True),
        (["--workers", "2", "--tau", "auto"], True),
        (["--workers", "2", "--tau", "5"], False),
        (["--tau", "auto"], False),
    ],
)
def test_workers_without_work_are_noted(options, is_noted, drive, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(intervis.run.workers, "process_workers", lambda count: nullcontext())
    command = ["run", str(drive.root), "--frames", ":1", "--out", str(tmp_path / "out")]
    assert exit_code([*command, *options]) == 0
    assert ("one worker analyses a drive" in capsys.readouterr().err) == is_noted


def test_workers_end_with_a_killed_caller(tmp_path):
    program = (
        "import os, time\n"
        "from intervis.run.workers import process_workers\n"
        "if __name__ == '__main__':\n"
        "    with process_workers(1) as executor:\n"
        "        print(executor.submit(os.getpid).result(), flush=True)\n"
        "        time.sleep(60)\n"
    )
    (tmp_path / "caller.py").write_text(program)
    caller = subprocess.Popen(
        [sys.executable, str(tmp_path / "caller.py")], stdout=subprocess.PIPE, text=True
    )
    worker = int(caller.stdout.readline())
    caller.kill()
    caller.communicate()
    assert has_ended(worker)


@pytest.mark.parametrize("count", [0, -1, 1025])
def test_an_impossible_number_of_workers_is_refused(count):
    for workers in (process_workers(count), dask_workers(None, count)):
        with pytest.raises(SettingsError, match="workers must be 1 to 1024"), workers:
            pass


def test_dask_is_named_where_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"intervis\[cluster\]"), dask_workers(None, 1):
        pass
