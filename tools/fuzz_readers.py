"""Fuzzing of the readers: every changed file is read, or refused in one sentence.

For each target (a kind of file in a small valid drive, see ``tests/drives/valid_files.py``) the
file is changed at random, again and again, and everything of the drive is read. An outcome is

- read: no exception;
- refused: an `IntervisError` with one line of text;
- raw: any other exception, a warning, or a refusal of several lines. The changed file is kept in
  ``out/fuzz``: make it a fixture of a test;
- slow: more than two seconds.

Memory is bounded while the files are read, so that a reader which takes what a header declares
fails. Runs with the same seed and count are the same. ``python tools/fuzz_readers.py --help``
lists the options.
"""

import importlib
import logging
import random
import sys
import tempfile
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from fuzzing import ROOT, BoundedMemory, Outcome, judged, run_targets
from mutators import mutated

TARGETS_FOLDER = ROOT / "tests" / "drives"


def targets() -> dict[str, Any]:
    """The targets of the tests, by name."""
    if str(TARGETS_FOLDER) not in sys.path:
        sys.path.insert(0, str(TARGETS_FOLDER))
    return dict(importlib.import_module("valid_files").TARGETS)


def fuzz(name: str, count: int, seed: int, keep: Path | None) -> Outcome:
    """Read `count` changed files of one target.

    Parameters
    ----------
    name : str
        The target.
    count, seed : int
    keep : Path or None
        Folder for the files that end in a raw exception or take too long.
    """
    known = targets()
    logging.getLogger("intervis").addHandler(logging.NullHandler())
    logging.getLogger("intervis").propagate = False
    outcome = Outcome(name)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "drive"
        root.mkdir()
        path = known[name].write(root)
        seeds = [path.read_bytes()]
        known[name].read(
            root
        )  # a valid file is read; libraries are loaded before memory is bounded
        for number, other in enumerate(known):
            place = Path(folder) / f"other{number}"
            place.mkdir()
            seeds.append(known[other].write(place).read_bytes())
        with warnings.catch_warnings(), BoundedMemory():
            warnings.simplefilter("error")
            for number in range(count):
                rng = random.Random(f"{seed} {name} {number}")
                content = mutated(seeds[0], seeds, rng)
                path.write_bytes(content)
                kind, fault = judged(partial(known[name].read, root))
                outcome.counts[kind] += 1
                if kind in ("raw", "slow"):
                    outcome.faults[fault] += 1
                    if keep is not None and outcome.faults[fault] == 1:
                        keep.mkdir(parents=True, exist_ok=True)
                        kept = f"{name} {seed} {number}{path.suffix}".replace(" ", "-")
                        (keep / kept).write_bytes(content)
    return outcome


def main(arguments: Sequence[str] | None = None) -> int:
    """Fuzz the targets and print a table; 1 if anything was raw or slow."""
    description = "Fuzz the readers with changed files."
    known = list(targets())
    return run_targets(fuzz, known, arguments, description=description, count=20_000, keep=True)


if __name__ == "__main__":
    sys.exit(main())
