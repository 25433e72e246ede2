"""Executors for a run: processes of this machine, or workers of dask."""

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.process import BaseProcess
from typing import Any

from intervis.errors import MissingExtraError, SettingsError
from intervis.kernels import thread_count

MOST_WORKERS = 1024
GRACE_S = 10.0
"""Seconds that workers have to end their stretches when a run is stopped."""


@contextmanager
def process_workers(count: int) -> Iterator[Executor]:
    """An executor of worker processes, which share the cores of this machine.

    The processes are spawned, not forked, so threads of the caller do not matter. They end with
    the caller, also when it is killed.

    Parameters
    ----------
    count : int
        Number of processes, 1 to 1024.

    Raises
    ------
    SettingsError
        `count` is out of range.
    """
    threads = _threads_of_each(count)
    others = set(active_children())
    pool = ProcessPoolExecutor(count, get_context("spawn"), initializer=_start, initargs=(threads,))
    try:
        yield pool
    finally:
        # shutdown() alone may wait for ever: a worker that is killed while it waits for work holds
        # a lock, and the others do not hear that there is no more.
        pool.shutdown(wait=False, cancel_futures=True)
        _end(set(active_children()) - others)


@contextmanager
def dask_workers(address: str | None, count: int) -> Iterator[Executor]:
    """An executor over dask workers.

    Parameters
    ----------
    address : str or None
        Of a scheduler whose workers see the same folders. None: a cluster on the loopback
        interface of this machine.
    count : int
        Worker processes of a cluster of this machine.

    Raises
    ------
    MissingExtraError
        dask's package ``distributed`` is not installed.
    SettingsError
        `count` is out of range, or there is no scheduler at `address`.
    """
    threads = _threads_of_each(count)
    try:
        import distributed
    except ImportError:
        raise MissingExtraError("distributed", "cluster", "the executor dask") from None
    dask: Any = distributed  # it has no types
    logging.getLogger("distributed").setLevel(logging.ERROR)  # it reports each connection
    if address is None:
        cluster = dask.LocalCluster(
            host="127.0.0.1",
            n_workers=count,
            threads_per_worker=1,
            dashboard_address="127.0.0.1:0",
            env={"INTERVIS_THREADS": str(threads)},
            silence_logs=logging.ERROR,
        )
        with cluster, dask.Client(cluster) as client:
            yield client.get_executor(pure=False)
        return
    try:
        client = dask.Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        reason = (str(error) or "no answer").splitlines()[0]
        raise SettingsError(f"there is no dask scheduler at {address}: {reason}.") from None
    with client:
        yield client.get_executor(pure=False)


def _threads_of_each(count: int) -> int:
    """How many threads each of several workers runs its kernels on."""
    if not 1 <= count <= MOST_WORKERS:
        raise SettingsError(f"the number of workers must be 1 to {MOST_WORKERS}, got {count}.")
    return max(1, thread_count() // count)


def _end(workers: Iterable[BaseProcess]) -> None:
    """Wait for workers that have no more work; end those that stay."""
    deadline = time.monotonic() + GRACE_S
    for worker in workers:
        worker.join(max(0.0, deadline - time.monotonic()))
        if worker.is_alive():
            worker.terminate()
            worker.join(1.0)
        if worker.is_alive():
            worker.kill()


def _start(threads: int) -> None:
    """Prepare a worker process: its share of the cores, and its end."""
    os.environ["INTERVIS_THREADS"] = str(threads)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the caller, who ends the workers
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # removes a file that is half written
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None  # a spawned process has one
    parent.join()
    os._exit(1)
