"""What does a tilted scanner at the side see that the scanner on the roof does not?

python examples/two_scanners.py [DRIVE]    # a drive with several scanners, for example nuScenes
"""

import sys
import tempfile

import numpy as np

import intervis


def main(drive: intervis.Drive) -> None:
    frame = drive[drive.frame_numbers[0]]
    for scan in frame.scans:
        world = scan.points @ scan.pose[:3, :3].T + scan.pose[:3, 3]
        ahead, left, up = ((world - frame.pose[:3, 3]) @ frame.pose[:3, :3]).T
        beside = (np.abs(ahead) < 2.5) & (left > 0.9) & (left < 3.0) & (up < -1.0)
        print(f"{scan.name}: {len(scan.points):,} returns, {beside.sum():,} beside the left doors")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(intervis.open_drive(sys.argv[1]))
    else:
        from intervis.lab.worlds import simulate_drive

        with tempfile.TemporaryDirectory() as folder:
            scanners = ["hdl-32e", "qt64@left"]
            path = simulate_drive(folder, "nuscenes", scanners, frames=1, images=False)
            main(intervis.open_drive(path))
