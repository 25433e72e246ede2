"""Fuzzing: a short run over every reader, and what the tool counts."""

import importlib
import random
import sys
import warnings
from pathlib import Path

import pytest

from intervis.errors import DriveError

TOOLS = Path(__file__).resolve().parents[2] / "tools"
sys.path.insert(0, str(TOOLS))
fuzzing = importlib.import_module("fuzzing")
fuzz_readers = importlib.import_module("fuzz_readers")
mutators = importlib.import_module("mutators")
TARGETS = fuzz_readers.targets()


@pytest.mark.parametrize("target", TARGETS)
def test_changed_files_are_read_or_refused_in_one_sentence(target, monkeypatch):
    """A short run; `make fuzz` is the long one, and the one that measures time."""
    monkeypatch.setattr(fuzzing, "SLOW_S", float("inf"))
    if target in ("jpeg", "mcap with a camera"):
        pytest.importorskip("PIL", reason="Pillow (extra plots) is not installed")
    outcome = fuzz_readers.fuzz(target, count=60, seed=1, keep=None)
    assert not outcome.faults
    assert outcome.counts["read"] + outcome.counts["refused"] == 60
    assert outcome.counts["refused"] > 0  # the changes are no caresses


def made_target(read):
    def write(folder):
        path = folder / "file.txt"
        path.write_bytes(b"seed")
        return path

    return TARGETS["settings"]._replace(write=write, read=read)


def refuse(text):
    raise DriveError(text)


def warn():
    warnings.warn("leaked", UserWarning, stacklevel=1)


def take(size_bytes):
    return len(bytearray(size_bytes))


@pytest.mark.parametrize(
    ("action", "kind"),
    [
        (lambda: 1, "read"),
        (lambda: refuse("one sentence."), "refused"),
        (lambda: refuse("two\nlines"), "raw"),
        (lambda: refuse("endless " * 1000), "raw"),
        (lambda: 1 / 0, "raw"),
        (lambda: {}["key"], "raw"),
        (warn, "raw"),
        (lambda: take(2**31), "raw"),
    ],
)
def test_outcomes_are_told_apart(monkeypatch, tmp_path, action, kind):
    """The valid file is read; each changed one has the outcome."""

    def read(folder):
        return 1 if (folder / "file.txt").read_bytes() == b"seed" else action()

    monkeypatch.setattr(fuzz_readers, "targets", lambda: {"made": made_target(read)})
    outcome = fuzz_readers.fuzz("made", count=20, seed=3, keep=tmp_path / "kept")
    assert outcome.counts[kind] > 10  # a few changes change nothing
    assert set(outcome.counts) <= {kind, "read"}
    kept = list((tmp_path / "kept").iterdir()) if kind == "raw" else []
    assert len(kept) == (kind == "raw")  # one file for each kind of fault
    assert all(path.read_bytes() != b"seed" for path in kept)


def test_slow_reading_is_found(monkeypatch):
    monkeypatch.setattr(fuzzing, "SLOW_S", 0.0)
    outcome = fuzz_readers.fuzz("settings", count=3, seed=0, keep=None)
    assert outcome.counts["slow"] == 3


def test_a_seed_repeats_its_changes_and_another_does_not():
    seeds = [b"FIELDS x y z\nSIZE 4 4 4\nDATA ascii\n1 2 3\n", bytes(range(256))]

    def changed(seed):
        return [mutators.mutated(seeds[0], seeds, random.Random(f"{seed} {n}")) for n in range(200)]

    assert changed(0) == changed(0)
    assert changed(0) != changed(1)
    assert len(set(changed(0))) > 150


@pytest.mark.parametrize("mutator", mutators.MUTATORS, ids=lambda mutator: mutator.__name__)
@pytest.mark.parametrize("content", [b"", b"\n", b"12 a\nb 3.5\n", bytes(700)])
def test_every_change_takes_any_content(mutator, content):
    changed = {mutator(content, [content, b"other"], random.Random(n)) for n in range(50)}
    assert all(isinstance(result, bytes) for result in changed)
    assert len(changed) > 1 or len(content) < 2 or content == bytes(700)


def test_the_exit_code_says_whether_anything_was_raw(monkeypatch, capsys, tmp_path):
    def outcome_of(target, count, seed, keep):
        outcome = fuzz_readers.Outcome(target)
        outcome.counts.update({"read": count - 1, "raw" if target == "png" else "refused": 1})
        outcome.faults.update(["KeyError at made.py:3"] * (target == "png"))
        return outcome

    monkeypatch.setattr(fuzz_readers, "fuzz", outcome_of)
    monkeypatch.setattr(fuzzing, "ProcessPoolExecutor", SamePlace)
    arguments = ["--count", "5", "--keep", str(tmp_path)]
    assert fuzz_readers.main([*arguments, "poses", "labels"]) == 0
    assert "0 raw or slow" in capsys.readouterr().out
    assert fuzz_readers.main([*arguments, "poses", "png"]) == 1
    assert "1 x KeyError at made.py:3" in capsys.readouterr().out


class SamePlace:
    """An executor without processes."""

    def __init__(self, jobs):
        assert jobs == 2

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def map(self, work, names):
        return map(work, names)
