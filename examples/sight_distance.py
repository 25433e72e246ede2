"""How far does a driver see the road ahead, and is it enough?

python examples/sight_distance.py [DRIVE SPEED_KMH]

Without a drive: roads whose sight distance is known on paper, scanned by a simulated HDL-64E. With
--full its scans have all columns, and its preset is compared.
"""

import sys

import numpy as np

import intervis
from intervis.uses import (
    AASHTO,
    AUSTROADS,
    route_of_drive,
    route_on_road,
    sight_distances,
    survey_of,
)
from intervis.uses.routes.sight_distance_table import station_table, summary

STEP_M = 0.25


def of_drive(path: str, speed_kmh: float) -> None:
    drive = intervis.open_drive(path)
    route = route_of_drive(drive)
    survey = survey_of(drive, route)
    road = route_on_road(survey, route)
    found = sight_distances(survey.scene, road, AASHTO, speed_mps=speed_kmh / 3.6)
    print(station_table(found).as_text())
    print(summary(found))


def on_paper(columns: int, sensors: tuple[str | None, ...]) -> None:
    from intervis.lab.worlds import roads

    row = roads.ParkedRow()
    crest, curve, junction = roads.crest_road(), roads.curve_road(), roads.junction_road()
    cases = [
        (crest, AASHTO, lambda _: roads.crest_sight_m(600.0, 1.08, 0.60)),
        (crest, AUSTROADS, lambda _: roads.crest_sight_m(600.0, 1.10, 0.20)),
        (curve, AASHTO, lambda _: roads.curve_sight_m(80.0, 5.0)),
        (junction, AASHTO, lambda at_m: row.first_hidden_m(30.0 - at_m)),
    ]
    print("sight distance, metres              paper  stations  engine minus paper:")
    print("                                                      least  median  most")
    for sensor in sensors:
        for world, standard, paper in cases:
            scene = world.scene(5.0, np.random.default_rng(7), columns, sensor)
            steps = {"step_m": 2.5, "target_step_m": STEP_M, "reach_m": 80.0}
            found = sight_distances(scene, world.road, standard, speed_mps=15.0, **steps)
            known = found.chainage_m < 28.0 if world is junction else found.is_bounded
            paper_m = np.array([paper(at_m) for at_m in found.chainage_m[known]])
            error_m = found.possible_m[known] - paper_m
            shown = f"{paper_m.min():.1f}" + (f"-{paper_m.max():.1f}" if np.ptp(paper_m) else "")
            numbers = " ".join(f"{value:+6.1f}" for value in np.quantile(error_m, [0, 0.5, 1]))
            name = f"{world.name}, {standard.name}, {sensor or 'derived'}"
            print(f"{name:32s} {shown:>9s} {len(error_m):8d}   {numbers}")


if __name__ == "__main__":
    if "--full" in sys.argv:
        on_paper(2083, (None, "HDL-64E"))
    elif len(sys.argv) > 2:
        of_drive(sys.argv[1], float(sys.argv[2]))
    else:
        on_paper(600, (None,))
