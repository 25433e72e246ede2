"""Files of visibility grids: NPZ, and PGM with YAML as ROS's map_server reads them."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np

from intervis.errors import OutputError
from intervis.files import write_bytes, write_text
from intervis.uses.visibility_grid import VisibilityGrid

FREE, UNSEEN, FILLED = 254, 205, 0
"""Grey values of map_server: free, unknown and occupied."""

YAML = """image: {image}
resolution: {resolution}
origin: [{x:.6f}, {y:.6f}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def save_grid(path: Path, grid: VisibilityGrid) -> None:
    """Write a grid in the format of the ending.

    ``.npz`` holds all arrays by the names of `VisibilityGrid`. ``.pgm`` is an image with north (y)
    up: visible cells are free, cells with obstacles occupied, all others unknown; the file of the
    same name with ``.yaml`` tells resolution and origin.

    Raises
    ------
    OutputError
        The ending is another one, or the file cannot be written.
    """
    _writer(path)(path, grid)


def check_grid_file(path: Path | None) -> None:
    """Raise where `save_grid` cannot write a file of this name.

    Raises
    ------
    OutputError
        The ending is none of those.
    """
    if path is not None:
        _writer(path)


def _writer(path: Path) -> Callable[[Path, VisibilityGrid], None]:
    ending = path.suffix.lower()
    if ending not in _WRITERS:
        raise OutputError(f"a grid is written as {' or '.join(_WRITERS)}: {path} is neither.")
    return _WRITERS[ending]


def _save_npz(path: Path, grid: VisibilityGrid) -> None:
    file = io.BytesIO()
    np.savez(
        file,
        viewpoint=grid.viewpoint,
        corner=grid.corner,
        cell_m=grid.cell_m,
        height_m=grid.height_m,
        state=grid.state,
        probability=grid.probability,
        blocker=grid.blocker,
        ground_m=grid.ground_m,
        obstacle=grid.obstacle,
    )
    write_bytes(path, file.getvalue())


def _save_pgm(path: Path, grid: VisibilityGrid) -> None:
    grey = np.where(grid.state == 1, FREE, UNSEEN).astype(np.uint8)
    grey[grid.obstacle] = FILLED
    image = grey.T[::-1]  # rows from the largest y down, columns along x
    rows, columns = image.shape
    write_bytes(path, f"P5\n{columns} {rows}\n255\n".encode() + image.tobytes())
    x, y = grid.corner
    text = YAML.format(image=path.name, resolution=grid.cell_m, x=x, y=y)
    write_text(path.with_suffix(".yaml"), text)


_WRITERS = {".npz": _save_npz, ".pgm": _save_pgm}
