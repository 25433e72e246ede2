"""What follows from sight lines: the visible share of labelled objects."""

from intervis.uses.objects import ObjectSight, objects_of_frame

__all__ = ["ObjectSight", "objects_of_frame"]
