"""The folder that masks are written to: it holds masks of one drive and one kind only."""

from __future__ import annotations  # help() shows the names of the array types

import contextlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path

import intervis
from intervis.drives import Drive
from intervis.errors import OutputError
from intervis.files import make_folder, remove_parts, write_text
from intervis.output_folder import MARKER, locked, refuse_links
from intervis.uses.voxels.drive_masks import MaskSettings
from intervis.uses.voxels.mask_record import FOLDER

METADATA_NAME = "masks.json"
MADE_BY = "intervis masks"


def described(drive: Drive, layout: str, settings: MaskSettings, cameras: Iterable[str]) -> str:
    """Content of the file `METADATA_NAME`, which tells what the masks in the folder are.

    Parameters
    ----------
    drive : Drive
    layout : str
    settings : MaskSettings
    cameras : iterable of str
        Names of the cameras whose masks are made.
    """
    classes = settings.classes
    content = {
        "made_by": MADE_BY,
        "version": intervis.__version__,
        "drive": drive.fingerprint(),
        "layout": layout,
        "cameras": sorted(cameras),
        "definition": settings.definition,
        "later": settings.later,
        "keep_moving": settings.keep_moving,
        "corner": settings.grid.corner.tolist(),
        "cell_m": settings.grid.cell_m,
        "shape": list(settings.grid.shape),
        "grid_from_velo": settings.grid_from_velo.tolist(),
        "classes": None if classes is None else {str(key): classes[key] for key in classes},
    }
    return json.dumps(content, indent=1) + "\n"


@contextlib.contextmanager
def mask_folder(out: Path, text: str) -> Iterator[None]:
    """Hold the folder of masks: made, or found to hold masks of the same kind, and locked.

    Where an error ends the work before the first frame is written, nothing is left.

    Parameters
    ----------
    out : Path
    text : str
        From `described`.

    Raises
    ------
    OutputError
        The folder cannot be written, holds other files, or masks of another drive, layout,
        definition or of other cameras; or another process writes to it.
    """
    _check(out, text)  # before anything is made or marked
    is_new = not out.exists()
    make_folder(out)
    with locked(out):
        _check(out, text)  # another process may have come first
        remove_parts(out / METADATA_NAME)
        if not (out / METADATA_NAME).exists():
            write_text(out / METADATA_NAME, text)
        try:
            yield
        except BaseException:
            if not (out / FOLDER).exists():
                _leave(out, is_new)
            raise


def _leave(out: Path, is_new: bool) -> None:
    """Take back the claim to a folder that holds no frame of ours."""
    with contextlib.suppress(OSError):  # the error that ended the work is the one to tell
        (out / METADATA_NAME).unlink()
        (out / MARKER).unlink()
        if is_new:
            out.rmdir()


def _check(out: Path, text: str) -> None:
    """Raise where the folder holds files of something else, or masks of another kind."""
    path = out / METADATA_NAME
    refuse_links(path)
    try:
        if out.exists() and not out.is_dir():
            raise OutputError(f"{out} is a file: give the path of a folder.")
        before = path.read_text(errors="replace") if path.is_file() else None
        names = [entry.name for entry in out.iterdir()] if before is None and out.is_dir() else []
    except OSError as error:
        raise OutputError(f"cannot read {out}: {error.strerror or error}.") from None
    is_foreign = any(name != MARKER and not _is_part(name) for name in names)
    if is_foreign or (before is not None and MADE_BY not in before):
        raise OutputError(f"{out} holds files of something else: choose a new or empty folder.")
    if before is not None and before != text:
        raise OutputError(
            f"{out} holds masks of another drive, layout, definition or grid, or of other cameras"
            f" (see {METADATA_NAME}): choose another folder."
        )


def _is_part(name: str) -> bool:
    """Whether a killed process has left the file before it had written `METADATA_NAME`."""
    return name.startswith(f".{METADATA_NAME}.") and name.endswith(".part")
