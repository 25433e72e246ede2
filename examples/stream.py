"""Scans arrive in one thread; another one asks what is visible, at the same time.

python examples/stream.py [DRIVE]
"""

import sys
import tempfile
import threading

import numpy as np

import intervis


def main(drive: intervis.Drive) -> None:
    stream = intervis.Stream(max_scans=10)
    frames = [drive[number] for number in drive.frame_numbers[:6]]
    stream.push(frames[0].points, frames[0].pose, frames[0].timestamp_s)
    ahead = frames[0].pose[:3, 3] + [20.0, 0.0, -1.0]
    targets = ahead + np.random.default_rng(0).uniform([-9, -9, 0], [9, 9, 1], (5000, 3))

    def push() -> None:
        for frame in frames[1:]:
            stream.push(frame.points, frame.pose, frame.timestamp_s)

    scanner = threading.Thread(target=push)
    scanner.start()
    print("while scans arrive:", stream.sight(frames[0].pose[:3, 3], targets))
    scanner.join()
    print("with all of them:  ", stream.sight(frames[0].pose[:3, 3], targets))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(intervis.open_drive(sys.argv[1]))
    else:
        from intervis.lab.worlds import simulate

        with tempfile.TemporaryDirectory() as folder:
            main(intervis.open_drive(simulate(folder, frames=6, images=False)))
