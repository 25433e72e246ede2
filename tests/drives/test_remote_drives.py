"""Drives in storage that is reached through fsspec: what is read is what the local files hold.

No test uses a network: the storage is fsspec's memory, or a memory that counts, or that refuses.
"""

import pickle
import sys
from collections import Counter
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from drive_layouts import pose_line, scan_rows, write_kitti_raw, write_scan, write_text
from scanned_room import scanned_room
from valid_files import TARGETS

from intervis.cli import exit_code
from intervis.drives import Drive, open_drive
from intervis.drives.remote_path import remote_path
from intervis.drives.scan_file import read_scan
from intervis.errors import DriveError, MissingExtraError, OutputError, ScanError
from intervis.files import check_new_folder, make_folder, write_bytes

fsspec = pytest.importorskip("fsspec", reason="fsspec (extra remote) is not installed")
from fsspec.implementations.memory import MemoryFileSystem  # noqa: E402
from fsspec.spec import AbstractBufferedFile  # noqa: E402

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


# --- addresses ---


@pytest.fixture
def uploaded(tmp_path, memory) -> Path:
    """A drive of KITTI raw of three scans, also at ``memory://bucket``; its local folder."""
    drive = write_kitti_raw(tmp_path, images=(0, 2))
    upload(tmp_path)
    return drive


def test_an_address_may_be_written_in_several_ways(uploaded):
    place = f"bucket/{uploaded.parent.name}/{uploaded.name}"
    digest = open_drive(uploaded).fingerprint()
    drive = open_drive(f"memory://{place}")
    assert str(drive.root) == f"memory://{place}"
    for address in (
        *(f"memory://{place}/", f"MEMORY://{place}", f"memory:/{place}", Path(f"memory://{place}")),
        *("memory://bucket", drive.root, f"file://{uploaded}"),
    ):
        assert open_drive(address).fingerprint() == digest


def test_a_folder_named_like_a_scheme_is_a_folder(tmp_path, monkeypatch):
    write_scan(tmp_path / "s3:" / "street" / "1.bin", 1)
    monkeypatch.chdir(tmp_path)
    assert open_drive("s3:/street").frame_numbers == (1,)


def test_a_remote_drive_can_be_sent_to_another_process(uploaded):
    drive = pickle.loads(pickle.dumps(open_drive("memory://bucket")))
    assert_same_drive(open_drive(uploaded), drive)
    assert drive.root == open_drive("memory://bucket").root


def test_one_of_several_remote_drives_must_be_named(tmp_path, memory):
    for name in ("a", "b"):
        write_scan(tmp_path / name / "velodyne_points/data/0.bin", 0)
    with pytest.raises(DriveError, match=r"^memory://bucket holds 2 drives; .*: a, b\.$"):
        open_drive(upload(tmp_path))


def test_a_remote_path_is_as_a_local_one(tmp_path, memory):
    """Names, order and patterns, against `pathlib` on the same files."""
    for name in ("a/x.txt", "a/y.bin", "b/c/x.txt", "b/.hidden", "d.tar.gz", "image_2/0.png"):
        write_text(tmp_path / name, "content")
    root = remote_path(upload(tmp_path))

    def below(path, top):
        return path.relative_to(top).as_posix()

    for pattern in ("*", "*/*", "a/*.txt", "*/x.txt", "image_*", "image_*/0.png", "nothing/*",
                    "b/c", "d.tar.gz", "d.tar.gz/*", "[ab]/*"):  # fmt: skip
        found = sorted(below(path, root) for path in root.glob(pattern))
        assert found == sorted(below(path, tmp_path) for path in tmp_path.glob(pattern)), pattern
    for name in ("a", "a/x.txt", "d.tar.gz", "b/c", "b/none", "none/none"):
        here, there = tmp_path / name, root / name
        for question in ("exists", "is_file", "is_dir"):
            assert getattr(there, question)() == getattr(here, question)(), (name, question)
        assert (there.name, there.stem, there.suffix) == (here.name, here.stem, here.suffix)
        assert below(there.with_suffix(".q"), root) == below(here.with_suffix(".q"), tmp_path)
        assert below(there.with_name("q"), root) == below(here.with_name("q"), tmp_path)
        assert below(there.parent, root) == below(here.parent, tmp_path)
    names = ["b", "a/x", "a", "a-b", "A"]
    ordered = [below(path, root) for path in sorted(root / name for name in names)]
    assert ordered == [below(path, tmp_path) for path in sorted(tmp_path / name for name in names)]
    assert (root.parent, root.parents) == (root, [])  # buckets are not searched
    assert (root / "a").parents == [root]
    assert len({root / "a", remote_path("memory://bucket/a"), root}) == 2


