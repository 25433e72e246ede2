"""Files that `intervis view` may replace: those that it wrote."""

from pathlib import Path

from intervis.errors import OutputError
from intervis.files import check_replaceable

HEAD_BYTES = 2048


def check_own_file(path: Path, mark: bytes) -> None:
    """Check before the work that nothing stands at a path, or a file with our mark in its head.

    Raises
    ------
    OutputError
        Another file stands there, or no regular file.
    """
    target = check_replaceable(path)
    if not target.exists():
        return
    try:
        with open(target, "rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise OutputError(f"cannot read {path}: {error.strerror}.") from None
    if head and mark not in head:
        raise OutputError(
            f"{path} was not written by 'intervis view' and was not changed: choose another file."
        )
