"""intervis: what can see what, from LiDAR scans of a moving vehicle.

The names below are the front door. They are loaded when they are first used, so that importing
the package costs nothing and compiles nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from intervis.camera import Camera as Camera
    from intervis.drives import Drive as Drive
    from intervis.drives import Frame as Frame
    from intervis.drives import open_drive as open_drive
    from intervis.errors import CalibrationError as CalibrationError
    from intervis.errors import DriveError as DriveError
    from intervis.errors import IntervisError as IntervisError
    from intervis.errors import PointsError as PointsError
    from intervis.errors import PoseError as PoseError
    from intervis.errors import SettingsError as SettingsError
    from intervis.method.analysis import Analysis as Analysis
    from intervis.method.analysis import analyze as analyze
    from intervis.settings import Settings as Settings
    from intervis.sight import Scene as Scene
    from intervis.sight import Sight as Sight

__version__ = "0.1.0"

_HOME = {
    "Analysis": "intervis.method.analysis",
    "analyze": "intervis.method.analysis",
    "CalibrationError": "intervis.errors",
    "Camera": "intervis.camera",
    "Drive": "intervis.drives",
    "DriveError": "intervis.errors",
    "Frame": "intervis.drives",
    "IntervisError": "intervis.errors",
    "open_drive": "intervis.drives",
    "PointsError": "intervis.errors",
    "PoseError": "intervis.errors",
    "Scene": "intervis.sight",
    "Settings": "intervis.settings",
    "SettingsError": "intervis.errors",
    "Sight": "intervis.sight",
}
__all__ = [
    "Analysis",
    "CalibrationError",
    "Camera",
    "Drive",
    "DriveError",
    "Frame",
    "IntervisError",
    "PointsError",
    "PoseError",
    "Scene",
    "Settings",
    "SettingsError",
    "Sight",
    "__version__",
    "analyze",
    "open_drive",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'intervis' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
