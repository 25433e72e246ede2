"""Interleaved timings: every work in every round, ratios, changes since an earlier run."""

import json

import pytest

from intervis.cli import exit_code
from intervis.lab.speed.comparison import as_json, changes_table, ratios, timings_table
from intervis.lab.speed.timing import Timing, Work, interleaved
from small_drive import scan_folder


def timing(group, by, *times_s):
    return Timing(group, by, 100, list(times_s))


TIMINGS = [
    timing("mesh", "intervis", 0.002, 0.001, 0.003),
    timing("mesh", "scipy", 0.030, 0.020, 0.010),
    timing("lines", "intervis", 0.004, 0.004, 0.004),
]


def test_every_round_does_every_work_once_in_changing_order():
    done = []
    works = [Work(name, "intervis", lambda name=name: done.append(name), 1) for name in "abcd"]
    notes = []
    timings = interleaved(works, 6, progress=notes.append)
    assert done[:4] == list("abcd")  # not timed
    rounds = [done[k : k + 4] for k in range(4, len(done), 4)]
    assert len(rounds) == 6
    assert all(sorted(one) == list("abcd") for one in rounds)
    assert len({tuple(one) for one in rounds}) > 1
    assert [len(one.times_s) for one in timings] == [6] * 4
    assert len(notes) == 4 * 7


def test_long_work_is_left_out_after_three_rounds():
    timings = interleaved([Work("a", "intervis", lambda: None, 1)], 9, longest_s=0.0)
    assert len(timings[0].times_s) == 3


def test_medians_spreads_and_ratios_by_hand():
    assert TIMINGS[0].median_s == 0.002
    assert TIMINGS[0].spread == 0.5  # quartiles 0.001 and 0.003
    assert ratios(TIMINGS) == {("mesh", "scipy"): pytest.approx(10.0)}
    rows = timings_table(TIMINGS).rows
    assert [row[2] for row in rows] == ["1", "10", "1"]
    assert [row[0] for row in rows] == ["mesh", "", "lines"]


def test_a_change_is_measured_against_another_tool_where_there_is_one():
    earlier = json.loads(as_json(TIMINGS, {"frame": 3}))
    assert earlier["frame"] == 3
    now = [
        timing("mesh", "intervis", 0.008, 0.008, 0.008),  # 4 times as long
        timing("mesh", "scipy", 0.040, 0.040, 0.040),  # the machine is half as fast
        timing("lines", "intervis", 0.006, 0.006, 0.006),
        timing("new", "intervis", 1.0, 1.0, 1.0),
    ]
    rows = changes_table(now, earlier).rows
    assert [(row[0], row[3], row[4]) for row in rows] == [
        ("mesh", "2.00", "scipy"),
        ("lines", "1.50", "time"),
    ]


def test_the_command_times_writes_and_compares(tmp_path, capsys):
    drive = str(scan_folder(tmp_path / "drive", (0,)))
    first = tmp_path / "first.json"
    command = ["bench", drive, "--rounds", "3", "--only", "20,000"]
    assert exit_code([*command, "--json", str(first)]) == 0
    content = json.loads(first.read_text())
    assert {one["by"] for one in content["timings"]} >= {"intervis", "scipy"}
    assert all(one["size"] == 20_000 for one in content["timings"])
    assert content["versions"]["numpy"]
    assert exit_code([*command, "--compare", str(first)]) == 0
    said = capsys.readouterr().out
    assert "triangulation, 20,000 random positions" in said
    assert "Since the earlier run" in said


def test_every_work_runs_on_a_small_drive(tmp_path, capsys):
    drive = str(scan_folder(tmp_path / "drive", (0,)))
    assert exit_code(["bench", drive, "--rounds", "3"]) == 0
    said = capsys.readouterr().out
    for group in (
        "tau 35",
        "full circle",
        "made ready",
        "sight lines",
        "mask of a scan",
        "paper compares",
    ):
        assert group in said


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--rounds", "2"], "--rounds must be 3 or more"),
        (
            ["--only", "nothing"],
            "no work has a name with 'nothing'; the groups are: triangulation, ",
        ),
        (["--only", "nothing"], "; a scan made ready; all sight lines of a viewpoint; "),
        (["--frame", "7"], "has no frame 7"),
        (["--compare", "{folder}/gone.json"], "cannot read"),
        (["--compare", "{folder}/other.json"], "holds no timings"),
        (["--json", "{folder}/none/a.json"], "there is no folder"),
    ],
)
def test_impossible_requests_are_one_sentence(options, said, tmp_path, capsys):
    drive = str(scan_folder(tmp_path / "drive", (0,)))
    (tmp_path / "other.json").write_text('{"timings": [{"group": "a", "by": "b"}]}')
    given = [option.format(folder=tmp_path) for option in options]
    assert exit_code(["bench", drive, *given]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_a_file_of_the_drive_is_not_written_over(tmp_path, capsys):
    """By whatever name: calibration of some layouts stands beside the drive's folder."""
    drive = scan_folder(tmp_path / "drive", (0,))
    scan = min(path for path in drive.rglob("*") if path.suffix in (".bin", ".pcd", ".npy"))
    before, other = scan.read_bytes(), tmp_path / "times.json"
    other.hardlink_to(scan)
    assert exit_code(["bench", str(drive), "--json", str(other)]) == 2
    assert "never changes: choose another place" in capsys.readouterr().err
    assert scan.read_bytes() == before
