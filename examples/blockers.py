"""What hides the returns of a scan, by class, and what would be seen if the cars were gone?

python examples/blockers.py [DRIVE [CLASS ...]]
"""

import sys
import tempfile

import intervis
from intervis.uses import blocker_shares, labelled_scene


def main(drive: intervis.Drive, classes: list[str]) -> None:
    number = drive.frame_numbers[0]
    whole = labelled_scene(drive, number)
    without = labelled_scene(drive, number, without=classes)
    place, targets = [8.0, 2.5, 0.5], without.targets  # sensor frame, metres
    before, after = whole.sight(place, targets), without.sight(place, targets)
    behind = whole.blocker_classes(before)
    for name, share in list(blocker_shares(behind).items())[:5]:
        print(f"{100 * share:4.1f} % of the occluded lines: {name}")
    print(f"as scanned: {before}")
    print(f"without {', '.join(classes)}: {after}")
    opened = after.visible & before.occluded
    print(
        f"{opened.sum():,} occluded lines become visible; where nothing was seen they are unknown"
    )


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(intervis.open_drive(sys.argv[1]), sys.argv[2:])
    else:
        from intervis.lab.worlds import simulate

        with tempfile.TemporaryDirectory() as folder:
            root = simulate(folder, frames=1, images=False, labels=True)
            main(intervis.open_drive(root), ["parked car", "moving-car"])
