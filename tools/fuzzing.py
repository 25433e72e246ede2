"""What the fuzzers share: judging one run, bounded memory, the table of all targets."""

import argparse
import linecache
import resource
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from intervis.errors import IntervisError

ROOT = Path(__file__).resolve().parents[1]
SLOW_S = 2.0
MEMORY_BYTES = 2**30
"""Address space that a run may take beyond that of the process with its libraries."""

LONGEST_REFUSAL = 2000
"""Letters of a refusal at most."""


@dataclass
class Outcome:
    """What came of the runs on one target."""

    target: str
    counts: Counter[str] = field(default_factory=Counter)
    faults: Counter[str] = field(default_factory=Counter)


def judged(work: Callable[[], Any], plain: tuple[type[Exception], ...] = ()) -> tuple[str, str]:
    """Kind of the outcome of a run (read, refused, raw or slow), and what was wrong.

    Parameters
    ----------
    work : callable
    plain : tuple of exception types
        Further types that are refusals where a ``raise`` of the package raised them.
    """
    start_s = time.perf_counter()
    kind, fault = "read", ""
    try:
        work()
    except Exception as error:
        if isinstance(error, IntervisError) or (isinstance(error, plain) and _is_ours(error)):
            text = str(error)
            kind = "refused" if "\n" not in text and len(text) < LONGEST_REFUSAL else "raw"
            lines, letters = len(text.splitlines()), len(text)
            fault = f"refusal of {lines} lines and {letters} letters: {text[:60]!r}"
        else:
            kind, fault = "raw", _described(error)
    taken_s = time.perf_counter() - start_s
    if taken_s > SLOW_S:
        return "slow", f"{taken_s:.1f} s, {fault or 'read'}"
    return kind, fault


def _is_ours(error: Exception) -> bool:
    """Whether a statement of the package raised this, not something that it called."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    line = linecache.getline(last.filename, last.lineno or 0)
    return "/src/intervis/" in last.filename and line.strip().startswith("raise")


def _described(error: Exception) -> str:
    """Type, place and message of an exception, in one line."""
    frames = traceback.extract_tb(error.__traceback__)
    inner = [frame for frame in frames if "/src/intervis/" in frame.filename]
    frame = inner[-1] if inner else frames[-1]
    place = f"{Path(frame.filename).name}:{frame.lineno}"
    return f"{type(error).__name__} at {place}: {str(error)[:100]!r}"


class BoundedMemory:
    """A context in which the process may take no more than `MEMORY_BYTES` of further memory."""

    def __enter__(self) -> None:
        self._limits = resource.getrlimit(resource.RLIMIT_AS)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        used_bytes = pages * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used_bytes + MEMORY_BYTES, self._limits[1]))

    def __exit__(self, *_: object) -> None:
        resource.setrlimit(resource.RLIMIT_AS, self._limits)


def run_targets(
    fuzz: Callable[..., Outcome],
    known: Collection[str],
    arguments: Sequence[str] | None,
    *,
    description: str,
    count: int,
    keep: bool = False,
) -> int:
    """Fuzz the targets that the command line names, and print a table; 1 if anything was wrong.

    Parameters
    ----------
    fuzz : function of name, count, seed (and keep) to Outcome
    known : collection of str
        Names of all targets.
    arguments : sequence of str or None
        Of the command line.
    description : str
    count : int
        Runs on each target, unless the command line says otherwise.
    keep : bool
        Whether `fuzz` keeps what went wrong in a folder.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--count", type=int, default=count, help="runs on each target")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="targets at a time")
    if keep:
        parser.add_argument("--keep", type=Path, default=ROOT / "out" / "fuzz")
    parser.add_argument("targets", nargs="*", help="names of targets; default: all")
    options = parser.parse_args(arguments)
    names = options.targets or list(known)
    unknown = sorted(set(names) - set(known))
    if unknown:
        parser.error(f"no target {', '.join(unknown)}; there are: {', '.join(known)}")
    more = {"keep": options.keep} if keep else {}
    work = partial(fuzz, count=options.count, seed=options.seed, **more)
    print(f"{'target':28s} {'runs':>7s} {'read':>7s} {'refused':>7s} {'raw':>5s} {'slow':>5s}")
    total: Counter[str] = Counter()
    with ProcessPoolExecutor(options.jobs) as pool:
        for outcome in pool.map(work, names):
            _print_row(outcome.target, outcome.counts)
            for fault, times in outcome.faults.most_common():
                print(f"    {times:6d} x {fault}")
            total += outcome.counts
    _print_row("all", total)
    faulty = total["raw"] + total["slow"]
    kept = f"; files kept in {options.keep}" if keep and faulty else ""
    print(f"{faulty} raw or slow{kept}")
    return 1 if faulty else 0


def _print_row(name: str, counts: Counter[str]) -> None:
    figures = (counts["read"], counts["refused"], counts["raw"], counts["slow"])
    print(
        f"{name:28s} {sum(figures):7d} {figures[0]:7d} {figures[1]:7d}"
        f" {figures[2]:5d} {figures[3]:5d}"
    )
    sys.stdout.flush()
