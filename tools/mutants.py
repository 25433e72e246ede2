"""Mutation run: does a test fail when the code is changed a little?

A seeded sample of the mutations (`mutations`) of some folders is tested. Each mutant is written
into a copy of the project, where the tests of its folder and the doctests of its module run until
the first failure. A mutant is killed when a test fails, when Python or the compiler refuses it, or
when it runs out of time; else it survives, and a test is missing.

Results are appended to a file while the run goes on. A run that is started again with the same
code, tests and sample goes on where it stopped.

``python tools/mutants.py --help`` lists the options; docs/testing.md explains them.
"""

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pytest

from mutations import Mutation, defaults_of, mutations_of

ROOT = Path(__file__).resolve().parents[1]
AREAS = {
    "src/intervis/method": "tests/method",
    "src/intervis/sight": "tests/sight",
    "src/intervis/drives": "tests/drives",
}
"""Folders of source, and the folder of tests for each."""

KILLED, TIMED_OUT, SURVIVED = "killed", "timed out", "survived"
MEMORY_KIB = 12 * 1024**2
"""Address space of one test run: a mutant that allocates without end must not stop the machine."""

IGNORED = shutil.ignore_patterns("*.egg-info", "__pycache__")
LIMIT_FACTOR, LIMIT_EXTRA_S = 4.0, 30.0
"""A mutant may take this many times as long as the unchanged code, and this much longer."""


@dataclass(frozen=True)
class Mutant:
    """A mutation of one file of the project.

    Attributes
    ----------
    area : str
        Folder of source that it belongs to.
    file : str
        Its file, relative to the project.
    mutation : Mutation
    """

    area: str
    file: str
    mutation: Mutation

    @property
    def key(self) -> str:
        """File, function, original and mutated source: does not change with line numbers."""
        return f"{self.file}::{self.mutation.name}"


@dataclass(frozen=True)
class Result:
    """What the tests said of a mutant.

    Attributes
    ----------
    key : str
        See `Mutant.key`.
    digest : str
        SHA-256 of the source and the tests that it holds for.
    area, file, line, operator, original, mutated
        See `Mutant` and `Mutation`.
    outcome : str
        ``killed``, ``timed out`` or ``survived``.
    seconds : float
        Duration of the tests.
    """

    key: str
    digest: str
    area: str
    file: str
    line: int
    operator: str
    original: str
    mutated: str
    outcome: str
    seconds: float


