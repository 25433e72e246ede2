"""Compiled kernels: one place decides how they are compiled, cached and spread over threads.

A kernel may use the constants and the kernels of its own folder. Compiled code holds copies of
them, so what is kept on disk is bound to all source of that folder: after an edit or an upgrade
it is compiled again.

Kernels release the interpreter lock and are spread by `in_parts` over plain threads. That needs
none of numba's threading layers, so nothing warns about an old TBB and any thread may call.
"""

import contextlib
import hashlib
import inspect
import logging
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event as numba_event

log = logging.getLogger(__name__)

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a function on its first call, to disk where a cache can be written."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    try:
        compiled = numba.njit(cache=True, **options)(function)
        _bind_to_sources(compiled, Path(inspect.getfile(function)).parent)
    except (RuntimeError, AttributeError):  # nothing can be kept: compile in memory, every time
        compiled = numba.njit(**options)(function)
    return cast(Function, compiled)


_events: Any = numba_event  # it has no types


class _Announcement(_events.Listener):  # type: ignore[misc]
    """Says once, on the log, that a kernel is compiled now."""

    def on_start(self, event: Any) -> None:
        """Speak, and listen no longer."""
        if event.data["dispatcher"].py_func.__module__.startswith("intervis."):
            log.info("compiling kernels, once for this version and machine: up to half a minute")
            with contextlib.suppress(ValueError):  # another thread was first
                _events.unregister("numba:compile", self)

    def on_end(self, event: Any) -> None:
        """Say nothing."""


_events.register("numba:compile", _Announcement())


def _bind_to_sources(compiled: Any, folder: Path) -> None:
    """Make what is cached on disk of a kernel depend on all source files of its folder.

    numba compares the time stamp and the size of the one file that defines the kernel, and has no
    public setting for more. The digest becomes part of the version, which numba compares before
    it unpickles the index: an index that refers to renamed modules cannot be unpickled. A cache
    that cannot be read or written costs a warning and a compilation, not the run.
    """
    file = compiled._cache._cache_file
    file._version = f"{file._version} {_digest(folder)}"
    file.load = _never_fails(file.load, file.flush)
    file.save = _never_fails(file.save, file.flush)


def _never_fails(access: Callable[..., Any], reset: Callable[[], None]) -> Callable[..., Any]:
    def guarded(*arguments: Any) -> Any:
        try:
            return access(*arguments)
        except Exception as error:
            log.warning("the cache of compiled kernels cannot be used: %s", error)
            with contextlib.suppress(Exception):
                reset()
            return None

    return guarded


@cache
def _digest(folder: Path) -> str:
    """Digest of a folder's Python source."""
    digest = hashlib.sha256()
    for file in sorted(folder.glob("*.py")):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()


def thread_count() -> int:
    """How many threads kernels run on: the cores this process may use, or INTERVIS_THREADS."""
    asked = os.environ.get("INTERVIS_THREADS", "")
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="intervis")


def in_parts(work: Callable[[int, int], object], count: int, least: int = 4096) -> None:
    """Call ``work(start, stop)`` over parts of ``range(count)``, on several threads at once.

    Parameters
    ----------
    work : callable
        Must release the interpreter lock (a `kernel`) and write to its own part of the output.
    count : int
        Number of items in all.
    least : int
        Parts smaller than this are not worth a thread.
    """
    threads = min(thread_count(), max(1, count // least))
    if threads == 1:
        work(0, count)
        return
    # More parts than threads: the parts differ in cost, and a free thread takes the next one.
    parts = threads * 4
    bounds = [count * part // parts for part in range(parts + 1)]
    for done in [
        _pool(threads).submit(work, start, stop) for start, stop in pairwise(bounds) if stop > start
    ]:
        done.result()
