"""A single scan file: a drive of one frame, number 0, without camera or timestamp.

It has a pose where the file states one (PCD VIEWPOINT), or 3DTK's ``.pose`` beside it.
"""

from pathlib import Path

from intervis.drives.drive import Drive
from intervis.drives.point_labels import label_files
from intervis.drives.scan_file import READERS, scan_ending
from intervis.drives.threedtk import ENDING, station_poses
from intervis.drives.viewpoint import stated_poses
from intervis.errors import DriveError


def read_drive(path: Path, camera: str | None) -> Drive:
    """Read a single scan file as a drive.

    Raises
    ------
    DriveError
        The file's name does not end as a scan's, or a camera was requested.
    """
    if scan_ending(path) is None:
        raise DriveError(f"{path} is not a scan: its name must end in {' '.join(READERS)}.")
    if camera is not None:
        raise DriveError(f"{path} has no camera {camera!r}: it is a single scan.")
    poses, read = stated_poses({0: path})
    stations, pose_files = station_poses({0: path}) if scan_ending(path) == ENDING else ({}, [])
    return Drive(
        root=path,
        name=path.name,
        layout="single_scan",
        scan_paths={0: path},
        poses=stations or poses,
        metadata_files=tuple(pose_files),
        read=read,
        label_paths=label_files({0: path}),
    )
