"""Runs that are killed at random moments: does the next run end with the right files?

A drive of small scans is analysed once without interruption. Then, again and again, a run is
started, killed without warning (SIGKILL) when a random number of frames is written, and resumed.
The resumed run must end without failures, with the arrays of the uninterrupted run in every frame
file (stage times aside), and leave no incomplete file. Kinds of runs, in turn:

- one: one process;
- shards: two processes, each with a shard, both killed;
- parent: two worker processes; their parent is killed;
- worker: two worker processes; one of them is killed, and the run must end by itself;
- dask: two dask workers on this machine; the whole process group is killed;
- masks: `intervis masks`, whose resumed folder must hold the bytes of the uninterrupted one.

``python tools/kill_runs.py --count 100``
"""

import argparse
import importlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from intervis.drives import open_drive
from intervis.errors import IntervisError
from intervis.run.stream import run_drive
from intervis.settings import Settings
from intervis.uses.voxels.drive_masks import MaskSettings
from intervis.uses.voxels.mask_layouts import LAYOUTS
from intervis.uses.voxels.mask_run import MaskRun

ROOT = Path(__file__).resolve().parents[1]
KINDS = ("one", "shards", "parent", "worker", "dask", "masks")
SCANS = 60
SETTINGS = Settings(tau=1)
LONGEST_S = 600.0

Command = list[str]


def main() -> int:
    """Kill and resume; the exit code says whether all runs ended right."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=25, help="runs to kill (default: 25)")
    parser.add_argument("--seed", type=int, default=0, help="seed of kinds and moments")
    parser.add_argument("--kind", choices=KINDS, help="only runs of this kind")
    chosen = parser.parse_args()
    rng = random.Random(chosen.seed)
    small = _small_drive()
    outcomes: Counter[str] = Counter()
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="intervis-kills-") as folder:
        drive = small.scan_folder(Path(folder) / "drive", tuple(range(SCANS)))
        reference = Path(folder) / "reference"
        run_drive(open_drive(drive), reference, settings=SETTINGS)
        _masks(drive, Path(folder) / "masks")
        masks = _contents(Path(folder) / "masks")
        expected = small.results(reference)
        for number in range(chosen.count):
            kind = chosen.kind or KINDS[number % len(KINDS)]
            out = Path(folder) / f"run-{number}"
            there = _killed(kind, drive, out, rng)
            if kind == "masks":
                fault = _fault_of_masks(drive, out, masks)
            else:
                fault = _fault(drive, out, expected, small)
            wrong += bool(fault)
            outcomes[f"{kind}: {'WRONG' if fault else 'right'}"] += 1
            print(
                f"[{number + 1}/{chosen.count}] {kind} killed with {there} of {SCANS} frames:"
                f" {fault or 'right'}",
                flush=True,
            )
            shutil.rmtree(out, ignore_errors=True)
    for name in sorted(outcomes):
        print(f"{outcomes[name]:4} {name}")
    return 1 if wrong else 0


def _small_drive() -> Any:
    """The drives of the tests."""
    sys.path.insert(0, str(ROOT / "tests"))
    return importlib.import_module("small_drive")


def _command(drive: Path, out: Path, *options: str) -> Command:
    return _program("run", drive, out, "--tau", "1", *options)


def _program(name: str, drive: Path, out: Path, *options: str) -> Command:
    program = "from intervis.cli import main; main()"
    return [sys.executable, "-c", program, name, str(drive), "--out", str(out), *options]


def _commands(kind: str, drive: Path, out: Path) -> list[Command]:
    if kind == "shards":
        return [_command(drive, out, "--shard", f"{number}/2") for number in (1, 2)]
    if kind in ("parent", "worker"):
        return [_command(drive, out, "--workers", "2")]
    if kind == "dask":
        return [_command(drive, out, "--workers", "2", "--executor", "dask")]
    if kind == "masks":
        return [_program("masks", drive, out, "--later", "0", "--layout", "sscbench-kitti360")]
    return [_command(drive, out)]


def _fault(drive: Path, out: Path, expected: Any, small: Any) -> str:
    """Resume a run; what is wrong with it then, if anything."""
    try:
        summary = run_drive(open_drive(drive), out, settings=SETTINGS)
    except IntervisError as error:
        return str(error)
    if summary.failures:
        return summary.failures[0].reason
    if small.results(out) != expected:
        return "the arrays are not those of the uninterrupted run"
    left = [path.name for path in out.rglob("*.part")]
    return f"left: {', '.join(left)}" if left else ""


def _masks(drive: Path, out: Path) -> None:
    """What the command of this kind writes."""
    layout, opened = LAYOUTS["sscbench-kitti360"], open_drive(drive)
    run = MaskRun(opened, opened.frame_numbers, layout, MaskSettings(layout.grid))
    for _ in run.write(out):
        pass


def _fault_of_masks(drive: Path, out: Path, expected: dict[str, bytes]) -> str:
    """Resume masks; what is wrong with them then, if anything."""
    try:
        _masks(drive, out)
    except IntervisError as error:
        return str(error)
    found = _contents(out)
    differing = [name for name in {**expected, **found} if expected.get(name) != found.get(name)]
    return f"not as in the uninterrupted folder: {', '.join(differing)}" if differing else ""


def _contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def _start(command: Command) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def _killed(kind: str, drive: Path, out: Path, rng: random.Random) -> int:
    """Start a run, kill it when some frames are there, and count the frames that it leaves."""
    frames = rng.randrange(SCANS)
    delay_s = rng.choice([0.0, rng.uniform(0.0, 0.02)])
    processes = [_start(command) for command in _commands(kind, drive, out)]
    files = ".intervis-masks/*.json" if kind == "masks" else "frames/*.npz"
    while len(list(out.glob(files))) < frames and processes[0].poll() is None:
        time.sleep(0.0005)
    time.sleep(delay_s)
    if kind == "worker":
        for child in _children(processes[0].pid)[-1:]:
            _kill(child)
        assert processes[0].wait(LONGEST_S) == 0, "the run did not replace its worker"
    for process in processes:
        if kind == "dask":  # its workers belong to a nanny, which a killed parent cannot end
            os.killpg(process.pid, signal.SIGKILL)
        process.kill()
        process.wait(LONGEST_S)
    return len(list(out.glob(files)))


def _children(parent: int) -> list[int]:
    """Processes that a process has started, by the kernel's list (Linux)."""
    path = Path(f"/proc/{parent}/task/{parent}/children")
    return [int(number) for number in path.read_text().split()] if path.exists() else []


def _kill(process: int) -> None:
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        return


if __name__ == "__main__":
    sys.exit(main())
