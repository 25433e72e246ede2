"""The folder that masks are written to: it holds masks of one drive and one kind only."""

from __future__ import annotations  # help() shows the names of the array types

import json
from collections.abc import Iterable
from pathlib import Path

import intervis
from intervis.drives import Drive
from intervis.errors import OutputError
from intervis.files import make_folder, refuse_address, write_text
from intervis.output_folder import refuse_links
from intervis.uses.voxels.drive_masks import MaskSettings

METADATA_NAME = "masks.json"
MADE_BY = "intervis masks"


def check_folder(
    out: Path, drive: Drive, layout: str, settings: MaskSettings, cameras: Iterable[str]
) -> str:
    """Check before the work that masks can be written into a folder.

    Returns
    -------
    str
        Content of the file `METADATA_NAME`, which tells what the masks in the folder are.

    Raises
    ------
    OutputError
        It holds other files, or masks of another drive, layout, definition or of other cameras.
    """
    text = json.dumps(_metadata(drive, layout, settings, cameras), indent=1) + "\n"
    path = out / METADATA_NAME
    refuse_address(out)
    refuse_links(path)
    try:
        if out.exists() and not out.is_dir():
            raise OutputError(f"{out} is a file: give the path of a folder.")
        before = path.read_text(errors="replace") if path.is_file() else None
        foreign = before is None and out.is_dir() and any(out.iterdir())
    except OSError as error:
        raise OutputError(f"cannot read {out}: {error.strerror or error}.") from None
    if foreign or (before is not None and MADE_BY not in before):
        raise OutputError(f"{out} holds files of something else: choose a new or empty folder.")
    if before is not None and before != text:
        raise OutputError(
            f"{out} holds masks of another drive, layout, definition or grid, or of other cameras"
            f" (see {METADATA_NAME}): choose another folder."
        )
    return text


def claim_folder(out: Path, text: str) -> None:
    """Make the folder, and write into it what its masks are.

    Raises
    ------
    OutputError
        It cannot be made or written to.
    """
    make_folder(out)
    write_text(out / METADATA_NAME, text)


def _metadata(
    drive: Drive, layout: str, settings: MaskSettings, cameras: Iterable[str]
) -> dict[str, object]:
    classes = settings.classes
    return {
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
