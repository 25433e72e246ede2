"""What follows from sight lines: visible shares of objects, blind spots, answers as files."""

from intervis.uses.answer_file import save_answers
from intervis.uses.blind_spots import BlindSpot, blind_spots
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.visibility_grid import VisibilityGrid, visibility_grid

__all__ = [
    "BlindSpot",
    "ObjectSight",
    "VisibilityGrid",
    "blind_spots",
    "objects_of_frame",
    "save_answers",
    "visibility_grid",
]