class MutationError(Exception):
    """The run cannot start or cannot go on."""


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line; 0 when every mutant was tested, 2 when the run cannot start."""
    options = _options(arguments)
    try:
        _run(options)
    except MutationError as error:
        print(f"mutants: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("mutants: stopped; the same command goes on from here.", file=sys.stderr)
        return 130
    return 0


def _run(options: argparse.Namespace) -> None:
    root: Path = options.root.resolve()
    areas = dict(pair.split("=") for pair in options.area) if options.area else AREAS
    chosen = sampled(mutants_of(root, areas), options.equivalent, options.count, options.seed)
    chosen = [mutant for mutant in chosen if options.match in mutant.key]
    digests = {area: _digest(root, area, tests) for area, tests in areas.items()}
    done = _results(options.results, chosen, digests)
    waiting = [mutant for mutant in chosen if mutant.key not in done]
    print(f"{len(chosen)} mutants, {len(done)} of them tested before")
    if options.list:
        for mutant in chosen:
            print(mutant.key)
        return
    if waiting:
        options.results.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
            runner = Runner(root, areas, Path(folder))
            runner.prepare({mutant.area for mutant in waiting})
            for result in _tested(waiting, runner, digests, options):
                done[result.key] = result
    for line in table([done[mutant.key] for mutant in chosen]):
        print(line)


def mutants_of(root: Path, areas: Iterable[str]) -> list[Mutant]:
    """All mutants of some folders, ordered by file and line."""
    for area in areas:
        if not (root / area).is_dir():
            raise MutationError(f"there is no folder {root / area}.")
    sources = [file.read_text() for file in sorted((root / "src").rglob("*.py"))]
    defaults = defaults_of(sources)
    return [
        Mutant(area, file.relative_to(root).as_posix(), mutation)
        for area in areas
        for file in sorted((root / area).rglob("*.py"))
        for mutation in mutations_of(file.read_text(), defaults)
    ]


def sampled(mutants: list[Mutant], equivalent: Path, count: int, seed: int) -> list[Mutant]:
    """A random sample of the mutants that are not known to be equivalent, in order.

    Raises
    ------
    MutationError
        The list of equivalent mutants names one of these folders that does not exist, or gives no
        reason.
    """
    excluded = _equivalent_keys(equivalent)
    folders = tuple(f"{area}/" for area in {mutant.area for mutant in mutants})  # of `--area`
    unknown = {key for key in excluded if key.startswith(folders)} - {one.key for one in mutants}
    if unknown:
        raise MutationError(f"{equivalent} names mutants that do not exist: {sorted(unknown)}.")
    candidates = [mutant for mutant in mutants if mutant.key not in excluded]
    picked = random.Random(seed).sample(range(len(candidates)), min(count, len(candidates)))
    return [candidates[index] for index in sorted(picked)]


def _equivalent_keys(file: Path) -> set[str]:
    if not file.is_file():
        return set()
    keys = set()
    for line in file.read_text().splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        key, _, reason = line.rpartition("  # ")
        if not key or not reason.strip():
            raise MutationError(f"{file}: this line gives no reason after '  # ': {line}")
        keys.add(key.strip())
    return keys


class Runner:
    """Runs tests against mutants, each in a project copy of its own.

    Parameters
    ----------
    root : Path
        The project; it is only read.
    areas : dict of str to str
        Folder of tests for each folder of source.
    folder : Path
        Where copies are made.
    """

    def __init__(self, root: Path, areas: dict[str, str], folder: Path) -> None:
        self.root = root
        self.areas = areas
        self.folder = folder
        self.limit_s: dict[str, float] = {}
        self.original = folder / "original" / "project"
        self.running: set[subprocess.Popen[str]] = set()
        self.order = {area: _test_files(root, tests) for area, tests in areas.items()}

    def prepare(self, areas: set[str]) -> None:
        """Copy the project and run the tests of these areas on the unchanged code.

        This measures how long a mutant may take. It also compiles the kernels: numba keeps them
        beside the copy's source, and a mutant of another folder need not compile them again.

        Raises
        ------
        MutationError
            The tests do not pass on the unchanged code.
        """
        self.original.mkdir(parents=True)
        for name in ("src", "tests"):
            shutil.copytree(self.root / name, self.original / name, ignore=IGNORED)
        shutil.copy2(self.root / "pyproject.toml", self.original)
        for area in sorted(areas):
            start = time.perf_counter()
            outcome, output = self._tests(self.original, [area, *self.order[area]], None)
            if outcome != SURVIVED:
                raise MutationError(f"{self.areas[area]} fails without a mutant:\n{output}")
            took_s = time.perf_counter() - start
            self.limit_s[area] = LIMIT_FACTOR * took_s + LIMIT_EXTRA_S
            print(
                f"{self.areas[area]} passes in {took_s:.0f} s;"
                f" a mutant has {self.limit_s[area]:.0f} s",
                flush=True,
            )

    def test(self, mutant: Mutant) -> tuple[str, float]:
        """Outcome of one mutant, and seconds."""
        with self._copy() as project:
            (project / mutant.file).write_text(mutant.mutation.source)
            start = time.perf_counter()
            tests = [file for _, file in self._ordered(mutant)]
            outcome, _ = self._tests(project, [mutant.file, *tests], self.limit_s[mutant.area])
            return outcome, time.perf_counter() - start

    def _ordered(self, mutant: Mutant) -> list[tuple[int, str]]:
        """The area's test files, those first that mention most names of the mutated module."""
        words = _names((self.root / mutant.file).read_text()) | {Path(mutant.file).stem}
        return sorted((-len(words & seen), file) for file, seen in self.order[mutant.area].items())

    @contextmanager
    def _copy(self) -> Iterator[Path]:
        with tempfile.TemporaryDirectory(prefix="mutant-", dir=self.folder) as folder:
            shutil.copytree(self.original.parent, folder, symlinks=True, dirs_exist_ok=True)
            yield Path(folder) / "project"

    def _tests(self, project: Path, files: list[str], limit_s: float | None) -> tuple[str, str]:
        """Outcome of the tests in some files or folders of a copy, and their output."""
        shared = project.parent / "shared"
        if not shared.exists() and (self.root.parent / "shared").exists():
            shared.symlink_to((self.root.parent / "shared").resolve())
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow"]
        plugins = ["-p", "no:cacheprovider", "-p", "no:xdist", "--hypothesis-seed=0"]
        process = subprocess.Popen(
            ["sh", "-c", f'ulimit -v {MEMORY_KIB}; exec "$@"', "sh", *command, *plugins, *files],
            cwd=project,
            env=_environment(project),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.running.add(process)
        try:
            output, _ = process.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            return TIMED_OUT, f"more than {limit_s} s"
        finally:
            _end(process)
            self.running.discard(process)
        if process.returncode == pytest.ExitCode.USAGE_ERROR and "conftest" not in output:
            # Not the mutant's doing: the environment has changed, and every mutant would count.
            raise SystemExit(f"the tests do not start:\n{output.strip()}")
        passed = process.returncode in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
        return (SURVIVED if passed else KILLED), output

    def stop(self) -> None:
        """End all running tests; what they would have said is not kept."""
        for process in list(self.running):
            with suppress(ProcessLookupError):  # it has just ended
                os.killpg(process.pid, signal.SIGKILL)


def _end(process: subprocess.Popen[str]) -> None:
    """End a test run with all processes it has started."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def _environment(project: Path) -> dict[str, str]:
    """One thread for each run, the copy's source, and kernels cached beside that source."""
    kept = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    threads = dict.fromkeys(("INTERVIS_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    return kept | threads | {"PYTHONPATH": str(project / "src")}


def _test_files(root: Path, tests: str) -> dict[str, set[str]]:
    """The words in each test file of a folder."""
    return {
        file.relative_to(root).as_posix(): set(re.findall(r"\w+", file.read_text()))
        for file in sorted((root / tests).rglob("test_*.py"))
    }


def _names(source: str) -> set[str]:
    """Names that a module defines at its top level."""
    return set(re.findall(r"^(?:def |class )?(\w+)(?:\(|:| =)", source, flags=re.MULTILINE))


def _tested(
    waiting: list[Mutant], runner: Runner, digests: dict[str, str], options: argparse.Namespace
) -> Iterator[Result]:
    """Test mutants several at a time; write and show each result when it is there."""
    with (
        options.results.open("a") as file,
        ThreadPoolExecutor(options.jobs) as pool,
    ):
        running = {pool.submit(runner.test, mutant): mutant for mutant in waiting}
        try:
            for number, future in enumerate(as_completed(running), start=1):
                result = _result(running[future], digests, *future.result())
                file.write(json.dumps(asdict(result)) + "\n")
                file.flush()
                place = f"[{number}/{len(waiting)}] {result.outcome:9} {result.seconds:5.1f} s"
                print(f"{place}  {result.file}:{result.line}", flush=True)
                yield result
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            runner.stop()
            raise


def _result(mutant: Mutant, digests: dict[str, str], outcome: str, seconds: float) -> Result:
    mutation = mutant.mutation
    return Result(
        key=mutant.key,
        digest=digests[mutant.area],
        area=mutant.area,
        file=mutant.file,
        line=mutation.line,
        operator=mutation.operator,
        original=mutation.original,
        mutated=mutation.mutated,
        outcome=outcome,
        seconds=round(seconds, 1),
    )


def _results(file: Path, mutants: list[Mutant], digests: dict[str, str]) -> dict[str, Result]:
    """Earlier results that still hold: those of the same source and the same tests."""
    keys = {mutant.key for mutant in mutants}
    results: dict[str, Result] = {}
    for line in file.read_text().splitlines() if file.is_file() else ():
        try:
            fields: dict[str, Any] = json.loads(line)
        except json.JSONDecodeError:  # a line that an interrupted run was writing
            continue
        result = Result(**fields)
        if result.key in keys and result.digest == digests.get(result.area):
            results[result.key] = result
    return results


def _digest(root: Path, area: str, tests: str) -> str:
    """Digest of all source and of an area's tests."""
    digest = hashlib.sha256(f"{area} {tests}".encode())
    shared_tests = (root / "tests").glob("*.py")
    for file in sorted({*(root / "src").rglob("*.py"), *(root / tests).rglob("*"), *shared_tests}):
        if file.is_file() and "__pycache__" not in file.parts:
            digest.update(file.relative_to(root).as_posix().encode() + file.read_bytes())
    return digest.hexdigest()


def table(results: list[Result]) -> Iterator[str]:
    """Lines of the final report: the score of each area, and the survivors."""
    yield ""
    yield f"{'area':28}{'mutants':>9}{'killed':>9}{'timed out':>11}{'survived':>10}{'score':>8}"
    areas = dict.fromkeys(result.area for result in results)
    for area in [*areas, "all"]:
        counts = Counter(one.outcome for one in results if area in (one.area, "all"))
        total = counts.total()
        score = f"{(total - counts[SURVIVED]) / total:.0%}" if total else "-"
        columns = f"{total:9}{counts[KILLED]:9}{counts[TIMED_OUT]:11}{counts[SURVIVED]:10}"
        yield f"{area:28}{columns}{score:>8}"
    for outcome in (SURVIVED, TIMED_OUT):
        chosen = [result for result in results if result.outcome == outcome]
        if chosen:
            yield ""
            yield f"{outcome}:"
        for result in chosen:
            yield f"{result.file}:{result.line}  [{result.operator}]"
            yield f"    {result.key.partition('::')[2]}"


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description="Tests whether the tests notice small changes of the code."
    )
    add = parser.add_argument
    add("--count", type=int, default=100, help="mutants to sample (%(default)s)")
    add("--seed", type=int, default=0, help="seed of the sample (%(default)s)")
    add("--jobs", type=int, default=2, help="mutants tested at a time (%(default)s)")
    add("--match", default="", help="only sampled mutants whose file, function or source has this")
    add("--list", action="store_true", help="list the sample and stop")
    add("--root", type=Path, default=ROOT, help="the project (this one)")
    add(
        "--area",
        action="append",
        metavar="SOURCE=TESTS",
        help="a folder of source and its tests; may be repeated (method, sight and drives)",
    )
    add("--results", type=Path, help="file of results (out/mutants.jsonl in the project)")
    add("--equivalent", type=Path, help="list of equivalent mutants (tools/ in the project)")
    options = parser.parse_args(arguments)
    options.results = options.results or options.root / "out" / "mutants.jsonl"
    options.equivalent = options.equivalent or options.root / "tools" / "equivalent_mutants.txt"
    return options


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.exit(main())
