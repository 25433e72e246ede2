"""The command line: entry point, exit codes, and the table of commands.

This module imports little, so that an interruption in the first moments is reported as well.
"""

import io
import sys
from collections.abc import Sequence

from intervis.cli.terminal import complain

DONE, SOME_FRAMES_FAILED, WRONG_REQUEST, INTERNAL_ERROR, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit codes."""

COMMANDS = {
    "run": "intervis.cli.run",
    "sight": "intervis.cli.sight",
    "objects": "intervis.cli.objects",
    "blindspots": "intervis.cli.blind_spots",
    "view": "intervis.cli.view",
    "masks": "intervis.cli.masks",
    "route": "intervis.cli.route",
    "sightdistance": "intervis.cli.sight_distance",
    "agents": "intervis.cli.agents",
    "site": "intervis.cli.site",
    "replay": "intervis.cli.replay",
    "warm": "intervis.cli.warm",
    "evaluate": "intervis.lab.cli.evaluate",
    "reproduce": "intervis.lab.cli.reproduce",
    "interpretations": "intervis.lab.cli.reproduce",
    "simulate": "intervis.lab.cli.world",
    "demo": "intervis.lab.cli.world",
    "calibrate": "intervis.lab.cli.calibrate",
    "matrix": "intervis.lab.cli.matrix",
    "bench": "intervis.lab.cli.bench",
}
"""Module of each command; the function has the name of the command.

Modules are imported when a command is called, so the library does not depend on `intervis.lab`.
"""


def main() -> None:
    """Entry point of the program ``intervis``."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # escape characters that the terminal lacks
            stream.reconfigure(errors="backslashreplace")
    sys.exit(exit_code(sys.argv[1:]))


def exit_code(arguments: Sequence[str]) -> int:
    """Run one command line; an error is one line on stderr, without a traceback.

    Returns
    -------
    int
        0 done, 1 some frames failed, 2 the request was wrong, 3 internal error, 130 interrupted.
    """
    try:
        from intervis.cli.program import call

        return call(arguments)
    except KeyboardInterrupt:
        complain("interrupted.")
        return INTERRUPTED
