"""Power spectra against Parseval's theorem and known signals."""

import numpy as np
import pytest

from intervis.lab.paper.spectra import Spectrum, power_spectra


def test_a_spectrum_holds_the_variance_of_its_coordinate(rng):
    points = rng.normal(size=(1000, 3)) * [1.0, 5.0, 0.1] + 30.0
    for column, spectrum in enumerate(power_spectra(points)):
        step = spectrum.frequency[1]
        assert np.isclose(spectrum.power.sum() * step, points[:, column].var(), rtol=1e-6)


def test_white_noise_is_flat_and_a_wave_is_not(rng):
    noise, wave = rng.normal(size=4096), np.sin(np.arange(4096) * 0.3)
    flat, ordered, _ = power_spectra(np.column_stack([noise, wave, wave]))
    # The geometric over the arithmetic mean of an exponential distribution: exp(-0.5772) = 0.561.
    assert abs(flat.flatness - 0.561) < 0.03
    assert ordered.flatness < 0.01


def test_a_handful_of_points_has_no_spectrum():
    assert all(len(spectrum.power) == 0 for spectrum in power_spectra(np.zeros((7, 3))))
    assert all(len(spectrum.power) == 5 for spectrum in power_spectra(np.zeros((8, 3))))
    assert all(spectrum.flatness == 0.0 for spectrum in power_spectra(np.zeros((8, 3))))


def test_the_standard_error_of_flatness_is_that_of_repeated_noise(rng):
    noise = [power_spectra(rng.normal(size=(512, 3))) for _ in range(200)]
    flatness = np.array([[spectrum.flatness for spectrum in three] for three in noise])
    errors = np.array([[spectrum.flatness_error for spectrum in three] for three in noise])
    assert errors.mean() == pytest.approx(flatness.std(ddof=1), rel=0.1)
    nine = Spectrum(*4 * [np.empty(9)], flatness=0.5)
    assert nine.flatness_error == pytest.approx(0.5 * np.sqrt((np.pi**2 / 6 - 1) / 8))
    assert all(one.flatness_error == 0.0 for one in power_spectra(np.zeros((5, 3))))
