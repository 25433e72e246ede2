"""Draw the steps of the paper's method on one frame of the built-in street, from above.

python tools/draw_method.py docs/images/method_steps.png
"""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

from intervis.drives import Frame, open_drive
from intervis.lab.worlds import simulate
from intervis.method.analysis import Analysis, analyze
from intervis.plots.figures import draw_intervisibility, draw_surface
from intervis.plots.style import (
    FAINT,
    SEQUENTIAL,
    colour_bar,
    dots,
    legend_below,
    mark_viewpoint,
    page_figure,
    save_figure,
)
from intervis.settings import Settings
from page_screenshot import reduce_colours

FRAME = 4
X_M, Y_M = (-1.0, 33.0), (-11.0, 11.0)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("out", type=Path, help="the .png to write")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        frame = open_drive(simulate(folder, frames=FRAME + 1, images=False))[FRAME]
        draw(arguments.out, frame)
    reduce_colours(arguments.out)
    return 0


def draw(out: Path, frame: Frame) -> None:
    """Four panels: returns in view and nodes, surface, finite elements, intervisible points."""
    result = analyze(
        frame.points,
        camera=frame.camera,
        cam_from_velo=frame.cam_from_velo,
        settings=Settings(tau=35),
    )
    with page_figure(4.9, nrows=2, ncols=2) as (figure, grid):
        sampling, surface, mesh, chosen = grid.ravel()
        draw_sampling(sampling, frame, result)
        draw_surface(surface, result)
        draw_mesh(mesh, result)
        draw_intervisibility(chosen, result)
        titles = (
            f"1  Field of view and sampling: {len(result.nodes)} nodes",
            "2  Manifold auxiliary surface",
            f"3  Finite elements: {len(result.triangles)} triangles",
            "4  Points, edges and region",
        )
        for axes, title in zip(grid.ravel(), titles, strict=True):
            axes.set(title=title, xlim=X_M, ylim=Y_M, xlabel="x forward, m", ylabel="y left, m")
            axes.set(aspect="equal", anchor="N")
        surface.collections[-1].set_clim(0.0, X_M[1])  # of the nodes that are shown
        legend_below(figure, chosen, columns=6)
        save_figure(figure, out)


def draw_sampling(axes: Any, frame: Frame, result: Analysis) -> None:
    """The returns in view, and those that are nodes."""
    returns = frame.points[result.in_view]
    dots(axes, returns, s=0.3, color=FAINT).set_rasterized(True)
    shown = dots(axes, result.node_points, c=result.node_points[:, 2], s=5, cmap=SEQUENTIAL)
    mark_viewpoint(axes, result.viewpoint)
    colour_bar(axes, shown, "elevation z, m")


def draw_mesh(axes: Any, result: Analysis) -> None:
    """The triangles over the ground."""
    ground = result.node_points[:, :2]
    axes.triplot(*ground.T, result.triangles, color="#5b6370", linewidth=0.4)
    mark_viewpoint(axes, result.viewpoint)


if __name__ == "__main__":
    sys.exit(main())
