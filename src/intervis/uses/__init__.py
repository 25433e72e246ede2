"""What follows from sight: objects, classes, grids, blind spots, routes, agents, sites, files."""

from intervis.uses.agents.mutual_sight import Agent, MutualSight, mutual_sight
from intervis.uses.answer_file import save_answers
from intervis.uses.blind_spots import BlindSpot, blind_spots
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.routes.route import Route
from intervis.uses.routes.route_answer import RouteAnswer, targets_along, zones_along
from intervis.uses.routes.route_file import read_route, route_of_drive
from intervis.uses.routes.sight_distance import SightDistances, sight_distances
from intervis.uses.routes.sight_standard import AASHTO, AUSTROADS, DMRB, SightStandard
from intervis.uses.routes.survey import Survey, route_on_road, survey_of
from intervis.uses.routes.zone import Zone
from intervis.uses.semantics.blockers import blocker_shares
from intervis.uses.semantics.classed_returns import ClassedReturns, classed_returns
from intervis.uses.semantics.labelled_scene import LabelledScene, labelled_scene
from intervis.uses.sites.candidate import Candidate, candidates_along, candidates_within
from intervis.uses.sites.coverage import Coverage, coverage
from intervis.uses.sites.demand import Demand, demand_of_points, demand_of_zones, weighted_by_users
from intervis.uses.sites.reach import Reach
from intervis.uses.sites.siting import Siting, best_sites, choose_sites
from intervis.uses.visibility_grid import VisibilityGrid, visibility_grid
from intervis.uses.voxels.bev_grid import BevGrid, bev_grid
from intervis.uses.voxels.carving import CarvedGrid, Carver
from intervis.uses.voxels.drive_masks import MaskSettings, frame_masks
from intervis.uses.voxels.masks import Masks, PosedScan, masks_of
from intervis.uses.voxels.voxel_grid import VoxelGrid

__all__ = [
    "AASHTO",
    "AUSTROADS",
    "DMRB",
    "Agent",
    "BevGrid",
    "BlindSpot",
    "Candidate",
    "CarvedGrid",
    "Carver",
    "ClassedReturns",
    "Coverage",
    "Demand",
    "LabelledScene",
    "MaskSettings",
    "Masks",
    "MutualSight",
    "ObjectSight",
    "PosedScan",
    "Reach",
    "Route",
    "RouteAnswer",
    "SightDistances",
    "SightStandard",
    "Siting",
    "Survey",
    "VisibilityGrid",
    "VoxelGrid",
    "Zone",
    "best_sites",
    "bev_grid",
    "blind_spots",
    "blocker_shares",
    "candidates_along",
    "candidates_within",
    "choose_sites",
    "classed_returns",
    "coverage",
    "demand_of_points",
    "demand_of_zones",
    "frame_masks",
    "labelled_scene",
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
    "weighted_by_users",
    "zones_along",
]
