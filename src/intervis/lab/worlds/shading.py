"""What colour a ray sees: sun and sky on surfaces, gloss, grain, haze, clouds.

Colours are linear red, green, blue; one is white paper in the sun. Nothing here is measured: it is
there so that a person recognises a street.
"""

import math

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import BoolArray, Float32Array, Float64Array, IntArray
from intervis.kernels import kernel
from intervis.lab.worlds.triangles import LABELS

SUN = (2.35, 2.15, 1.80)
SKYLIGHT = (0.52, 0.62, 0.80)
BOUNCE = (0.26, 0.24, 0.20)
HORIZON = (0.86, 0.93, 1.0)
ZENITH = (0.20, 0.42, 0.82)
CLOUD = (1.25, 1.25, 1.26)
HAZE_M = 480.0
FOCAL_PX = 720.0
"""Grain finer than a pixel of such a camera is left out."""

VEGETATION, ROOF, GLASS, WINDOW, CAR = (
    LABELS[name] for name in ("vegetation", "roof", "glass", "window", "car")
)

_GRAIN = {  # strength and waves a metre, fine and coarse
    "road": (0.16, 26.0, 0.20, 0.55),
    "marking": (0.12, 20.0, 0.16, 1.6),
    "kerb": (0.10, 22.0, 0.10, 1.5),
    "sidewalk": (0.09, 24.0, 0.12, 0.7),
    "terrain": (0.42, 7.0, 0.35, 0.5),
    "building": (0.05, 16.0, 0.10, 0.6),
    "roof": (0.12, 9.0, 0.15, 0.7),
    "fence": (0.10, 14.0, 0.10, 1.1),
    "vegetation": (0.25, 9.0, 0.22, 1.1),
    "trunk": (0.35, 16.0, 0.10, 2.0),
    "bridge": (0.08, 14.0, 0.16, 0.5),
    "person": (0.12, 30.0, 0.0, 1.0),
}
GRAIN = np.zeros((len(LABELS), 4))
for _name, _row in _GRAIN.items():
    GRAIN[LABELS[_name]] = _row


@kernel
def _scatter(x: int, y: int, z: int) -> float:
    """A number between 0 and 1 that belongs to a cell of space."""
    mixed = np.uint32(x * 73856093) ^ np.uint32(y * 19349663) ^ np.uint32(z * 83492791)
    mixed = np.uint32((np.uint64(mixed) * np.uint64(2654435769)) & np.uint64(0xFFFFFFFF))
    mixed ^= mixed >> np.uint32(15)
    mixed = np.uint32((np.uint64(mixed) * np.uint64(2246822519)) & np.uint64(0xFFFFFFFF))
    mixed ^= mixed >> np.uint32(13)
    return float(mixed) / 4294967296.0


@kernel
def noise(x: float, y: float, z: float) -> float:
    """Smooth noise between 0 and 1, one wave in about two units."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    ix, iy, iz = int(fx), int(fy), int(fz)
    tx, ty, tz = x - fx, y - fy, z - fz
    tx, ty, tz = (
        tx * tx * (3.0 - 2.0 * tx),
        ty * ty * (3.0 - 2.0 * ty),
        tz * tz * (3.0 - 2.0 * tz),
    )
    total = 0.0
    for cx in range(2):
        wx = tx if cx else 1.0 - tx
        for cy in range(2):
            wy = ty if cy else 1.0 - ty
            low = _scatter(ix + cx, iy + cy, iz)
            high = _scatter(ix + cx, iy + cy, iz + 1)
            total += wx * wy * (low + tz * (high - low))
    return total


@kernel
def _sky(dx: float, dy: float, dz: float, out: Float64Array) -> None:
    """Colour of the sky in a unit direction; below the horizon, of what stands there."""
    rise = min(1.0, max(0.0, dz * 1.7)) ** 0.7
    for part in range(3):
        out[part] = HORIZON[part] + rise * (ZENITH[part] - HORIZON[part])
    if dz > 0.015:
        scale = 1.9 / (dz + 0.10)
        u, v = dx * scale, dy * scale
        cover, weight, size = 0.0, 0.5, 1.0
        for octave in range(4):
            cover += weight * noise(u * size + 7.3, v * size + 1.7, 3.1 + octave)
            weight *= 0.5
            size *= 2.1
        cover = min(1.0, max(0.0, (cover - 0.46) / 0.22)) * min(1.0, (dz - 0.015) * 14.0)
        cover = cover * cover * (3.0 - 2.0 * cover) * 0.85
        for part in range(3):
            out[part] += cover * (CLOUD[part] - out[part])


@kernel
def _mirrored(dx: float, dy: float, dz: float, out: Float64Array) -> None:
    """What a window or a car's paint mirrors: sky above, the street's grey below."""
    _sky(dx, dy, abs(dz), out)
    street = 1.0 - min(1.0, max(0.0, (dz - 0.12) * 4.0))
    for part in range(3):
        out[part] += street * (0.5 * BOUNCE[part] + 0.06 - out[part])


@kernel
def _grain(label: int, x: float, y: float, z: float, range_m: float) -> float:
    """A factor around one that roughens a surface as its label has it."""
    factor = 1.0
    for layer in range(2):
        strength, waves = GRAIN[label, 2 * layer], GRAIN[label, 2 * layer + 1]
        seen = min(1.0, max(0.0, 1.6 - 2.0 * waves * range_m / FOCAL_PX))
        if strength * seen > 0.0:
            wave = noise(x * waves, y * waves, z * waves)
            factor += strength * seen * (2.0 * wave - 1.0)
    if label == ROOF:  # rows of tiles
        row = z / 0.24
        seen = min(1.0, max(0.0, 1.4 - 9.0 * range_m / FOCAL_PX))
        factor *= 1.0 - 0.28 * seen * (row - math.floor(row)) ** 3
    return factor


@kernel
def sunward(
    ways: Float64Array,
    ranges: Float64Array,
    hits: IntArray,
    origin: Float64Array,
    normals: Float64Array,
    labels: NDArray[np.int8],
    sun: Float64Array,
    starts: Float64Array,
    asks: BoolArray,
    start: int,
    stop: int,
) -> None:
    """Where each ray's shadow ray begins, and whether it needs one."""
    for ray in range(start, stop):
        hit = hits[ray]
        if hit < 0:
            asks[ray] = False
            continue
        facing = 0.0
        towards = 0.0
        for axis in range(3):
            facing += normals[hit, axis] * ways[ray, axis]
            towards += normals[hit, axis] * sun[axis]
        side = -1.0 if facing > 0.0 else 1.0
        lit = towards * side > 0.0
        asks[ray] = lit or labels[hit] == VEGETATION
        for axis in range(3):
            step = normals[hit, axis] * side * 2e-3 if lit else sun[axis] * 0.05
            starts[ray, axis] = origin[axis] + ways[ray, axis] * ranges[ray] + step


