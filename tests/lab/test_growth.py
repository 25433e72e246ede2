"""Growth: exponents by hand, memory of a known amount, scans that differ in density only."""

import json
import subprocess
import sys

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.errors import IntervisError
from intervis.lab.speed import growth as curves
from intervis.lab.speed.growth import Growth, growth, growth_steps, growth_table, street_scan
from intervis.lab.speed.growth_figure import growth_figure
from intervis.lab.speed.peak_memory import RESET, peak_bytes

linux = pytest.mark.skipif(not RESET.exists(), reason="the peak of memory is known on Linux only")


def power_law(exponent, factor_s=1e-6, bytes_per_point=(500.0, 400.0, 300.0)):
    sizes = (10_000, 100_000, 1_000_000)
    times_s = tuple(factor_s * size**exponent for size in sizes)
    peaks = tuple(round(n * b) for n, b in zip(sizes, bytes_per_point, strict=True))
    return Growth("a work", sizes, times_s, tuple([t] for t in times_s), peaks)


@pytest.mark.parametrize("exponent", [0.9, 1.0, 1.27, 2.0])
def test_the_exponent_of_a_power_law_is_found(exponent):
    assert power_law(exponent).exponent == pytest.approx(exponent, abs=1e-5)


def test_the_exponent_is_that_of_the_least_squares_of_logarithms():
    """Decades 0, 1, 2 of n; logarithms of the time 0, 2, 2: slope (2 * 1 + 0 * -1) / 2 = 1."""
    assert Growth("a", (1, 10, 100), (1.0, 100.0, 100.0), ([], [], []), None).exponent == 1.0


def test_bytes_for_each_point_and_the_table():
    one = power_law(1.0)
    assert one.bytes_per_point == pytest.approx((500.0, 400.0, 300.0))
    rows = growth_table([one]).rows
    assert rows[0] == ("a work", "n^1.00", "10,000", "10.0", "500")
    assert rows[2] == ("", "", "1,000,000", "1000.0", "300")
    unknown = Growth("a", (1, 10), (1.0, 2.0), ([], []), None)
    assert unknown.bytes_per_point is None
    assert growth_table([unknown]).rows[0][-1] == ""


@linux
@pytest.mark.parametrize("megabytes", [40, 160])
def test_the_peak_of_memory_is_what_was_allocated_in_the_meantime(megabytes):
    """In a process of its own: the peak of an array that is gone at the end, and of one kept."""
    program = (
        "import numpy as np\n"
        "from intervis.lab.speed.peak_memory import taken_bytes\n"
        "before = np.ones(30_000_000)\n"  # does not count
        "def passing():\n"
        f"    np.ones({megabytes} * 125_000)\n"
        f"    return np.ones(125_000)\n"
        "del before\n"
        "print(taken_bytes(passing))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == pytest.approx(megabytes * 1e6, rel=0.1)


@linux
def test_a_work_that_fails_is_one_sentence():
    with pytest.raises(IntervisError, match="the memory of 'none' could not be measured: KeyError"):
        peak_bytes("none", np.zeros((10, 3), np.float32))


def test_scans_have_the_returns_that_are_asked_for_and_the_same_extent():
    small, large = street_scan(5_000), street_scan(20_000)
    assert len(small) == pytest.approx(5_000, rel=0.1)
    assert len(large) == pytest.approx(20_000, rel=0.1)
    for share in (5, 50, 95):
        extents = [np.percentile(np.linalg.norm(scan, axis=1), share) for scan in (small, large)]
        assert extents[0] == pytest.approx(extents[1], rel=0.15)


def test_every_work_is_timed_and_measured_at_every_size():
    notes = []
    found = growth((2_000, 4_000), rounds=3, progress=notes.append)
    assert [one.work for one in found] == list(curves.WORKS)
    assert len(notes) == growth_steps((2_000, 4_000), 3)
    for one in found:
        assert one.sizes == (len(street_scan(2_000)), len(street_scan(4_000)))
        assert [len(times_s) for times_s in one.times_s] == [3, 3]
        assert one.median_s == tuple(float(np.median(times_s)) for times_s in one.times_s)
        if RESET.exists():
            assert len(one.peak_bytes) == 2


def test_the_chart_holds_every_curve_and_the_goal():
    found = [power_law(1.0), power_law(1.3, 1e-7)]
    time, memory = growth_figure(found).axes
    for one, line in zip(found, time.lines, strict=False):
        np.testing.assert_allclose(line.get_xdata(), one.sizes)
        np.testing.assert_allclose(line.get_ydata(), 1e3 * np.array(one.median_s))
    assert [line.get_label() for line in time.lines[:2]] == ["a work: n^1.00", "a work: n^1.30"]
    goal = time.lines[2]
    slope = np.diff(np.log(goal.get_ydata())) / np.diff(np.log(goal.get_xdata()))
    assert slope == pytest.approx([1.1])
    assert len(memory.lines) == 3
    np.testing.assert_allclose(memory.lines[0].get_ydata(), [500, 400, 300])
    np.testing.assert_allclose(memory.lines[2].get_ydata(), 600.0)


def test_the_command_shows_draws_and_writes(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(curves, "SIZES", (2_000, 4_000))
    written, chart = tmp_path / "growth.json", tmp_path / "growth.svg"
    command = [
        "bench",
        "--growth",
        "--rounds",
        "3",
        "--json",
        str(written),
        "--picture",
        str(chart),
    ]
    assert exit_code(command) == 0
    said = capsys.readouterr().out
    assert all(work in said for work in curves.WORKS)
    content = json.loads(written.read_text())
    assert [one["work"] for one in content["growth"]] == list(curves.WORKS)
    assert all(len(one["times_s"]) == 2 for one in content["growth"])
    assert content["versions"]["numba"]
    assert chart.read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["somewhere", "--growth"], "--growth scans the built-in street: leave out SOURCE"),
        (["--growth", "--only", "scene"], "--growth scans the built-in street: leave out SOURCE"),
        (["--growth", "--rounds", "1"], "--rounds must be 3 or more"),
        (["--picture", "a.png"], "--picture draws the chart of --growth"),
        (["--growth", "--picture", "a.pdf"], "a picture must be named .png or .svg"),
        (["--growth", "--json", "{folder}/a.png", "--picture", "{folder}/a.png"], "both name"),
    ],
)
def test_impossible_growth_is_one_sentence(options, said, tmp_path, capsys):
    given = [option.format(folder=tmp_path) for option in options]
    assert exit_code(["bench", *given]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
