"""Power spectra of x, y and z along a sequence of points (paper Fig. 4 (b) and 5 (b))."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import periodogram, welch

from intervis.arrays import Float64Array

SEGMENT = 256
"""Samples per segment of Welch's estimate."""


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The spectrum of one coordinate along the sequence of points.

    Attributes
    ----------
    frequency : (K,) float64 array
        Cycles per sample, 0 to 0.5.
    power : (K,) float64 array
        Periodogram, square metres per (cycle per sample).
    smooth_frequency, smooth_power : (M,) float64 arrays
        Welch's estimate in the same units, averaged over segments.
    flatness : float
        Spectral flatness: geometric over arithmetic mean of the periodogram without its first
        value. Near 0.561 for white noise, near 0 for a single wave; NaN without a spectrum.
    """

    frequency: Float64Array
    power: Float64Array
    smooth_frequency: Float64Array
    smooth_power: Float64Array
    flatness: float

    @property
    def flatness_error(self) -> float:
        """Standard error of the flatness.

        For K independent exponential values, which a periodogram of noise has, the logarithm of
        the flatness has the variance (pi^2 / 6 - 1) / K.
        """
        count = len(self.power) - 1
        return self.flatness * float(np.sqrt((np.pi**2 / 6 - 1) / count)) if count > 0 else 0.0


def power_spectra(points: Float64Array) -> tuple[Spectrum, Spectrum, Spectrum]:
    """Spectra of the three columns of (K, 3) points, in the order of the rows.

    The mean of each column is subtracted first. Fewer than eight points have no spectrum: the
    arrays are empty and the flatness is NaN.

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
    inner = power[1:]  # the mean is subtracted, so the first value is 0
    mean = float(inner.mean())
    tiny = np.finfo(np.float64).tiny
    flatness = float(np.exp(np.log(np.maximum(inner, tiny)).mean()) / mean) if mean else 0.0
    return Spectrum(frequency, power, smooth_frequency, smooth_power, flatness)
