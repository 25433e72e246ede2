"""Which voxels around a frame are free, occupied, occluded or unknown, and what its camera sees.

python examples/voxel_masks.py [DRIVE]
"""

import sys
import tempfile

import intervis
from intervis.uses import MaskSettings, VoxelGrid, bev_grid, frame_masks


def main(drive: intervis.Drive) -> None:
    number = drive.frame_numbers[0]
    grid = VoxelGrid(corner=[0.0, -12.8, -2.0], cell_m=0.2, shape=(128, 128, 20))
    cameras = {drive.camera_name: drive} if drive.camera_name else {}
    masks = frame_masks(drive, number, MaskSettings(grid, later=3), cameras)
    for name in ("free", "occupied", "occluded", "invalid"):
        print(f"{name:>9}: {getattr(masks, name).mean():6.1%} of the voxels")
    for name, seen in masks.camera.items():
        print(f"{name} sees {seen.sum() / masks.mask_lidar.sum():.0%} of what the scans observed")

    print(bev_grid([(drive[number].points, None)], reach_m=30.0, cell_m=0.2))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(intervis.open_drive(sys.argv[1]))
    else:
        from intervis.lab.worlds import simulate

        with tempfile.TemporaryDirectory() as folder:
            main(intervis.open_drive(simulate(folder, frames=4, images=False)))
