"""Draw the mix-planes calculation structure (MPCS) of the paper's Sec. 2.3 as two SVG files.

python tools/draw_mpcs.py docs/images

``mpcs.svg`` shows the star of a node with the planes, lines and angles that the text names,
``mpcs_lines.svg`` lines 6 and 8 of Algorithm 1 in section. Places are chosen; the centroid and the
angle theta_1 are computed from them by Eq. 14 and Eq. 13.
"""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intervis.method.mesh import build_mesh, star_centroids
from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, REGION

VIEWPOINT = np.array([0.0, 0.0, 3.2])
STAR = np.array(
    [
        [6.2, 0.0, 0.7],  # the node i
        [9.0, 1.2, 2.1],  # j, beyond it
        [7.3, 3.3, 1.0],
        [4.6, 2.0, 0.35],
        [4.1, -0.9, 0.1],
        [6.4, -2.6, 0.4],
        [9.7, -1.9, 0.8],
    ]
)
RIGHT_AND_UP = np.array([[64.0, 0.0], [25.0, -22.0], [0.0, -58.0]])
"""Pixels right and down for a step along x, y (away from the reader) and z."""
ORIGIN = np.array([40.0, 226.0])

Places = NDArray[np.float64]
Pixel = tuple[float, float]


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("out", type=Path, help="the folder to write to")
    folder = parser.parse_args().out
    (folder / "mpcs.svg").write_text(svg(720, 300, structure()), encoding="utf-8")
    (folder / "mpcs_lines.svg").write_text(svg(720, 250, sections()), encoding="utf-8")
    return 0


def structure() -> list[str]:
    """The star of node i in space, with planes, lines and angles."""
    mesh = build_mesh(STAR[:, :2])
    centroid = star_centroids(mesh, STAR)[0]
    node, beyond = STAR[0], STAR[1]
    sight = unit(VIEWPOINT - node)
    across = np.array([sight[2], 0.0, -sight[0]])  # upwards, at right angles to l3
    side = np.array([0.0, 1.0, 0.0])
    upright = np.array([[0.0, 0, -0.4], [9.9, 0, -0.4], [9.9, 0, 3.6], [0, 0, 3.6]])
    low, high, half = node - 1.1 * across, node + 1.9 * across, 1.9 * side
    parts = [polygon([low, low + half, high + half, high], INTERVISIBLE, 0.16)]
    parts += [polygon(upright, "#7a8290", 0.13)]
    parts += [polygon(STAR[corners], REGION, 0.5, FAINT) for corners in mesh.triangles]
    parts += [polygon([low - half, low, high, high - half], INTERVISIBLE, 0.16)]
    parts += [line(STAR[a], STAR[b], "#8a6a1a", 1.2) for a, b in mesh.edges]
    parts += [
        line(VIEWPOINT, node, INK, 2.4),
        line(node, beyond, NODE, 2.8),
        line(node, centroid, INK, 1.6, "4 3"),
        arc(node, unit(VIEWPOINT - node), unit(beyond - node), 0.95),
        corner(node, sight, across, 0.34),
    ]
    parts += [dot(place, "#8a6a1a", 4) for place in STAR[2:]]
    parts += [dot(VIEWPOINT, INK, 6), dot(node, INK, 6), dot(beyond, NODE, 6)]
    parts += [dot(centroid, "white", 4.5, INK)]
    parts += [
        label(VIEWPOINT, "P₀", (12, 0)),
        label(node, "i", (-8, 26), style="italic"),
        label(beyond, "j", (12, 4), NODE, "italic"),
        label(centroid, "G", (9, 6), subscript="c"),
        label((VIEWPOINT + node) / 2, "l₃", (-18, 24), style="italic"),
        label((node + beyond) / 2, "l₁", (14, 22), NODE, "italic"),
        label(node + 0.95 * across, "θ₁", (26, 2)),
        label(node + 0.34 * sight, "θ₂ = 90°", (-120, 30)),
        label(upright[2], "P", (-28, 24), "#5b6370", "italic", "v"),
        label(high + half, "P", (8, 6), INTERVISIBLE, "italic", "i"),
        label(STAR[6], "P", (-70, 4), "#8a6a1a", "italic", "a"),
    ]
    return parts


def sections() -> list[str]:
    """Lines 6 and 8 in the upright plane through P0 and i: what each adds."""
    parts: list[str] = []
    for left, title, far, j, text in (
        (0, "line 6", 100, (278, 118), ("beyond i, and seen", "under a larger angle")),
        (360, "line 8", 140, (146, 214), ("in front of i, and seen", "under a smaller angle")),
    ):
        eye, i = (left + 40, 96), (left + 206, 178)
        end = (left + j[0], j[1])
        parts += [
            f'<path d="M{left + 20} 236 Q{left + 120} 232 {i[0]} {i[1]} T{left + 330} {far}"'
            f' fill="none" stroke="{REGION}" stroke-width="5" stroke-linecap="round"/>',
            stroke(eye, i, INK, 2.0),
            stroke(eye, end, NODE, 1.6, "5 4"),
            stroke(i, end, NODE, 2.6),
            stroke(*trace(eye, i, 62), INTERVISIBLE, 1.6, "2 4"),
            spot(eye, INK, 6),
            spot(i, INK, 6),
            spot(end, NODE, 6),
            words((left + 20, 30), title, INK, weight="bold"),
            words((left + 92, 30), text[0], INK),
            words((left + 92, 50), text[1], INK),
            words((eye[0] - 8, eye[1] - 14), "P₀", INK),
            words((i[0] + 2, i[1] + 26), "i", INK, "italic"),
            words((end[0] + 4, end[1] + 26), "j", NODE, "italic"),
        ]
    return parts


