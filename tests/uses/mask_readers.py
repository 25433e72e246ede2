"""Readers of masks by the conventions of each benchmark's own loader, with loops in the open."""

from pathlib import Path

import numpy as np


def bits_of(path: Path) -> list[int]:
    """Bits of a file, the most significant of each byte first."""
    bits = []
    for byte in path.read_bytes():
        bits += [(byte >> (7 - place)) & 1 for place in range(8)]
    return bits


def semantickitti_volume(path: Path, shape: tuple[int, int, int]) -> np.ndarray:
    """A packed file of SemanticKITTI: z runs fastest, then y, then x."""
    bits, volume = bits_of(path), np.zeros(shape, int)
    assert len(bits) == shape[0] * shape[1] * shape[2]
    for x in range(shape[0]):
        for y in range(shape[1]):
            for z in range(shape[2]):
                volume[x, y, z] = bits[z + shape[2] * (y + shape[1] * x)]
    return volume


def semantickitti_labels(path: Path, shape: tuple[int, int, int]) -> np.ndarray:
    """Labels of SemanticKITTI: two bytes a voxel, the lower one first."""
    content, volume = path.read_bytes(), np.zeros(shape, int)
    assert len(content) == 2 * shape[0] * shape[1] * shape[2]
    for x in range(shape[0]):
        for y in range(shape[1]):
            for z in range(shape[2]):
                at = 2 * (z + shape[2] * (y + shape[1] * x))
                volume[x, y, z] = content[at] + 256 * content[at + 1]
    return volume


def bytes_volume(path: Path, shape: tuple[int, int, int]) -> np.ndarray:
    """One byte a voxel, as SSCBench-KITTI-360 holds its invalid masks."""
    content, volume = path.read_bytes(), np.zeros(shape, int)
    assert len(content) == shape[0] * shape[1] * shape[2]
    for at, value in enumerate(content):
        x, rest = divmod(at, shape[1] * shape[2])
        volume[(x, *divmod(rest, shape[2]))] = value
    return volume


def rows_volume(rows: np.ndarray, shape: tuple[int, int, int], order: str) -> np.ndarray:
    """Rows of indices in an order of axes, and the class: a volume [x, y, z], -1 where none is."""
    volume = np.full(shape, -1)
    for row in rows.tolist():
        place = dict(zip(order, row[:3], strict=True))
        volume[place["x"], place["y"], place["z"]] = row[3]
    return volume


def flat_place(index: int, shape: tuple[int, int, int]) -> tuple[int, int, int]:
    """Voxel [x, y, z] of an index of OccNet and OpenScene: x runs fastest, then y, then z."""
    z, rest = divmod(index, shape[0] * shape[1])
    y, x = divmod(rest, shape[0])
    return x, y, z


def flat_rows_volume(rows: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Rows of index and class: a volume [x, y, z], -1 where none is."""
    volume = np.full(shape, -1)
    for index, label in rows.tolist():
        volume[flat_place(index, shape)] = label
    return volume


def nuscenes_axes(volume: np.ndarray) -> np.ndarray:
    """A volume in x right, y ahead turned into x ahead, y left, voxel by voxel."""
    turned = np.empty((volume.shape[1], volume.shape[0], volume.shape[2]), volume.dtype)
    for right in range(volume.shape[0]):
        for ahead in range(volume.shape[1]):
            turned[ahead, volume.shape[0] - 1 - right] = volume[right, ahead]
    return turned
