"""Which returns of a scan does another place see, and why is one hidden?

python examples/visible_returns.py [DRIVE]
"""

import sys
import tempfile

import intervis


def main(drive: intervis.Drive) -> None:
    frame = drive[drive.frame_numbers[0]]
    scene = intervis.Scene.from_scan(frame.points)
    ahead = [8.0, 0.0, 0.0]  # sensor frame: x forward, y left, z up, metres
    sight = scene.sight(ahead, frame.points)
    print(sight)
    hidden = frame.points[sight.occluded]
    if len(hidden):
        print(intervis.explain(scene, ahead, hidden[len(hidden) // 2]))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(intervis.open_drive(sys.argv[1]))
    else:
        from intervis.lab.worlds import simulate

        with tempfile.TemporaryDirectory() as folder:
            main(intervis.open_drive(simulate(folder, frames=1, images=False)))
