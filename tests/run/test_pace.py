"""The pace of a run, worked out by hand: intervals, rate, and frames beyond the budget."""

import json

import pytest

from intervis.cli import exit_code
from intervis.errors import ScanError
from intervis.kernels import thread_count
from intervis.method.granularity import FRAME_MS
from intervis.run.frame_file import FrameRecord
from intervis.run.pace import Pace, budget_kept
from intervis.run.stream import run_drive
from intervis.run.stretch import FrameFailure
from intervis.run.tables import pace_table
from intervis.run.workers import process_workers
from intervis.settings import Settings
from small_drive import MemoryDrive, scan_folder


def record(number, total_ms=1.0, tau=5, reused=False):
    return FrameRecord(number, {"n": 1.0}, {"total": 1e-3 * total_ms}, tau, reused=reused)


def paced(outcomes, **options):
    """The pace of outcomes by the second at which each came; the run began at 0."""
    seconds = iter([0.0, *(second for second, _ in outcomes)])
    pace = Pace(clock=lambda: next(seconds), **options)
    for _, outcome in outcomes:
        pace.note(outcome)
    return pace.as_dict()


def test_only_times_between_two_computed_frames_count():
    rate = paced(
        [
            (10.0, record(0)),  # compiled
            (10.5, record(1)),  # 0.5
            (10.6, record(2, reused=True)),
            (19.0, record(3)),
            (19.1, record(4)),  # 0.1
            (19.2, FrameFailure(5, "gone.")),
            (25.0, record(6)),
            (25.3, record(7)),  # 0.3
            (25.31, record(8)),  # written only: no frame was analysed meanwhile
        ]
    )
    assert rate["frames"] == 3
    assert rate["seconds"] == pytest.approx(0.9)
    assert rate["frames_per_s"] == pytest.approx(3 / 0.9)
    interval = rate["interval_s"]
    assert interval["p50"] == pytest.approx(0.3)
    assert interval["p99"] == pytest.approx(0.3 + 0.98 * 0.2)  # between the second and the third
    assert (interval["min"], interval["max"]) == (pytest.approx(0.1), pytest.approx(0.5))


def test_frames_from_executors_have_a_rate_and_no_intervals():
    rate = paced(
        [(8.0, record(0)), (8.0, record(1)), (8.0, record(2, reused=True))], one_by_one=False
    )
    assert rate == {"frames": 2, "seconds": 8.0, "frames_per_s": 0.25, "interval_s": None}


@pytest.mark.parametrize(
    "outcomes",
    [
        [],
        [(3.0, record(0))],
        [(3.0, record(0, reused=True)), (3.1, record(1))],
        [(3.0, record(0)), (3.001, record(1))],
    ],
)
def test_too_few_frames_have_no_rate(outcomes):
    assert paced(outcomes) is None


BUDGET = Settings(tau="auto", time_budget_ms=10.0)


def test_frames_beyond_the_budget_are_listed():
    records = [record(3, 9.9), record(4, 10.1), record(8, 10.0), record(9, 31.0)]
    assert budget_kept(records, BUDGET) == {
        "budget_ms": 10.0,
        "frames": 4,
        "missed": 2,
        "missed_frames": [4, 9],
    }


@pytest.mark.parametrize(
    "settings",
    [Settings(), Settings(tau=3, time_budget_ms=10.0), BUDGET.with_changes(sampling="radius")],
)
def test_without_a_chosen_tau_there_is_no_budget(settings):
    assert budget_kept([record(0, 50.0)], settings) is None


def content(misses, missed_ms=12.0, frames=20):
    return {
        "rate": {
            "frames": 19,
            "seconds": 1.9,
            "frames_per_s": 10.0,
            "interval_s": {"p50": 0.1, "p99": 0.25, "max": 0.3},
        },
        "budget": {
            "budget_ms": 10.0,
            "frames": frames,
            "missed": len(misses),
            "missed_frames": misses,
        },
        "frames": [
            {"number": n, "tau": 7, "times_s": {"total": 1e-3 * missed_ms}} for n in range(frames)
        ],
    }


