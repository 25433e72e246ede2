"""Compile the kernels before they are needed: for images of containers, and for live nodes."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.method.analysis import analyze
from intervis.progress import Progress, reporter
from intervis.settings import Settings
from intervis.sight import Scene, explain, visible_mask
from intervis.sight.observed_profile import unobserved_parts
from intervis.transform import rigid
from intervis.uses import (
    PosedScan,
    VoxelGrid,
    bev_grid,
    blind_spots,
    masks_of,
    visibility_grid,
)
from intervis.uses.voxels.camera_voxels import PosedCamera
from intervis.uses.voxels.masks import DEFINITIONS


def warm_up(*, progress: Progress | None = None) -> None:
    """Compile the kernels of method, sight lines and voxels, or load them from the cache on disk.

    Without it the first analysis and the first sight line of a process take that time: about a
    minute for all kernels where nothing has been compiled yet, about a second afterwards.

    Parameters
    ----------
    progress : callable, optional
        Called after each of the `PARTS`.

    Examples
    --------
    >>> import intervis
    >>> intervis.warm_up()
    """
    report = reporter(progress)
    for name, part in PARTS.items():
        part()
        report(name)


@contextmanager
def compiling(part: str) -> Iterator["subprocess.Popen[bytes]"]:
    """Compile one of the `PARTS` in a process of its own, beside other work.

    The process is waited for at the end; where the other work fails, it is ended.
    """
    program = f"from intervis.compilation import PARTS; PARTS[{part!r}]()"
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.DEVNULL) as process:
        try:
            yield process
        except BaseException:
            process.kill()
            raise


def _method() -> None:
    """Analyse a small scan, from all returns and from a few."""
    points = _returns()
    for kind in (np.float32, np.float64):
        analyze(points.astype(kind), settings=Settings(tau=8))
        for settings in (Settings(tau=1), Settings(tau=8)):
            analyze(
                points.astype(kind),
                camera=Camera(np.eye(3, 4), 2, 2, "warm"),
                cam_from_velo=rigid([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0, 0, 0]),
                settings=settings,
            )


def _sight() -> None:
    """Ask all that a scene answers, of scans with and without times."""
    points = _returns()
    still = Scene.from_scan(points.astype(np.float32))
    explain(still, [0, 0, 0], [30, 0, 0])
    blind_spots(visibility_grid(still, [0, 0, 0], points, reach_m=6.0))
    scene = Scene()
    for second in range(3):
        scene.add(points, rigid(np.eye(3), [0.3 * second, 0, 0]), float(second))
    scene.sight([0, 0, 0], points[::50], moment_s=1.0)
    scene.sight_within([[0, 0, 0]], points[::50], 12.0)
    scene.sight_boxes([0, 0, 0], [rigid(np.eye(3), [25.0, 0, 0])], [[4.0, 2.0, 1.5]])
    unobserved_parts(scene.packed_scans(), np.zeros((1, 3)), points[:1], 4)
    scene.ground_height(points[::50, :2])
    for kind in (np.float32, np.float64):
        visible_mask(points.astype(kind), [0, 0, 0])


def _voxels() -> None:
    """Carve a small grid by two scans, and follow beams through it."""
    grid = VoxelGrid(corner=(0.0, -3.0, -2.0), cell_m=0.5, shape=(12, 12, 8))
    points = _returns()
    labels = np.full(len(points), 50, np.uint16)
    scans = [PosedScan(points.astype(np.float32), np.eye(4), labels=labels) for _ in range(2)]
    camera = PosedCamera(
        Camera(np.eye(3, 4), 2, 2, "warm"), rigid([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0, 0, 0])
    )
    for definition in DEFINITIONS:
        seen = {} if definition == "semantickitti" else {"camera": camera}
        masks_of(grid, scans, definition=definition, cameras=seen)
    bev_grid([(points, None)], reach_m=6.0)


def _returns() -> Float64Array:
    """(N, 3) returns from a street with a wall across it, metres."""
    azimuth, elevation = np.meshgrid(np.radians(np.arange(-180, 180)), np.linspace(-0.4, 0.1, 32))
    x, y, z = np.cos(azimuth), np.sin(azimuth), np.tan(elevation)
    reach_m = 1.7 / np.maximum(-z, 0.04)  # to the ground, or 42 m
    reach_m = np.minimum(reach_m, np.where(x > 0.1, 20.0 / np.maximum(x, 0.1), np.inf))
    points = reach_m[..., None] * np.stack([x, y, z], axis=-1)
    return np.asarray(points.reshape(-1, 3))


PARTS: dict[str, Callable[[], None]] = {
    "method": _method,
    "sight lines": _sight,
    "voxels": _voxels,
}
"""What is compiled together."""
