"""Warming up: everything that drives need is compiled, and nothing later compiles."""

import os
import subprocess
import sys

import numpy as np
import pytest

import intervis
from intervis.compilation import PARTS, compiling, warm_up
from small_drive import scan_folder, street


def test_warming_up_reports_its_parts():
    done = []
    warm_up(progress=done.append)
    assert done == list(PARTS) == ["method", "sight lines", "voxels"]


def test_a_part_is_compiled_by_a_process_of_its_own():
    with compiling("method") as process:
        assert process.wait() == 0


def test_compiling_ends_where_the_other_work_fails():
    with pytest.raises(ZeroDivisionError), compiling("method") as process:
        raise ZeroDivisionError
    assert process.returncode != 0


def test_the_first_compilation_is_announced_once(tmp_path):
    program = (
        "from intervis.kernels import kernel\n"
        "@kernel\n"
        "def one(x):\n"
        "    return x + 1\n"
        "@kernel\n"
        "def two(x):\n"
        "    return x + 2\n"
        "import logging\n"
        "logging.basicConfig(level=logging.INFO, format='%(message)s')\n"
        "for f in (one, two):\n"
        "    f.py_func.__module__ = 'intervis.made'\n"
        "    f(1)\n"
    )
    (tmp_path / "made.py").write_text(program)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "made.py")], capture_output=True, text=True, check=True
    )
    assert done.stderr.count("compiling kernels, once") == 1


@pytest.mark.slow
def test_after_warming_up_no_command_compiles(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    drive = str(scan_folder(tmp_path / "drive"))
    commands = [
        ["run", drive, "--out", str(tmp_path / "out")],
        ["run", drive, "--out", str(tmp_path / "fine"), "--tau", "1"],
        ["sight", drive, "--from", "sensor", "--to", "9,0,0", "--targets", "returns"],
        ["blindspots", drive],
        ["view", drive, "--html", str(tmp_path / "page.html")],
        ["masks", drive, "--out", str(tmp_path / "masks"), "--layout", "npz"],
    ]

    def said(arguments):
        done = subprocess.run(
            [sys.executable, "-m", "intervis", *arguments],
            capture_output=True,
            text=True,
            env=environment,
        )
        assert done.returncode == 0, done.stderr
        return done.stderr

    assert "compiling kernels" in said(commands[0])
    said(["warm"])
    for command in commands[1:]:
        assert "compiling" not in said(command), command


def test_a_point_that_is_not_finite_has_no_ground():
    scene = intervis.Scene.from_scan(street(1, 4000))
    heights = scene.ground_height([[8.0, 1.0], [np.nan, 0.0], [0.0, np.inf]])
    assert np.isfinite(heights).tolist() == [True, False, False]
