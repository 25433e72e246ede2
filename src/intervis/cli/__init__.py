"""The command line: thin, and it imports what a command needs only when the command runs."""

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

DONE, SOME_FRAMES_FAILED, WRONG_REQUEST, OWN_FAULT, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit codes."""

COMMANDS = {
    "run": "intervis.cli.run",
    "sight": "intervis.cli.sight",
    "evaluate": "intervis.lab.cli.evaluate",
    "reproduce": "intervis.lab.cli.reproduce",
    "interpretations": "intervis.lab.cli.reproduce",
    "simulate": "intervis.lab.cli.world",
    "demo": "intervis.lab.cli.world",
}
"""Where each command's function of the same name lives.

They are named and not imported: a command loads what it needs when it is called, and the library
does not depend on the laboratory.
"""


class _Imported(Mapping[str, Any]):
    """Commands by name, each imported when it is asked for."""

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)

    def __getitem__(self, name: str) -> Any:
        function = getattr(import_module(COMMANDS[name]), name)
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command(name)(function)
        return typer.main.get_command(alone)


class _Commands(TyperGroup):
    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = _Imported()  # type: ignore[assignment]


app = typer.Typer(
    name="intervis",
    cls=_Commands,
    help="What can see what: intervisibility of LiDAR point clouds from a moving vehicle.",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _show_version(asked: bool) -> None:
    if asked:
        show(f"intervis {intervis.__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option("--version", help="Show the version.", callback=_show_version, is_eager=True),
    ] = False,
    verbose: Annotated[bool, typer.Option("--verbose", help="Say more on stderr.")] = False,
) -> None:
    logging.basicConfig(
        level=logging.DEBUG if verbose else logging.WARNING, format="intervis: %(message)s"
    )
    # Neighbours log whole compilations at this level; only our own words are asked for.
    for neighbour in ("numba", "matplotlib", "PIL"):
        logging.getLogger(neighbour).setLevel(logging.WARNING)
    if context.invoked_subcommand is None:
        show(context.get_help())
        raise typer.Exit(WRONG_REQUEST)


def main() -> None:
    """Entry point of the program ``intervis``."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a name that the terminal cannot show is escaped
            stream.reconfigure(errors="backslashreplace")
    sys.exit(exit_code(sys.argv[1:]))


def exit_code(arguments: Sequence[str]) -> int:
    """Run one command line; every failure becomes one sentence on stderr.

    Returns
    -------
    int
        0 done, 1 some frames failed, 2 the request was wrong, 3 the program is at fault,
        130 interrupted.
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
    except OSError as error:  # the system refused something that no part of the program foresaw
        complain(f"cannot use {error.filename or 'a file'}: {error.strerror or error}.")
        return WRONG_REQUEST
    except Exception as error:
        logging.getLogger("intervis").debug("unexpected", exc_info=True)
        complain(
            f"the program met something that it did not expect ({type(error).__name__}: {error});"
            " this is its own fault: 'intervis --verbose ...' shows where."
        )
        return OWN_FAULT
    return code if isinstance(code, int) else DONE