# --- what is asked of the storage ---


class CountedFile(AbstractBufferedFile):
    """A file that counts what is fetched."""

    def _fetch_range(self, start: int, end: int) -> bytes:
        CountingStorage.asked["bytes"] += end - start
        CountingStorage.asked["parts"] += 1
        return bytes(self.fs.store[self.path].getbuffer()[start:end])


class CountingStorage(MemoryFileSystem):
    """The memory, with files that are fetched in parts, and a count of all questions."""

    protocol = "counting"
    asked: ClassVar[Counter] = Counter()

    @classmethod
    def _strip_protocol(cls, path):
        return MemoryFileSystem._strip_protocol(path.replace("counting://", "memory://"))

    def info(self, path, **options):
        self.asked["info"] += 1
        return super().info(path, **options)

    def ls(self, path, detail=True, **options):
        self.asked["ls"] += 1
        return super().ls(path, detail=detail, **options)

    def _open(self, path, mode="rb", block_size=None, **options):
        self.asked["info"] -= 1  # the file asks for its own size
        return CountedFile(self, path, mode, block_size, cache_type="readahead")


@pytest.fixture
def counting(memory):
    fsspec.register_implementation("counting", CountingStorage, clobber=True)
    CountingStorage.asked.clear()
    return CountingStorage.asked


def test_files_of_a_folder_are_asked_for_together(tmp_path, counting):
    """Of 40 scans with a label and an image each, no single one is asked about."""
    for number in range(40):
        write_scan(tmp_path / f"velodyne/{number:06d}.bin", number)
        np.zeros(5, "<u4").tofile(write_text(tmp_path / f"labels/{number:06d}.label", ""))
    write_text(tmp_path / "times.txt", "".join(f"{number / 10}\n" for number in range(40)))
    upload(tmp_path)
    drive = open_drive("counting://bucket")
    assert len(drive) == len(drive.label_paths) == 40
    assert counting["info"] + counting["ls"] < 20
    counting.clear()
    assert drive[7].point_classes is not None
    assert counting == {"info": 0, "bytes": 5 * 16 + 5 * 4, "parts": 2}  # one fetch for each file


def test_the_fingerprint_fetches_a_part_of_a_scan(tmp_path, counting):
    rows = np.ones((400_000, 4), np.float32)  # 6.4 MB
    for number in range(3):
        rows.tofile(tmp_path / f"{number}.bin")
    upload(tmp_path, tmp_path.name)
    drive = open_drive(f"counting://{tmp_path.name}")
    assert drive.fingerprint() == open_drive(tmp_path).fingerprint()
    assert counting["bytes"] < 0.1 * 3 * rows.nbytes


def test_opening_a_folder_of_pcd_files_fetches_their_headers(tmp_path, counting):
    points = np.tile(scanned_room(beams=2, step_deg=2.0).astype("<f4"), (300, 1))
    for number in range(3):
        head = (
            "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
            f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
            f"POINTS {len(points)}\nDATA binary\n"
        )
        (tmp_path / f"{number}.pcd").write_bytes(head.encode() + points.tobytes())
    upload(tmp_path)
    drive = open_drive("counting://bucket")
    assert counting["bytes"] < 0.5 * 3 * points.nbytes
    assert np.array_equal(drive[2].points, points)


# --- what the storage refuses ---


class RefusingStorage(MemoryFileSystem):
    """The memory, which raises `failure` for places that hold the text `at`."""

    protocol = "refusing"
    failure: Exception = RuntimeError()
    at = ""

    @classmethod
    def _strip_protocol(cls, path):
        return MemoryFileSystem._strip_protocol(path.replace("refusing://", "memory://"))

    def _refuse(self, path):
        if self.at in path:
            raise self.failure

    def info(self, path, **options):
        self._refuse(path)
        return super().info(path, **options)

    def ls(self, path, detail=True, **options):
        self._refuse(path)
        return super().ls(path, detail=detail, **options)

    def _open(self, path, *arguments, **options):
        self._refuse(path)
        return super()._open(path, *arguments, **options)


