"""KITTI-360: one calibration for all drives, and folders for scans, images and poses.

``calibration/calib_cam_to_velo.txt``, ``calib_cam_to_pose.txt``, ``perspective.txt``;
``data_3d_raw/NAME/velodyne_points/data/*.bin`` with ``timestamps.txt``;
``data_2d_raw/NAME/image_0K/data_rect/*.png``; ``data_poses/NAME/poses.txt`` (world from the
vehicle) or ``cam0_to_world.txt`` (world from the rectified camera 0), also beside the scans.

Poses are stated for frames in which the vehicle moves; those between are interpolated. The two
fisheye cameras are not read. Source: kitti360Scripts, loadCalibration and kitti360Viewer3DRaw.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.drives.calibration import (
    CalibrationFile,
    CameraCalibration,
    read_calibration_file,
)
from intervis.drives.camera_choice import pick_camera
from intervis.drives.drive import Drive
from intervis.drives.image_file import IMAGE_ENDINGS
from intervis.drives.image_size import warn_of_other_size
from intervis.drives.numbering import lines_by_number, numbered_files, numbered_scans
from intervis.drives.pose_track import PoseTrack
from intervis.drives.trajectory import (
    known_timestamps,
    read_numbered_poses,
    read_poses,
    read_timestamps,
)
from intervis.errors import CalibrationError, CameraError
from intervis.transform import inverse

EXPECTED_FILES = "data_3d_raw/NAME/velodyne_points/data/*.bin beside calibration/ (KITTI-360)"
SCANS, CALIBRATION = "data_3d_raw", "calibration"
CAM_TO_VELO, CAM_TO_POSE, PERSPECTIVE = (
    "calib_cam_to_velo.txt",
    "calib_cam_to_pose.txt",
    "perspective.txt",
)


def find_roots(path: Path) -> list[Path]:
    """Folders of drives: `path` itself, or those in it, or in its ``data_3d_raw``."""
    for pattern in (
        "velodyne_points",
        "*/velodyne_points",
        f"{SCANS}/*/velodyne_points",
        f"*/{SCANS}/*/velodyne_points",
    ):
        drives = sorted(
            folder.parent
            for folder in path.glob(pattern)
            if folder.is_dir() and folder.parent.parent.name == SCANS
        )
        if drives:
            return drives
    return []


def read_drive(root: Path, camera: str | None) -> Drive:
    """Read the drive in a folder that `find_roots` returned."""
    scans = numbered_scans(root, "velodyne_points/data", EXPECTED_FILES)
    base = root.parent.parent
    folder = base / CALIBRATION
    times_path = root / "velodyne_points" / "timestamps.txt"
    times_ns: dict[int, int] = {}
    if times_path.is_file():
        lines = read_timestamps(times_path)
        known = lines_by_number(lines, list(scans), times_path, may_be_longer=True)
        times_ns = known_timestamps(known)
    image_folders = base / "data_2d_raw" / root.name
    with_images = {path.parent.name for path in image_folders.glob("image_0*/data_rect")}
    intrinsics = (
        read_calibration_file(folder / PERSPECTIVE)
        if with_images or (folder / PERSPECTIVE).is_file()
        else None
    )
    names = intrinsics.camera_names("P_rect_") if intrinsics else ()
    chosen = pick_camera(camera, names, with_images, root)
    images = numbered_files(image_folders / chosen / "data_rect", *IMAGE_ENDINGS) if chosen else {}
    calibration = _camera(folder, intrinsics, chosen) if intrinsics and chosen else None
    if calibration:
        warn_of_other_size(calibration.camera, images)
    pose_path = _pose_file(root)
    poses = _poses(pose_path, folder, list(scans), times_ns) if pose_path else {}
    files = [folder / name for name in (CAM_TO_VELO, CAM_TO_POSE, PERSPECTIVE)]
    metadata = [*files, *([pose_path] if pose_path else []), times_path]
    return Drive(
        root=root,
        name=root.name,
        layout="kitti_360",
        scan_paths=scans,
        image_paths=images,
        camera_names=names,
        camera_name=chosen,
        calibration=calibration,
        poses=poses or None,
        timestamps_ns=times_ns,
        metadata_files=tuple(path for path in metadata if path.is_file()),
    )


# --- calibration ---


def _velo_from_cam0(folder: Path) -> Float64Array:
    """The scanner's frame from that of camera 0 before rectification."""
    motions = read_poses(folder / CAM_TO_VELO)
    if len(motions) != 1:
        raise CalibrationError(f"{folder / CAM_TO_VELO} has {len(motions)} lines; expected one.")
    return motions[0]


def _camera(folder: Path, intrinsics: CalibrationFile, name: str) -> CameraCalibration:
    """A rectified camera; its frame is its own, so that its projection has no baseline."""
    number = name.removeprefix("image_")
    projection = intrinsics.matrix(f"P_rect_{number}", 3, 4)
    projection[:, 3] = 0
    size_px = np.clip(intrinsics.matrix(f"S_rect_{number}", 2), -1e9, 1e9)
    try:
        width_px, height_px = (round(float(size)) for size in size_px)
        camera = Camera(projection, width_px, height_px, name=name)
    except CameraError as error:
        raise CalibrationError(f"{intrinsics.where(f'P_rect_{number}')}: {error}") from None
    places = read_calibration_file(folder / CAM_TO_POSE)
    cam_from_cam0 = inverse(places.rigid_motion(name)) @ places.rigid_motion("image_00")
    rectified = intrinsics.rotation(f"R_rect_{number}")
    return CameraCalibration(camera, rectified @ cam_from_cam0 @ inverse(_velo_from_cam0(folder)))


# --- poses ---


def _pose_file(root: Path) -> Path | None:
    """The file of poses; those of the vehicle come first."""
    folders = (root.parent.parent / "data_poses" / root.name, root)
    for name in ("poses.txt", "cam0_to_world.txt"):
        for folder in folders:
            if (folder / name).is_file():
                return folder / name
    return None


def _poses(
    path: Path, folder: Path, numbers: list[int], times_ns: Mapping[int, int]
) -> dict[int, Float64Array]:
    """world_from_velo of the frames; those without a stated pose are interpolated in time."""
    cam0_from_velo = inverse(_velo_from_cam0(folder))
    if path.name == "poses.txt":
        pose_from_cam0 = read_calibration_file(folder / CAM_TO_POSE).rigid_motion("image_00")
        frame_from_velo = pose_from_cam0 @ cam0_from_velo
    else:
        intrinsics = read_calibration_file(folder / PERSPECTIVE)
        frame_from_velo = intrinsics.rotation("R_rect_00") @ cam0_from_velo
    stated = {number: pose @ frame_from_velo for number, pose in read_numbered_poses(path).items()}
    poses = {number: stated[number] for number in numbers if number in stated}
    known = sorted((times_ns[number], number) for number in poses if number in times_ns)
    track = PoseTrack(
        np.array([time_ns for time_ns, _ in known], np.int64), [poses[n] for _, n in known]
    )
    for number in numbers:
        if number not in poses and number in times_ns:
            pose = track.at(times_ns[number])
            if pose is not None:
                poses[number] = pose
    return dict(sorted(poses.items()))
