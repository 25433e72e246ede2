"""What is checked of the file of a recording, whichever viewer it is for."""

from pathlib import Path

from intervis.errors import OutputError
from intervis.view.own_file import check_own_file

BYTES_PER_RETURN = 22.0
BYTES_PER_FRAME = 150_000
"""What a frame takes in a recording, for the estimate: its returns; image, mesh and blind spots."""


def estimated_bytes(frames: int, returns: int) -> float:
    """Size of a recording of so many frames with so many returns each, bytes."""
    return frames * (BYTES_PER_FRAME + BYTES_PER_RETURN * returns)


def check_recording_file(path: Path, viewer: str, ending: str, mark: str) -> None:
    """Check that a recording can be written to a path: its name, and what stands there.

    Parameters
    ----------
    path : Path
    viewer, ending : str
        Name of the viewer, and the ending of its files.
    mark : str
        Stands in the head of each recording of ours: such files may be replaced.

    Raises
    ------
    OutputError
        The name ends otherwise, or another file stands there.
    """
    if path.suffix.lower() != ending:
        raise OutputError(
            f"a recording for {viewer} must be named {ending} at its end, got {path}."
        )
    check_own_file(path, mark.encode())
