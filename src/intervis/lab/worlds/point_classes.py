"""Labels of simulated returns in SemanticKITTI's numbers: class below, instance above 16 bits."""

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import IntArray, UInt32Array
from intervis.drives.point_labels import CLASS_NAMES
from intervis.lab.worlds.triangles import LABELS
from intervis.lab.worlds.world import Actor, World

OF_SURFACE = {
    **{"road": "road", "marking": "lane-marking", "kerb": "sidewalk", "sidewalk": "sidewalk"},
    **{"terrain": "terrain", "building": "building", "window": "building", "roof": "building"},
    **{"fence": "fence", "vegetation": "vegetation", "trunk": "trunk", "pole": "pole"},
    **{"sign": "traffic-sign", "car": "car", "glass": "car", "person": "person"},
    **{"bridge": "other-structure", "furniture": "other-object"},
}
"""SemanticKITTI's name of each class of triangles; ``none`` has none."""

OF_ACTOR = {"car": "car", "bicycle": "bicyclist", "person": "person"}
"""The same for what moves, by the first word of its name: a cyclist is one with the bicycle."""

NUMBERS = {name: number for number, name in CLASS_NAMES.items()}
MOVED_M, LOOKED_AT_S = 1.0, 1.0
"""An actor that goes so far from its first place, looked at once a second, moves."""


def point_labels(world: World, labels: NDArray[np.int8], objects: IntArray) -> UInt32Array:
    """Labels (N,) of returns from class and object (N,) of the surfaces that they lie on."""
    of_surface = np.zeros(max(LABELS.values()) + 1, np.uint32)
    for surface, name in OF_SURFACE.items():
        of_surface[LABELS[surface]] = NUMBERS[name]
    of_actor = np.array([0, *(_number(actor, world.last_s) for actor in world.actors)], np.uint32)
    classes: UInt32Array = np.where(objects > 0, of_actor[objects], of_surface[labels])
    return classes | objects.astype(np.uint32) << np.uint32(16)


def _number(actor: Actor, last_s: float) -> int:
    name = OF_ACTOR[actor.name.partition(" ")[0]]
    places = np.array([actor.pose_at(t)[:3, 3] for t in np.arange(0.0, last_s, LOOKED_AT_S)])
    moves = np.linalg.norm(places - places[0], axis=1).max() > MOVED_M
    return NUMBERS[f"moving-{name}" if moves else name]
