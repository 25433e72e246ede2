"""The replay of a drive: a clock of its own, so that every figure is known."""

import ast
import json
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from intervis.cli import exit_code
from intervis.drives import open_drive
from intervis.errors import DriveError, SettingsError
from intervis.live import replay as replay_module
from intervis.live.replay import quantiles_ms, replay
from small_drive import scan_folder, street

DOCS = Path(__file__).parents[1] / "docs"


def drive_with_poses(folder, numbers=(0, 1, 2, 5)):
    scan_folder(folder, numbers)
    rows = [f"1 0 0 {0.5 * number} 0 1 0 0 0 0 1 0" for number in range(max(numbers) + 1)]
    (folder / "poses.txt").write_text("\n".join(rows) + "\n")
    return open_drive(folder)


class Clock:
    """Seconds that pass only while something is done."""

    def __init__(self):
        self.now = 100.0
        self.slept = []

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.slept.append(round(seconds, 9))
        self.now += seconds


class SlowStream:
    """Takes 30 ms for a scan and 50 ms for sight lines; frame 2 takes 0.4 s."""

    def __init__(self, clock):
        self.clock, self.pushed, self.asked = clock, [], []

    def push(self, points, pose, time_s):
        self.clock.now += 0.4 if len(self.pushed) == 2 else 0.03
        self.pushed.append((len(points), pose[0, 3], round(time_s, 9)))

    def sight(self, viewpoint, targets):
        self.clock.now += 0.05
        self.asked.append((viewpoint, targets))


@pytest.fixture
def clock(monkeypatch):
    monkeypatch.setattr(replay_module, "_compile", lambda frame, targets: None)
    return Clock()


def replayed(drive, clock, **options):
    stream = SlowStream(clock)
    done = replay(
        drive, drive.frame_numbers, stream=stream, clock=clock, sleep=clock.sleep, **options
    )
    return done, stream


def test_scans_come_at_their_times_and_figures_add_up(tmp_path, clock):
    drive = drive_with_poses(tmp_path / "drive")
    done, stream = replayed(drive, clock, scans_per_s=10, sights=70)
    assert done.numbers == (0, 1, 2, 5)
    assert clock.slept == pytest.approx([0.0, 0.02, 0.02, 0.0])
    assert done.ingest_s == pytest.approx([0.03, 0.03, 0.4, 0.03])
    assert done.sight_s == pytest.approx([0.05] * 4)
    # The third scan is due at 0.2 s and answered at 0.65; the fourth, due at 0.3, begins then.
    assert done.delay_s == pytest.approx([0.08, 0.08, 0.45, 0.43])
    assert done.late == 1
    assert done.scans_per_s == pytest.approx(10)
    assert [time_s for _, _, time_s in stream.pushed] == [0.0, 0.1, 0.2, 0.3]
    assert [east for _, east, _ in stream.pushed] == [0.0, 0.5, 1.0, 2.5]
    assert all(targets.shape == (70, 3) for _, targets in stream.asked)


def test_targets_lie_on_the_ways_to_returns(tmp_path, clock):
    drive = drive_with_poses(tmp_path / "drive", (3,))
    _, stream = replayed(drive, clock, scans_per_s=10, sights=500)
    viewpoint, targets = stream.asked[0]
    assert viewpoint.tolist() == [1.5, 0, 0]
    ways = targets - viewpoint
    returns = street(3).astype(np.float64)
    cosine = (ways @ returns.T) / np.linalg.norm(ways, axis=1)[:, None]
    cosine /= np.linalg.norm(returns, axis=1)
    nearest = cosine.argmax(axis=1)
    assert np.all(cosine.max(axis=1) > 1 - 1e-9)
    share = np.linalg.norm(ways, axis=1) / np.linalg.norm(returns[nearest], axis=1)
    assert 0.499 < share.min() < 0.55
    assert 1.45 < share.max() < 1.501


def timed(drive, times_ns):
    object.__setattr__(drive, "timestamps_ns", times_ns)
    return drive


def test_times_of_the_drive_and_a_rate(tmp_path, clock):
    start_ns = 1_700_000_000_000_000_000
    times_ns = {0: start_ns, 1: start_ns + 10**9, 2: start_ns + 5 * 10**8, 5: start_ns + 3 * 10**9}
    drive = timed(drive_with_poses(tmp_path / "drive"), times_ns)
    done, stream = replayed(drive, clock, rate=2.0)
    # Due at 0, 0.5, 0.5 (a time that goes back does not) and 1.5 s.
    assert clock.slept == pytest.approx([0.0, 0.42, 0.0, 0.47])
    assert [time_s for _, _, time_s in stream.pushed] == [0.0, 1.0, 1.0, 3.0]
    assert done.scans_per_s == pytest.approx(2)


def test_frames_that_cannot_be_replayed_are_left_out(tmp_path, clock):
    drive = drive_with_poses(tmp_path / "drive")
    (tmp_path / "drive/000001.bin").write_bytes(b"123")
    np.full((5, 4), np.nan, np.float32).tofile(tmp_path / "drive/000002.bin")
    done, _ = replayed(drive, clock, scans_per_s=10)
    assert done.numbers == (0, 5)
    assert sorted(done.skipped) == [1, 2]
    assert "000001.bin" in done.skipped[1]
    assert done.skipped[2] == "it has no returns."
    assert done.as_dict()["skipped"].keys() == {"1", "2"}


