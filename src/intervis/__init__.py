"""intervis: what can see what, from LiDAR scans of a moving vehicle.

The public names below and the subpackages (``intervis.sight``) are loaded when they are first
used, so that importing the package loads and compiles little.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from intervis.camera import Camera as Camera
    from intervis.compilation import warm_up as warm_up
    from intervis.drives import Drive as Drive
    from intervis.drives import Frame as Frame
    from intervis.drives import open_drive as open_drive
    from intervis.errors import ArgumentError as ArgumentError
    from intervis.errors import CalibrationError as CalibrationError
    from intervis.errors import CameraError as CameraError
    from intervis.errors import DriveError as DriveError
    from intervis.errors import IntervisError as IntervisError
    from intervis.errors import MissingExtraError as MissingExtraError
    from intervis.errors import OutputError as OutputError
    from intervis.errors import PointsError as PointsError
    from intervis.errors import PoseError as PoseError
    from intervis.errors import ScanError as ScanError
    from intervis.errors import SceneError as SceneError
    from intervis.errors import SettingsError as SettingsError
    from intervis.live import Stream as Stream
    from intervis.method.analysis import Analysis as Analysis
    from intervis.method.analysis import analyze as analyze
    from intervis.settings import Settings as Settings
    from intervis.sight import OCCLUDED as OCCLUDED
    from intervis.sight import UNKNOWN as UNKNOWN
    from intervis.sight import VISIBLE as VISIBLE
    from intervis.sight import Explanation as Explanation
    from intervis.sight import Scene as Scene
    from intervis.sight import Sensor as Sensor
    from intervis.sight import Sight as Sight
    from intervis.sight import explain as explain
    from intervis.sight import visible_mask as visible_mask
    from intervis.view.notebook import show as show

__version__ = "0.1.0"

_HOME = {
    "Camera": "intervis.camera",
    "Drive": "intervis.drives",
    "Frame": "intervis.drives",
    "open_drive": "intervis.drives",
    "ArgumentError": "intervis.errors",
    "CalibrationError": "intervis.errors",
    "CameraError": "intervis.errors",
    "DriveError": "intervis.errors",
    "IntervisError": "intervis.errors",
    "MissingExtraError": "intervis.errors",
    "OutputError": "intervis.errors",
    "PointsError": "intervis.errors",
    "PoseError": "intervis.errors",
    "ScanError": "intervis.errors",
    "SceneError": "intervis.errors",
    "SettingsError": "intervis.errors",
    "Stream": "intervis.live",
    "Analysis": "intervis.method.analysis",
    "analyze": "intervis.method.analysis",
    "Settings": "intervis.settings",
    "Explanation": "intervis.sight",
    "OCCLUDED": "intervis.sight",
    "Scene": "intervis.sight",
    "Sensor": "intervis.sight",
    "Sight": "intervis.sight",
    "UNKNOWN": "intervis.sight",
    "VISIBLE": "intervis.sight",
    "explain": "intervis.sight",
    "show": "intervis.view.notebook",
    "visible_mask": "intervis.sight",
    "warm_up": "intervis.compilation",
}
_SUBPACKAGES = ("drives", "live", "method", "plots", "run", "sight", "uses", "view")
__all__ = [
    "OCCLUDED",
    "UNKNOWN",
    "VISIBLE",
    "Analysis",
    "ArgumentError",
    "CalibrationError",
    "Camera",
    "CameraError",
    "Drive",
    "DriveError",
    "Explanation",
    "Frame",
    "IntervisError",
    "MissingExtraError",
    "OutputError",
    "PointsError",
    "PoseError",
    "ScanError",
    "Scene",
    "SceneError",
    "Sensor",
    "Settings",
    "SettingsError",
    "Sight",
    "Stream",
    "__version__",
    "analyze",
    "explain",
    "open_drive",
    "show",
    "visible_mask",
    "warm_up",
]


def __getattr__(name: str) -> Any:
    if name in _SUBPACKAGES:
        return import_module(f"intervis.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'intervis' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *_SUBPACKAGES})
