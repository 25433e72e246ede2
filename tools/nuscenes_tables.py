"""Write the tables of a large data set in nuScenes' schema, and open one of its scenes.

The tables are made by the writer of `intervis simulate --layout nuscenes`; there are no scans and
no images. By default they have the size of nuScenes' trainval set: 850 scenes of 40 samples, 2.4
million files, 1.2 million annotations.

    python tools/nuscenes_tables.py write DIR [--scenes 850]
    python tools/nuscenes_tables.py open DIR/v1.0-mini/scene-0425    # in a fresh process, please
"""

import argparse
import resource
import sys
import time
from pathlib import Path

import numpy as np

from intervis.camera import Camera
from intervis.drives.drive_writer import (
    BoxRecord,
    FrameRecord,
    ImageRecord,
    Rig,
    RigCamera,
    RigScanner,
    ScanRecord,
)
from intervis.drives.nuscenes_table_writer import VERSION, NuScenesTables, file_name
from intervis.drives.pose_track import PoseTrack
from intervis.transform import rigid

SAMPLES, FRAMES_PER_SAMPLE, BOXES = 40, 10, 34
START_NS, FRAME_NS, SCENE_NS = 1_532_402_927_000_000_000, 50_000_000, 60_000_000_000
CAMERAS = ("front", "front-left", "front-right", "rear", "back-left", "back-right")
CATEGORIES = ("car", "person", "bicycle")


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("work", choices=("write", "open"))
    parser.add_argument("path", type=Path)
    parser.add_argument("--scenes", type=int, default=850)
    arguments = parser.parse_args()
    if arguments.work == "write":
        write(arguments.path, arguments.scenes)
    else:
        measure(arguments.path)
    return 0


def write(root: Path, scenes: int) -> None:
    """Write tables; of each scene the first scan alone exists, so that the scene can be opened."""
    folder = root / VERSION
    folder.mkdir(parents=True)
    (root / "samples" / "LIDAR_TOP").mkdir(parents=True)
    tables = NuScenesTables(folder, _rig(), "maps/blank.png", FRAMES_PER_SAMPLE)
    for scene in range(scenes):
        name, start_ns = f"scene-{scene + 1:04d}", START_NS + scene * SCENE_NS
        tables.begin_scene(name, "made", start_ns)
        for number in range(SAMPLES * FRAMES_PER_SAMPLE):
            frame = _frame(start_ns + number * FRAME_NS, number)
            tables.add(frame, [1] * len(frame.boxes))
        (root / file_name(name, "LIDAR_TOP", start_ns, True)).write_bytes(bytes(20))
        if sys.stderr.isatty():
            print(f"\r{name}", end="", file=sys.stderr)
    tables.close()
    sizes = {path.name: path.stat().st_size for path in sorted(folder.iterdir())}
    print(", ".join(f"{name} {size / 1e6:,.1f} MB" for name, size in sizes.items()))
    print(f"all: {sum(sizes.values()) / 1e9:.2f} GB")


def _rig() -> Rig:
    camera = Camera(np.eye(3, 4) * [[1266.0], [1266.0], [1.0]], 1600, 900)
    cameras = tuple(RigCamera(name, camera, np.eye(4)) for name in CAMERAS)
    return Rig((RigScanner("roof", "HDL-32E", np.eye(4), 32),), cameras)


def _frame(time_ns: int, number: int) -> FrameRecord:
    c, s = np.cos(0.01 * number), np.sin(0.01 * number)  # numbers of many digits
    pose = rigid([[c, -s, 0], [s, c, 0], [0, 0, 1]], [400 * c + np.pi, 600 + 400 * s, np.sqrt(2)])
    scan = ScanRecord(np.empty((0, 3), np.float32), np.empty(0, np.float32))
    image = ImageRecord(np.empty((0, 0, 3), np.uint8), time_ns + 10_000_000, pose)
    boxes = tuple(
        BoxRecord(f"object {nth}", CATEGORIES[nth % 3], pose, np.array([4.5, 1.9, 1.6]))
        for nth in range(BOXES if number % FRAMES_PER_SAMPLE == 0 else 0)
    )
    track = PoseTrack(np.array([time_ns]), [pose])
    return FrameRecord(time_ns, track, (scan,), (image,) * len(CAMERAS), boxes)


def measure(scene: Path) -> None:
    """Open a scene, read its boxes, and print times and the largest memory of this process."""
    import intervis

    clocks = (time.perf_counter, time.process_time)
    before = [clock() for clock in clocks]
    drive = intervis.open_drive(scene)
    opened = [clock() for clock in clocks]
    assert drive.read_boxes is not None
    boxes = drive.read_boxes(drive.frame_numbers[0])
    done = [clock() for clock in clocks]
    (open_s, open_cpu_s), (boxes_s, boxes_cpu_s) = (
        [end - start for start, end in zip(*pair, strict=True)]
        for pair in ((before, opened), (opened, done))
    )
    most_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(
        f"{drive.name}: opened in {open_s:.2f} s ({open_cpu_s:.2f} s of processor time);"
        f" {len(boxes)} boxes in {boxes_s:.2f} s ({boxes_cpu_s:.2f} s); at most {most_mb:.0f} MB"
    )


if __name__ == "__main__":
    sys.exit(main())