def test_what_is_missing_is_said(tmp_path, clock):
    drive = drive_with_poses(tmp_path / "drive")
    with pytest.raises(DriveError, match=r"has no times: .* --hz 10"):
        replayed(drive, clock)
    for wrong in ({"rate": 0}, {"rate": np.nan}, {"scans_per_s": -1}, {"sights": 0}):
        with pytest.raises(SettingsError, match=r"must be (from 1e-06|a finite|a whole)"):
            replayed(drive, clock, **{"scans_per_s": 10, **wrong})
    without = open_drive(scan_folder(tmp_path / "other"))
    with pytest.raises(DriveError, match="has no poses"):
        replayed(without, clock, scans_per_s=10)
    for number in drive.frame_numbers:
        (tmp_path / f"drive/{number:06d}.bin").write_bytes(b"123")
    with pytest.raises(DriveError, match="no frame of drive could be replayed: "):
        replayed(drive, clock, scans_per_s=10)


def test_quantiles_in_milliseconds():
    assert quantiles_ms(np.arange(101) / 1000) == {"p50": 50.0, "p99": 99.0, "max": 100.0}


def test_the_command_prints_and_writes_its_figures(tmp_path, capsys):
    drive_with_poses(tmp_path / "drive", (0, 1, 2))
    (tmp_path / "drive/000001.bin").write_bytes(b"123")
    words = ["replay", str(tmp_path / "drive"), "--hz", "50", "--sights", "20"]
    assert exit_code([*words, "--json", str(tmp_path / "a.json")]) == 1
    out, err = capsys.readouterr()
    assert "drive: 2 frames, 50.0 a second, 20 sight lines after each" not in out  # one is left out
    assert "drive: 2 frames, 25.0 a second, 20 sight lines after each" in out
    assert "ingest of a scan" in out
    assert "frame 1 was left out: " in err
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["frames"] == 2
    assert content["ingest_ms"].keys() == {"p50", "p99", "max"}
    assert exit_code(["replay", str(tmp_path / "drive")]) == 2
    assert "--hz 10" in capsys.readouterr().err
    assert exit_code([*words, "--frames", "0:1"]) == 0


# --- the page about live use ---


def node_of_the_page() -> str:
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "live.md").read_text(), re.DOTALL)
    (node,) = (block for block in blocks if "rclpy" in block)
    return node


def test_the_node_of_the_page_is_short_and_parses():
    node = node_of_the_page()
    ast.parse(node)
    assert len([line for line in node.splitlines() if line.strip()]) <= 40


def test_the_node_of_the_page_runs_with_made_modules_of_ros(monkeypatch):
    """ROS is not installed here: its modules are stand-ins that call back once."""
    published = []

    class Node:
        def __init__(self, name):
            pass

        def create_subscription(self, kind, topic, callback, depth):
            self.callback = callback

        def create_publisher(self, kind, topic, depth):
            return SimpleNamespace(publish=published.append)

        def get_logger(self):
            return SimpleNamespace(warning=lambda text: pytest.fail(text))

    class Buffer:
        def lookup_transform(self, world, frame, stamp):
            assert (world, frame, stamp.sec) == ("odom", "velodyne", 7)
            place = SimpleNamespace(x=1.0, y=2.0, z=3.0)
            turn = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
            return SimpleNamespace(transform=SimpleNamespace(translation=place, rotation=turn))

    def spin(node):
        points = street(1)
        stamp = SimpleNamespace(sec=7, nanosec=0)
        fields = [
            SimpleNamespace(name=axis, offset=4 * n, datatype=7, count=1)
            for n, axis in enumerate("xyz")
        ]
        node.callback(
            SimpleNamespace(
                header=SimpleNamespace(stamp=stamp, frame_id="velodyne"),
                height=1,
                width=len(points),
                fields=fields,
                is_bigendian=False,
                point_step=12,
                row_step=12 * len(points),
                data=points.tobytes(),
                is_dense=True,
            )
        )

    def module(name, **content):
        made = ModuleType(name)
        made.__dict__.update(content)
        monkeypatch.setitem(sys.modules, name, made)
        return made

    module("rclpy", init=lambda: None, spin=spin, node=module("rclpy.node", Node=Node))
    module("sensor_msgs", msg=module("sensor_msgs.msg", PointCloud2=object))
    floats = SimpleNamespace
    module("std_msgs", msg=module("std_msgs.msg", Float32MultiArray=floats))
    failure = type("TransformException", (Exception,), {})
    module(
        "tf2_ros",
        Buffer=Buffer,
        TransformListener=lambda buffer, node: None,
        TransformException=failure,
    )
    exec(compile(node_of_the_page(), "live.md", "exec"), {"__name__": "__main__"})
    (message,) = published
    assert len(message.data) == 2
    assert all(0 <= probability <= 1 for probability in message.data)
