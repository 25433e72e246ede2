"""What is measured on: real scans where they lie beside the project, else simulated ones."""

from pathlib import Path

import pytest

from intervis import open_drive
from intervis.lab.worlds import simulate

DATA = Path(__file__).resolve().parents[2] / "shared/data"


@pytest.fixture(scope="session")
def frame(tmp_path_factory):
    """KITTI raw's first frame, with its camera."""
    real = DATA / "kitti_raw/2011_09_26/2011_09_26_drive_9001_sync"
    drive = open_drive(
        real if real.is_dir() else simulate(tmp_path_factory.mktemp("world"), frames=1)
    )
    return drive[drive.frame_numbers[0]]


@pytest.fixture(scope="session")
def frames(tmp_path_factory):
    """Fourteen scans of a drive, with poses."""
    real = DATA / "pcd_drive"
    drive = open_drive(
        real if real.is_dir() else simulate(tmp_path_factory.mktemp("world"), frames=14)
    )
    return [drive[number] for number in drive.frame_numbers[:14]]