@pytest.fixture
def refusing(memory, monkeypatch):
    fsspec.register_implementation("refusing", RefusingStorage, clobber=True)

    def refuse(failure: Exception, at: str = "") -> None:
        monkeypatch.setattr(RefusingStorage, "failure", failure)
        monkeypatch.setattr(RefusingStorage, "at", at)

    return refuse


class OddError(Exception):
    """What a library of some storage raises."""


REFUSALS = [
    (PermissionError("Forbidden"), "Permission denied"),
    (TimeoutError(), "Connection timed out"),
    (OddError("Unable to locate credentials.\nA trace"), "Unable to locate credentials"),
    (OSError(5, "An error occurred (SlowDown)"), r"An error occurred \(SlowDown\)"),
    (OddError(), "OddError"),
]


@pytest.mark.parametrize(("failure", "reason"), REFUSALS)
def test_storage_that_refuses_is_told_in_one_sentence(uploaded, refusing, failure, reason):
    refusing(failure)
    with pytest.raises(DriveError, match=rf"^cannot read refusing://bucket: {reason}\.$"):
        open_drive("refusing://bucket")


@pytest.mark.parametrize(("failure", "reason"), REFUSALS)
def test_a_scan_that_storage_refuses_fails_alone(uploaded, refusing, failure, reason):
    refusing(OddError(), "nowhere")
    drive = open_drive("refusing://bucket")
    refusing(failure, "0000000001.bin")
    assert np.array_equal(drive[2].points, scan_rows(2)[:, :3])
    message = rf"^cannot read the scan refusing://bucket/.*/0000000001\.bin: {reason}\.$"
    with pytest.raises(ScanError, match=message):
        drive[1]
    with pytest.raises(DriveError, match=rf"^cannot read refusing://.*01\.bin: {reason}\.$"):
        drive.fingerprint()


class BrokenFile(AbstractBufferedFile):
    """A file whose connection ends."""

    def _fetch_range(self, start, end):
        raise OddError("Connection lost")


def test_a_connection_that_ends_within_a_file_is_told(uploaded, refusing, monkeypatch):
    refusing(OddError(), "nowhere")
    drive = open_drive("refusing://bucket")
    frame = drive[0]

    def broken(self, path, mode="rb", block_size=None, **options):
        return BrokenFile(self, path, mode, block_size)

    monkeypatch.setattr(RefusingStorage, "_open", broken)
    with pytest.raises(ScanError, match=r"00\.bin: Connection lost\.$"):
        drive[0]
    with pytest.raises(DriveError, match=r"^cannot read the image .*00\.png: Connection lost\.$"):
        _ = frame.image
    with pytest.raises(DriveError, match=r"^cannot read refusing://.*\.txt: Connection lost\.$"):
        open_drive("refusing://bucket")


def test_files_of_a_folder_that_may_not_be_listed_are_asked_for_one_by_one(
    tmp_path, refusing, monkeypatch
):
    for name in "abcde":
        write_text(tmp_path / "folder" / name, name)
    folder = remote_path(upload(tmp_path, "bucket").replace("memory", "refusing")) / "folder"
    refusing(OddError(), "nowhere")

    def refuse(self, path, **options):
        raise PermissionError("ListBucket")

    monkeypatch.setattr(RefusingStorage, "ls", refuse)
    assert [name for name in "abcdefgh" if (folder / name).is_file()] == list("abcde")
    with pytest.raises(PermissionError, match="Permission denied"):
        list(folder.iterdir())


def test_what_is_neither_file_nor_folder_is_not_opened(tmp_path, refusing, monkeypatch):
    """Pipes and devices of a server, as sftp has them: reading one may never end."""
    write_scan(tmp_path / "1.bin", 1)
    upload(tmp_path)
    refusing(OddError(), "nowhere")
    ls = MemoryFileSystem.ls

    def with_a_pipe(self, path, detail=True, **options):
        return [{**one, "type": "other"} for one in ls(self, path, detail=True, **options)]

    monkeypatch.setattr(RefusingStorage, "ls", with_a_pipe)
    (path,) = remote_path("refusing://bucket").iterdir()
    with pytest.raises(ScanError, match="it is a pipe or a device, not a file"):
        read_scan(path)


def test_an_address_is_not_opened_for_writing(memory):
    with pytest.raises(OSError, match="addresses are read and not written"):
        remote_path("memory://bucket/a").open("wb")
    assert not memory.store


