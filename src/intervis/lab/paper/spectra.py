"""Power spectra of a sequence of points in x, y and z (paper Fig. 4 (b) and 5 (b))."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import periodogram, welch

from intervis.arrays import Float64Array

SEGMENT = 256
"""Samples in one segment of the smoothed estimate."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The spectrum of one coordinate along the sequence of points.

    Attributes
    ----------
    frequency : (K,) float64 array
        Cycles for each sample, 0 to 0.5.
    power : (K,) float64 array
        Periodogram, square metres for each cycle a sample.
    smooth_frequency, smooth_power : (M,) float64 arrays
        Welch's estimate: the same, averaged over segments.
    flatness : float
        Geometric over arithmetic mean of the periodogram: 1 for white noise, towards 0 for order.
    """

    frequency: Float64Array
    power: Float64Array
    smooth_frequency: Float64Array
    smooth_power: Float64Array
    flatness: float


def power_spectra(points: Float64Array) -> tuple[Spectrum, Spectrum, Spectrum]:
    """Spectra of the three columns of points, taken in the order of their rows.

    The mean of each column is taken away first. Fewer than eight points have no spectrum: their
    arrays are empty and their flatness is NaN.

    Examples
    --------
    >>> wave = np.sin(2 * np.pi * 0.25 * np.arange(512))
    >>> spectrum = power_spectra(np.column_stack([wave, wave, wave]))[0]
    >>> float(spectrum.frequency[spectrum.power.argmax()])
    0.25
    """
    x, y, z = (_spectrum(np.ascontiguousarray(column)) for column in points.T)
    return x, y, z


def _spectrum(signal: Float64Array) -> Spectrum:
    nothing = np.empty(0)
    if len(signal) < 8:
        return Spectrum(nothing, nothing, nothing, nothing, float("nan"))
    frequency, power = periodogram(signal, detrend="constant")
    segment = min(SEGMENT, len(signal))
    smooth_frequency, smooth_power = welch(signal, nperseg=segment, detrend="constant")
    inner = power[1:]  # the mean is gone, so the first value is 0
    mean = float(inner.mean())
    tiny = np.finfo(np.float64).tiny
    flatness = float(np.exp(np.log(np.maximum(inner, tiny)).mean()) / mean) if mean else 0.0
    return Spectrum(frequency, power, smooth_frequency, smooth_power, flatness)
