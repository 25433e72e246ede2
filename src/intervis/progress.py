"""How long-running functions report progress: one convention for the library and `intervis.lab`.

A function that may run for seconds takes ``progress: Progress | None = None`` and calls it once
after each finished step, with a short note that names the step.
"""

from collections.abc import Callable

from intervis.arguments import function_of

Progress = Callable[[str], None]
"""``progress(note)``: called after each finished step."""


def silent(note: str) -> None:
    """The progress callback that reports nothing."""


def reporter(progress: Progress | None) -> Progress:
    """The callback itself, `silent` in place of None.

    Raises
    ------
    ArgumentError
        It can not be called.
    """
    function_of(progress, "progress")
    return silent if progress is None else progress
