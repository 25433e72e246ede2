"""Sight lines while scans arrive: `Stream` takes scans from any thread and answers any thread."""

from intervis.live.stream import Stream

__all__ = ["Stream"]
