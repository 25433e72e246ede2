"""Drives in storage that is reached through fsspec: what is read is what the local files hold.

No test uses a network: the storage is fsspec's memory, or a memory that counts, or that refuses.
"""

from pathlib import Path

import numpy as np
import pytest
from valid_files import TARGETS

from intervis.drives import Drive, open_drive
from intervis.errors import DriveError

fsspec = pytest.importorskip("fsspec", reason="fsspec (extra remote) is not installed")
from fsspec.implementations.memory import MemoryFileSystem  # noqa: E402

ON_DISK = ("e57", "ros2 database")
"""Starts of the names of targets whose formats are read from local files only."""

FOLDERS = {name: target for name, target in TARGETS.items() if name != "settings"}
REMOTE = [name for name in FOLDERS if not name.startswith(ON_DISK)]
LOCAL = [name for name in FOLDERS if name.startswith(ON_DISK)]


@pytest.fixture
def memory():
    """An empty memory of fsspec, which is one for the whole process."""
    storage = fsspec.filesystem("memory")
    storage.store.clear()
    storage.pseudo_dirs[:] = [""]
    yield storage
    storage.store.clear()
    storage.pseudo_dirs[:] = [""]


def upload(folder: Path, bucket: str = "bucket") -> str:
    """Copy the files of a folder into the memory; returns the address of the copy."""
    for path in folder.rglob("*"):
        if path.is_file():
            place = path.relative_to(folder).as_posix()
            MemoryFileSystem().pipe_file(f"/{bucket}/{place}", path.read_bytes())
    return f"memory://{bucket}"


def assert_same(one: object, other: object) -> None:
    if isinstance(one, np.ndarray):
        assert isinstance(other, np.ndarray)
        assert one.dtype == other.dtype
        assert one.tobytes() == other.tobytes()
    else:
        assert one == other


def assert_same_drive(local: Drive, remote: Drive) -> None:
    """All that the frames hold is the same, bit by bit."""
    assert remote.fingerprint() == local.fingerprint()
    assert remote.frame_numbers == local.frame_numbers
    assert remote.camera_names == local.camera_names
    for number in local.frame_numbers:
        a, b = local[number], remote[number]
        assert repr(a) == repr(b)
        for name in ("points", "pose", "timestamp_ns", "cam_from_velo", "image", "point_classes"):
            assert_same(getattr(a, name), getattr(b, name))
        assert b.points.flags.writeable == a.points.flags.writeable
        for first, second in zip(a.boxes, b.boxes, strict=True):
            assert repr(first) == repr(second)
            assert_same(first.velo_from_box, second.velo_from_box)
        for first, second in zip(a.scans, b.scans, strict=True):
            assert first.name == second.name
            assert_same(first.points, second.points)
            assert_same(first.pose, second.pose)
            assert first.attributes.keys() == second.attributes.keys()
            for name in first.attributes:
                assert_same(first.attributes[name], second.attributes[name])


@pytest.mark.parametrize("name", REMOTE)
def test_a_remote_drive_holds_what_the_local_one_holds(name, tmp_path, memory):
    folder = tmp_path / "bucket"
    folder.mkdir()
    FOLDERS[name].write(folder)
    scene = "/scene-0061" if name.startswith("nuScenes") else ""
    bag = next((f"/{bag}" for bag in ("drive", "drive.bag") if (folder / bag).exists()), "")
    remote = open_drive(upload(folder) + scene + bag)
    assert_same_drive(open_drive(f"{folder}{scene}{bag}"), remote)
    assert str(remote.root).startswith("memory://bucket")


@pytest.mark.parametrize("name", LOCAL)
def test_formats_whose_library_needs_files_on_a_disk_say_so(name, tmp_path, memory):
    file = FOLDERS[name].write(tmp_path)
    address = upload(tmp_path)
    for path in (file, file.parent):
        place = path.relative_to(tmp_path).as_posix()
        with pytest.raises(DriveError, match=r"^memory://bucket.* is read from local files only"):
            open_drive(f"{address}/{place}")