def test_the_table_has_rate_times_and_every_miss():
    table = pace_table(content([4, 17]))
    assert dict(table.rows) == {
        "frames a second": "10.0",
        "ms from frame to frame, p50": "100.0",
        "ms from frame to frame, p99": "250.0",
        "ms from frame to frame, max": "300.0",
        "budget ms": "10",
        "frames that took longer": "2 of 20",
    }
    assert "4 (12.0 ms, tau 7), 17 (12.0 ms, tau 7)." in table.notes[-1]
    assert "Every frame kept the budget" in pace_table(content([])).notes[-1]
    many = pace_table(content(list(range(15)))).notes[-1]
    assert "11 (12.0 ms, tau 7), and 3 more, which summary.json lists." in many
    assert "12 (12.0 ms" not in many
    assert pace_table({"rate": None, "budget": None}) is None
    assert pace_table({}) is None  # the summary of an earlier version


def test_a_run_has_its_rate_in_the_summary(tmp_path):
    drive = MemoryDrive((0, 1, 2, 3), failing={2: ScanError("gone.")})
    run_drive(drive, tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["rate"]["frames"] == 1  # of frame 1 after frame 0
    assert summary["rate"]["frames_per_s"] == pytest.approx(
        1 / summary["rate"]["interval_s"]["p50"]
    )
    assert summary["budget"] is None
    assert run_drive(MemoryDrive((0, 1, 3)), tmp_path / "again").content["rate"]["frames"] == 1
    assert run_drive(MemoryDrive((0, 1, 3)), tmp_path / "again").content["rate"] is None


def test_a_run_over_workers_has_a_rate(tmp_path):
    from intervis.drives import open_drive

    drive = open_drive(scan_folder(tmp_path / "scans", tuple(range(20))))
    with process_workers(min(2, thread_count())) as executor:
        rate = run_drive(drive, tmp_path / "out", executor=executor).content["rate"]
    assert rate["frames"] == 20
    assert rate["interval_s"] is None


# --budget


def run_with(tmp_path, *options):
    drive = (
        scan_folder(tmp_path / "drive", (0, 1, 2))
        if not (tmp_path / "drive").exists()
        else tmp_path / "drive"
    )
    return exit_code(["run", str(drive), "--out", str(tmp_path / "out"), *options])


def test_a_budget_that_cannot_be_kept_lists_every_frame(tmp_path, capsys):
    assert run_with(tmp_path, "--budget", "0.001") == 0
    said = capsys.readouterr().out
    assert "frames that took longer" in said
    assert "3 of 3" in said
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["budget"]["missed_frames"] == [0, 1, 2]
    assert summary["settings"]["tau"] == "auto"
    assert summary["settings"]["time_budget_ms"] == 0.001
    # As coarse as the measured curve reaches, 134 nodes, with a margin of 15 %: 440 / 1.15 / 2.
    assert {frame["measures"]["n_fov"] for frame in summary["frames"]} == {440}
    assert {frame["tau"] for frame in summary["frames"]} == {2}


def test_a_wide_budget_keeps_every_return_and_is_kept(tmp_path, capsys):
    assert run_with(tmp_path, "--budget", str(1e6 * FRAME_MS)) == 0
    assert "Every frame kept the budget" in capsys.readouterr().out
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["budget"]["missed"] == 0
    assert {frame["tau"] for frame in summary["frames"]} == {1}


def test_a_tolerance_keeps_nodes_that_the_budget_would_drop(tmp_path):
    assert run_with(tmp_path, "--budget", "0.001", "--set", "tpi_tolerance=6") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["settings"]["tpi_tolerance"] == 6
    assert {frame["tau"] for frame in summary["frames"]} == {1}, "440 returns, at least 565 nodes"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--budget", "0"], "--budget must be a positive number of milliseconds, got 0.0."),
        (["--budget", "nan"], "--budget must be a positive number of milliseconds, got nan."),
        (["--budget", "10", "--tau", "35"], "--budget chooses tau for each frame: leave out"),
        (["--budget", "10", "--set", "tau=3"], "--budget chooses tau for each frame: leave out"),
        (["--budget", "10", "--set", "sampling=radius"], "sampling by a radius, which has none."),
    ],
)
def test_impossible_budgets_are_one_sentence(options, said, tmp_path, capsys):
    assert run_with(tmp_path, *options) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
