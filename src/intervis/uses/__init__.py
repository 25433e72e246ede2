"""What follows from sight lines: objects, grids, masks, blind spots, routes, agents, files."""

from intervis.uses.agents import Agent, MutualSight, mutual_sight
from intervis.uses.answer_file import save_answers
from intervis.uses.bev_grid import BevGrid, bev_grid
from intervis.uses.blind_spots import BlindSpot, blind_spots
from intervis.uses.carving import CarvedGrid, Carver
from intervis.uses.drive_masks import MaskSettings, frame_masks
from intervis.uses.masks import Masks, PosedScan, masks_of
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.route import Route
from intervis.uses.route_answer import RouteAnswer, targets_along, zones_along
from intervis.uses.route_file import read_route, route_of_drive
from intervis.uses.sight_distance import SightDistances, sight_distances
from intervis.uses.sight_standard import AASHTO, AUSTROADS, DMRB, SightStandard
from intervis.uses.survey import Survey, route_on_road, survey_of
from intervis.uses.visibility_grid import VisibilityGrid, visibility_grid
from intervis.uses.voxel_grid import VoxelGrid
from intervis.uses.zone import Zone

__all__ = [
    "AASHTO",
    "AUSTROADS",
    "DMRB",
    "Agent",
    "BevGrid",
    "BlindSpot",
    "CarvedGrid",
    "Carver",
    "MaskSettings",
    "Masks",
    "MutualSight",
    "ObjectSight",
    "PosedScan",
    "Route",
    "RouteAnswer",
    "SightDistances",
    "SightStandard",
    "Survey",
    "VisibilityGrid",
    "VoxelGrid",
    "Zone",
    "bev_grid",
    "blind_spots",
    "frame_masks",
    "masks_of",
    "mutual_sight",
    "objects_of_frame",
    "read_route",
    "route_of_drive",
    "route_on_road",
    "save_answers",
    "sight_distances",
    "survey_of",
    "targets_along",
    "visibility_grid",
    "zones_along",
]
