"""Who sees whom: a roadside unit, a child between parked cars, and the car that scans.

python examples/agents.py
"""

import tempfile

import numpy as np

import intervis
from intervis.lab.worlds import simulate
from intervis.transform import rigid
from intervis.uses import Agent, mutual_sight
from intervis.uses.agents.agent_file import scanner_agent
from intervis.uses.agents.agents_table import matrix_table, pair_table, pairs_of
from intervis.uses.routes.survey import scene_of_drive

FACING_BACK = np.diag([-1.0, -1.0, 1.0])


def main(drive: intervis.Drive) -> None:
    numbers = list(drive.frame_numbers)
    scene = scene_of_drive(drive, numbers)
    x, y, _ = drive.poses[numbers[-1]][:3, 3]
    ground_m = float(scene.ground_height([[x + 12.0, y]])[0])
    agents = [
        scanner_agent(drive, numbers),
        Agent("roadside unit", rigid(np.eye(3), [x + 12.0, y + 3.0, ground_m + 2.0])),
        Agent("child", rigid(FACING_BACK, [x + 15.0, y - 5.5, ground_m + 1.0]), fov_deg=200.0),
    ]
    found = mutual_sight(scene, agents, numbers, scene.timestamps_s)
    print(matrix_table(found).as_text())
    print(pair_table(pairs_of(found)).as_text())


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        main(intervis.open_drive(simulate(folder, frames=6, images=False)))
