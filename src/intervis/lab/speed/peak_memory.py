"""Memory that a work takes at its peak, measured in a process of its own.

The peak is the operating system's, so what compiled kernels and other libraries allocate counts
too. It is known on Linux only.
"""

import gc
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from intervis.arrays import Float32Array
from intervis.errors import IntervisError

STATUS, RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")

WARM_POINTS = 3000
"""A scan thinned to so many points is worked on first: it loads kernels and starts threads."""


def peak_bytes(work: str, scan: Float32Array) -> int | None:
    """Memory that a work of `intervis.lab.speed.growth` takes for a scan; None where unknown.

    Parameters
    ----------
    work : str
        A name of ``WORKS``.
    scan : (N, 3) float32 array
        Not counted itself.

    Raises
    ------
    IntervisError
        The process failed.
    """
    if not (STATUS.exists() and RESET.exists()):
        return None
    program = (
        "import sys; from intervis.lab.speed.peak_memory import measure;"
        " print(measure(sys.argv[1], sys.argv[2]))"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scan.npy"
        np.save(path, scan)
        done = subprocess.run(
            [sys.executable, "-c", program, work, str(path)], capture_output=True, text=True
        )
    if done.returncode != 0:
        reason = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise IntervisError(f"the memory of {work!r} could not be measured: {reason}")
    return int(done.stdout)


def measure(work: str, path: str) -> int:
    """What the process of `peak_bytes` does: bytes that a work takes for the scan in a file."""
    from intervis.lab.speed.growth import WORKS

    call, scan = WORKS[work], np.load(path)
    call(np.ascontiguousarray(scan[:: max(1, len(scan) // WARM_POINTS)]))
    return taken_bytes(lambda: call(scan))


def taken_bytes(call: Callable[[], object]) -> int:
    """Bytes that this process takes at the peak of a call, beyond what it holds before."""
    gc.collect()
    RESET.write_text("5")  # the peak begins anew
    before = _bytes("VmRSS")
    result = call()
    taken = _bytes("VmHWM") - before
    del result
    return taken


def _bytes(name: str) -> int:
    """An entry of the process's status, which has kilobytes."""
    for line in STATUS.read_text().splitlines():
        if line.startswith(f"{name}:"):
            return 1024 * int(line.split()[1])
    raise IntervisError(f"{STATUS} has no entry {name}.")
