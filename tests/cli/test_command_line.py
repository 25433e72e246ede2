"""The command line: start-up, output, one-line error messages, exit codes, interruption."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import intervis
import intervis.run.stream
import intervis.run.stretch
from intervis.cli import COMMANDS, exit_code
from small_drive import files_below, scan_folder, street

PROGRAM = [sys.executable, "-c", "from intervis.cli import main; main()"]


@pytest.fixture
def drive(tmp_path) -> Path:
    return scan_folder(tmp_path / "drive")


# Start-up


def modules_after(code: str) -> set[str]:
    """Names of the modules that a fresh interpreter holds after some code."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules, sep='\\n')"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.split())


def test_no_description_in_the_list_of_commands_is_cut_off(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    assert exit_code(["--help"]) == 0
    commands = capsys.readouterr().out.partition("Commands:")[2].strip().splitlines()
    assert len(commands) == len(COMMANDS)
    assert [line for line in commands if not line.endswith(".") or "..." in line] == []


@pytest.mark.parametrize("command", ["sightdistance", "route", "agents", "replay", "evaluate"])
def test_the_rate_of_scans_has_one_name(command, capsys):
    assert exit_code([command, "--help"]) == 0
    said = capsys.readouterr().out
    assert "--hz F" in said
    assert ("--rate" in said) == (command == "replay")  # there: how many times faster


def test_help_loads_nothing_heavy():
    loaded = modules_after("from intervis.cli import exit_code\nassert exit_code(['--help']) == 0")
    assert "typer" in loaded
    assert loaded.isdisjoint({"numpy", "scipy", "numba", "pydantic", "matplotlib", "PIL", "rich"})


def test_importing_the_package_loads_nothing_heavy():
    loaded = modules_after("import intervis")
    assert loaded.isdisjoint({"numpy", "scipy", "numba", "pydantic", "matplotlib", "PIL", "typer"})


def test_a_run_loads_no_matplotlib(drive, tmp_path):
    loaded = modules_after(
        "from intervis.cli import exit_code\n"
        f"assert exit_code(['run', {str(drive)!r}, '--out', {str(tmp_path / 'out')!r}]) == 0"
    )
    assert "numba" in loaded
    assert loaded.isdisjoint({"matplotlib", "PIL"})


@pytest.mark.parametrize("command", [[], ["run"], ["simulate"], ["demo"]])
def test_every_command_has_help(command, capsys):
    assert exit_code([*command, "--help"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith(f"Usage: intervis {' '.join(command)}".rstrip())
    assert not err


def test_version(capsys):
    assert exit_code(["--version"]) == 0
    assert capsys.readouterr().out == f"intervis {intervis.__version__}\n"


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_closed_streams_are_no_error(closed, drive, tmp_path):
    for words in ("--version", "--help", f"run {drive} --out {tmp_path / 'out'}"):
        done = subprocess.run(
            ["sh", "-c", f'exec "$0" -c "$1" {words} {closed}', PROGRAM[0], PROGRAM[2]],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr


# Output


def test_a_run_prints_the_measures_under_the_papers_names(drive, tmp_path, capsys):
    assert exit_code(["run", str(drive), "--out", str(tmp_path / "out"), "--tau", "10"]) == 0
    out, err = capsys.readouterr()
    lines = out.splitlines()
    heading = "frame tau n_raw n_fov nodes n N SP ARR % TPI % TPI_unique % DCP % total ms"
    assert " ".join(lines[1].split()) == heading
    rows = [line.split() for line in lines[3:6]]
    # Without a camera the whole circle is in view: 440 returns, 440 / 10 = 44 nodes, 90 % less.
    assert [row[:5] for row in rows] == [[str(n), "10", "440", "440", "44"] for n in (0, 1, 2)]
    assert [row[7] for row in rows] == ["90.00"] * 3
    assert "p50 ms" in out
    assert "p99 ms" in out
    assert f"Results: {tmp_path / 'out'}" in out
    assert err == "note: this drive has no camera, so the viewpoint is the sensor.\n"


def test_many_frames_are_summarized(tmp_path, capsys):
    drive = scan_folder(tmp_path / "drive", tuple(range(13)))
    assert exit_code(["run", str(drive), "--out", str(tmp_path / "out")]) == 0
    first_words = [line.split()[0] for line in capsys.readouterr().out.splitlines()[3:7]]
    assert first_words == ["mean", "sample", "minimum", "maximum"]


def test_a_second_run_says_so_and_changes_nothing(drive, tmp_path, capsys):
    command = ["run", str(drive), "--out", str(tmp_path / "out")]
    assert exit_code(command) == 0
    before = files_below(tmp_path / "out")
    assert exit_code(command) == 0
    assert files_below(tmp_path / "out") == before
    assert "3 of 3 frames were reused from an earlier run." in capsys.readouterr().out


@pytest.mark.parametrize(
    "words", [["--viewpoint", "-1,0,2.5"], ["--viewpoint=-1,0,2.5"], ["--viewpoint=-1.0, 0, 2.5"]]
)
def test_a_viewpoint_may_begin_with_a_minus(drive, tmp_path, words):
    assert exit_code(["run", str(drive), "--out", str(tmp_path / "out"), *words]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["viewpoint"] == [-1.0, 0.0, 2.5]


def test_settings_come_from_a_file_then_tau_then_set(drive, tmp_path):
    (tmp_path / "mine.toml").write_text('tau = 7\nchart = "polar"\nrepulsion = 0.2\n')
    out = tmp_path / "out"
    changes = "--tau 9 --set repulsion=0 --set criterion=sight_angle --set influence_radius=none"
    command = ["run", str(drive), "--out", str(out), "--settings", str(tmp_path / "mine.toml")]
    code = exit_code([*command, *changes.split(), "--frames", "1:"])
    assert code == 0
    settings = json.loads((out / "summary.json").read_text())["settings"]
    assert (settings["tau"], settings["chart"], settings["repulsion"]) == (9, "polar", 0)
    assert settings["criterion"] == "sight_angle"
    assert settings["influence_radius"] is None
    assert sorted(path.name for path in (out / "frames").iterdir()) == [
        "0000000001.npz",
        "0000000002.npz",
    ]


def test_one_scan_is_a_drive(drive, tmp_path, capsys):
    code = exit_code(["run", str(drive / "000001.bin"), "--out", str(tmp_path / "out")])
    assert code == 0
    assert (tmp_path / "out" / "frames" / "0000000000.npz").exists()


def test_overwrite_starts_anew(drive, tmp_path, capsys):
    out = str(tmp_path / "out")
    assert exit_code(["run", str(drive), "--out", out]) == 0
    assert exit_code(["run", str(drive), "--out", out, "--tau", "9"]) == 2
    assert exit_code(["run", str(drive), "--out", out, "--tau", "9", "--overwrite"]) == 0


@pytest.mark.parametrize("mine", ["index.html", "measures.csv", "pictures/scan.png"])
def test_a_report_replaces_no_file_of_other_origin(mine, drive, tmp_path, capsys):
    out = tmp_path / "out"
    (out / mine).parent.mkdir(parents=True)
    (out / mine).write_text("mine")
    assert exit_code(["run", str(drive), "--out", str(out), "--report"]) == 2
    assert f"{out / mine} was not written by an earlier report" in capsys.readouterr().err
    assert list(files_below(out)) == [mine]


@pytest.mark.parametrize("more", [[], ["--overwrite"]])
def test_the_users_own_settings_are_not_replaced(more, drive, tmp_path, capsys):
    mine = tmp_path / "settings.toml"
    mine.write_text("# my settings\ntau = 7\n")
    command = ["run", str(drive), "--out", str(tmp_path), "--settings", str(mine), *more]
    assert exit_code(command) == 2
    assert "choose another folder" in capsys.readouterr().err
    assert mine.read_text() == "# my settings\ntau = 7\n"


# One-line messages


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "{drive}/nowhere", "--out", "{out}"], "nothing at {drive}/nowhere"),
        (["run", "{empty}", "--out", "{out}"], "is empty"),
        (["run", "{text}", "--out", "{out}"], "is not a drive of a known layout. Looked for"),
        (["run", "{text}/notes.txt", "--out", "{out}"], "is not a scan"),
        (["run", "{drive}", "--out", "{out}", "--tau", "0"], "'tau' must be 1 or more"),
        (["run", "{drive}", "--out", "{out}", "--tau", "-3"], "'tau' must be 1 or more"),
        (["run", "{drive}", "--out", "{out}", "--tau", "few"], "--tau must be a whole number"),
        (["run", "{drive}", "--out", "{out}", "--set", "critrion=z"], "did you mean 'criterion'?"),
        (["run", "{drive}", "--out", "{out}", "--set", "criterion=z"], "'criterion'"),
        (["run", "{drive}", "--out", "{out}", "--set", "tau"], "--set must be name=value"),
        (["run", "{drive}", "--out", "{out}", "--settings", "{drive}/no.toml"], "cannot read"),
        (["run", "{drive}", "--out", "{out}", "--settings", "{bad}"], "not valid TOML"),
        (["run", "{drive}", "--out", "{out}", "--settings", "{wrong}"], "did you mean 'tau'?"),
        (["run", "{drive}", "--out", "{out}", "--settings", "{deep}"], "nested too deeply"),
        (["run", "{drive}", "--out", "{out}", "--settings", "{self}"], "unknown setting 'self'"),
        (["run", "{drive}", "--out", "{out}", "--settings", "{long}"], "not valid TOML"),
        (["run", "{drive}", "--out", "{out}", "--settings", "{wide}"], "'xxx"),
        (["run", "{drive}", "--out", "{out}", "--viewpoint", "driver"], "or X,Y,Z in metres"),
        (["run", "{drive}", "--out", "{out}", "--viewpoint", "1,2"], "must be X,Y,Z in metres"),
        (["run", "{drive}", "--out", "{out}", "--viewpoint", "1,nan,2"], "three finite numbers"),
        (["run", "{drive}", "--out", "{out}", "--viewpoint", "start"], "this drive has none"),
        (["run", "{drive}", "--out", "{out}", "--frames", "a:b"], "--frames must be A:B"),
        (["run", "{drive}", "--out", "{out}", "--frames", "5:5"], "holds no frame"),
        (["run", "{drive}", "--out", "{out}", "--frames", "7:"], "3 frames, from 0 to 2"),
        (["run", "{drive}", "--out", "{out}", "--camera", "image_09"], "image_09"),
        (["run", "{drive}", "--out", "{text}/notes.txt"], "is a file: choose a folder"),
        (["run", "{drive}", "--out", "{text}/notes.txt/out"], "cannot"),
        (["run", "{drive}"], "--out"),
        (["run", "{drive}", "--out"], "See 'intervis run --help'."),
        (["ran"], "Did you mean 'run'? See 'intervis --help'."),
        (["run", "--out", "{out}"], "SOURCE"),
        (["run", "{drive}", "--out", "{out}", "--tua", "3"], "--tau"),
        (["run", "extra", "--out", "{out}"], "there is nothing at extra"),
        (["demo", "--frames", "0", "--out", "{out}"], "1 or more"),
        (["demo", "--frames", "x"], "--frames"),
        (["simulate"], "--out"),
    ],
)
def test_a_wrong_request_is_a_one_line_message(words, said, drive, tmp_path, capsys):
    places = {"drive": drive, "out": tmp_path / "out", "empty": tmp_path / "empty"}
    places |= {"text": tmp_path / "text", "bad": tmp_path / "bad.toml"}
    places["wrong"] = tmp_path / "wrong.toml"
    places["empty"].mkdir()
    places["text"].mkdir()
    (places["text"] / "notes.txt").write_text("hello")
    places["bad"].write_text("tau = = 3")
    places["wrong"].write_text("taw = 3")
    content = {"deep": "a = " + "[" * 9999, "self": "self = 1", "long": "tau = " + "9" * 5000}
    content |= {"wide": "gate = '" + "x" * 5000 + "'"}
    for name, text in content.items():
        places[name] = tmp_path / f"{name}.toml"
        places[name].write_text(text)
    code = exit_code([word.format(**places) for word in words])
    err = capsys.readouterr().err
    lines = [line for line in err.splitlines() if not line.startswith("note: ")]
    assert code == 2, err
    assert len(lines) == 1, err
    assert lines[0].startswith("intervis: ")
    assert said.format(**places) in lines[0]
    assert len(lines[0]) < 1000
    assert not list((tmp_path / "out").rglob("*")) if (tmp_path / "out").exists() else True


def test_another_run_in_out_is_refused(drive, tmp_path, capsys):
    out = str(tmp_path / "out")
    assert exit_code(["run", str(drive), "--out", out]) == 0
    capsys.readouterr()
    assert exit_code(["run", str(drive), "--out", out, "--tau", "9"]) == 2
    assert "tau is 35 there and 9 here" in capsys.readouterr().err


def test_tau_auto(drive, tmp_path):
    out = tmp_path / "out"
    assert exit_code(["run", str(drive), "--out", str(out), "--tau", "auto"]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["settings"]["tau"] == "auto"
    for frame in summary["frames"]:
        assert frame["measures"]["n"] == -(-frame["measures"]["n_fov"] // frame["tau"])


def test_a_broken_frame_is_listed_and_the_exit_code_says_so(drive, tmp_path, capsys):
    (drive / "000001.bin").write_bytes(b"12345")
    assert exit_code(["run", str(drive), "--out", str(tmp_path / "out")]) == 1
    err = capsys.readouterr().err
    assert "intervis: frame 1 failed: " in err
    assert "Traceback" not in err
    assert sorted(p.name for p in (tmp_path / "out" / "frames").iterdir()) == [
        "0000000000.npz",
        "0000000002.npz",
    ]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert [failure["number"] for failure in summary["failures"]] == [1]


def test_a_drive_of_broken_frames_has_a_summary(drive, tmp_path, capsys):
    for path in drive.iterdir():
        path.write_bytes(b"")
    assert exit_code(["run", str(drive), "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err.count("failed: ") == 3
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["frames"] == []


def scan_of(points: np.ndarray, path: Path) -> Path:
    np.save(path, points.astype(np.float32))
    return path


@pytest.mark.parametrize(
    ("name", "points"),
    [
        ("one", [[5.0, 1, -1]]),
        ("two", [[5.0, 1, -1], [6.0, 0, -1]]),
        ("three", [[5.0, 1, -1], [6.0, 0, -1], [7.0, 3, 0]]),
        ("collinear", [[x, 0.0, -1] for x in range(5, 25)]),
        ("equal", [[5.0, 1, -1]] * 20),
    ],
)
def test_tiny_scans_run(name, points, tmp_path):
    scan = scan_of(np.array(points), tmp_path / f"{name}.npy")
    out = tmp_path / "out"
    assert exit_code(["run", str(scan), "--out", str(out), "--tau", "1"]) == 0
    frame = json.loads((out / "summary.json").read_text())["frames"][0]
    assert frame["measures"]["n"] == len(points)
    assert frame["measures"]["TPI"] is not None


def test_points_that_are_not_finite_are_ignored_and_reported(tmp_path, capsys):
    points = street(0)
    points[::10] = np.nan
    scan = scan_of(points, tmp_path / "holes.npy")
    assert exit_code(["run", str(scan), "--out", str(tmp_path / "out")]) == 0
    assert (
        "44 rows that are no return (NaN, infinite, or 0, 0, 0) were ignored."
        in capsys.readouterr().out
    )


def test_nothing_in_view_is_a_failed_frame(tmp_path, capsys):
    points = street(0)
    scan = scan_of(points[points[:, 0] < -1], tmp_path / "behind.npy")
    code = exit_code(["run", str(scan), "--out", str(tmp_path / "out"), "--set", "view=front"])
    assert code == 1
    assert "no return is in view" in capsys.readouterr().err


def test_an_interruption_says_how_to_resume(drive, tmp_path, capsys, monkeypatch):
    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(intervis.run.stretch, "analyze", interrupt)
    assert exit_code(["run", str(drive), "--out", str(tmp_path / "out")]) == 130
    assert "the same command resumes the run" in capsys.readouterr().err


INTERRUPTED_IMPORT = """
import runpy, sys
module = sys.argv.pop(1)
class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt())
runpy.run_module("intervis", run_name="__main__")
"""


@pytest.mark.parametrize("module", ["typer", "intervis.cli.run", "pydantic", "intervis.run"])
def test_an_interruption_while_modules_are_imported_is_one_line(module, drive, tmp_path):
    command = [sys.executable, "-c", INTERRUPTED_IMPORT, module]
    done = subprocess.run(
        [*command, "run", str(drive), "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
    )
    assert done.stderr == "intervis: interrupted.\n"
    # An interruption inside exec() makes the interpreter end by the signal itself.
    assert done.returncode in (130, -signal.SIGINT)


def test_the_entry_point_imports_little():
    assert modules_after("import intervis.cli").isdisjoint({"typer", "logging", "numpy"})


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (MemoryError(), 2, "not enough memory"),
        (RuntimeError("odd"), 3, "RuntimeError: odd"),
    ],
)
def test_an_internal_error_is_a_one_line_message(
    error, code, said, drive, tmp_path, capsys, monkeypatch
):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(intervis.run.stream, "run_drive", fail)
    assert exit_code(["run", str(drive / "000000.bin"), "--out", str(tmp_path / "out")]) == code
    err = capsys.readouterr().err
    assert said in err
    assert "Traceback" not in err


def test_verbose_shows_the_traceback_of_an_internal_error(drive, tmp_path):
    program = (
        "import intervis.run.stream as s\n"
        "def odd(*a, **k): raise RuntimeError('odd')\n"
        "s.run_drive = odd\n"
        "from intervis.cli import main\n"
        "main()\n"
    )
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            program,
            "--verbose",
            "run",
            str(drive),
            "--out",
            str(tmp_path / "o"),
        ],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 3
    assert "in odd" in done.stderr


def test_a_closed_pipe_is_no_error(drive, tmp_path):
    with subprocess.Popen(
        [*PROGRAM, "run", str(drive), "--out", str(tmp_path / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        process.stdout.close()
        err = process.stderr.read()
        assert process.wait(60) == 0, err
    assert err == "note: this drive has no camera, so the viewpoint is the sensor.\n"
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["complete"] is True


@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_run_resumes(tmp_path, stop):
    drive = scan_folder(tmp_path / "drive", tuple(range(80)))
    out = tmp_path / "out"
    # Whoever runs the tests in the background hands down an ignored SIGINT.
    program = f"import signal; signal.signal(2, signal.default_int_handler); {PROGRAM[-1]}"
    command = [*PROGRAM[:-1], program, "run", str(drive), "--out", str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        while process.poll() is None and len(list(out.glob("frames/*.npz"))) < 3:
            time.sleep(0.001)
        process.send_signal(stop)
        err = process.communicate()[1].decode()
    there = {p.name: p.stat().st_mtime_ns for p in out.glob("frames/*.npz")}
    if len(there) == 80:
        pytest.skip("the run was over before it could be stopped")
    if stop == signal.SIGINT:
        assert process.returncode == 130
        assert "the same command resumes the run" in err
        assert "Traceback" not in err
        assert [path.name for path in out.rglob(".*")] == [".intervis"]
    assert subprocess.run(command, capture_output=True).returncode == 0
    assert len(list(out.glob("frames/*.npz"))) == 80
    assert [path.name for path in out.rglob(".*")] == [".intervis"]
    assert all((out / "frames" / name).stat().st_mtime_ns == when for name, when in there.items())


def test_names_that_the_terminal_cannot_show_are_escaped(tmp_path):
    folder = os.fsencode(scan_folder(tmp_path / "drive")).replace(b"drive", b"dr\xefve")
    os.rename(tmp_path / "drive", folder)
    done = subprocess.run(
        [*PROGRAM, "run", folder, "--out", str(tmp_path / "out")],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert os.fsencode(summary["input"]["name"]) == b"dr\xefve"
    missing = subprocess.run(
        [*PROGRAM, "run", folder + b"x", "--out", str(tmp_path / "out")], capture_output=True
    )
    assert missing.returncode == 2
    assert len(missing.stderr.splitlines()) == 1


@pytest.mark.parametrize("command", ["run", "sight"])
def test_names_that_a_terminal_would_obey_are_escaped(tmp_path, command):
    """A folder's name may colour the terminal, or clear it: in messages, notes and results."""
    folder = scan_folder(tmp_path / "a\x1b[31mred\x07\x9b")
    (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 3)
    words = {
        "run": ["run", folder, "--out", tmp_path / "out", "--viewpoint", "start"],
        "sight": ["sight", folder, "--from", "sensor", "--to", "5,0,0"],
    }[command]
    for path in (folder, Path(f"{folder}x")):
        said = [str(path) if word == folder else str(word) for word in words]
        done = subprocess.run([*PROGRAM, "--verbose", *said], capture_output=True, text=True)
        for text in (done.stdout, done.stderr):
            assert not set(text) & {"\x1b", "\x07", "\x9b"}
    assert "a\\x1b[31mred\\x07\\x9bx" in done.stderr


# Several drives


def test_several_drives_have_folders_of_their_own_below_the_output(tmp_path):
    drives = [str(scan_folder(tmp_path / name, (0, 1))) for name in ("north", "south")]
    out = tmp_path / "out"
    assert exit_code(["run", *drives, "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["north", "south"]
    for name in ("north", "south"):
        assert len(list((out / name / "frames").glob("*.npz"))) == 2


def test_a_drive_that_fails_does_not_stop_the_others(tmp_path, capsys):
    drives = [scan_folder(tmp_path / name, (0, 1)) for name in ("north", "south")]
    out = tmp_path / "out"
    (out / "north").mkdir(parents=True)
    (out / "north" / "frames").write_text("mine")
    assert exit_code(["run", *map(str, drives), "--out", str(out)]) == 1
    assert "north" in capsys.readouterr().err
    assert len(list((out / "south" / "frames").glob("*.npz"))) == 2


def test_a_drive_that_is_not_there_is_told_before_the_work(tmp_path, capsys):
    drive = str(scan_folder(tmp_path / "north", (0, 1)))
    out = tmp_path / "out"
    assert exit_code(["run", drive, str(tmp_path / "gone"), "--out", str(out)]) == 2
    assert "gone: check the path" in capsys.readouterr().err
    assert not out.exists()


def test_no_result_is_written_into_a_drive(tmp_path, capsys):
    drive = scan_folder(tmp_path / "north", (0, 1))
    other = scan_folder(tmp_path / "south", (0, 1))
    before = files_below(tmp_path)
    for words in (
        ["run", str(drive), "--out", str(drive)],
        ["run", str(drive), "--out", str(drive / "out")],
        ["run", str(drive), str(other), "--out", str(tmp_path)],
        ["sight", str(drive), "--from", "sensor", "--to", "9,0,0", "--out", f"{drive}/a.csv"],
        ["sight", str(drive), "--from", "sensor", "--to", "9,0,0", "--picture", f"{drive}/a.png"],
    ):
        assert exit_code(words) in (1, 2)
        assert "which this command reads and never changes" in capsys.readouterr().err
    assert files_below(tmp_path) == before


def test_drives_of_one_name_are_refused_before_the_work(tmp_path, capsys):
    drives = [str(scan_folder(tmp_path / name / "scans", (0,))) for name in ("a", "b")]
    assert exit_code(["run", *drives, "--out", str(tmp_path / "out")]) == 2
    assert "several of the drives are called scans" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_shards_of_several_short_drives_share_the_work(tmp_path, capsys):
    drives = [str(scan_folder(tmp_path / name, (0, 1))) for name in ("north", "south")]
    out = tmp_path / "out"
    done = []
    for shard in ("1/2", "2/2"):
        assert exit_code(["run", *drives, "--out", str(out), "--shard", shard]) == 0
        assert f"Shard {shard[0]} of 2" in capsys.readouterr().out
        done.append({path.parent.parent.name for path in out.rglob("*.npz")})
    assert done == [{"north"}, {"north", "south"}]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--shard", "3/2"], "--shard must be I/N"),
        (["--shard", "1"], "--shard must be I/N"),
        (["--shard", "1/2", "--report"], "a shard has no report"),
        (["--shard", "1/2", "--overwrite"], "a shard cannot overwrite"),
        (["--executor", "slurm"], "--executor must be dask or dask:ADDRESS"),
        (["--workers", "0"], "workers must be 1 to 1024"),
    ],
)
def test_impossible_ways_of_sharing_work_are_one_sentence(options, said, drive, tmp_path, capsys):
    assert exit_code(["run", str(drive), "--out", str(tmp_path / "out"), *options]) == 2
    assert said in capsys.readouterr().err


def test_no_command_overwrites_what_it_reads(tmp_path, capsys):
    drive = scan_folder(tmp_path / "drive", (0, 1))
    (tmp_path / "t.csv").write_text("x,y,z\n9,0,0\n")
    (tmp_path / "a.csv").write_text("name,x,y\na,9,0\nb,0,0\n")
    (tmp_path / "old.json").write_text("{}")
    before = files_below(tmp_path)
    for words in (
        ["route", str(drive), "--targets", f"{tmp_path}/t.csv", "--csv", f"{tmp_path}/t.csv"],
        ["route", str(drive), "--targets", f"{tmp_path}/t.csv", "--geojson", f"{drive}/a.geojson"],
        ["agents", str(drive), "--agents", f"{tmp_path}/a.csv", "--csv", f"{tmp_path}/a.csv"],
        ["sightdistance", str(drive), "--route", f"{tmp_path}/t.csv", "--csv", f"{tmp_path}/t.csv"],
        ["sightdistance", str(drive), "--worst", f"{drive}/worst"],
        ["masks", str(drive), "--out", f"{drive}/masks"],
        ["masks", str(drive), "--out", f"{tmp_path}/m", "--picture", f"{drive}/a.png"],
        ["view", str(drive), "--html", f"{drive}/a.html"],
        ["objects", str(drive), "--csv", f"{drive}/a.csv"],
        ["blindspots", str(drive), "--geojson", f"{drive}/a.geojson"],
        ["replay", str(drive), "--json", f"{drive}/a.json"],
        [
            "bench",
            str(drive),
            "--json",
            f"{tmp_path}/old.json",
            "--compare",
            f"{tmp_path}/old.json",
        ],
    ):
        assert exit_code(words) == 2, words
        assert "which this command reads and never changes" in capsys.readouterr().err, words
    assert files_below(tmp_path) == before


@pytest.mark.parametrize("place", ["1e308,0,0", "0,nan,0", "0,0,-inf"])
def test_a_place_that_is_none_is_one_sentence_in_every_command(place, drive, tmp_path, capsys):
    for words in (
        ["run", str(drive), "--out", f"{tmp_path}/o", "--viewpoint", place],
        ["sight", str(drive), f"--from={place}", "--to", "9,0,0"],
        ["view", str(drive), "--html", f"{tmp_path}/p.html", f"--from={place}"],
        ["view", str(drive), "--html", f"{tmp_path}/p.html", f"--to={place}"],
        ["objects", str(drive), f"--from={place}"],
        ["blindspots", str(drive), f"--from={place}"],
    ):
        assert exit_code(words) == 2, words
        err = capsys.readouterr().err
        assert "must be three finite numbers in metres" in err, words
        assert err.count("\n") == 1
