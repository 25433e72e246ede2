"""Worlds of known triangles: shapes, street, ray casting, scanner, renderer, simulated drives."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from intervis.lab.worlds.drive_simulation import simulate_drive as simulate_drive
    from intervis.lab.worlds.ray_casting import RayCaster as RayCaster
    from intervis.lab.worlds.recording import load_world as load_world
    from intervis.lab.worlds.scanner import Scanner as Scanner
    from intervis.lab.worlds.simulation import simulate as simulate
    from intervis.lab.worlds.street.layout import build_street as build_street

_HOME = {
    "load_world": "intervis.lab.worlds.recording",
    "RayCaster": "intervis.lab.worlds.ray_casting",
    "Scanner": "intervis.lab.worlds.scanner",
    "build_street": "intervis.lab.worlds.street.layout",
    "simulate": "intervis.lab.worlds.simulation",
    "simulate_drive": "intervis.lab.worlds.drive_simulation",
}
__all__ = ["RayCaster", "Scanner", "build_street", "load_world", "simulate", "simulate_drive"]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'intervis.lab.worlds' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value
