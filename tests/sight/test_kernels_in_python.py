"""The kernels as plain Python: every index is checked, and the answers are those of compiled code.

Compiled kernels do not check indices. In plain Python an index beyond an array is an error.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

SCRIPT = """
import sys
import numpy as np
from made_scans import street_scan, turned
from intervis.sight import Scene

scene = Scene(sensor="VLP-16")
for number in range(2):
    pose = turned(0.1 * number, 1.5 * number, 0.2)
    scan = street_scan(pose, seed=number, beams=12, step_deg=3.0, range_m=30.0)
    # a sector without its middle beams, a direction that rounds to a full turn, and returns on the
    # border of the ground map and beyond it
    slope = scan[:, 2] / np.hypot(scan[:, 0], scan[:, 1])
    hole = (np.abs(np.arctan2(scan[:, 1], scan[:, 0]) - 0.4) < 0.3) & (np.abs(slope + 0.2) < 0.16)
    border = [[64, 0], [-64, 3], [5, 64], [-5, -64], [65, 65], [-65, -70], [127, 1], [2, -90]]
    odd = [[9.0, -1e-18, 0.1], *([x + 0.001 * k, y, -1.7] for x, y in border for k in range(5))]
    scan = np.vstack([scan[~hole], odd]).astype(np.float32)
    scene.add(scan, pose, 0.2 * number)
rng = np.random.default_rng(5)
a = rng.normal(0, 1, (30, 3)) * [5, 5, 0.6]
b = rng.normal(0, 1, (30, 3)) * [12, 12, 1.5]
b[:4] = a[:4] * 2.5
a[4:10], b[4:10] = [1.0, 0.5, -0.2], b[4:10] / 6.0
a[10:16], b[10:16] = [6.0, 1.0, 0.3], [7.0, 1.5, -5.0]  # through the road
arrays = {}
for moment_s in (None, 0.1):
    for risk in (0.02, 0.2):
        sight = scene.sight_lines(a, b, risk=risk, moment_s=moment_s)
        arrays |= {f"{name} {moment_s} {risk}": values for name, values in vars(sight).items()}
np.savez(sys.argv[1], **arrays)
"""


def answers(path: Path, **environment: str) -> dict:
    tests = str(Path(__file__).parent)
    search = os.pathsep.join([*sys.path, tests])
    kept = {**os.environ, "PYTHONPATH": search, **environment}
    subprocess.run([sys.executable, "-c", SCRIPT, str(path)], env=kept, check=True)
    with np.load(path) as file:
        return dict(file)


def test_plain_python_checks_every_index_and_gives_the_same_answers(tmp_path):
    compiled = answers(tmp_path / "compiled.npz")
    plain = answers(tmp_path / "plain.npz", NUMBA_DISABLE_JIT="1")
    states = [values for name, values in compiled.items() if name.startswith("state")]
    assert {-1, 0, 1} <= set(np.concatenate(states).tolist())
    for name, values in compiled.items():
        np.testing.assert_allclose(plain[name], values, rtol=1e-6, atol=1e-6, err_msg=name)
