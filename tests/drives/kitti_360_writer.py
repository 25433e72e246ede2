"""A drive in KITTI-360's layout, from chosen places of vehicle, cameras and scanner."""

from drive_layouts import write_png, write_scan, write_text
from scipy.spatial.transform import Rotation

from intervis.transform import inverse, rigid

NAME = "2013_05_28_drive_0003_sync"


def motion(angles_deg, place_m):
    return rigid(Rotation.from_euler("zyx", angles_deg, degrees=True).as_matrix(), place_m)


AXES_OF_CAMERA = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # x forward, y left, z up from x right ...
POSE_FROM_CAM = {
    "image_00": motion([1, 2, -1], [1.6, 0.3, -1.1]) @ rigid(AXES_OF_CAMERA, [0, 0, 0]),
    "image_01": motion([2, 1, -2], [1.6, -0.3, -1.1]) @ rigid(AXES_OF_CAMERA, [0, 0, 0]),
}
POSE_FROM_VELO = motion([179, 1, 2], [0.8, 0.1, -0.4])
RECTIFYING = {"00": motion([0.3, -0.2, 0.1], [0, 0, 0]), "01": motion([-0.4, 0.2, 0.3], [0, 0, 0])}
WORLD_FROM_POSE = {
    number: motion([10 * number, 1, -1], [1000 + 2.0 * number, 3000, 110]) for number in range(5)
}


def numbers(matrix, rows=3):
    return " ".join(f"{value:.12g}" for value in matrix[:rows].ravel())


def write_drive(base, *, stated=(0, 1, 3), cam0=False, images=True):
    """Five scans; poses of some; frame 2 lies a quarter of the way from 1 to 3."""
    velo_from_cam0 = inverse(POSE_FROM_VELO) @ POSE_FROM_CAM["image_00"]
    write_text(base / "calibration/calib_cam_to_velo.txt", numbers(velo_from_cam0) + "\n")
    places = [f"{name}: {numbers(place)}\n" for name, place in POSE_FROM_CAM.items()]
    write_text(base / "calibration/calib_cam_to_pose.txt", "".join(places))
    intrinsics = ["calib_time: 09-Jan-2014 14:00:15\ncorner_dist: 9.950000e-02\n"]
    for number, baseline in (("00", 0), ("01", -328.3)):
        intrinsics.append(f"S_rect_{number}: 24 16\n")
        intrinsics.append(f"R_rect_{number}: {numbers(RECTIFYING[number][:3, :3])}\n")
        intrinsics.append(f"P_rect_{number}: 20 0 12 {baseline} 0 20 8 0 0 0 1 0\n")
    write_text(base / "calibration/perspective.txt", "".join(intrinsics))
    root = base / "data_3d_raw" / NAME
    times = []
    for number, seconds in enumerate((0.0, 0.1, 0.15, 0.3, 0.4)):
        write_scan(root / f"velodyne_points/data/{number:010d}.bin", number)
        times.append(f"2013-05-28 08:46:{10 + seconds:012.9f}\n")
        if images:
            picture = base / f"data_2d_raw/{NAME}/image_01/data_rect/{number:010d}.png"
            picture.parent.mkdir(parents=True, exist_ok=True)
            write_png(picture, 24, 16, grey=77)
    write_text(root / "velodyne_points/timestamps.txt", "".join(times))
    lines = []
    for number in stated:
        world_from_rect = (
            WORLD_FROM_POSE[number] @ POSE_FROM_CAM["image_00"] @ inverse(RECTIFYING["00"])
        )
        pose = numbers(world_from_rect, 4) if cam0 else numbers(WORLD_FROM_POSE[number])
        lines.append(f"{number} {pose}\n")
    name = "cam0_to_world.txt" if cam0 else "poses.txt"
    write_text(base / "data_poses" / NAME / name, "".join(lines))
    return root
