"""The command line. A command imports what it needs when it runs, so help is fast."""

import io
import logging
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import intervis
from intervis.cli.terminal import complain, show
from intervis.errors import IntervisError

DONE, SOME_FRAMES_FAILED, WRONG_REQUEST, INTERNAL_ERROR, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit codes."""

COMMANDS = {
    "run": "intervis.cli.run",
    "sight": "intervis.cli.sight",
    "evaluate": "intervis.lab.cli.evaluate",
    "reproduce": "intervis.lab.cli.reproduce",
    "readings": "intervis.lab.cli.reproduce",
    "simulate": "intervis.lab.cli.world",
    "demo": "intervis.lab.cli.world",
}
"""Module of each command; the function has the name of the command.

Modules are imported when a command is called, so the library does not depend on the laboratory.
"""


class _LazyCommands(Mapping[str, Any]):
    """Commands by name; each is imported on access."""

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)

    def __getitem__(self, name: str) -> Any:
        function = getattr(import_module(COMMANDS[name]), name)
        single = typer.Typer(add_completion=False, rich_markup_mode=None)
        single.command(name)(function)
        return typer.main.get_command(single)


class _Group(TyperGroup):
    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = _LazyCommands()  # type: ignore[assignment]


app = typer.Typer(
    name="intervis",
    cls=_Group,
    help="Intervisibility of LiDAR point clouds from a moving vehicle.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _show_version(requested: bool) -> None:
    if requested:
        show(f"intervis {intervis.__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version.", callback=_show_version, is_eager=True),
    ] = False,
    verbose: Annotated[bool, typer.Option("--verbose", help="Log details to stderr.")] = False,
) -> None:
    logging.basicConfig(
        level=logging.DEBUG if verbose else logging.WARNING, format="intervis: %(message)s"
    )
    # At DEBUG these packages log whole compilations; only messages of this package are wanted.
    for package in ("numba", "matplotlib", "PIL"):
        logging.getLogger(package).setLevel(logging.WARNING)
    if context.invoked_subcommand is None:
        show(context.get_help())
        raise typer.Exit(WRONG_REQUEST)


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
        code = app(args=list(arguments), prog_name="intervis", standalone_mode=False)
    except IntervisError as error:
        complain(str(error))
        return WRONG_REQUEST
    except typer.TyperException as error:
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "intervis"
        sentence = error.format_message().rstrip()
        complain(
            f"{sentence}{'' if sentence.endswith(('.', '?')) else '.'} See '{command} --help'."
        )
        return WRONG_REQUEST
    except (KeyboardInterrupt, typer.Abort):
        complain("interrupted.")
        return INTERRUPTED
    except MemoryError:
        complain("there is not enough memory for this request.")
        return WRONG_REQUEST
    except OSError as error:  # one that the library has not turned into its own error
        complain(f"cannot use {error.filename or 'a file'}: {error.strerror or error}.")
        return WRONG_REQUEST
    except Exception as error:
        logging.getLogger("intervis").debug("unexpected", exc_info=True)
        complain(
            f"internal error ({type(error).__name__}: {error}): run 'intervis --verbose ...' and"
            " report the traceback."
        )
        return INTERNAL_ERROR
    return code if isinstance(code, int) else DONE
