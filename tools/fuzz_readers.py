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

import argparse
import importlib
import logging
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from intervis.errors import IntervisError
from mutators import mutated

ROOT = Path(__file__).resolve().parents[1]
TARGETS_FOLDER = ROOT / "tests" / "drives"
SLOW_S = 2.0
MEMORY_BYTES = 2**30
"""Address space that reading may take beyond that of the process with its libraries."""

LONGEST_REFUSAL = 2000
"""Letters of a refusal at most."""


@dataclass
class Outcome:
    """What came of the runs on one target."""

    target: str
    counts: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)


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
        with warnings.catch_warnings(), _bounded_memory():
            warnings.simplefilter("error")
            for number in range(count):
                rng = random.Random(f"{seed} {name} {number}")
                content = mutated(seeds[0], seeds, rng)
                path.write_bytes(content)
                kind, fault = _read(partial(known[name].read, root))
                outcome.counts[kind] += 1
                if kind in ("raw", "slow"):
                    outcome.faults[fault] += 1
                    if keep is not None and outcome.faults[fault] == 1:
                        keep.mkdir(parents=True, exist_ok=True)
                        kept = f"{name} {seed} {number}{path.suffix}".replace(" ", "-")
                        (keep / kept).write_bytes(content)
    return outcome


def _read(read: Any) -> tuple[str, str]:
    """Kind of the outcome, and what was wrong."""
    start_s = time.perf_counter()
    kind, fault = "read", ""
    try:
        read()
    except IntervisError as error:
        text = str(error)
        kind = "refused" if "\n" not in text and len(text) < LONGEST_REFUSAL else "raw"
        fault = f"refusal of {len(text.splitlines())} lines and {len(text)} letters: {text[:60]!r}"
    except Exception as error:
        frame = next(
            (
                frame
                for frame in reversed(traceback.extract_tb(error.__traceback__))
                if "/intervis/" in frame.filename
            ),
            traceback.extract_tb(error.__traceback__)[-1],
        )
        kind = "raw"
        place = f"{Path(frame.filename).name}:{frame.lineno}"
        fault = f"{type(error).__name__} at {place}: {str(error)[:100]!r}"
    taken_s = time.perf_counter() - start_s
    if taken_s > SLOW_S:
        return "slow", f"{taken_s:.1f} s, {fault or 'read'}"
    return kind, fault


class _bounded_memory:  # noqa: N801, a context manager
    def __enter__(self) -> None:
        self._limits = resource.getrlimit(resource.RLIMIT_AS)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        used_bytes = pages * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used_bytes + MEMORY_BYTES, self._limits[1]))

    def __exit__(self, *_: object) -> None:
        resource.setrlimit(resource.RLIMIT_AS, self._limits)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fuzz the targets and print a table; 1 if anything was raw or slow."""
    parser = argparse.ArgumentParser(description="Fuzz the readers with changed files.")
    parser.add_argument("--count", type=int, default=20_000, help="changed files for each target")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="targets at a time")
    parser.add_argument("--keep", type=Path, default=ROOT / "out" / "fuzz")
    parser.add_argument("targets", nargs="*", help="names of targets; default: all")
    options = parser.parse_args(arguments)
    names = options.targets or list(targets())
    unknown = sorted(set(names) - set(targets()))
    if unknown:
        parser.error(f"no target {', '.join(unknown)}; there are: {', '.join(targets())}")
    work = partial(fuzz, count=options.count, seed=options.seed, keep=options.keep)
    print(f"{'target':28s} {'runs':>7s} {'read':>7s} {'refused':>7s} {'raw':>5s} {'slow':>5s}")
    faulty = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        for outcome in pool.map(work, names):
            counts = outcome.counts
            figures = (counts["read"], counts["refused"], counts["raw"], counts["slow"])
            print(
                f"{outcome.target:28s} {sum(figures):7d} {figures[0]:7d} {figures[1]:7d}"
                f" {figures[2]:5d} {figures[3]:5d}",
                flush=True,
            )
            for fault, times in outcome.faults.most_common():
                print(f"    {times:6d} x {fault}")
            faulty += counts["raw"] + counts["slow"]
    print(f"{faulty} raw or slow; files kept in {options.keep}" if faulty else "0 raw or slow")
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main())
