"""What the command line says and where: results to stdout, everything else to stderr."""

import contextlib
import os
import sys
from collections.abc import Callable, Iterator

Advance = Callable[[str], None]
"""Counts one item as done and shows a note beside the bar."""


def show(text: str) -> None:
    """Print a result. A reader who has gone (a closed pipe) is no error: the files are written."""
    try:
        print(text)
        sys.stdout.flush()
    except BrokenPipeError:
        _silence_stdout()


def _silence_stdout() -> None:
    # What is left in the buffer would complain once more when the interpreter closes it.
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def tell(text: str) -> None:
    """Say something beside the result, on stderr."""
    with contextlib.suppress(BrokenPipeError):
        print(text, file=sys.stderr, flush=True)


def complain(sentence: str) -> None:
    """Say what went wrong, in one sentence on stderr."""
    tell(f"intervis: {' '.join(sentence.split())}")


@contextlib.contextmanager
def progress(work: str, total: int) -> Iterator[Advance]:
    """A bar with rate and time left on stderr, where stderr is a terminal; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda note: None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class RateColumn(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:.1f}/s" if task.speed else "")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        RateColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", style="dim", markup=False),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(work, total=total, note="kernels compile on the first run")
        yield lambda note: bar.update(task, advance=1, note=note)
