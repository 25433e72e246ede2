"""Draw what each preset of `intervis simulate` sees at one place of the street, from above.

python tools/draw_scanners.py docs/images/simulated_scanners.png
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from intervis.lab.worlds.mounted_scanner import mounted
from intervis.lab.worlds.presets import PRESETS
from intervis.lab.worlds.simulated_drive import SimulatedDrive
from intervis.lab.worlds.street.layout import build_street
from intervis.plots.style import SEQUENTIAL, dots, page_figure, save_figure
from intervis.transform import transform

FRAME, REACH_M = 30, 30.0
SHOWN = (*sorted(PRESETS), "pandar64@mast", "qt64@right")


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("out", type=Path, help="the .png to write")
    arguments = parser.parse_args()
    world = build_street(0)
    with page_figure(5.2, nrows=3, ncols=4, sharex=True, sharey=True) as (figure, grid):
        for axes, text in zip(grid.ravel(), SHOWN, strict=True):
            scanner = mounted(text)
            drive = SimulatedDrive.of(world, [scanner])
            (scan,) = drive.frame(0 if scanner.is_on_ground else FRAME).scans
            points = transform(scanner.ego_from_scanner, scan.points)
            points = points[np.abs(points[:, :2]).max(axis=1) < REACH_M]
            drawn = dots(axes, points, c=points[:, 2], s=0.15, cmap=SEQUENTIAL, vmin=0, vmax=4)
            drawn.set_rasterized(True)
            axes.set(xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M), aspect="equal")
            axes.set_title(f"{scanner.preset.name}@{scanner.mount}")
        bar = figure.colorbar(drawn, ax=grid, shrink=0.4)
        bar.set_label("height above the ground, m", fontsize=7.0)
        save_figure(figure, arguments.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
