"""A bird's-eye view of a street on paper, on a slope, and with something that moved."""

import numpy as np
import pytest

from intervis.errors import SceneError, SettingsError
from intervis.transform import rigid, transform
from intervis.uses.voxels.bev_grid import BevGrid, bev_grid

FREE, OCCUPIED, OCCLUDED, UNKNOWN = range(4)


def street(slope: float = 0.0, post_at: tuple[float, float] | None = (6.05, 2.05)) -> np.ndarray:
    """A plane that rises towards x, a wall at x = 15, and a post as high as the scanner.

    The scanner stands 1.8 m above the plane.
    """
    azimuth, elevation = np.meshgrid(
        np.radians(np.arange(0.1, 360, 0.4)), np.radians(np.arange(-28, 4, 0.4))
    )
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=-1).reshape(-1, 3)
    falls = slope * rays[:, 0] - rays[:, 2]
    range_m = np.where(falls > 1e-3, 1.8 / np.maximum(falls, 1e-3), 1e6)
    range_m = np.minimum(
        range_m, np.where(rays[:, 0] > 1e-3, 15 / np.maximum(rays[:, 0], 1e-3), 1e6)
    )
    if post_at is not None:
        to_post = np.hypot(*post_at)
        across = rays[:, 0] * post_at[1] / to_post - rays[:, 1] * post_at[0] / to_post
        ahead = rays[:, 0] * post_at[0] + rays[:, 1] * post_at[1] > 0
        hit = (np.abs(across) * to_post < 0.25) & ahead & (rays[:, 2] < 0.05)
        range_m = np.where(hit, np.minimum(range_m, to_post), range_m)
    kept = range_m < 45
    return (rays * range_m[:, None])[kept]


def state_at(grid: BevGrid, x: float, y: float) -> int:
    i, j = np.floor((np.array([x, y]) - grid.corner) / grid.cell_m).astype(int)
    return int(grid.state[i, j])


@pytest.mark.parametrize("slope", [0.0, 0.08])
def test_a_post_hides_what_is_behind_it(slope) -> None:
    grid = bev_grid([(street(slope), None)], reach_m=20.0)
    assert grid.state.shape == (200, 200)
    assert state_at(grid, 3.0, 1.0) == FREE
    assert state_at(grid, 6.05, 2.05) == OCCUPIED
    assert state_at(grid, 9.0, 3.0) == OCCLUDED
    assert state_at(grid, 9.0, -3.0) == FREE
    assert state_at(grid, 15.05, -3.0) == OCCUPIED
    assert state_at(grid, 18.0, -3.0) == OCCLUDED
    known = np.isfinite(grid.ground_m)
    middle = grid.ground_m[100 + 40, 100]  # 8 m ahead
    assert known.all()
    assert middle == pytest.approx(-1.8 + slope * 8.0, abs=0.15)
    i, j = np.floor((np.array([6.05, 2.05]) - grid.corner) / 0.2).astype(int)
    assert grid.probability[i, j] > 0.5 > grid.probability[115, 105]


def test_something_that_moved_away_is_no_obstacle_now() -> None:
    scans = [(street(post_at=None), None), (street(), None)]
    grid = bev_grid(scans, reach_m=12.0)
    assert state_at(grid, 6.05, 2.05) == FREE
    assert state_at(bev_grid(scans[::-1], reach_m=12.0), 6.05, 2.05) == OCCUPIED


def test_a_second_place_sees_behind_the_post() -> None:
    pose = rigid(np.eye(3), [0.0, 8.0, 0.0])
    points = street(post_at=(6.05, 2.05 - 8.0))
    grid = bev_grid([(street(), None), (points, pose)], reach_m=14.0)
    assert state_at(grid, 9.0, 3.0) == FREE
    assert state_at(grid, 6.05, 2.05) == OCCUPIED


def test_a_grid_stands_around_the_first_scanner_of_a_map() -> None:
    pose = rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [100.0, 50.0, 3.0])
    here, there = (bev_grid([(street(), one)], reach_m=10.0) for one in (None, pose))
    assert there.corner.tolist() == [90.0, 40.0]
    x, y, _ = transform(pose, np.array([6.05, 2.05, 0.0]))
    assert state_at(there, x, y) == state_at(here, 6.05, 2.05) == OCCUPIED
    assert there.ground_m[50, 50] == pytest.approx(1.2, abs=0.05)


def test_mistakes_are_told() -> None:
    with pytest.raises(SceneError, match="one scan at least"):
        bev_grid([])
    with pytest.raises(SceneError, match="shows no ground"):
        bev_grid([(np.empty((0, 3)), None)])
    with pytest.raises(SettingsError, match="heights_m must rise"):
        bev_grid([(street(), None)], heights_m=(1.0, 0.5))
    with pytest.raises(SettingsError, match="cell_m must be a positive length"):
        bev_grid([(street(), None)], cell_m=0.0)
    with pytest.raises(SettingsError, match=r"at\s+most 40,000,000 are carved"):
        bev_grid([(street(), None)], reach_m=2000.0)
    assert "100 x 100 cells of 0.2 m" in repr(bev_grid([(street(), None)], reach_m=10.0))
