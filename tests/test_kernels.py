"""Compiled kernels: what is kept on disk never outlives the source it was made of."""

import os
import subprocess
import sys

import pytest

NUMBERS = "FACTOR = {factor}\n"
KERNELS = """
from intervis.kernels import kernel
from {package}.numbers import FACTOR

@kernel
def scaled(x):
    return FACTOR * x
"""
ASK = """
from {package}.kernels_of_it import scaled
print(scaled(1.0), scaled.stats.cache_hits.total())
"""


@pytest.fixture
def ask(tmp_path):
    """Writes the number that a kernel takes from another module, runs the kernel in a process."""
    folder = tmp_path / "made_package"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "kernels_of_it.py").write_text(KERNELS.format(package=folder.name))

    def run(factor: float) -> tuple[float, int]:  # the answer, and how often the cache had it
        (folder / "numbers.py").write_text(NUMBERS.format(factor=factor))
        keep = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
        said = subprocess.run(
            [sys.executable, "-c", ASK.format(package=folder.name)],
            cwd=tmp_path,
            env=keep | {"PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        return float(said[0]), int(said[1])

    return run


def test_a_constant_changed_in_another_module_is_noticed(ask):
    assert ask(2.0) == (2.0, 0)
    assert ask(2.0) == (2.0, 1), "unchanged source is not compiled again"
    assert ask(3.0) == (3.0, 0)
    assert ask(2.0) == (2.0, 0)


def test_a_damaged_cache_costs_a_compilation_and_no_more(ask, tmp_path):
    assert ask(2.0) == (2.0, 0)
    files = list((tmp_path / "made_package" / "__pycache__").glob("*.nb[ic]"))
    assert len(files) == 2
    for file in files:
        file.write_bytes(file.read_bytes()[:-20] + b"damaged")
    assert ask(2.0) == (2.0, 0)
    assert ask(2.0) == (2.0, 1), "it has been written anew"
