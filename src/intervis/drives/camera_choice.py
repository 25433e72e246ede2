"""Which camera of a drive is used: the one that is asked for, or the usual one."""

from collections.abc import Collection
from pathlib import Path

from intervis.errors import DriveError


def pick_named_camera(
    asked: str | None, names: Collection[str], usual: str, drive: Path
) -> str | None:
    """Name of the camera to use, of cameras with names of their own; None where there is none.

    The default is the camera `usual`, or else the first one.

    Raises
    ------
    DriveError
        The drive has no such camera.

    Examples
    --------
    >>> pick_named_camera(None, ["CAM_BACK", "CAM_FRONT"], "CAM_FRONT", Path("drive"))
    'CAM_FRONT'
    """
    if asked is None:
        return usual if usual in names else next(iter(names), None)
    if asked in names:
        return asked
    available = ", ".join(names) or "none"
    raise DriveError(f"{drive} has no camera {asked!r:.60}; available cameras: {available}.")


def pick_camera(
    asked: str | None, names: tuple[str, ...], with_images: Collection[str], drive: Path
) -> str | None:
    """Name of the camera to use, None where there is none.

    The default is the left colour camera (number 2). If only other cameras have images, the
    default is the first of those.

    Parameters
    ----------
    asked : str or None
        A camera's name (``image_03``) or number (``3``); None for the default.
    names : tuple of str
        Cameras in the calibration.
    with_images : collection of str
        Names of the folders with images.
    drive : Path
        The drive's path, for the error message.

    Raises
    ------
    DriveError
        The drive has no such camera.

    Examples
    --------
    >>> pick_camera(None, ("image_00", "image_02"), ("image_00", "image_02"), Path("drive"))
    'image_02'
    >>> pick_camera("0", ("image_00", "image_02"), (), Path("drive"))
    'image_00'
    """
    if asked is not None:
        number = asked.removeprefix("image_")
        for name in names:
            own = name.removeprefix("image_")
            if asked == name or (number.isdecimal() and number.lstrip("0") == own.lstrip("0")):
                return name
        available = ", ".join(names) or "none"
        shown = repr(asked if len(asked) <= 60 else asked[:60] + "...")
        raise DriveError(f"{drive} has no camera {shown}; available cameras: {available}.")
    candidates = [name for name in names if name in with_images] or list(names)
    left_colour = [name for name in candidates if int(name.removeprefix("image_")) == 2]
    return next(iter(left_colour + candidates), None)
