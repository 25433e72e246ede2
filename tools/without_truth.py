"""Answers without a class of returns against the built-in street, whose triangles are known.

    python tools/without_truth.py [--seeds 3]

Lines run from some places to the returns that are left. Those that the class occludes as scanned
are asked again without it, and cast at the street without the triangles of that class.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intervis.arrays import BoolArray, Float64Array
from intervis.drives import Drive, open_drive
from intervis.lab.worlds import load_world, simulate
from intervis.lab.worlds.mounted_scanner import mounted
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.lab.worlds.triangles import LABELS
from intervis.plots.tables import Table
from intervis.transform import transform
from intervis.uses import labelled_scene

CLASSES = {
    "car": (("car", "moving-car"), ("car", "glass")),
    "vegetation": (("vegetation",), ("vegetation",)),
    "vegetation, trunk": (("vegetation", "trunk"), ("vegetation", "trunk")),
}
"""What is left out: classes of returns, and of the street's triangles."""

FRAMES, ASKED = 18, (0, 8, 17)
PLACES = ((8.0, 2.5, 0.5), (12.0, 0.0, 0.0), (5.0, -2.0, 0.3))
EVERY = 3
"""One of so many returns is a target."""

MARGIN_M = 0.4
"""A surface so near to the end of a line does not occlude it."""


class Counts(NamedTuple):
    """Lines behind a class: how many, their answers without it, how many visible ones are wrong."""

    lines: int
    visible: int
    wrong: int
    occluded: int
    unknown: int


def counts(drive: Drive, name: str, number: int, others: tuple[int, ...]) -> Iterator[Counts]:
    """Counts from each place of a frame."""
    returns, surfaces = CLASSES[name]
    triangles, labels, _ = load_world(drive.root).triangles_at_frame(number)
    gone = np.isin(labels, [LABELS[surface] for surface in surfaces])
    caster, pose = RayCaster(triangles[~gone]), drive[number].pose
    assert pose is not None
    whole = labelled_scene(drive, number, frames=others)
    cut = labelled_scene(drive, number, frames=others, without=returns)
    targets = cut.targets[::EVERY]
    for place in PLACES:
        before = whole.blocker_classes(whole.sight(place, targets))
        behind = np.isin(before, returns)
        after = cut.sight(place, targets[behind])
        is_open = _open(caster, transform(pose, np.array(place)), transform(pose, targets[behind]))
        masks = (behind, after.visible, after.visible & ~is_open, after.occluded, after.unknown)
        yield Counts(*(int(mask.sum()) for mask in masks))


def _open(caster: RayCaster, start: Float64Array, ends: Float64Array) -> BoolArray:
    """Which lines from a start to ends (L, 3), world frame, no triangle occludes."""
    length_m = np.linalg.norm(ends - start, axis=1)
    directions = (ends - start) / length_m[:, None]
    starts = np.broadcast_to(start, directions.shape)
    range_m, _ = caster.closest(starts, directions, float(length_m.max(initial=1.0)))
    return np.asarray(~(range_m < length_m - MARGIN_M))


def report(seeds: int) -> Table:
    """Counts over all seeds, frames and places."""
    found: dict[tuple[str, int], list[Counts]] = {}
    for seed in range(seeds):
        with tempfile.TemporaryDirectory() as folder:
            root = simulate(
                Path(folder), frames=FRAMES, seed=seed, scanner=mounted("vlp-16"), images=False,
                labels=True,
            )  # fmt: skip
            drive = open_drive(root)
            for name in CLASSES:
                for others in ((), tuple(range(FRAMES))):
                    for number in ASKED:
                        key = name, len({number, *others})
                        found.setdefault(key, []).extend(counts(drive, name, number, others))
    rows = [_row(name, scans, parts) for (name, scans), parts in found.items()]
    heads = ("without", "scans", "lines behind it", "visible", "wrong", "occluded", "unknown")
    return Table(f"Lines behind a class, {seeds} streets", heads, tuple(rows))


def _row(name: str, scans: int, parts: list[Counts]) -> tuple[str, ...]:
    total = Counts(*np.sum(parts, axis=0).tolist())
    shares = (total.visible, total.occluded, total.unknown)
    visible, occluded, unknown = (f"{100 * part / total.lines:.0f} %" for part in shares)
    wrong = f"{100 * total.wrong / max(total.visible, 1):.1f} %"
    return name, str(scans), f"{total.lines:,}", visible, wrong, occluded, unknown


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(description="Answers without a class against known triangles.")
    parser.add_argument("--seeds", type=int, default=3)
    print(report(parser.parse_args().seeds).as_markdown())


if __name__ == "__main__":
    main()
