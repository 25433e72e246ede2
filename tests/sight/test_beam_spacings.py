"""Beam spacings of a scan by bands of elevation: numbers on paper."""

import numpy as np
import pytest

from intervis.sight.kernels.rasterize import band_of, beam_spacings

USUAL = 0.1
"""Steps from 0.025 to 0.8 count, in 64 bins of 0.775 / 64 = 0.0121."""
BANDS = 4
"""Each is 1 wide: -2 to -1, -1 to 0, 0 to 1, 1 to 2."""


def spacings(*columns):
    """Spacings of columns of pseudo-elevations, each ascending."""
    elevation = np.concatenate([np.asarray(column, float) for column in columns])
    start = np.cumsum([0, *map(len, columns)]).astype(np.uint32)
    kernel = getattr(beam_spacings, "py_func", beam_spacings)
    order = np.arange(len(elevation), dtype=np.uint32)
    return kernel(elevation, order, start, USUAL, BANDS).tolist()


def steps(count, step, middle):
    """Columns of two returns, a step apart, around a pseudo-elevation."""
    return [[middle - 0.5 * step, middle + 0.5 * step]] * count


def near(value):
    """Within half a bin."""
    return pytest.approx(value, abs=0.0061)


@pytest.mark.parametrize(("count", "known"), [(99, False), (100, True)])
def test_a_hundred_steps_make_a_band(count, known):
    assert spacings(*steps(count, 0.3, 0.5)) == [near(0.3 if known else USUAL)] * 4


def test_a_step_counts_in_the_band_of_its_middle():
    """The steps of 0.4 reach from band 1 into band 2, their middle lies in band 2."""
    found = spacings(*steps(300, 0.05, -0.5), *steps(150, 0.4, 0.01))
    assert found == [near(0.05), near(0.05), near(0.4), near(0.4)]
    found = spacings(*steps(150, 0.4, -0.01), *steps(300, 0.05, 0.5))
    assert found == [near(0.4), near(0.4), near(0.05), near(0.05)]


def test_a_band_without_steps_takes_the_nearest_and_of_two_the_lower_one():
    found = spacings(*steps(100, 0.05, -1.5), *steps(100, 0.4, 0.5))
    assert found == [near(0.05), near(0.05), near(0.4), near(0.4)]
    found = spacings(*steps(100, 0.2, 1.5))
    assert found == [near(0.2)] * 4


@pytest.mark.parametrize(
    ("step", "counts"), [(0.024, False), (0.026, True), (0.79, True), (0.81, False), (1.5, False)]
)
def test_steps_from_a_quarter_to_eight_times_the_usual_one_count(step, counts):
    assert spacings(*steps(200, step, 0.5))[2] == (near(step) if counts else USUAL)


def test_the_spacing_is_the_median_step():
    """Half of the steps reach it: 60 of 120, not 59."""
    for small, expected in ((60, 0.1), (59, 0.3)):
        found = spacings(*steps(small, 0.1, 0.5), *steps(120 - small, 0.3, 0.5))
        assert found[2] == near(expected)


def test_steps_lie_between_neighbours_of_one_column():
    """Three returns, 0.1 and 0.2 apart; from column to column nothing is counted."""
    found = spacings(*[[0.3, 0.4, 0.6]] * 100, *[[0.35]] * 300)
    assert found[2] == near(0.1)
    assert spacings(*[[0.3]] * 300)[2] == USUAL


@pytest.mark.parametrize(
    ("elevation", "band"), [(-2.0, 0), (-1.91, 0), (-1.89, 1), (0.0, 20), (1.89, 38), (2.0, 39)]
)
def test_bands_of_a_tenth(elevation, band):
    assert band_of(elevation, 40) == band
