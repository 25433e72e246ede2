"""Exceptions of the library: one root class, and one class for each kind of error."""

from typing import Self


class IntervisError(Exception):
    """Root of all exceptions that the library raises.

    The message is one sentence that says what is wrong and what to do.
    """


class ArgumentError(IntervisError, TypeError):
    """An argument is of the wrong kind: text for a scene, None for a grid."""


class PointsError(IntervisError, ValueError):
    """An array of points (or a viewpoint, or targets) has the wrong shape, type or content."""


class PoseError(IntervisError, ValueError):
    """A transform is not a rigid motion."""


class CameraError(IntervisError, ValueError):
    """A camera's projection matrix or image size is invalid."""


class SettingsError(IntervisError, ValueError):
    """A setting is unknown or out of range."""


class DriveError(IntervisError):
    """A drive or scan is missing, has no known layout, or cannot be read."""


class CalibrationError(DriveError):
    """A calibration, pose or time file is missing, or one of its lines does not parse."""


class ScanError(DriveError):
    """One scan of a drive cannot be read; the other frames may be readable."""


class SceneError(IntervisError):
    """A scene cannot answer a query: it holds no scan, or scans without the timestamps needed."""


class OutputError(IntervisError):
    """Results cannot be written to the given path."""


class MissingExtraError(IntervisError, ImportError):
    """An optional dependency is not installed; the message names the extra to install."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        super().__init__(
            f"{purpose} needs the package {package!r}: install it with"
            f" pip install 'intervis[{extra}]'."
        )
        self._parts = (package, extra, purpose)

    def __reduce__(self) -> tuple[type[Self], tuple[str, str, str]]:
        return type(self), self._parts  # errors of worker processes are pickled
