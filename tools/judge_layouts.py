"""Read a drive with its data set's own kit, and compare with what intervis read of it.

Runs in an environment of its own (nuscenes-devkit, av2, or mcap with mcap-ros2-support;
docs/testing.md says how to make one); intervis is not imported. `tools/dump_drive.py` writes the
arrays.

    python tools/judge_layouts.py nuscenes ROOT OUT.npz
    python tools/judge_layouts.py argoverse2 LOG OUT.npz
    python tools/judge_layouts.py mcap FILE OUT.npz

Prints the largest differences; the exit status is 1 where one exceeds its tolerance.
"""

import argparse
import hashlib
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

TOLERANCES = {
    "points_m": 1e-4,  # intervis holds float32 in the scanner's frame: 8 um at 100 m
    "origin_m": 1e-6,
    "pixels": 1e-2,  # of points 1 m and farther from the camera
    "corners_m": 1e-6,
}
"""Largest differences; everything else must be equal."""

FARTHEST_PX = 3000


class Seen(NamedTuple):
    """What a kit reads of one moment, named as in the arrays."""

    time_ns: int
    arrays: dict[str, Any]


def nuscenes_moments(root: Path) -> Iterator[Seen]:
    """The sweeps of the scene in nuScenes' tables, by nuscenes-devkit."""
    from nuscenes.nuscenes import NuScenes
    from nuscenes.utils.data_classes import LidarPointCloud
    from nuscenes.utils.geometry_utils import points_in_box, transform_matrix, view_points
    from pyquaternion import Quaternion

    version = next(path.parent.name for path in root.glob("*/scene.json"))
    kit = NuScenes(version, str(root), verbose=False)
    sample = kit.get("sample", kit.scene[0]["first_sample_token"])
    chains: dict[str, list[Any]] = {}
    for channel, token in sample["data"].items():
        chains[channel] = []
        while token:
            chains[channel].append(kit.get("sample_data", token))
            token = chains[channel][-1]["next"]

    def world_from(record: Any) -> Any:
        sensor = kit.get("calibrated_sensor", record["calibrated_sensor_token"])
        ego = kit.get("ego_pose", record["ego_pose_token"])
        matrices = [
            transform_matrix(one["translation"], Quaternion(one["rotation"]))
            for one in (ego, sensor)
        ]
        return matrices[0] @ matrices[1]

    lidars = [channel for channel in chains if channel.startswith("LIDAR")]
    main = "LIDAR_TOP" if "LIDAR_TOP" in lidars else sorted(lidars)[0]
    for record in chains[main]:
        arrays: dict[str, Any] = {}
        for channel in lidars:
            own = min(chains[channel], key=lambda one: abs(one["timestamp"] - record["timestamp"]))
            path = kit.get_sample_data_path(own["token"])
            cloud = LidarPointCloud.from_file(path)
            cloud.transform(world_from(own))
            arrays[f"scan/{channel}/points_world"] = cloud.points[:3].T
            arrays[f"scan/{channel}/intensity"] = cloud.points[3]
            arrays[f"scan/{channel}/origin_world"] = world_from(own)[:3, 3]
        points = arrays[f"scan/{main}/points_world"]
        for channel in set(chains) - set(lidars):
            own = min(chains[channel], key=lambda one: abs(one["timestamp"] - record["timestamp"]))
            path, _, intrinsic = kit.get_sample_data(own["token"])
            cam_from_world = np.linalg.inv(world_from(own))
            points_cam = cam_from_world[:3, :3] @ points.T + cam_from_world[:3, 3:]
            pixels = view_points(points_cam, intrinsic, normalize=True)
            arrays[f"camera/{channel}/pixels"] = pixels[:2].T
            arrays[f"camera/{channel}/depth_m"] = points_cam[2]
            arrays[f"camera/{channel}/image"] = digest(Path(path))
        found = []
        for box in kit.get_boxes(record["token"]) if record["is_key_frame"] else ():
            annotation = kit.get("sample_annotation", box.token)
            cloud = np.concatenate([arrays[f"scan/{name}/points_world"] for name in lidars])
            inside = int(points_in_box(box, cloud.T).sum())
            if abs(inside - annotation["num_lidar_pts"]) > 1:
                print(f"  {inside} points in a box that states {annotation['num_lidar_pts']}")
            found.append(
                (
                    annotation["instance_token"],
                    box.name,
                    annotation["num_lidar_pts"],
                    box.corners().T,
                )
            )
        yield Seen(record["timestamp"] * 1000, arrays | boxes_of(found))


