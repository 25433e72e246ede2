"""Places: heights of the ground, free sites, and equal seeds."""

import numpy as np
import pytest

from intervis.lab.worlds.beam_pattern import PATTERNS
from intervis.lab.worlds.mounts import MOUNTS
from intervis.lab.worlds.places import PLACES, crest, dark_cars, hall


@pytest.mark.parametrize("name", [name for name in PLACES if name != "street"])
def test_scanners_stand_in_the_open_and_seeds_repeat(name: str) -> None:
    place = PLACES[name](3)
    assert np.array_equal(place.triangles, PLACES[name](3).triangles)
    assert not np.array_equal(place.triangles, PLACES[name](4).triangles)
    feet = place.ground(place.sites)
    for mount in MOUNTS.values():
        assert place.free(feet + np.array([0, 0, mount.height_m])).all()


def test_ground_of_the_crest_rises_and_falls_at_15_percent() -> None:
    x = np.array([0.0, 10.0, 20.0, 40.0, 60.0, 70.0])
    ground = crest(0).ground(np.column_stack([x, np.zeros(6)]))
    assert np.allclose(ground[:, 2], [0, 1.5, 3, 0, -3, -1.5], atol=1e-6)


def test_hall_is_closed_and_its_gallery_is_not_free() -> None:
    place = hall(0)
    origin = np.array([0.0, 1.0, 1.7])
    out = origin + 100 * np.array([[1, 0, 0], [-1, 0, 0.2], [0, 1, 0.3], [0, -1, 0], [0, 0, 1.0]])
    assert place.caster.blocked(origin, out).all()
    points = np.array([[0, 10, 4.15], [0, 10, 2.0], [0, 10, 6.0]])
    assert place.free(points).tolist() == [False, True, True]


def test_dark_paint_and_glass_lose_their_share_of_echoes() -> None:
    place = dark_cars(2)
    shares = place.lost_share
    assert shares is not None
    assert len(shares) == len(place.triangles)
    pose = np.eye(4)
    pose[:3, 3] = [0.0, 0.0, 1.9]
    pattern = PATTERNS["os1-128"]()
    scan = pattern.scan(place.caster, pose, np.random.default_rng(2), shares)
    _, hits = place.caster.closest(pose[:3, 3], pattern.directions, pattern.farthest_m)
    for share in np.unique(shares):
        of_share = (hits >= 0) & (shares[hits] == share)
        found = np.mean(~np.isfinite(scan.ranges_m[of_share]))
        expected = max(share, pattern.dropout)
        spread = np.sqrt(expected * (1 - expected) / of_share.sum())
        assert found == pytest.approx(expected, abs=5 * spread)
    assert set(np.unique(shares)) == {0.0, 0.6, 0.8, 0.9, 0.97}
    # Houses and ground lose none: no lost share below the cars, and none above the shop windows.
    heights_m = place.triangles[..., 2]
    assert not shares[heights_m.max(axis=1) < 0.2].any()
    assert not shares[heights_m.min(axis=1) > 2.7].any()


def test_worlds_without_dark_surfaces_say_so() -> None:
    assert [name for name in PLACES if PLACES[name](0).lost_share is not None] == ["dark-cars"]
