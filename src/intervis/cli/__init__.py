"""The command line: thin, and it imports what a command needs only when the command runs."""

import io
import logging
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

import intervis
from intervis.cli import evaluate as _evaluate
from intervis.cli import reproduce as _reproduce
from intervis.cli import run as _run
from intervis.cli import sight as _sight
from intervis.cli import world as _world
from intervis.cli.terminal import complain, show
from intervis.errors import IntervisError

DONE, SOME_FRAMES_FAILED, WRONG_REQUEST, OWN_FAULT, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit codes."""

app = typer.Typer(
    name="intervis",
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


app.command("run")(_run.run)
app.command("reproduce")(_reproduce.reproduce)
app.command("readings")(_reproduce.readings)
app.command("sight")(_sight.sight)
app.command("evaluate")(_evaluate.evaluate)
app.command("simulate")(_world.simulate)
app.command("demo")(_world.demo)


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