def test_nothing_at_an_address_is_told(memory):
    with pytest.raises(DriveError, match=r"^there is nothing at memory://none/drive: check"):
        open_drive("memory://none/drive")


def test_an_address_of_no_known_storage_is_told():
    with pytest.raises(DriveError, match=r"^there is no storage quux://: give a local path, or"):
        open_drive("quux://bucket/drive")


def missing(package):
    """A search for a file system whose package is not installed."""

    def get_filesystem_class(scheme):
        raise ImportError(f"Install {package} to access it")

    return get_filesystem_class


@pytest.mark.parametrize(
    ("address", "package", "extra"),
    [("s3://bucket/drive", "s3fs", "s3"), ("gs://bucket/drive", "gcsfs", "gs")],
)
@pytest.mark.parametrize("has_fsspec", [False, True])
def test_a_missing_package_is_named(monkeypatch, address, package, extra, has_fsspec):
    if has_fsspec:
        monkeypatch.setattr(fsspec, "get_filesystem_class", missing(package))
    else:
        monkeypatch.setitem(sys.modules, "fsspec", None)
    command = rf"'{package}': install it with pip install 'intervis\[{extra}\]'\.$"
    with pytest.raises(MissingExtraError, match=rf"^Reading {address[:5]} .* {command}"):
        open_drive(address)


def test_the_missing_package_of_other_storage_is_told(monkeypatch):
    monkeypatch.setattr(fsspec, "get_filesystem_class", missing("adlfs"))
    with pytest.raises(DriveError, match=r"^Reading abfs:// addresses .*: Install adlfs to"):
        open_drive("abfs://bucket/drive")
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(MissingExtraError, match=r"'fsspec': .*'intervis\[remote\]'\.$"):
        open_drive("abfs://bucket/drive")


# --- commands ---


@pytest.fixture
def room(tmp_path, memory) -> Path:
    """A drive of three equal scans, 1 m apart, also at ``memory://bucket/room``."""
    for number in range(3):
        points = scanned_room(beams=16, step_deg=1.0)
        rows = np.column_stack([points, np.full(len(points), number)]).astype("<f4")
        rows.tofile(write_text(tmp_path / f"room/{number}.bin", ""))
    lines = "\n".join(pose_line(number) for number in range(3))
    write_text(tmp_path / "room/poses.txt", lines)
    write_text(tmp_path / "room/times.txt", "0\n0.1\n0.2\n")
    upload(tmp_path)
    return tmp_path / "room"


def test_sight_lines_of_a_remote_drive_are_those_of_the_local_one(room, capsys):
    said = []
    for source in (str(room), "memory://bucket/room"):
        arguments = ["sight", source, "--from", "sensor", "--to", "3,0.5,0", "--targets", "returns"]
        assert exit_code([*arguments, "--frames", "0:3"]) == 0
        said.append(capsys.readouterr().out)
    assert "3 scans" in said[0]
    assert said[1] == said[0]


def test_a_run_over_a_remote_drive_is_that_over_the_local_one(room, tmp_path):
    for source, out in ((room, "here"), ("memory://bucket/room", "there")):
        assert exit_code(["run", str(source), "--out", str(tmp_path / out)]) == 0
    names = sorted(path.name for path in (tmp_path / "here/frames").iterdir())
    assert len(names) == 3
    for name in names:
        here, there = (np.load(tmp_path / out / "frames" / name) for out in ("here", "there"))
        assert here.files == there.files
        for key in set(here.files) - {"times_s"}:
            assert here[key].tobytes() == there[key].tobytes(), (name, key)


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "ROOM", "--out", "s3://bucket/out"),
        ("masks", "ROOM", "--out", "s3://bucket/out"),
        ("sight", "ROOM", "--from", "sensor", "--to", "3,0,0", "--out", "s3://bucket/out.npz"),
    ],
)
def test_results_are_not_written_to_remote_storage(room, tmp_path, monkeypatch, capsys, arguments):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert exit_code([str(room) if word == "ROOM" else word for word in arguments]) == 2
    said = capsys.readouterr().err
    assert "intervis: cannot write s3://bucket/out" in said
    assert "results are written to a local disk" in said
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "write", [check_new_folder, make_folder, lambda path: write_bytes(path, b"")]
)
def test_no_writer_takes_an_address_for_a_path(tmp_path, monkeypatch, write):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match=r"^cannot write gs://bucket/out: results are written"):
        write(Path("gs://bucket/out"))
    assert not list(tmp_path.iterdir())
