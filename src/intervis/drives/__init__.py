"""Drives: scans, cameras, poses and timestamps, read from the supported layouts.

Each layout has a module with ``EXPECTED_FILES`` (for the error message), ``find_roots`` and
``read_drive``.
"""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, cast

from intervis.arguments import address_of, path_of, shown
from intervis.drives import (
    argoverse,
    e57_stations,
    kitti_360,
    kitti_object,
    kitti_odometry,
    kitti_raw,
    kitti_tracking,
    las_mapping,
    nuscenes,
    ptx_stations,
    ros_bag,
    scan_folder,
    single_scan,
)
from intervis.drives.boxes import Box
from intervis.drives.drive import Drive
from intervis.drives.frame import Frame, ScannerScan
from intervis.drives.remote_path import is_remote, remote_path
from intervis.errors import ArgumentError, DriveError

__all__ = ["Box", "Drive", "Frame", "ScannerScan", "open_drive"]


class _Layout(NamedTuple):
    expected_files: str
    find_roots: Callable[[Path], list[Path]]
    read_drive: Callable[[Path, str | None], Drive]


_LAYOUTS = tuple(
    _Layout(module.EXPECTED_FILES, module.find_roots, module.read_drive)
    for module in (
        kitti_360,
        kitti_raw,
        kitti_odometry,
        kitti_tracking,
        kitti_object,
        nuscenes,
        argoverse,
        scan_folder,
        ptx_stations,
        e57_stations,
        ros_bag,
        las_mapping,
    )
)


_FILE_READERS: dict[str, Callable[[Path, str | None], Drive]] = {
    ptx_stations.ENDING: ptx_stations.read_drive,
    e57_stations.ENDING: e57_stations.read_drive,
    **dict.fromkeys(ros_bag.READERS, ros_bag.read_drive),
    **dict.fromkeys(las_mapping.ENDINGS, las_mapping.read_drive),
}
"""Readers of files that hold several scans, by the ending of the file's name."""


def open_drive(path: str | os.PathLike[str], *, camera: str | None = None) -> Drive:
    """Open a drive; its layout is recognised from the files at `path`.

    Known layouts: KITTI raw (the drive's folder, or a date with one drive in it), KITTI odometry
    and SemanticKITTI (a sequence), KITTI tracking (``training/velodyne/NNNN``), KITTI object
    (``training``), KITTI-360 (``data_3d_raw/NAME``), nuScenes (a scene's name below the folder of
    its tables), Argoverse 2 (a log), ROS 1 and ROS 2 bags and MCAP files (a topic below their path,
    where several hold clouds), a folder of scans (optionally with ``poses.txt``; also a sequence of
    the DynamicMap benchmark and stations of 3DTK), PTX and E57 files with stations, LAS and LAZ
    files with a trajectory beside them, and a single ``.bin``, ``.cdr``, ``.npy``, ``.pcd``,
    ``.pcd.bin`` (nuScenes), ``.ply`` or ``.3d``. Scans are read when their frames are accessed. No
    file is unpickled or executed.

    Parameters
    ----------
    path : path-like
        A folder or a file; or the address of one in storage that fsspec reads, ``s3://BUCKET/DRIVE``
        (extras ``s3``, ``gs``; ``remote`` for others). E57 and ROS 2 databases must be local.
    camera : str, optional
        Name of a camera (``image_03``), or its number. Default: the left colour camera, number 2.

    Returns
    -------
    Drive

    Raises
    ------
    DriveError
        `path` does not exist, its layout is not known (the message lists the expected files), it
        holds several drives, the drive has no such camera, or the storage refuses.
    MissingExtraError
        What reads the format or the address is not installed.
    CalibrationError
        A file of calibration, poses or times is missing where it is needed, or a line of it does
        not parse.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for number in (3, 5):
    ...         np.ones((7, 4), np.float32).tofile(f"{folder}/{number:06d}.bin")
    ...     drive = open_drive(folder)
    ...     drive.frame_numbers, drive[5].points.shape
    ((3, 5), (7, 3))
    """
    if camera is not None and not isinstance(camera, str):
        raise DriveError(f"a camera must be a name or a number in a text, got {shown(camera)}.")
    try:
        given = _given(path)
        if not given.exists():
            return _open_name(given, camera)
        root = given.resolve()
        if root.is_file():
            read_file = _FILE_READERS.get(root.suffix.lower(), single_scan.read_drive)
            return read_file(root, camera)
        return _open_folder(root, camera)
    except OSError as error:
        raise DriveError(f"cannot read {error.filename or path}: {error.strerror}.") from None


def _given(path: str | os.PathLike[str]) -> Path:
    """The path that `open_drive` is given, local or remote."""
    if is_remote(path):  # of another drive
        return cast(Path, path)
    try:
        given = path_of(path, "the path of a drive")
    except ArgumentError as error:
        raise DriveError(str(error)) from None
    address = address_of(path)
    if address is not None:
        scheme, _, place = address.partition("://")
        return Path("/", place) if scheme == "file" else remote_path(address)
    with contextlib.suppress(RuntimeError):  # ~name of an unknown user
        return given.expanduser()
    return given


def _open_name(given: Path, camera: str | None) -> Drive:
    """The drive of a scene or a topic, which are named below what is there."""
    scene = nuscenes.find_scene(given)
    if scene is not None:
        return nuscenes.read_drive(scene.resolve(), camera)
    topic = ros_bag.find_topic(given.absolute())
    if topic is not None:
        return ros_bag.read_drive(topic.resolve(), camera)
    raise DriveError(f"there is nothing at {given}: check the path.")


def _open_folder(folder: Path, camera: str | None) -> Drive:
    """The drive in a folder, read by the first layout that finds its files."""
    for layout in _LAYOUTS:
        roots = layout.find_roots(folder)
        if len(roots) > 1:
            names = ", ".join(str(root.relative_to(folder)) for root in roots[:8])
            raise DriveError(
                f"{folder} holds {len(roots)} drives; give the path of one of them: {names}."
            )
        if roots:
            return layout.read_drive(roots[0], camera)
    content = sorted(entry.name for entry in folder.iterdir())
    if not content:
        raise DriveError(f"the folder {folder} is empty.")
    expected_files = "; ".join(layout.expected_files for layout in _LAYOUTS)
    shown = ", ".join(content[:8]) + (", ..." if len(content) > 8 else "")
    raise DriveError(
        f"{folder} is not a drive of a known layout. Looked for: {expected_files}. Found: {shown}."
    )
