"""When does a zone beside the road come into sight, and how much of it?

python examples/route.py
"""

import tempfile

import intervis
from intervis.lab.worlds import simulate
from intervis.uses import Zone, route_of_drive, survey_of, zones_along
from intervis.uses.routes.route_sight_table import sighting_table


def main(drive: intervis.Drive) -> None:
    route = route_of_drive(drive)
    survey = survey_of(drive, route)
    x, y, _ = drive.poses[drive.frame_numbers[-1]][:3, 3]
    kerb = [[x + 8, y - 5], [x + 16, y - 5], [x + 16, y - 3.5], [x + 8, y - 3.5]]
    road = [[x + 8, y - 1], [x + 16, y - 1], [x + 16, y + 1], [x + 8, y + 1]]
    zones = [Zone("kerb", kerb, 0.3, 1.2), Zone("road", road, 0.3, 1.2)]
    answer = zones_along(survey.scene, route, zones, step_m=0.5, at_pose_times=True)
    print(sighting_table(answer.rows).as_text())
    print(answer.summary)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        main(intervis.open_drive(simulate(folder, frames=6, images=False)))
