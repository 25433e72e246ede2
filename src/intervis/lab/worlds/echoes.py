"""Echoes: how strong one is, and whether it is lost."""

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float32Array, Float64Array
from intervis.lab.worlds.triangles import LABELS

LEAST_SIGNAL = 2.5e-6
"""Signal (1/m^2) at which half of the echoes are lost: of a surface that reflects 10 % at 200 m."""

INTENSITY_NOISE = 0.18
"""Standard deviation of the intensity, as a fraction of it."""


def intensity(
    reflectances: Float32Array, cosines: Float64Array, factors: Float64Array
) -> Float32Array:
    """Intensity (N,) of echoes, 0 to 0.99 in steps of 0.01.

    Parameters
    ----------
    reflectances, cosines : (N,) arrays
        Of the surfaces, and of the angles of incidence.
    factors : (N,) array
        Random factors around 1.
    """
    strength = reflectances * (0.45 + 0.55 * cosines) * factors
    percent = (np.clip(strength, 0, 0.99) * 100).round().astype(np.float32)
    return np.asarray(percent / np.float32(100))


def loss_probability(
    reflectances: Float32Array,
    labels: NDArray[np.int8],
    ranges_m: Float64Array,
    cosines: Float64Array,
    *,
    dropout: float,
    least_signal: float = LEAST_SIGNAL,
) -> Float64Array:
    """Probability (N,) that an echo is lost: at random, too weak, or reflected away by glass.

    Parameters
    ----------
    reflectances, labels, ranges_m, cosines : (N,) arrays
        Of the surfaces, with the angles of incidence.
    dropout : float
        Share that is lost at random.
    least_signal : float
        Signal (reflectance x cosine of incidence / range^2, 1/m^2) at which half are lost.
    """
    signal = reflectances * cosines / np.maximum(ranges_m, 1e-3) ** 2
    detected = signal**3 / np.maximum(signal**3 + least_signal**3, 1e-300)
    glassy = np.isin(labels, (LABELS["window"], LABELS["glass"]))
    reflected_back = np.where(glassy, 1 - 0.75 * (1 - cosines**8), 1.0)
    return np.asarray(1 - (1 - dropout) * detected * reflected_back)
