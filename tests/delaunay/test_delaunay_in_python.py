"""The kernels as plain Python, and compiled with checked indices: the results are the same.

Compiled kernels do not check indices. In plain Python an index beyond an array is an error.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = """
import sys
import numpy as np
from intervis.delaunay import triangulate, triangulation

triangulation.WORTH_PARTS = 40
rng = np.random.default_rng(7)
x, y = (axis.ravel() * 1.0 for axis in np.meshgrid(np.arange(6), np.arange(7)))
grid = np.column_stack([x, y])
sets = {
    "random": rng.normal(size=(150, 2)),
    "copies": rng.integers(0, 5, (60, 2)) * 1.0,
    "grid": grid,
    "turned grid": grid @ [[0.8, 0.6], [-0.6, 0.8]] + 0.1,
    "clusters": np.vstack([rng.normal(size=(40, 2)), 1e-9 * rng.normal(size=(40, 2)) + 1e3]),
    "line": np.column_stack([x, x]),
    "nearly a line": np.column_stack([x + 0.1 * y, 1e-16 * rng.normal(size=42)]),
    "two": grid[:2],
    "none": grid[:0],
}
arrays = {}
for name, positions in sets.items():
    found = triangulate(positions)
    arrays |= {f"{name} {key}": value for key, value in vars(found).items()}
    arrays |= {f"{name} edges": found.edges(), f"{name} areas": found.areas(positions)}
np.savez(sys.argv[1], **arrays)
"""


def answers(path: Path, **environment: str) -> dict:
    kept = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    subprocess.run([sys.executable, "-c", SCRIPT, str(path)], env=kept, check=True)
    with np.load(path) as file:
        return dict(file)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    return answers(tmp_path_factory.mktemp("compiled") / "answers.npz")


def test_plain_python(compiled, tmp_path):
    plain = answers(tmp_path / "plain.npz", NUMBA_DISABLE_JIT="1")
    assert len(compiled["random triangles"]) > 200
    assert len(compiled) == 45
    for name, values in compiled.items():
        np.testing.assert_array_equal(plain[name], values, err_msg=name)


@pytest.mark.slow
def test_checked_indices(compiled, tmp_path):
    checks = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for name, values in answers(tmp_path / "checked.npz", **checks).items():
        np.testing.assert_array_equal(values, compiled[name], err_msg=name)
