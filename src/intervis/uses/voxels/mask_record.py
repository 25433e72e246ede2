"""The record of the masks of a frame: what they were made from, and digests of their files.

It is written before the files. So files of ours are known however a run ends, and a frame is done
when all files of its record have their digests.
"""

from __future__ import annotations  # help() shows the names of the array types

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath

from intervis.errors import OutputError
from intervis.files import remove_parts, write_bytes
from intervis.output_folder import is_own_file, refuse_links_below

FOLDER = ".intervis-masks"
"""Folder of the records, below that of the masks."""


@dataclass(frozen=True)
class MaskRecord:
    """What the masks of a frame were made from, and what their files hold.

    Attributes
    ----------
    number : int
        Of the frame.
    fingerprint : str
        From `intervis.uses.voxels.mask_input.MaskInput`.
    files : mapping of str to str
        Digest of the content of each file, by its path below the folder.
    """

    number: int
    fingerprint: str
    files: Mapping[str, str]


def record_path(out: Path, number: int) -> Path:
    """File of the record of a frame.

    Examples
    --------
    >>> record_path(Path("out"), 17).as_posix()
    'out/.intervis-masks/0000000017.json'
    """
    return out / FOLDER / f"{number:010d}.json"


def read_record(out: Path, number: int) -> MaskRecord | None:
    """The record of a frame; None where there is none, a damaged one, or that of another frame.

    Raises
    ------
    OutputError
        It cannot be read.
    """
    path = record_path(out, number)
    if not is_own_file(path):
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        record = MaskRecord(content["number"], content["fingerprint"], content["files"])
        if record.number == number and _is_list_of_files(record.files):
            return record
    except OSError as error:
        raise OutputError(f"cannot read {path}: {error.strerror or error}.") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    return None


def _is_list_of_files(files: object) -> bool:
    """Whether a record names one file or more below the folder, no hidden ones, and digests."""
    if not isinstance(files, dict) or not files:
        return False
    texts = all(isinstance(text, str) for text in files.values())
    return texts and all(_is_below(name) for name in files)


def _is_below(name: str) -> bool:
    parts = PurePosixPath(name).parts
    hidden = any(part.startswith(".") for part in parts)  # ".." and the records themselves
    return bool(parts) and not name.startswith("/") and not hidden and "\0" not in name


def fault_of(out: Path, record: MaskRecord, fingerprint: str) -> str:
    """Why a frame is not done by its record; empty if it is.

    Raises
    ------
    OutputError
        A file cannot be read.
    """
    if record.fingerprint != fingerprint:
        return "its files were made from another scan, pose, label, camera or setting."
    for name, digest in record.files.items():
        if not (out / name).exists():
            return f"{name} is missing."
        if not _holds(out / name, digest):
            return f"{name} is damaged."
    return ""


def write_frame(out: Path, number: int, fingerprint: str, contents: Mapping[str, bytes]) -> None:
    """Write the files of a frame, each whole or not at all, and first their record.

    Files of an earlier record of the frame are replaced, and removed where there is no such file
    now; what killed processes have left of them is removed.

    Parameters
    ----------
    out : Path
        The folder, held by `intervis.uses.voxels.mask_folder.mask_folder`.
    number : int
        Of the frame.
    fingerprint : str
    contents : mapping of str to bytes
        Content of the files by their paths below `out`.

    Raises
    ------
    OutputError
        A file cannot be written, stands behind a link, or was not made by intervis.
    """
    earlier = read_record(out, number)
    owned = {} if earlier is None else earlier.files
    digests = {name: _digest(content) for name, content in contents.items()}
    for name in {**owned, **digests}:
        refuse_links_below(out, out / name)
        if name not in owned:
            _check_not_foreign(out / name, digests[name])
    for name in owned:
        if name not in digests and _holds(out / name, owned[name]):
            (out / name).unlink()
    record = MaskRecord(number, fingerprint, digests)
    text = json.dumps(asdict(record), indent=1) + "\n"
    _write(out, record_path(out, number), text.encode())
    for name, content in contents.items():
        _write(out, out / name, content)


def _write(out: Path, path: Path, content: bytes) -> None:
    refuse_links_below(out, path)
    remove_parts(path)
    write_bytes(path, content)


def _check_not_foreign(path: Path, digest: str) -> None:
    if path.exists() and not _holds(path, digest):
        raise OutputError(
            f"{path} is not of these masks and was not changed: move it away, or choose another"
            " folder."
        )


def _holds(path: Path, digest: str) -> bool:
    """Whether a regular file has a content of that digest."""
    try:
        return is_own_file(path) and _digest(path.read_bytes()) == digest
    except OSError as error:
        raise OutputError(f"cannot read {path}: {error.strerror or error}.") from None


def _digest(content: bytes) -> str:
    return hashlib.blake2b(content, digest_size=16).hexdigest()
