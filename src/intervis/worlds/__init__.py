"""Known geometry: shapes, street, ray casting, scanner, renderer, writer of KITTI's raw layout."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from intervis.worlds.raycast import RayCaster as RayCaster
    from intervis.worlds.recording import load_world as load_world
    from intervis.worlds.scanner import Scanner as Scanner
    from intervis.worlds.simulation import simulate as simulate
    from intervis.worlds.street import build_street as build_street

_HOME = {
    "load_world": "intervis.worlds.recording",
    "RayCaster": "intervis.worlds.raycast",
    "Scanner": "intervis.worlds.scanner",
    "build_street": "intervis.worlds.street",
    "simulate": "intervis.worlds.simulation",
}
__all__ = ["RayCaster", "Scanner", "build_street", "load_world", "simulate"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'intervis.worlds' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value
