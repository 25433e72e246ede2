"""Flips of blind spots: a still world, a shadow whose area moves on paper, a van that leaves."""

from pathlib import Path

import numpy as np
import posed_street
import pytest
import walled_square
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis import open_drive
from intervis.cli import exit_code
from intervis.errors import DriveError, SettingsError
from intervis.transform import rigid
from intervis.uses.steadiness import Look, flip_table, flips_between, flips_of_drive

HERE = (-15.0, 0.0)


def look(place: tuple[float, float], phase_deg: float = 0.0, noise_m: float = 0.0) -> Look:
    points = walled_square.returns(*place, phase_deg).astype(np.float64)
    ranges = np.linalg.norm(points, axis=1, keepdims=True)
    noise = np.random.default_rng(int(1e3 * phase_deg)).normal(0.0, noise_m, ranges.shape)
    points *= 1.0 + noise / ranges
    pose = rigid(np.eye(3), [*place, walled_square.HEIGHT_M])
    return Look.from_scan(points, [0, 0, 0], pose)


def test_where_nothing_moves_no_flip_has_a_cause() -> None:
    still = look(HERE)
    same = flips_between(still, still)
    assert (same.motion_m, same.flipped, same.without_cause) == (0.0, 0.0, 0.0)
    # Beams between those of before, and noise of 2 cm: only edges of the shadow change.
    other = flips_between(still, look(HERE, phase_deg=0.25, noise_m=0.02))
    assert other.motion_m == 0.0
    assert other.by_motion == 0.0
    assert other.by_returns < 1e-4
    assert 0.0 < other.without_cause <= other.flipped < 0.01
    assert 0.0 <= other.contradicted <= other.without_cause


def test_a_shadow_moves_by_the_area_on_paper() -> None:
    # From (-15, v) the shadow of the wall's end at (0, 10) is y = v + (10 - v) (x + 15) / 15:
    # 10 + 2 x / 3 from v = 0, and 10 + 7 x / 15 from v = 3: they are x / 5 apart, and so are those
    # of the other end. Up to x = 25 that is 2 * 25^2 / 10 = 125 m2.
    found = flips_between(look(HERE), look((-15.0, 3.0)), reach_m=40.0)
    assert found.motion_m == pytest.approx(3.0)
    assert found.flipped * found.judged_m2 == pytest.approx(125.0, rel=0.2)
    assert found.by_motion > 0.85 * found.flipped
    assert found.by_returns < 0.02 * found.flipped
    # The same, where so much motion is said to explain nothing:
    strict = flips_between(look(HERE), look((-15.0, 3.0)), reach_m=40.0, still_m=5.0)
    assert strict.by_motion == 0.0
    assert strict.flipped == found.flipped


def test_a_van_that_leaves_is_a_changed_return() -> None:
    with_van = Look.from_scan(posed_street.returns(0.0), [0, 0, 0])
    without = Look.from_scan(posed_street.returns(0.0, van=None), [0, 0, 0])
    found = flips_between(with_van, without)
    # The shadow of the van, 2.4 m high and seen from 1.7 m, is as long as the grid.
    assert found.by_returns * found.judged_m2 > 20.0
    assert found.by_returns > 0.8 * found.flipped
    assert found.by_motion == 0.0
    back = flips_between(without, with_van)
    assert back.by_returns == pytest.approx(found.by_returns, rel=0.1)


@settings(max_examples=5, deadline=None)
@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_causes_add_up(x_m: float, y_m: float) -> None:
    found = flips_between(look(HERE), look((HERE[0] + x_m, HERE[1] + y_m)), cell_m=0.8)
    parts = found.by_motion + found.by_returns + found.without_cause
    assert parts == pytest.approx(found.flipped, abs=1e-12)
    assert found.contradicted <= found.without_cause
    assert found.motion_m == pytest.approx(np.hypot(x_m, y_m), abs=1e-9)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return posed_street.write(tmp_path_factory.mktemp("drives") / "street", count=3, step_m=0.5)


def test_frames_of_a_drive_are_compared_in_the_world(street: Path) -> None:
    drive = open_drive(street)
    found = flips_of_drive(drive, [0, 1, 2], reach_m=30.0)
    for nth, one in enumerate(found):
        assert one.motion_m == pytest.approx(0.5)
        pose = rigid(np.eye(3), [0.5, 0.0, 0.0])
        direct = flips_between(
            Look.from_scan(drive[nth].points, [0, 0, 0]),
            Look.from_scan(drive[nth + 1].points, [0, 0, 0], pose),
            reach_m=30.0,
        )
        assert one.flipped == pytest.approx(direct.flipped, abs=2e-3)
    table = flip_table(found, [0, 1, 2])
    assert [row[0] for row in table.rows] == ["0 to 1", "1 to 2", "mean"]
    mean = 100 * (found[0].without_cause + found[1].without_cause) / 2
    assert float(table.rows[-1][6].removesuffix(" %")) == pytest.approx(mean, abs=0.006)


def test_what_cannot_be_compared_is_told(street: Path, tmp_path: Path, capsys) -> None:
    drive = open_drive(street)
    with pytest.raises(DriveError, match="1 frame cannot be compared with the next"):
        flips_of_drive(drive, [0])
    with pytest.raises(SettingsError, match="still_m must be a finite number"):
        flips_between(look(HERE), look(HERE), still_m=float("nan"))
    bare = tmp_path / "bare"
    bare.mkdir()
    for nth in range(2):
        (bare / f"{nth:06d}.bin").write_bytes((street / f"{nth:06d}.bin").read_bytes())
    for given_options, message in (
        ([str(bare), "--steadiness", "0:2"], "frame 0 of bare has no pose, which tells how"),
        ([str(street), "--steadiness", "0"], "1 frame cannot be compared with the next"),
        ([str(street), "--steadiness", "a"], "--steadiness must be A:B"),
        ([str(street), "--steadiness", "5:2"], "--steadiness 5:2 holds no frame"),
        ([str(street), "--steadiness", "3:1"], "--steadiness 3:1 holds no frame"),
        ([str(street), "--steadiness", "0:2", "--picture", "p.png"], "--steadiness prints a table"),
        ([str(street), "--steadiness", "0:2", "--frame", "1"], "--steadiness prints a table"),
    ):
        assert exit_code(["blindspots", *given_options]) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1


def test_the_command_prints_every_pair_and_the_mean(street: Path, capsys) -> None:
    assert exit_code(["blindspots", str(street), "--steadiness", ":", "--reach", "20"]) == 0
    said = capsys.readouterr().out
    assert "street, 3 frames." in said
    assert "0 to 1" in said
    assert "\nmean " in said


def test_where_nothing_is_judged_there_is_no_share(street: Path) -> None:
    """Far from the scans no ground is known: 0 % would read as a steady answer."""
    nothing = flips_of_drive(open_drive(street), [0, 1], viewpoint=(5000.0, 0.0, 0.0))
    assert nothing[0].judged_m2 == 0.0
    assert np.isnan(nothing[0].flipped)
    judged = flips_of_drive(open_drive(street), [1, 2])
    rows = flip_table([*nothing, *judged], [0, 1, 2]).rows
    assert rows[0][3:] == ("-",) * 5
    assert rows[2][3:] == rows[1][3:]  # the mean is that of the pair that was judged
    assert rows[1][3] != "-"
