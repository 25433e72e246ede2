"""The lock and the marker of an output folder, between threads, processes and links."""

import subprocess
import sys

import pytest

from intervis.errors import OutputError
from intervis.output_folder import MARKER, is_marked, is_own_file, locked, refuse_links

HOLDER = """
import sys, pathlib
from intervis.output_folder import locked
with locked(pathlib.Path(sys.argv[1]), shared=sys.argv[2] == "shared"):
    print("held", flush=True)
    sys.stdin.read()
"""


def holder(folder, mode="alone"):
    """Another process that holds the folder until its input ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder), mode],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "held\n"
    return process


def test_a_held_folder_is_refused_until_its_holder_ends(tmp_path):
    process = holder(tmp_path)
    with pytest.raises(OutputError, match="another process is writing to"), locked(tmp_path):
        pass
    process.communicate()
    with locked(tmp_path):
        assert is_marked(tmp_path)


def test_a_killed_holder_leaves_no_lock(tmp_path):
    process = holder(tmp_path)
    process.kill()
    process.communicate()
    with locked(tmp_path):
        pass


def test_those_who_share_a_folder_meet_each_other_only(tmp_path):
    process = holder(tmp_path, "shared")
    with locked(tmp_path, shared=True), locked(tmp_path, shared=True):
        pass
    with pytest.raises(OutputError, match="another process"), locked(tmp_path):
        pass
    process.communicate()


def test_a_folder_is_marked_by_the_first_who_holds_it(tmp_path):
    assert not is_marked(tmp_path)
    with locked(tmp_path):
        pass
    first = (tmp_path / MARKER).read_bytes()
    with locked(tmp_path):
        pass
    assert b"made by intervis" in first
    assert (tmp_path / MARKER).read_bytes() == first


def test_links_are_not_ours(tmp_path):
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "a.txt").write_text("a")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "a.txt").write_text("a")
    (tmp_path / "own" / "b.txt").symlink_to(tmp_path / "theirs" / "a.txt")
    (tmp_path / "link").symlink_to("theirs")
    assert is_own_file(tmp_path / "own" / "a.txt")
    assert not is_own_file(tmp_path / "own" / "b.txt")
    assert not is_own_file(tmp_path / "link" / "a.txt")
    assert not is_own_file(tmp_path / "own")
    assert not is_own_file(tmp_path / "none")
    refuse_links(tmp_path / "own", tmp_path / "none")
    with pytest.raises(OutputError, match="link is a link"):
        refuse_links(tmp_path / "own", tmp_path / "link")


def test_a_link_in_place_of_the_marker_is_refused(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / MARKER).symlink_to("mine.txt")
    with pytest.raises(OutputError, match="is a link"), locked(tmp_path):
        pass
    assert not is_marked(tmp_path)
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_a_folder_in_place_of_the_marker_is_one_sentence(tmp_path):
    (tmp_path / MARKER).mkdir()
    with (
        pytest.raises(OutputError, match=r"cannot write in .*: is a directory\."),
        locked(tmp_path),
    ):
        pass
