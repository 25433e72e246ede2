"""Write what intervis reads of a drive as plain arrays in the world's frame (.npz).

`tools/judge_layouts.py` compares them with what a data set's own kit reads. Per frame and scanner:
points and origin in the world, intensities; per camera: pixels of the main scanner's points, digest
of the image; boxes: corners in the world, categories, tracks, numbers of returns.

    python tools/dump_drive.py DRIVE OUT.npz
"""

import argparse
import hashlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.drives import Drive, Frame, open_drive
from intervis.transform import transform

SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("drive", type=Path, help="what intervis.open_drive takes")
    parser.add_argument("out", type=Path, help="the .npz to write")
    arguments = parser.parse_args()
    arrays = dumped(open_drive(arguments.drive))
    with arguments.out.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    print(f"{arguments.out}: {len(arrays)} arrays")
    return 0


def dumped(drive: Drive) -> dict[str, NDArray[Any]]:
    """Arrays by names like ``3/scan/LIDAR_TOP/points_world``."""
    arrays: dict[str, NDArray[Any]] = {"frames": np.array(drive.frame_numbers)}
    for number in drive.frame_numbers:
        frame = drive[number]
        arrays[f"{number}/time_ns"] = np.array(frame.timestamp_ns)
        for scan in frame.scans:
            assert scan.pose is not None
            name = f"{number}/scan/{scan.name or 'main'}"
            arrays[f"{name}/points_world"] = transform(scan.pose, scan.points)
            arrays[f"{name}/origin_world"] = scan.pose[:3, 3]
            arrays[f"{name}/intensity"] = scan.attributes["intensity"]
        arrays |= {f"{number}/boxes/{name}": one for name, one in _boxes(frame).items()}
    for camera in drive.camera_names:
        seen = open_drive(drive.root, camera=camera)
        for number in seen.frame_numbers:
            for name, one in _projected(seen[number]).items():
                arrays[f"{number}/camera/{camera}/{name}"] = one
    return arrays


def _boxes(frame: Frame) -> dict[str, NDArray[Any]]:
    assert frame.pose is not None
    boxes = sorted(frame.boxes, key=lambda box: box.track)
    corners = [
        transform(frame.pose @ box.velo_from_box, SIGNS * box.size_m).tolist() for box in boxes
    ]
    return {
        "corners_world": np.array(corners).reshape(-1, 8, 3),
        "category": np.array([box.category for box in boxes], np.str_),
        "track": np.array([box.track for box in boxes], np.str_),
        "returns": np.array([-1 if box.returns is None else box.returns for box in boxes]),
    }


def _projected(frame: Frame) -> dict[str, NDArray[Any]]:
    """Pixels (N, 2) and depth (N,) of the frame's points, and the digest of its image."""
    if frame.camera is None or frame.cam_from_velo is None or frame.image_path is None:
        return {}
    points_cam: Float64Array = transform(frame.cam_from_velo, frame.points)
    pixels = points_cam @ frame.camera.projection[:, :3].T + frame.camera.projection[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "pixels": pixels[:, :2] / pixels[:, 2:],
            "depth_m": points_cam[:, 2],
            "image": np.array(hashlib.sha256(frame.image_path.read_bytes()).hexdigest()),
        }


if __name__ == "__main__":
    sys.exit(main())
