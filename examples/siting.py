"""Where should two roadside scanners stand to see a road and the kerb beside it?

python examples/siting.py
"""

import tempfile

import intervis
from intervis.lab.worlds import simulate
from intervis.sight import SENSORS
from intervis.uses import (
    Reach,
    Zone,
    best_sites,
    candidates_along,
    demand_of_zones,
    route_of_drive,
)
from intervis.uses.routes.survey import scene_of_drive
from intervis.uses.sites.site_table import site_table, summary_of, zone_table


def main(drive: intervis.Drive) -> None:
    scene = scene_of_drive(drive, drive.frame_numbers)
    route = route_of_drive(drive)
    x, y, _ = drive.poses[drive.frame_numbers[-1]][:3, 3]
    road = [[x, y - 2], [x + 25, y - 2], [x + 25, y + 2], [x, y + 2]]
    kerb = [[x, y - 5], [x + 25, y - 5], [x + 25, y - 3.5], [x, y - 3.5]]
    zones = [Zone("road", road, 0.3, 1.5), Zone("kerb", kerb, 0.3, 1.2, weight=3.0)]
    masts = candidates_along(scene, route.extended(25.0), 5.0, offsets_m=(-6.0, 6.0), mast_m=3.0)
    found = best_sites(
        scene,
        masts,
        demand_of_zones(scene, zones, cell_m=1.0),
        2,
        reach=Reach(SENSORS["OS1-128"], least_returns=10.0),
    )
    print(site_table(found).as_text())
    print(zone_table(found).as_text())
    print(summary_of(found))


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        main(intervis.open_drive(simulate(folder, frames=6, images=False)))