@kernel
def shade(
    ways: Float64Array,
    ranges: Float64Array,
    hits: IntArray,
    origin: Float64Array,
    normals: Float64Array,
    labels: NDArray[np.int8],
    colours: Float32Array,
    sun: Float64Array,
    sunlit: BoolArray,
    out: Float32Array,
    start: int,
    stop: int,
) -> None:
    """Linear colour (R, 3) that each ray sees."""
    far, glance = np.empty(3), np.empty(3)
    for ray in range(start, stop):
        dx, dy, dz = ways[ray, 0], ways[ray, 1], ways[ray, 2]
        hit = hits[ray]
        if hit < 0:
            _sky(dx, dy, dz, far)
            for part in range(3):
                out[ray, part] = far[part]
            continue
        label, reach = labels[hit], ranges[ray]
        nx, ny, nz = normals[hit, 0], normals[hit, 1], normals[hit, 2]
        facing = nx * dx + ny * dy + nz * dz
        if facing > 0.0:
            nx, ny, nz, facing = -nx, -ny, -nz, -facing
        x, y, z = origin[0] + dx * reach, origin[1] + dy * reach, origin[2] + dz * reach
        towards = nx * sun[0] + ny * sun[1] + nz * sun[2]
        if label == VEGETATION:  # light comes through a leaf, too
            towards = 0.30 + 0.70 * abs(towards)
        direct = max(0.0, towards) if sunlit[ray] else 0.0
        factor = _grain(label, x, y, z, reach)
        up = 0.5 + 0.5 * nz
        for part in range(3):
            light = direct * SUN[part] + up * SKYLIGHT[part] + (1.0 - up) * BOUNCE[part]
            out[ray, part] = colours[hit, part] * factor * light
        if label in (WINDOW, GLASS, CAR):
            gloss = 0.045 if label == CAR else 0.13
            gloss += (0.75 - gloss) * (1.0 + facing) ** 5
            rx, ry, rz = dx - 2 * facing * nx, dy - 2 * facing * ny, dz - 2 * facing * nz
            _mirrored(rx, ry, rz, glance)
            glint = max(0.0, rx * sun[0] + ry * sun[1] + rz * sun[2]) ** 90 if sunlit[ray] else 0.0
            for part in range(3):
                out[ray, part] += gloss * (glance[part] - out[ray, part]) + glint * SUN[part] * 0.6
        clear = math.exp(-reach / HAZE_M)
        for part in range(3):
            out[ray, part] = clear * out[ray, part] + (1.0 - clear) * HORIZON[part] * 0.92


@kernel
def developed(linear: Float32Array, out: Float32Array, start: int, stop: int) -> None:
    """Film: linear light to picture values between 0 and 1, bright parts rolled off, sRGB gamma."""
    for pixel in range(start, stop):
        for part in range(3):
            light = max(0.0, float(linear[pixel, part])) * 0.80
            film = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)
            film = min(1.0, film)
            if film <= 0.0031308:
                out[pixel, part] = 12.92 * film
            else:
                out[pixel, part] = 1.055 * film ** (1.0 / 2.4) - 0.055
