"""Engine against reference where values lie exactly on the bounds of the rules.

All lengths are multiples of 1/128 m and all bounds multiples of 1/8 m, so that floating point is
exact and samples meet the bounds: depth -0.25 m, 4 samples along a surface, and so on.
"""

import numpy as np
import pytest

from intervis.sight import occupancy_model
from intervis.sight.answers import answer_lines, sum_lines
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.kernels.terrain import CELLS
from intervis.sight.occupancy_model import AGE_COST_M_PER_S, MODEL
from intervis.sight.reference import reference_result, reference_samples

BOUNDS = {
    "step_m": 0.25,
    "end_margin_m": 0.375,
    "below_ground_m": 0.5,
    "surface_from_m": -0.25,
    "surface_to_m": 1.25,
    "end_surface_m": 0.25,
    "grazing_samples": 4,
    "free_depth_m": -0.75,
    "dynamic_max_depth_m": 3.0,
    "dynamic_min_height_m": 0.25,
    "dynamic_max_height_m": 3.0,
    "motion_step_m": 0.5,
    "motion_reach_m": 3.25,
}
COLUMNS, ROWS, ROWS_PER_UNIT = 16, 32, 16.0
TURNS = {
    "upright": np.eye(3),
    "to the left": np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    "backwards": np.diag([-1.0, -1, 1]),
    "upside down": np.diag([1.0, -1, -1]),
}


LEVEL_TURNS = {1: "upside down", 2: "to the left", 5: "backwards"}
"""Turn of the axes of the ground maps by the number of scans."""


@pytest.fixture(autouse=True)
def exact_bounds(monkeypatch):
    """The reference reads its constants from the module."""
    for name, value in BOUNDS.items():
        monkeypatch.setattr(occupancy_model, name.upper(), value)


EXACT = MODEL._replace(
    parameters=MODEL.parameters._replace(**{name: float(value) for name, value in BOUNDS.items()})
)


def world(rng, scans, timed):
    """Scans on the x axis at whole metres, whose surfaces lie at multiples of 1/8 m."""
    # 640 and 704 units differ by exactly a tenth: the bound of interpolation
    units = rng.choice(
        [0, 128, 320, 512, 560, 624, 640, 640, 704, 704, 800], (scans, COLUMNS, ROWS)
    )
    units = np.where(rng.random((scans, COLUMNS, 1)) < 0.5, units[:, :, :1], units)
    units *= np.where(rng.random(units.shape) < 0.3, -1, 1)
    turns = [TURNS[name] for name in rng.choice(list(TURNS), scans)]
    position = np.zeros((scans, 3))
    position[:, 0] = rng.permutation(np.arange(-8, 9))[:scans]
    position[:, 2] = rng.choice([0.0, 0.0, 0.5], scans)
    ground = rng.choice(
        [-3.125, -3.0, -2.0, -0.375, -0.25, -0.125, 0.5, 0.625, np.nan], (scans, 1, 1)
    )
    ground = np.where(
        rng.random((scans, CELLS, CELLS)) < 0.5,
        rng.choice([-3.0, -1.0, 0.5, 0.75, np.nan], (scans, CELLS, CELLS)),
        ground,
    )
    offset_s = (
        rng.choice([-0.5, -0.25, 0.0, 0.25, 0.75], scans) if timed else np.full(scans, np.nan)
    )
    return PackedScans(
        pixels=units.astype(np.int16).ravel(),
        unit_m=np.full(scans, 1.0 / 128.0),
        offset=np.arange(scans) * COLUMNS * ROWS,
        columns=np.full(scans, COLUMNS),
        rows=np.full(scans, ROWS),
        # the axes lie on a row, between two rows, on the first and the last row that is read
        elevation_from=-rng.choice([0.0, 8.0, 9.5, 10.25, 12.75, 30.5, 31.0], scans)
        / ROWS_PER_UNIT,
        rows_per_unit=np.full(scans, ROWS_PER_UNIT),
        sensor_from_scene=np.array(
            [np.column_stack([t.T, -t.T @ p]) for t, p in zip(turns, position, strict=True)]
        ),
        position=position,
        ground=ground.astype(np.float32),
        level_from_scene=TURNS[LEVEL_TURNS.get(scans, "upright")],
        age_cost_m=AGE_COST_M_PER_S * np.abs(offset_s) if timed else np.zeros(scans),
        time_offset_s=offset_s,
    )


def lines_of(rng, scans, count):
    """Lines of 2, 4, 8 or 16 m on the x axis and across it, and some that are not exact."""
    a = np.zeros((count, 3))
    a[:, 0] = rng.integers(-12, 9, count)
    b = a.copy()
    b[:, 0] += 2.0 ** rng.integers(1, 5, count)
    across = rng.random(count) < 0.25  # through a sensor's y axis
    b[across, 1] = b[across, 0] - a[across, 0]
    b[across, 0] = a[across, 0]
    a[:, 2] = b[:, 2] = rng.choice([0.0, 0.0, 0.5], count)
    odd = rng.random(count) < 0.1
    b[odd] += rng.normal(0.0, 1.0, (int(odd.sum()), 3))
    backwards = rng.random(count) < 0.5
    a[backwards], b[backwards] = b[backwards], a[backwards]
    return a, b


PARTS = ("free", "surface", "unobserved", "unobserved_m", "occluded_space_m", "time_gap_s")


@pytest.mark.parametrize("timed", [False, True])
@pytest.mark.parametrize("scans", [1, 2, 3, 5, 8])
def test_engine_is_the_reference_on_the_bounds(rng, scans, timed):
    if scans == 1:
        timed = False
    dynamic = 0
    for _ in range(4 if scans == 1 else 8):
        packed = world(rng, scans, timed)
        a, b = lines_of(rng, scans, 40)
        sums = sum_lines(packed, a, b, EXACT)
        answers = answer_lines(packed, a, b, paired=True, model=EXACT)
        for i in range(len(a)):
            expected = reference_result(packed, a[i], b[i])
            for name in PARTS:
                found = getattr(sums, name)[i]
                assert found == pytest.approx(getattr(expected, name), abs=1e-9), (name, a[i], b[i])
            assert answers.state[i] == expected.state
            dynamic += bool(reference_samples(packed, a[i], b[i]).occupied.any())
    assert dynamic > 0 or scans == 1


def test_a_line_is_occluded_from_the_least_surface_on(rng, monkeypatch):
    """Exactly as much surface as is asked for is enough, for engine and reference."""
    packed = world(rng, 3, False)
    a, b = lines_of(rng, 3, 60)
    surface = sum_lines(packed, a, b, EXACT).surface
    occluded = np.flatnonzero(answer_lines(packed, a, b, paired=True, model=EXACT).state == 0)
    assert len(occluded) > 3
    for i in occluded[:8]:
        expected = reference_result(packed, a[i], b[i])
        for upwards, state in ((False, 0), (True, -1)):
            least, of_reference = surface[i], expected.surface
            if upwards:
                least, of_reference = np.nextafter([least, of_reference], np.inf)
            parameters = EXACT.parameters._replace(occluded_min_surface=float(least))
            model = EXACT._replace(parameters=parameters)
            assert answer_lines(packed, a, b, paired=True, model=model).state[i] == state
            monkeypatch.setattr(occupancy_model, "OCCLUDED_MIN_SURFACE", of_reference)
            assert expected.state == state
