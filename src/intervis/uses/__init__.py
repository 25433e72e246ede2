"""What follows from sight lines: visible shares of objects, blind spots, grids, masks, files."""

from intervis.uses.answer_file import save_answers
from intervis.uses.bev_grid import BevGrid, bev_grid
from intervis.uses.blind_spots import BlindSpot, blind_spots
from intervis.uses.carving import CarvedGrid, Carver
from intervis.uses.drive_masks import MaskSettings, frame_masks
from intervis.uses.masks import Masks, PosedScan, masks_of
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.visibility_grid import VisibilityGrid, visibility_grid
from intervis.uses.voxel_grid import VoxelGrid

__all__ = [
    "BevGrid",
    "BlindSpot",
    "CarvedGrid",
    "Carver",
    "MaskSettings",
    "Masks",
    "ObjectSight",
    "PosedScan",
    "VisibilityGrid",
    "VoxelGrid",
    "bev_grid",
    "blind_spots",
    "frame_masks",
    "masks_of",
    "objects_of_frame",
    "save_answers",
    "visibility_grid",
]
