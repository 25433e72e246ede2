"""How long-running functions report progress: one convention for the library and `intervis.lab`.

A function that may run for seconds takes ``progress: Progress | None = None`` and calls it once
after each finished step, with a short note that names the step.
"""

from collections.abc import Callable

Progress = Callable[[str], None]
"""``progress(note)``: called after each finished step."""


def silent(note: str) -> None:
    """The progress callback that reports nothing."""
