"""What the masks of a frame are made from, as a digest: settings, scans, labels, poses, cameras."""

from __future__ import annotations  # help() shows the names of the array types

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import digest_of
from intervis.drives import Drive, Frame, ScannerScan
from intervis.uses.voxels.drive_masks import later_frames
from intervis.uses.voxels.mask_layouts import FrameName

Arrays = dict[str, NDArray[Any]]


class MaskInput:
    """Digests of the input of frames; each scan is read once, however many frames it is added to.

    Parameters
    ----------
    drive : Drive
    later : int
        So many frames after each frame are added to its target.
    cameras : mapping of str to Drive
        As `intervis.uses.voxels.drive_masks.drive_cameras` returns it.
    described : str
        Everything else that the masks depend on, as text.
    """

    def __init__(
        self, drive: Drive, later: int, cameras: Mapping[str, Drive], described: str
    ) -> None:
        self._drive, self._later, self._cameras = drive, later, cameras
        self._described = described
        self._digests: dict[int, str] = {}

    def fingerprint(self, name: FrameName) -> str:
        """Digest of all that the files of a frame depend on, as 32 hexadecimal digits.

        Raises
        ------
        DriveError, ScanError
            A scan cannot be read.
        """
        later = later_frames(self._drive, name.number, self._later)
        parts = [
            *(self._described, name.drive, name.number, name.scan),
            *(self._digest(number) for number in (name.number, *later)),
        ]
        return digest_of(json.dumps(parts), self._camera_arrays(name.number))

    def _digest(self, number: int) -> str:
        """Digest of the scans of a frame, with labels and poses."""
        if number not in self._digests:
            self._digests[number] = _frame_digest(self._drive[number])
        return self._digests[number]

    def _camera_arrays(self, number: int) -> Arrays:
        arrays: Arrays = {}
        for name, drive in sorted(self._cameras.items()):
            calibration = drive.calibration_of(number)
            if calibration is not None:
                camera = calibration.camera
                size_px = np.array([camera.width_px, camera.height_px])
                arrays[f"{name} projection"] = camera.projection
                arrays[f"{name} size"] = size_px
                arrays[f"{name} pose"] = calibration.cam_from_velo
        return arrays


def _frame_digest(frame: Frame) -> str:
    classes, scans = frame.point_classes, frame.scans
    arrays: Arrays = {} if classes is None else {"labels": classes}
    for nth, scan in enumerate(scans):
        arrays |= {f"{nth} {name}": values for name, values in _scan_arrays(scan).items()}
    return digest_of(json.dumps([scan.name for scan in scans]), arrays)


def _scan_arrays(scan: ScannerScan) -> Arrays:
    return {"points": scan.points} | ({} if scan.pose is None else {"pose": scan.pose})
