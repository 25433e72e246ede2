"""What the library raises: one root, one class for each kind of mistake a caller can make."""


class IntervisError(Exception):
    """Root of every error that the library raises on purpose.

    The message is one plain sentence that says what is wrong and what to do.
    """


class PointsError(IntervisError, ValueError):
    """An array of points (or a viewpoint, or targets) has the wrong shape, type or content."""


class PoseError(IntervisError, ValueError):
    """A transform is not a rigid motion."""


class CameraError(IntervisError, ValueError):
    """A camera's projection or image size makes no sense."""


class SettingsError(IntervisError, ValueError):
    """A setting is unknown or out of range."""


class DriveError(IntervisError):
    """A drive or scan cannot be found, recognised or read."""


class CalibrationError(DriveError):
    """A calibration file is missing, or a line of it does not parse."""


class ScanError(DriveError):
    """One scan of a drive cannot be read; the other frames may be fine."""


class SceneError(IntervisError):
    """A scene cannot answer: it holds no scan."""


class OutputError(IntervisError):
    """Results cannot be written where they should go."""


class MissingExtraError(IntervisError, ImportError):
    """An optional dependency is not installed; the message names the extra that brings it."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        super().__init__(
            f"{purpose} needs the package {package!r}: install it with"
            f" pip install 'intervis[{extra}]'."
        )
