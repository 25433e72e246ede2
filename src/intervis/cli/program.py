"""The commands and their options, by typer; a command is imported when it is called."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import intervis
from intervis.cli import COMMANDS, DONE, INTERNAL_ERROR, INTERRUPTED, WRONG_REQUEST
from intervis.cli.terminal import InterruptedRunError, complain, printable, show
from intervis.errors import IntervisError


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


class _PrintableFormatter(logging.Formatter):
    """Formats log records for a terminal."""

    def format(self, record: logging.LogRecord) -> str:
        """The record's text, with control characters written as escapes."""
        return printable(super().format(record))


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
    handler = logging.StreamHandler()
    handler.setFormatter(_PrintableFormatter("intervis: %(message)s"))
    logging.basicConfig(level=logging.DEBUG if verbose else logging.WARNING, handlers=[handler])
    # At DEBUG these packages log whole compilations; only messages of this package are wanted.
    for package in ("numba", "matplotlib", "PIL"):
        logging.getLogger(package).setLevel(logging.WARNING)
    logging.getLogger("intervis.kernels").setLevel(logging.DEBUG if verbose else logging.INFO)
    if context.invoked_subcommand is None:
        show(context.get_help())
        raise typer.Exit(WRONG_REQUEST)


def call(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; an error becomes one line on stderr."""
    try:
        code = app(args=list(arguments), prog_name="intervis", standalone_mode=False)
    except IntervisError as error:
        complain(str(error))
        return WRONG_REQUEST
    except typer.TyperException as error:
        command = " ".join(["intervis", *(word for word in arguments[:1] if word in COMMANDS)])
        message = error.format_message().rstrip()
        stop = "" if message.endswith((".", "?")) else "."
        complain(f"{message}{stop} See '{command} --help'.")
        return WRONG_REQUEST
    except InterruptedRunError as error:
        complain(str(error))
        return INTERRUPTED
    except typer.Abort:
        raise KeyboardInterrupt from None
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
    if code == INTERRUPTED:  # typer has turned KeyboardInterrupt into this code
        raise KeyboardInterrupt
    return code if isinstance(code, int) else DONE
