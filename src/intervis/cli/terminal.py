"""Output of the command line: results to stdout, everything else to stderr."""

import contextlib
import os
import re
import sys
from collections.abc import Iterator

from intervis.progress import Progress, silent

CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
"""Control characters without tab and line feed."""


class InterruptedRunError(Exception):
    """Ctrl-C in a command whose message says how to resume."""


def printable(text: str) -> str:
    r"""The text with control characters, which a terminal obeys, written as escapes.

    Names of files and fields may hold them.

    Examples
    --------
    >>> print(printable("a\x1b[31m name"))
    a\x1b[31m name
    """
    return CONTROL.sub(lambda match: f"\\x{ord(match[0]):02x}", text)


def show(text: str) -> None:
    """Print a result; a closed pipe is no error, as the files are written."""
    if sys.stdout is None:  # closed by the caller
        return
    try:
        print(printable(text))
        sys.stdout.flush()
    except BrokenPipeError:
        _silence_stdout()


def _silence_stdout() -> None:
    # Without this the interpreter flushes the buffer at exit and fails again.
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def tell(text: str) -> None:
    """Print a note on stderr."""
    if sys.stderr is None:
        return
    with contextlib.suppress(BrokenPipeError):
        print(printable(text), file=sys.stderr, flush=True)


def complain(message: str) -> None:
    """Print an error message as one line on stderr."""
    tell(f"intervis: {' '.join(message.split())}")


@contextlib.contextmanager
def progress(work: str, total: int) -> Iterator[Progress]:
    """A progress bar on stderr with rate and remaining time; nothing unless it is a terminal.

    Yields the callback that counts one step as done and shows its note beside the bar.
    """
    if sys.stderr is None or not sys.stderr.isatty():
        yield silent
        return
    from rich import progress as rich_progress
    from rich.console import Console
    from rich.text import Text

    class RateColumn(rich_progress.ProgressColumn):
        def render(self, task: rich_progress.Task) -> Text:
            return Text(f"{task.speed:.1f}/s" if task.speed else "")

    columns = (
        rich_progress.TextColumn("{task.description}"),
        rich_progress.BarColumn(),
        rich_progress.MofNCompleteColumn(),
        RateColumn(),
        rich_progress.TimeRemainingColumn(),
        rich_progress.TextColumn("{task.fields[note]}", style="dim", markup=False),
    )
    with rich_progress.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(work, total=total, note="the first run compiles kernels")
        yield lambda note: bar.update(task, advance=1, note=note)
