"""How often a scan without a pose shows where up is, over scanners, mounts and generated worlds.

``python tools/up_without_pose.py --seeds 4 5`` prints the table of docs/accuracy.md: for each mount
the scans that were taken as upright, those whose estimated direction is within 3 degrees of the
true one, within 11 (the road of a world rises by 8.5), and the wrong ones.
"""

import argparse
from collections import Counter

import numpy as np

from intervis.lab.truth.cells import Cell, cells, random_of, scan_of
from intervis.lab.worlds.places import PLACES, Place
from intervis.sight.gravity import up_of_scan
from intervis.sight.projected_scan import project_scan

HEADS = ("taken as upright", "within 3 degrees", "within 11 degrees", "wrong")


def outcome(cell: Cell, place: Place, seed: int) -> str:
    """What becomes of the up of one scan: one of `HEADS`."""
    scan = scan_of(cell, place, random_of(cell, seed))
    found = up_of_scan(project_scan(scan.points))
    if found is None:
        return HEADS[0]
    cosine = float(found @ scan.pose[2, :3])  # row z of the pose: the scene's z in scanner axes
    off_deg = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return HEADS[1] if off_deg < 3.0 else HEADS[2] if off_deg < 11.0 else HEADS[3]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[4, 5])
    counts: dict[str, Counter[str]] = {}
    for seed in parser.parse_args().seeds:
        places = {world: make(seed) for world, make in PLACES.items()}
        for cell in cells():
            name = f"{cell.mount}, single ring" if cell.scanner == "ring" else cell.mount
            found = outcome(cell, places[cell.world], seed)
            counts.setdefault(name, Counter())[found] += 1
            if found == HEADS[3]:
                print(f"wrong: {cell.scanner}, {cell.mount}, {cell.world}, seed {seed}")
    print(f"| mount | scans | {' | '.join(HEADS)} |")
    print("|---|--:|" + "--:|" * len(HEADS))
    for name, of_mount in counts.items():
        numbers = " | ".join(str(of_mount[head]) for head in HEADS)
        print(f"| {name} | {sum(of_mount.values())} | {numbers} |")


if __name__ == "__main__":
    main()
