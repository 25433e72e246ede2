"""Files appear whole or not at all, and a failure names the file and the reason."""

import errno
import os

import pytest

from intervis.errors import OutputError
from intervis.files import remove_parts, whole_folder, write_bytes, write_text, write_whole
from small_drive import files_below


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(errno.EACCES, "Permission denied"), "permission denied."),
        (OSError("odd"), "odd."),
        (OSError(errno.ENOSPC, ""), "the disk is full; free some space and run the command again."),
        (OSError(errno.EDQUOT, ""), "the disk is full; free some space and run the command again."),
    ],
)
def test_a_failure_names_file_and_reason_and_leaves_the_old_file(tmp_path, error, reason):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")

    def fail(file):
        file.write(b"half")
        raise error

    with pytest.raises(OutputError) as caught:
        write_whole(path, fail)
    assert str(caught.value) == f"cannot write {path}: {reason}"
    assert path.read_bytes() == b"old"
    assert list(files_below(tmp_path)) == ["a.bin"]


def test_any_exception_leaves_no_part(tmp_path):
    with pytest.raises(ZeroDivisionError):
        write_whole(tmp_path / "a.bin", lambda file: 1 / 0)
    assert files_below(tmp_path) == {}


def test_writers_of_one_file_do_not_meet(tmp_path):
    path = tmp_path / "a.bin"

    def slow(file):
        file.write(b"fir")
        write_whole(path, lambda other: other.write(b"second"))
        file.write(b"st")

    write_whole(path, slow)
    assert path.read_bytes() == b"first"
    assert list(files_below(tmp_path)) == ["a.bin"]


def test_equal_content_is_not_written_again(tmp_path):
    path = tmp_path / "new" / "folders" / "a.bin"
    write_bytes(path, b"one")
    os.utime(path, ns=(0, 0))
    write_bytes(path, b"one")
    assert path.stat().st_mtime_ns == 0
    write_bytes(path, b"two")
    assert path.read_bytes() == b"two"
    assert path.stat().st_mtime_ns > 0


def test_a_file_in_place_of_a_folder_is_an_error(tmp_path):
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(OutputError, match=r"cannot write .*taken/a\.bin"):
        write_bytes(tmp_path / "taken" / "a.bin", b"one")


def test_bytes_of_a_name_that_are_not_utf8_are_escaped(tmp_path):
    write_text(tmp_path / "a.txt", "dr\udcefve")
    assert (tmp_path / "a.txt").read_text() == "dr\\udcefve"


def test_a_link_is_kept_and_its_target_is_written(tmp_path):
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "target.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("kept/target.txt")
    (tmp_path / "new.txt").symlink_to("kept/created.txt")
    for name in ("link.txt", "new.txt"):
        write_text(tmp_path / name, "new")
        assert (tmp_path / name).is_symlink()
    assert (tmp_path / "kept" / "target.txt").read_text() == "new"
    assert (tmp_path / "kept" / "created.txt").read_text() == "new"
    assert len(list(tmp_path.rglob("*"))) == 5


@pytest.mark.parametrize("write", [write_bytes, write_text])
def test_a_pipe_is_refused_and_stays(tmp_path, write):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    (tmp_path / "link").symlink_to("pipe")
    for path in (pipe, tmp_path / "link"):
        with pytest.raises(OutputError, match="give the path of a file"):
            write(path, "x" if write is write_text else b"x")
    assert pipe.is_fifo()
    assert (tmp_path / "link").is_symlink()


def test_a_circle_of_links_is_an_error(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OutputError, match="cannot write"):
        write_text(tmp_path / "a", "x")
    assert (tmp_path / "a").is_symlink()


def test_a_folder_gets_its_name_when_it_is_complete(tmp_path):
    with whole_folder(tmp_path / "deep" / "new") as part:
        (part / "a").mkdir()
        (part / "a" / "b.txt").write_text("b")
        assert not (tmp_path / "deep" / "new").exists()
    assert list(files_below(tmp_path)) == ["deep/new/a/b.txt"]


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, ""), KeyboardInterrupt()])
def test_a_folder_that_is_cut_off_leaves_nothing(tmp_path, error):
    raised = OutputError if isinstance(error, OSError) else KeyboardInterrupt

    def cut_off():
        with whole_folder(tmp_path / "new") as part:
            (part / "half.txt").write_text("half")
            raise error

    with pytest.raises(raised):
        cut_off()
    assert not list(tmp_path.iterdir())


def test_of_two_processes_that_make_one_folder_the_second_fails(tmp_path):
    def both():
        with whole_folder(tmp_path / "new") as first, whole_folder(tmp_path / "new") as second:
            assert first != second
            (first / "a.txt").write_text("a")
            (second / "b.txt").write_text("b")

    with pytest.raises(OutputError, match="cannot write"):
        both()
    assert list(files_below(tmp_path)) == ["new/b.txt"]


def test_a_folder_with_files_is_not_changed(tmp_path):
    (tmp_path / "a.txt").write_text("mine")
    for path, what in ((tmp_path, "holds files already"), (tmp_path / "a.txt", "is a file")):
        with pytest.raises(OutputError, match=f"{what} and was not changed"), whole_folder(path):
            raise AssertionError
    assert list(files_below(tmp_path)) == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "mine"


def test_parts_of_one_file_are_removed_whatever_it_is_called(tmp_path):
    """The name is no pattern: [1] is not 1; links and files of other names stay."""
    names = [".[1].npz.0a.part", ".1.npz.0a.part", "[1].npz", ".[1].npz.link.part"]
    for name in names[:3]:
        (tmp_path / name).write_text("half")
    (tmp_path / names[3]).symlink_to(tmp_path / "[1].npz")
    remove_parts(tmp_path / "[1].npz")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names[1:])
    remove_parts(tmp_path / "none" / "a.npz")
