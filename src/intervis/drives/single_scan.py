"""One scan in a file: a drive of one frame, number 0, without camera, pose or time."""

from pathlib import Path

from intervis.drives.drive import Drive
from intervis.drives.scan_file import READERS, scan_ending
from intervis.errors import DriveError


def read_drive(path: Path, camera: str | None) -> Drive:
    """The drive of a single file.

    Raises
    ------
    DriveError
        The file's ending is none of a scan's, or a camera was asked for.
    """
    if scan_ending(path) is None:
        raise DriveError(f"{path} is no scan: its name must end in {' '.join(READERS)}.")
    if camera is not None:
        raise DriveError(f"{path} has no camera {camera!r}: a single scan has none.")
    return Drive(root=path, name=path.name, layout="single_scan", scan_paths={0: path})
