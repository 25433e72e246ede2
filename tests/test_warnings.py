"""Which warnings stop a test run: those of our code, not those of other plugins of pytest."""

import subprocess
import sys
from pathlib import Path

SETTINGS = Path(__file__).resolve().parents[1] / "pyproject.toml"
PLUGIN = """
import warnings
warnings.warn("the plugin is loaded", DeprecationWarning)
def pytest_configure(config):
    warnings.warn("the plugin is configured", UserWarning)
def pytest_runtest_call(item):
    warnings.warn("the plugin runs a test", UserWarning)
"""
TEST = """
import warnings
import pytest
@pytest.mark.parametrize("module", {modules})
def test_made(module):
    warnings.warn_explicit("message", UserWarning, "file.py", 1, module=module)
"""
OTHERS = ["other_plugin", "intervision", "pytest_other.plugin"]
OURS = [
    "intervis",
    "intervis.sight.scene",
    "/home/user/intervis/src/intervis/arrays",  # numba names the file
    "numpy.linalg",
    "test_scene",
]


def test_only_warnings_of_our_code_are_errors(tmp_path):
    (tmp_path / "warning_plugin.py").write_text(PLUGIN)
    (tmp_path / "test_warnings.py").write_text(TEST.format(modules=OTHERS + OURS))
    command = [sys.executable, "-m", "pytest", "-c", SETTINGS, "--rootdir", tmp_path, "-rA"]
    plugins = ["-p", "warning_plugin", "-p", "no:cacheprovider", "-p", "no:xdist"]
    run = subprocess.run(
        [*command, *plugins, "test_warnings.py"], cwd=tmp_path, capture_output=True, text=True
    )
    assert "the plugin is configured" in run.stdout + run.stderr
    for modules, outcome in ((OTHERS, "PASSED"), (OURS, "FAILED")):
        for module in modules:
            assert f"{outcome} test_warnings.py::test_made[{module}]" in run.stdout, run.stdout