def argoverse_moments(log: Path) -> Iterator[Seen]:
    """The sweeps of a log, by av2."""
    from av2.datasets.sensor.av2_sensor_dataloader import AV2SensorDataLoader
    from av2.structures.sweep import Sweep
    from av2.utils.io import read_feather

    kit = AV2SensorDataLoader(data_dir=log.parent, labels_dir=log.parent)
    stated = read_feather(log / "annotations.feather")
    lasers = {"up_lidar": (0, 32), "down_lidar": (32, 64)}
    for path in kit.get_ordered_log_lidar_fpaths(log.name):
        time_ns = int(path.stem)
        sweep, pose = Sweep.from_feather(path), kit.get_city_SE3_ego(log.name, time_ns)
        arrays: dict[str, Any] = {}
        places = {"up_lidar": sweep.ego_SE3_up_lidar, "down_lidar": sweep.ego_SE3_down_lidar}
        for name, (first, end) in lasers.items():
            own = (sweep.laser_number >= first) & (sweep.laser_number < end)
            arrays[f"scan/{name}/points_world"] = pose.transform_point_cloud(sweep.xyz[own])
            arrays[f"scan/{name}/intensity"] = sweep.intensity[own]
            arrays[f"scan/{name}/origin_world"] = pose.compose(places[name]).translation
        upper = sweep.xyz[sweep.laser_number < 32]
        for folder in sorted((log / "sensors" / "cameras").glob("*")):
            image = kit.get_closest_img_fpath(log.name, folder.name, time_ns)
            pixels, points_cam, _ = kit.project_ego_to_img_motion_compensated(
                upper, folder.name, int(image.stem), time_ns, log.name
            )
            arrays[f"camera/{folder.name}/pixels"] = pixels[:, :2]
            arrays[f"camera/{folder.name}/depth_m"] = points_cam[:, 2]
            arrays[f"camera/{folder.name}/image"] = digest(image)
        rows = stated[stated["timestamp_ns"] == time_ns]
        cuboids = kit.get_labels_at_lidar_timestamp(log.name, time_ns)
        found = []
        for cuboid, (_, row) in zip(cuboids.cuboids, rows.iterrows(), strict=True):
            inside = len(cuboid.compute_interior_points(sweep.xyz)[0])
            if abs(inside - row["num_interior_pts"]) > 3:  # points lie on 16-bit steps
                print(f"  {inside} points in a box that states {row['num_interior_pts']}")
            corners = pose.transform_point_cloud(cuboid.vertices_m)
            found.append((row["track_uuid"], cuboid.category, row["num_interior_pts"], corners))
        yield Seen(time_ns, arrays | boxes_of(found))


def mcap_moments(path: Path) -> Iterator[Seen]:
    """The clouds of a recording, by mcap and mcap-ros2-support."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    poses: dict[int, Any] = {}
    static: dict[str, Any] = {}
    clouds: dict[int, dict[str, Any]] = defaultdict(dict)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        summary = reader.get_summary()
        print(f"  {summary.statistics.message_count} messages, {len(summary.chunk_indexes)} chunks")
        for _, channel, _, message in reader.iter_decoded_messages():
            for one in getattr(message, "transforms", ()):
                motion = matrix_of(one.transform)
                if channel.topic == "/tf_static":
                    static[one.child_frame_id] = motion
                else:
                    poses[stamp_ns(one.header)] = motion
            if hasattr(message, "point_step"):
                clouds[stamp_ns(message.header)][channel.topic] = message
    for time_ns, messages in sorted(clouds.items()):
        arrays = {}
        for topic, message in messages.items():
            world_from_velo = poses[time_ns] @ static[message.header.frame_id]
            kinds = {4: "u2", 6: "u4", 7: "f4"}
            row = np.dtype(
                {
                    "names": [field.name for field in message.fields],
                    "formats": [kinds[field.datatype] for field in message.fields],
                    "offsets": [field.offset for field in message.fields],
                    "itemsize": message.point_step,
                }
            )
            table = np.frombuffer(bytes(message.data), row)
            points = np.column_stack([table[axis].astype(np.float64) for axis in "xyz"])
            arrays[f"scan/{topic}/points_world"] = (
                points @ world_from_velo[:3, :3].T + world_from_velo[:3, 3]
            )
            arrays[f"scan/{topic}/intensity"] = table["intensity"]
            arrays[f"scan/{topic}/origin_world"] = world_from_velo[:3, 3]
        yield Seen(time_ns, arrays)


def stamp_ns(header: Any) -> int:
    """Stamp of a header."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def matrix_of(transform: Any) -> Any:
    """(4, 4) of ``geometry_msgs/Transform``."""
    q, t = transform.rotation, transform.translation
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), t.x],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), t.y],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), t.z],
            [0, 0, 0, 1],
        ]
    )