def trace(eye: Pixel, i: Pixel, reach: float) -> tuple[Pixel, Pixel]:
    """The trace of plane P_i: through i, at right angles to the line from the viewpoint."""
    along = unit(np.subtract(i, eye).astype(np.float64))
    right, down = float(reach * along[1]), float(-reach * along[0])
    return (i[0] - 0.75 * right, i[1] - 0.75 * down), (i[0] + right, i[1] + down)


def unit(vector: Places) -> Places:
    """A vector of length 1."""
    direction: Places = vector / np.linalg.norm(vector)
    return direction


def on_paper(places: Iterable[Places] | Places) -> Places:
    """(K, 2) pixels of (K, 3) places."""
    paper: Places = np.asarray(list(places)) @ RIGHT_AND_UP + ORIGIN
    return paper


def path_of(places: Iterable[Places] | Places) -> str:
    """Places as the points of a polygon or polyline."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in on_paper(places))


def polygon(places: Iterable[Places], colour: str, opacity: float, rim: str = "none") -> str:
    """A filled polygon in space."""
    edge = f'stroke="{colour}" stroke-opacity="0.5"' if rim == "none" else f'stroke="{rim}"'
    return f'<polygon points="{path_of(places)}" fill="{colour}" fill-opacity="{opacity}" {edge}/>'


def line(a: Places, b: Places, colour: str, width: float, dashes: str = "") -> str:
    """A straight line in space."""
    (x1, y1), (x2, y2) = on_paper([a, b])
    return stroke((x1, y1), (x2, y2), colour, width, dashes)


def stroke(a: Pixel, b: Pixel, colour: str, width: float, dashes: str = "") -> str:
    """A straight line on paper."""
    dash = f' stroke-dasharray="{dashes}"' if dashes else ""
    ends = f'x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"'
    return f'<line {ends} stroke="{colour}" stroke-width="{width}" stroke-linecap="round"{dash}/>'


def arc(centre: Places, start: Places, end: Places, radius: float) -> str:
    """The arc of an angle between two unit vectors."""
    angle = float(np.arccos(np.clip(start @ end, -1, 1)))
    other = unit(end - (start @ end) * start)
    turned = np.linspace(0, angle, 40)[:, None]
    places = centre + radius * (np.cos(turned) * start + np.sin(turned) * other)
    return f'<polyline points="{path_of(places)}" fill="none" stroke="{INK}" stroke-width="1.6"/>'


def corner(centre: Places, a: Places, b: Places, size: float) -> str:
    """The mark of a right angle."""
    places = [centre + size * a, centre + size * (a + b), centre + size * b]
    return f'<polyline points="{path_of(places)}" fill="none" stroke="{INK}" stroke-width="1.4"/>'


def dot(place: Places, colour: str, radius: float, rim: str = "white") -> str:
    """A node."""
    ((x, y),) = on_paper([place])
    return spot((x, y), colour, radius, rim)


def spot(at: Pixel, colour: str, radius: float, rim: str = "white") -> str:
    """A disc on paper."""
    place = f'cx="{at[0]:.1f}" cy="{at[1]:.1f}"'
    return f'<circle {place} r="{radius}" fill="{colour}" stroke="{rim}" stroke-width="1.4"/>'


def label(
    place: Places,
    text: str,
    shift: Pixel,
    colour: str = INK,
    style: str = "normal",
    subscript: str = "",
) -> str:
    """A word beside a place in space."""
    ((x, y),) = on_paper([place])
    return words((x + shift[0], y + shift[1]), text, colour, style, subscript=subscript)


def words(
    at: Pixel,
    text: str,
    colour: str,
    style: str = "normal",
    weight: str = "normal",
    subscript: str = "",
) -> str:
    """A word on paper."""
    low = f'<tspan dy="5" font-size="13">{subscript}</tspan>' if subscript else ""
    look = f'fill="{colour}" font-style="{style}" font-weight="{weight}"'
    return f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" {look}>{text}{low}</text>'


def svg(width: int, height: int, parts: Iterable[str]) -> str:
    """A picture on white, so that it can be read on dark pages as well."""
    content = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
        f' width="{width}" height="{height}" font-family="sans-serif" font-size="18">\n'
        f'<rect width="{width}" height="{height}" fill="white"/>\n{content}\n</svg>\n'
    )


if __name__ == "__main__":
    sys.exit(main())
