"""The ground as the median of several scans, on level ground with a ghost below it in one scan."""

import numpy as np

from intervis.sight import Scene
from intervis.transform import rigid

PLACES = [(x, 0.0) for x in (-6.0, -3.0, 0.0, 3.0, 6.0)]
TILTED_M = (0.00, 0.02, 0.04, 0.06, 0.08)
"""How much higher each scan shows the ground."""


def level_scan(height_m: float, ghost_m: float = 0.0) -> np.ndarray:
    """Ground from 3 to 20 m around a scanner, and around (3, 3) at another height."""
    x, y = np.meshgrid(np.arange(-20, 20, 0.25), np.arange(-20, 20, 0.25))
    x, y = x.ravel(), y.ravel()
    z = np.full(len(x), -1.7 + height_m)
    z[(np.abs(x - 3.0) < 3.0) & (np.abs(y - 3.0) < 3.0)] += ghost_m
    return np.column_stack([x, y, z])[np.hypot(x, y) > 3.0]


def scene_of(ghost_m: float) -> Scene:
    scene = Scene()
    for nth, (x, y) in enumerate(PLACES):
        points = level_scan(TILTED_M[nth], ghost_m if nth == 2 else 0.0)
        scene.add(points, rigid(np.eye(3), [x, y, 1.7]))
    return scene


def test_the_median_ignores_the_ghost_of_one_scan() -> None:
    ghost = scene_of(-4.0)
    place = [[2.5, 2.5]]  # nearest to the scan with the ghost
    assert ghost.ground_height([[1.0, 4.0]])[0] < -2.0
    several = ghost.ground_height([[1.0, 4.0]], scans=5)[0]
    assert abs(several - 0.04) < 0.05
    np.testing.assert_allclose(scene_of(0.0).ground_height(place, 5), 0.04, atol=0.03)


def test_only_scans_that_show_the_ground_count() -> None:
    scene = scene_of(0.0)
    # At x = 25.5 the scans from x = 6 and x = 3 reach up to 26 and 23 m: one shows it.
    assert abs(scene.ground_height([[25.5, 0.0]], scans=5)[0] - 0.08) < 0.01
    # Where none does, the answer is that of the nearest scan.
    far = [[60.0, 0.0], [np.nan, 0.0]]
    np.testing.assert_array_equal(scene.ground_height(far, scans=5), scene.ground_height(far))
    assert np.isnan(scene.ground_height(far, scans=5)[1])


def test_one_scan_is_its_own_median() -> None:
    scene = Scene.from_scan(level_scan(0.0))
    rng = np.random.default_rng(0)
    places = rng.uniform(-30, 30, (200, 2))
    np.testing.assert_array_equal(scene.ground_height(places, 5), scene.ground_height(places))


def test_a_scan_tells_nothing_beyond_its_map() -> None:
    # The map of the first scan ends 64 m around it; the second one shows the ground 0.5 m higher.
    x, y = np.meshgrid(np.arange(-66, 66, 0.5), np.arange(-20, 20, 0.5))
    wide = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -1.7)])
    scene = Scene.from_scan(wide, rigid(np.eye(3), [0.0, 0.0, 1.7]))
    scene.add(level_scan(0.5), rigid(np.eye(3), [80.0, 0.0, 1.7]))
    assert abs(scene.ground_height([[70.0, 0.0]], scans=2)[0] - 0.5) < 0.01
    assert abs(scene.ground_height([[62.0, 0.0]], scans=2)[0] - 0.25) < 0.01  # both show it
