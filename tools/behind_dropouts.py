"""What the engine says of points behind the surfaces that dropouts interrupt.

A dropout is a beam without a return between two returns of one surface
(`intervis.sight.range_image`). For one frame of each drive, lines from the scanner to points 1.5 m
behind these surfaces, 2 to 40 m away: how many are visible, occluded and unknown.

``python tools/behind_dropouts.py DRIVE[:FRAME] ...``
"""

import argparse
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives import Frame, open_drive
from intervis.plots.figures import draw_image, pixels_of
from intervis.plots.style import dots, legend_below, page_figure, save_figure
from intervis.plots.tables import Table
from intervis.sight import Scene
from intervis.sight.kernels.pixel import is_dropout
from intervis.sight.kernels.projection import FULL_CIRCLE, pseudo_azimuth

BEHIND_M, RANGE_M, MOST = 1.5, (2.0, 40.0), 20_000
HEADS = (
    *("drive", "frame", "dropouts of the observed pixels", "lines"),
    *("visible", "occluded", "unknown", "mean P(visible)"),
)


def targets(scene: Scene, behind_m: float = BEHIND_M) -> tuple[Float64Array, float]:
    """Points (K, 3) behind the dropouts of a scene of one scan, and the share of dropouts."""
    scans = scene.packed_scans()
    rows, columns = int(scans.rows[0]), int(scans.columns[0])
    pixels = scans.pixels[: rows * columns].reshape(columns, rows)
    column, row = np.nonzero(np.vectorize(is_dropout, otypes=[bool])(pixels))
    elevation = scans.elevation_from[0] + row / scans.rows_per_unit[0]
    planar_m = -pixels[column, row].astype(np.float64) * scans.unit_m[0]
    angle = np.linspace(0.0, 2.0 * np.pi, 36_001)
    turned = np.array([pseudo_azimuth(np.cos(one), np.sin(one)) for one in angle[:-1]])
    azimuth = np.interp((column + 0.5) * FULL_CIRCLE / columns, [*turned, FULL_CIRCLE], angle)
    kept = (np.abs(elevation) < 1.0) & (planar_m > RANGE_M[0]) & (planar_m < RANGE_M[1])
    count = int(np.count_nonzero(kept))
    kept &= np.random.default_rng(0).permutation(len(kept)) < MOST * len(kept) / max(count, 1)
    rho, e, a = planar_m[kept] + behind_m, elevation[kept], azimuth[kept]
    share = len(row) / max(int(np.count_nonzero(pixels)), 1)
    return np.column_stack([rho * np.cos(a), rho * np.sin(a), rho * e]), share


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Lines to points behind dropouts.")
    parser.add_argument("drives", nargs="+", metavar="DRIVE[:FRAME]")
    parser.add_argument("--picture", type=Path, help="PNG: dropouts on the camera images")
    options = parser.parse_args()
    rows, frames = [], []
    for text in options.drives:
        folder, _, number = text.partition(":")
        drive = open_drive(Path(folder))
        frame = drive[int(number) if number else drive.frame_numbers[0]]
        frames.append(frame)
        scene = Scene.from_scan(frame.points)
        points, share = targets(scene)
        sight = scene.sight([0.0, 0.0, 0.0], points)
        states = (sight.visible, sight.occluded, sight.unknown)
        rows.append(
            (
                *(drive.name, str(frame.number), f"{100 * share:.1f} %", f"{len(points):,}"),
                *(f"{100 * mask.mean():.1f} %" for mask in states),
                f"{sight.probability.mean():.2f}",
            )
        )
    print(Table("Lines to points behind dropouts", HEADS, tuple(rows)).as_text())
    if options.picture is not None:
        draw(frames, options.picture)


def draw(frames: list[Frame], path: Path) -> None:
    """The surfaces that dropouts interrupt, on the camera image of each frame."""
    with page_figure(2.5 * len(frames), nrows=len(frames), squeeze=False) as (figure, axes):
        for axis, frame in zip(axes[:, 0], frames, strict=True):
            surfaces, _ = targets(Scene.from_scan(frame.points), 0.0)
            draw_image(axis, frame)
            positions, _ = pixels_of(frame, surfaces)
            limits = axis.get_xlim(), axis.get_ylim()
            dots(axis, positions, s=1.5, color="#d81b60", label="dropouts")
            axis.set(xlim=limits[0], ylim=limits[1])
        legend_below(figure, axes[-1, 0])
        save_figure(figure, path)


if __name__ == "__main__":
    main()
