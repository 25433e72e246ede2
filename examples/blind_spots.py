"""Where around the vehicle could a person stand unseen?

python examples/blind_spots.py [DRIVE]
"""

import sys
import tempfile

import intervis
from intervis.uses import blind_spots, visibility_grid


def main(drive: intervis.Drive) -> None:
    frame = drive[drive.frame_numbers[0]]
    scene = intervis.Scene.from_scan(frame.points)
    grid = visibility_grid(scene, [0, 0, 0], frame.points, reach_m=30.0, height_m=1.0)
    for spot in blind_spots(grid)[:8]:
        hides = spot.hides or "nothing large"
        print(f"{spot.nearest_m:5.1f} m away: {spot.area_m2:7.1f} m2, could hide: {hides}")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(intervis.open_drive(sys.argv[1]))
    else:
        from intervis.lab.worlds import simulate

        with tempfile.TemporaryDirectory() as folder:
            main(intervis.open_drive(simulate(folder, frames=1, images=False)))
