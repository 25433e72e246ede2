"""The output folder of a run: what may be written there, resumed, or removed."""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from intervis.errors import OutputError
from intervis.files import refuse_address, write_text
from intervis.output_folder import is_marked, is_own_file, locked, refuse_links
from intervis.run.summary import as_json, differences, read_summary, same_results, summarize
from intervis.settings import Settings

Shard = tuple[int, int]
"""Number of a shard, from 1, and how many there are."""

_FRAME = "frames/" + 10 * "[0-9]" + ".npz"
_PARTS = (".settings.toml.*.part", ".summary.json.*.part", f"frames/.{_FRAME[7:]}.*.part")


@contextlib.contextmanager
def run_folder(
    out: Path,
    head: Mapping[str, Any],
    settings: Settings,
    *,
    shard: Shard | None = None,
    overwrite: bool = False,
) -> Iterator[None]:
    """Hold the output folder of a run: made, or found to hold the same run, and locked.

    Parameters
    ----------
    out : Path
        Output folder.
    head : mapping
        From `summary.describe`.
    settings : Settings
        Settings of the run.
    shard : (number, count), optional
        Share the folder with other shards of the run; a shard cannot meet itself.
    overwrite : bool
        Remove an earlier run first.

    Raises
    ------
    OutputError
        The folder cannot be written, holds another run or what intervis did not make, or another
        process writes to it.
    """
    try:
        _check(out, head, settings, overwrite=overwrite)  # before anything is made or marked
        (out / "frames").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write in {out}: {(error.strerror or '').lower()}.") from None
    with contextlib.ExitStack() as held:
        held.enter_context(locked(out, shared=shard is not None))
        if shard is not None:
            held.enter_context(locked(out, name=f".shard-{shard[0]}-of-{shard[1]}"))
        _check(out, head, settings, overwrite=overwrite)  # another process may have come first
        if shard is None:
            _remove(out, ("summary.json", "settings.toml", _FRAME) if overwrite else ())
        if read_summary(out / "summary.json") is None:
            write_text(out / "settings.toml", settings.to_toml())
            write_text(out / "summary.json", as_json(summarize(head, [], [], complete=False)))
        yield


def finish(out: Path, content: Mapping[str, Any]) -> None:
    """Write the summary, unless the file already holds the same results."""
    path = out / "summary.json"
    earlier = read_summary(path)
    if earlier is None or not same_results(earlier, content):
        write_text(path, as_json(content))


def _check(out: Path, head: Mapping[str, Any], settings: Settings, *, overwrite: bool) -> None:
    """Raise where the folder holds another run, or files of others under the names of ours."""
    refuse_address(out)
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out} is a file: choose a folder for the results.")
    refuse_links(out / "frames", out / "summary.json", out / "settings.toml")
    if overwrite and is_marked(out):
        return
    # Looked at before the summary: another shard writes its summary first.
    has_frames = any(out.glob(_FRAME))
    earlier = read_summary(out / "summary.json")
    if earlier is None and has_frames:
        raise OutputError(
            f"{out} holds frames of a run whose summary.json is missing, so their input and"
            f" settings are unknown: choose another folder{_or_overwrite(out)}."
        )
    if earlier is None and _differs(out / "settings.toml", settings.to_toml()):
        raise OutputError(
            f"{out / 'settings.toml'} was not written by a run of these settings and was not"
            f" changed: choose another folder{_or_overwrite(out)}."
        )
    differing = [] if earlier is None or overwrite else differences(earlier, head)
    if differing:
        raise OutputError(
            f"{out} holds another run ({'; '.join(differing)}): choose another folder, or"
            " overwrite it."
        )


def _or_overwrite(out: Path) -> str:
    return ", or overwrite it" if is_marked(out) else ""


def _differs(path: Path, content: str) -> bool:
    """Whether a file exists and holds something else."""
    return path.exists() and path.read_bytes() != content.encode()


def _remove(out: Path, patterns: tuple[str, ...]) -> None:
    """Remove files of ours, and what killed processes have left of them."""
    for pattern in (*patterns, *_PARTS):
        for path in out.glob(pattern):
            if is_own_file(path):
                path.unlink()
