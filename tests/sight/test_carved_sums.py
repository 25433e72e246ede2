"""Sums of carved grids against loops over single voxels."""

import itertools

import numpy as np
import pytest

from intervis.sight.kernels.carved_sums import (
    FREE_SPACE,
    OCCLUDED,
    OCCUPIED,
    UNKNOWN,
    CarvedSums,
    accumulate_scan,
    finish_grid,
)
from intervis.sight.occupancy_model import MODEL

SHAPE = (3, 4, 5)
UNSEEN, BEFORE, ACROSS, BEHIND, VOLUMETRIC = 0, 1, 2, 3, 4


def no_sums(shape=SHAPE):
    kinds = (np.float32, np.float32, np.int16, np.uint8, np.uint8)
    return CarvedSums(*(np.zeros(shape, kind) for kind in kinds))


def test_one_scan_adds_its_words_voxel_by_voxel(rng):
    """A table of 0, 1, 2 ... tells which entry was taken: 20 a metre from -4 m on."""
    table = np.arange(3 * 90.0 + 1)  # volumetric returns, surfaces, dropouts, nothing observed
    place = rng.integers(0, 4, SHAPE).astype(np.uint8)
    place += (VOLUMETRIC * rng.integers(0, 2, SHAPE)).astype(np.uint8)
    depth = rng.uniform(-4.5, 1.5, SHAPE).astype(np.float32)
    depth[rng.random(SHAPE) < 0.2] = np.nan
    returns = (rng.random(SHAPE) < 0.15).astype(np.uint8)
    parameters = MODEL.parameters._replace(depth_from_m=-4.0, entries_per_m=20.0)
    for is_now in (True, False):
        sums = no_sums()
        for _ in range(2):
            accumulate_scan(place, depth, returns, is_now, table, parameters, sums)
        for at in np.ndindex(SHAPE):
            word = ACROSS if returns[at] else place[at] % 4
            metres = 0.0 if word == ACROSS else float(depth[at])
            observed = word != UNSEEN and not np.isnan(metres)
            entry = min(max(int(np.floor((metres + 4.0) * 20)), 0), 89) if observed else 0
            entry += 0 if place[at] >= VOLUMETRIC else 90
            assert sums.log_odds[at] == (2 * entry if observed else 0)
            assert sums.scans[at] == (2 if observed else 0)
            assert sums.behind[at] == (word == BEHIND)
            evidence = {UNSEEN: 0.0, BEFORE: -0.8, ACROSS: 1.7, BEHIND: 0.0}[word]
            assert sums.evidence[at] == pytest.approx(evidence, abs=1e-6)
            assert sums.now[at] == (word if is_now else UNSEEN)


@pytest.mark.parametrize(
    ("now", "evidence", "behind", "state"),
    [
        (ACROSS, -2.0, 0, OCCUPIED),  # the scan of the moment comes first
        (BEFORE, 2.0, 1, FREE_SPACE),
        (UNSEEN, 0.1, 1, OCCUPIED),
        (BEHIND, 0.1, 1, OCCUPIED),
        (UNSEEN, -0.1, 1, FREE_SPACE),
        (BEHIND, -0.1, 1, FREE_SPACE),
        (UNSEEN, 0.0, 1, OCCLUDED),
        (BEHIND, 0.0, 1, OCCLUDED),
        (UNSEEN, 0.0, 0, UNKNOWN),
    ],
)
def test_states_follow_from_the_sums(now, evidence, behind, state):
    sums = no_sums((1, 1, 1))
    for part, value in zip(sums[1:], (evidence, 0, behind, now), strict=True):
        part[...] = value
    found, probability = np.full((1, 1, 1), 9, np.uint8), np.zeros((1, 1, 1), np.float32)
    finish_grid(sums, np.zeros((1, 1)), 0.5, MODEL, np.ones(3), found, probability)
    assert found.item() == state
    assert (FREE_SPACE, OCCUPIED, OCCLUDED, UNKNOWN) == (0, 1, 2, 3)


@pytest.mark.parametrize("cell_m", [0.5, 0.3])
def test_probabilities_follow_from_height_and_log_odds(cell_m):
    """Heights of the model's tables, log-odds of 32 entries: both told by a table of its places."""
    known_entries, assumed_entries = 200, 170
    heights = np.arange(float(known_entries + assumed_entries)) / 10 - 8
    parameters = MODEL.parameters._replace(
        **{"height_from_m": -8.0, "assumed_from_m": -7.5, "entries_per_m": 20.0},
        **{"known_height_entries": float(known_entries), "log_odds_from": -12.0},
        entries_per_log_odds=8.0,
    )
    occupancies = np.arange(150.0)
    tables = MODEL.tables._replace(height_log_odds=heights, occupancies=occupancies)
    model = MODEL._replace(parameters=parameters, tables=tables)
    above_m = [-9.0, -7.97, -0.02, 0.97, 3.0, np.nan]
    ground = np.array([[*above_m, *(height + 1000.0 for height in above_m[:-1])]])
    weights = np.array([9.0, 1.0, 1.5, 1.75])
    shape = (1, ground.shape[1], 4)
    for scans, summed in itertools.product([0, 1, 2, 3, 7], [-6.0, 2.0]):
        sums = no_sums(shape)
        sums.scans[...], sums.log_odds[...] = scans, summed
        state, probability = np.empty(shape, np.uint8), np.empty(shape, np.float32)
        finish_grid(sums, ground, cell_m, model, weights, state, probability)
        for _, j, k in np.ndindex(shape):
            height_m = ground[0, j] + k * cell_m
            if np.isnan(height_m):
                entry = 0
            elif height_m > 500.0:  # over assumed ground, which is told by 1000 m
                place = int(np.floor(round((height_m - 1000 + 7.5) * 20, 6)))
                entry = min(max(place, 0) + known_entries, len(heights) - 1)
            else:
                place = int(np.floor(round((height_m + 8.0) * 20, 6)))
                entry = min(max(place, 0), known_entries - 1)
            log_odds = heights[entry]
            if scans:
                log_odds += weights[min(scans, 3)] * summed / scans
            place = min(max(int(np.floor((log_odds + 12) * 8)), 0), 149)
            assert probability[0, j, k] == place, (scans, summed, height_m)