def boxes_of(found: list[tuple[str, str, int, Any]]) -> dict[str, Any]:
    """Tracks, categories, numbers of returns and corners of boxes, sorted by track."""
    found.sort(key=lambda one: one[0])
    return {
        "boxes/track": np.array([one[0] for one in found], np.str_),
        "boxes/category": np.array([one[1] for one in found], np.str_),
        "boxes/returns": np.array([one[2] for one in found], int),
        "boxes/corners_world": np.array([one[3] for one in found], float).reshape(-1, 8, 3),
    }


def digest(path: Path) -> Any:
    """SHA-256 of a file."""
    return np.array(hashlib.sha256(path.read_bytes()).hexdigest())


def differences(ours: dict[str, Any], theirs: Seen) -> dict[str, float]:
    """Largest differences of one moment; infinite where something is not equal that must be."""
    found: dict[str, float] = defaultdict(float)
    names = set(ours) - {"time_ns"}
    if not any(name.startswith("boxes/") for name in theirs.arrays):
        names = {name for name in names if not name.startswith("boxes/")}
    for name in sorted(names | set(theirs.arrays)):
        one, two = ours.get(name), theirs.arrays.get(name)
        kind = {"points_world": "points_m", "origin_world": "origin_m"}.get(name.split("/")[-1])
        kind = "corners_m" if name == "boxes/corners_world" else kind
        kind = "pixels" if name.endswith("/pixels") else kind
        kind = "points_m" if name.endswith("/depth_m") else kind
        if one is None or two is None or one.shape != two.shape:
            print(f"  {name} is missing or has another size")
            found[kind or name] = np.inf
        elif kind == "corners_m":
            pairs = np.linalg.norm(one[:, :, None] - two[:, None], axis=-1)
            found[kind] = max(found[kind], pairs.min(axis=2).max(initial=0))
        elif kind == "pixels":
            near = np.abs(one).max(axis=1) < FARTHEST_PX  # in the image, or beside it
            near &= ours[name.replace("pixels", "depth_m")] > 1
            found[kind] = max(found[kind], np.abs(one - two)[near].max(initial=0))
        elif kind:
            found[kind] = max(found[kind], np.abs(one - two).max(initial=0))
        elif not np.array_equal(one, two):
            print(f"  {name} differs")
            found[name] = np.inf
    return found


KITS = {"nuscenes": nuscenes_moments, "argoverse2": argoverse_moments, "mcap": mcap_moments}


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("kit", choices=KITS)
    parser.add_argument("data", type=Path)
    parser.add_argument("arrays", type=Path, help="written by tools/dump_drive.py")
    arguments = parser.parse_args()
    with np.load(arguments.arrays, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    moments: dict[int, dict[str, Any]] = {}
    for number in arrays["frames"].tolist():
        start = f"{number}/"
        own = {key[len(start) :]: one for key, one in arrays.items() if key.startswith(start)}
        moments[int(own["time_ns"])] = own
    worst: dict[str, float] = defaultdict(float)
    frames = points = boxes = 0
    for seen in KITS[arguments.kit](arguments.data):
        ours = moments.pop(seen.time_ns)
        frames += 1
        points += sum(len(one) for name, one in ours.items() if name.endswith("/intensity"))
        boxes += len(seen.arrays.get("boxes/track", ()))
        for name, value in differences(ours, seen).items():
            worst[name] = max(worst[name], value)
    print(f"{arguments.kit}: {frames} frames, {points:,} points, {boxes} boxes")
    for name, value in worst.items():
        print(f"  {name}: {value:.3g} (at most {TOLERANCES.get(name, 0):g})")
    failed = bool(moments) or any(value > TOLERANCES.get(name, 0) for name, value in worst.items())
    if moments:
        print(f"  {len(moments)} frames were read by intervis only")
    print("  differs" if failed or not frames else "  agrees")
    return 1 if failed or not frames else 0


if __name__ == "__main__":
    sys.exit(main())
