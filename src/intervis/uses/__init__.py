"""What follows from sight lines: objects, blind spots, routes, sight distance, agents, files."""

from intervis.uses.agents import Agent, MutualSight, mutual_sight
from intervis.uses.answer_file import save_answers
from intervis.uses.blind_spots import BlindSpot, blind_spots
from intervis.uses.objects import ObjectSight, objects_of_frame
from intervis.uses.route import Route
from intervis.uses.route_answer import RouteAnswer, targets_along, zones_along
from intervis.uses.route_file import read_route, route_of_drive
from intervis.uses.sight_distance import SightDistances, sight_distances
from intervis.uses.sight_standard import AASHTO, AUSTROADS, DMRB, SightStandard
from intervis.uses.survey import Survey, route_on_road, survey_of
from intervis.uses.visibility_grid import VisibilityGrid, visibility_grid
from intervis.uses.zone import Zone

__all__ = [
    "AASHTO",
    "AUSTROADS",
    "DMRB",
    "Agent",
    "BlindSpot",
    "MutualSight",
    "ObjectSight",
    "Route",
    "RouteAnswer",
    "SightDistances",
    "SightStandard",
    "Survey",
    "VisibilityGrid",
    "Zone",
    "blind_spots",
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
