"""Beam patterns against the data sheets, and mounts."""

import numpy as np
import pytest

from intervis.lab.worlds.beam_pattern import (
    PANDAR64_DEG,
    PATTERNS,
    QT64_DEG,
    fan_ahead,
    rosette,
)
from intervis.lab.worlds.mounts import MOUNTS
from intervis.lab.worlds.ray_casting import RayCaster


@pytest.mark.parametrize("name", PATTERNS)
def test_unit_directions_rings_from_top_and_times_in_firing_order(name: str) -> None:
    pattern = PATTERNS[name]()
    assert np.allclose(np.linalg.norm(pattern.directions, axis=1), 1, atol=1e-12)
    assert (np.diff(pattern.time_s) >= 0).all()
    assert (pattern.spacing_rad > 0).all()
    if pattern.ring is not None:
        rows = [pattern.directions[pattern.ring == k, 2].mean() for k in np.unique(pattern.ring)]
        assert (np.diff(rows) < 0).all()


def test_unequal_rows_of_the_data_sheets() -> None:
    assert len(PANDAR64_DEG) == len(QT64_DEG) == 64
    gaps = -np.diff(PANDAR64_DEG)
    assert np.count_nonzero(np.isclose(gaps, 1 / 6)) == 48  # from +2 to -6 degrees
    assert (PANDAR64_DEG[0], PANDAR64_DEG[-1]) == (15.0, -25.0)
    assert np.isclose((-np.diff(QT64_DEG)).min(), 1.45)
    assert np.allclose(QT64_DEG, -np.array(QT64_DEG)[::-1])


def test_solid_state_scanner_of_the_data_sheet() -> None:
    pattern = fan_ahead()
    azimuth_deg = np.degrees(np.arctan2(pattern.directions[:, 1], pattern.directions[:, 0]))
    elevation_deg = np.degrees(np.arcsin(pattern.directions[:, 2]))
    assert len(pattern.directions) * 10 == 1_536_000  # points a second
    assert np.allclose(np.ptp(azimuth_deg), 119.9)
    assert np.allclose([elevation_deg.max(), elevation_deg.min()], [12.9, -12.5])
    rows = [np.unique(elevation_deg[pattern.ring == row].round(6)) for row in (0, 1, 127)]
    assert np.allclose(rows, [[12.9], [12.7], [-12.5]])
    assert np.allclose(np.diff(np.unique(azimuth_deg.round(6))), 0.1)
    assert np.isclose(pattern.time_s[-1], 0.1 * 1199 / 1200)


def test_rosette_stays_in_its_cone_and_does_not_repeat() -> None:
    pattern = rosette()
    off_deg = np.degrees(np.arccos(pattern.directions[:, 0]))
    assert 19.0 < off_deg.max() <= 19.2 + 1e-9
    tenth = len(pattern.directions) // 5
    first, second = pattern.directions[:tenth], pattern.directions[tenth : 2 * tenth]
    assert np.linalg.norm(first - second, axis=1).max() > np.radians(5)


def test_echoes_lie_on_the_wall_and_beams_beside_it_are_absent() -> None:
    wall = RayCaster(np.array([[[10.0, -99, -99], [10, 99, -99], [10, 0, 198]]]))
    pattern = PATTERNS["livox"]()
    scan = pattern.scan(wall, np.eye(4), np.random.default_rng(0))
    assert np.allclose(scan.points[:, 0], 10, atol=0.12)
    assert 0.97 < len(scan.points) / len(pattern.directions) < 0.99  # 2 % are lost
    behind = MOUNTS["upright"].pose([0, 0, 0], np.pi)
    assert len(pattern.scan(wall, behind, np.random.default_rng(0)).points) == 0


def test_tilted_mount_looks_down_on_one_side() -> None:
    pose = MOUNTS["tilted"].pose([0, 0, 0])
    assert np.allclose(pose[:3, :3] @ [0, -1, 0], [0, -np.sqrt(0.5), -np.sqrt(0.5)])
    assert pose[2, 3] == 1.7
