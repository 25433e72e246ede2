"""``intervis warm``: compile the kernels before they are needed."""

from contextlib import ExitStack

from intervis.cli.terminal import progress, show
from intervis.errors import OutputError


def warm() -> None:
    """Compile all kernels ahead of the first use.

    No later command of this version has to, on this machine. Takes about a minute; where the
    kernels are compiled already, some seconds.
    """
    from intervis.compilation import PARTS, compiling

    with progress("compiling", len(PARTS)) as advance, ExitStack() as held:
        for name, process in [(name, held.enter_context(compiling(name))) for name in PARTS]:
            if process.wait() != 0:
                raise OutputError(f"the kernels of {name} could not be compiled: see above.")
            advance(name)
    show("All kernels are compiled.")
