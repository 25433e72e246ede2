"""How often carved grids are right, and how they agree with sight lines and with Occ3D's files.

python tools/grid_report.py [--worlds 3 4 5 --later 10] [--drive DRIVE]
python tools/grid_report.py --occ3d labels.npz --rig frame.json

Worlds are seeds of the built-in street, none of which the rules were chosen on (those were 0, 1
and 2). The drive's first scan is carved and asked by lines to random voxels. The rig is the JSON
of a nuScenes frame with ``images`` (``cam2img``, ``cam2ego``) and ``lidar_points`` (``lidar2ego``).
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from intervis import Scene, open_drive
from intervis.camera import Camera
from intervis.lab.truth.exact_voxels import VoxelScore, score_voxels
from intervis.lab.worlds import Scanner, build_street
from intervis.plots.tables import Table
from intervis.transform import inverse
from intervis.uses.voxels.camera_voxels import PosedCamera, seen_by_pixels
from intervis.uses.voxels.carving import STATES, Carver
from intervis.uses.voxels.mask_layouts import LAYOUTS, OCC3D_FREE
from intervis.uses.voxels.masks import beam_marks
from intervis.uses.voxels.voxel_grid import VoxelGrid

FLAT_CLASSES = (11, 12, 13, 14)
"""Occ3D's classes of ground: driveable surface, other flat, sidewalk, terrain."""
TIMES_S = (0.0, 4.0)
BETWEEN_S = 0.5
"""Time between the scans of a world."""
LINES = 100_000


def world_table(seeds: list[int], later: int) -> Table:
    """Scores of the grid of SemanticKITTI in each world and at each time.

    From the scan of that time, and from `later` more scans, during which things move; the world at
    the time of the first scan decides.
    """
    grid, scanner = LAYOUTS["semantickitti"].grid, Scanner()
    rows: list[tuple[str, ...]] = []
    for added in (0, later) if later else (0,):
        scores: list[VoxelScore] = []
        for seed in seeds:
            world = build_street(seed)
            for time_s in TIMES_S:
                carver, pose = Carver(grid), world.vehicle_pose_at(time_s)
                for nth in range(added + 1):
                    at_s = time_s + nth * BETWEEN_S
                    points, _ = scanner.scan(
                        world.at(at_s), world.vehicle_pose_at(at_s), np.random.default_rng(nth)
                    )
                    moved = inverse(pose) @ world.vehicle_pose_at(at_s)
                    carver.add(points, moved, now=nth == 0)
                triangles = world.at(time_s).triangles
                scores.append(score_voxels(carver.result(), triangles, scanner, pose))
                rows.append((f"street {seed}, {time_s:g} s", f"{added + 1}", *_cells(scores[-1])))
        mean = np.mean([_shares(one) for one in scores], axis=0)
        total = f"{sum(one.observable for one in scores):,}"
        rows.append(("mean", f"{added + 1}", *(f"{100 * share:.1f} %" for share in mean), total))
    heads = (
        *("world", "scans", "free right", "occupied right", "free right, 5 cm"),
        *("occupied right, 5 cm", "observable claimed", "observable"),
    )
    return Table("Exact worlds", heads, tuple(rows))


def _shares(score: VoxelScore) -> tuple[float, ...]:
    return score.free, score.occupied, score.free_within, score.occupied_within, score.claimed


def _cells(score: VoxelScore) -> tuple[str, ...]:
    return (*(f"{100 * share:.1f} %" for share in _shares(score)), f"{score.observable:,}")


def line_table(source: Path) -> Table:
    """States of voxels against the answers of sight lines from the scanner to their centres."""
    drive = open_drive(source)
    points, grid = drive[drive.frame_numbers[0]].points, LAYOUTS["semantickitti"].grid
    carver = Carver(grid)
    carver.add(points, now=True)
    index = np.random.default_rng(0).integers(0, grid.shape, (LINES, 3))
    state = carver.result().state[tuple(index.T)]
    answer = Scene.from_scan(points).sight([0, 0, 0], grid.centre_of(index)).state
    counts = [[int(np.sum((state == s) & (answer == a))) for a in (1, 0, -1)] for s in STATES]
    rows = [(STATES[s], *(f"{one:,}" for one in counts[s])) for s in STATES]
    heads = ("voxel", "line visible", "line occluded", "line unknown")
    return Table(f"{LINES:,} random voxels of {drive.name}", heads, tuple(rows))


def occ3d_table(labels: Path, rig: Path) -> Table:
    """The printed algorithms on the occupied voxels of a published file, against its masks."""
    with np.load(labels, allow_pickle=False) as arrays:
        semantics, lidar, camera = (
            arrays[name] for name in ("semantics", "mask_lidar", "mask_camera")
        )
    grid, occupied = LAYOUTS["occ3d-nuscenes"].grid, semantics != OCC3D_FREE
    observed = lidar > 0
    frame = json.loads(rig.read_text())["data_list"][0]
    state = np.where(observed, np.where(occupied, 1, 0), 3).astype(np.uint8)
    seen = np.zeros(grid.shape, np.bool_)
    for posed in _cameras(frame):
        seen |= seen_by_pixels(grid, state, posed) > 0
    crossed = _crossed(grid, occupied & observed, frame) & ~occupied
    free, solid = observed & ~occupied, observed & occupied
    flat = solid & np.isin(semantics, FLAT_CLASSES)
    published = camera > 0
    rows = [
        ("mask_camera, all observed", seen[observed] == published[observed]),
        ("mask_camera, free", seen[free] == published[free]),
        ("mask_camera, ground", seen[flat] == published[flat]),
        ("mask_camera, other occupied", seen[solid & ~flat] == published[solid & ~flat]),
        ("mask_lidar, free: crossed by a ray", crossed[free]),
        ("rays: crossed is published as observed", observed[crossed]),
    ]
    cells = tuple((name, f"{100 * np.mean(same):.1f} %", f"{same.size:,}") for name, same in rows)
    return Table("The printed algorithms against Occ3D's file", ("voxels", "agree", "of"), cells)


def _cameras(frame: dict[str, Any]) -> list[PosedCamera]:
    posed = []
    for name, image in frame["images"].items():
        projection = np.column_stack([np.array(image["cam2img"]), np.zeros(3)])
        cam_from_ego = inverse(np.array(image["cam2ego"], np.float64))
        posed.append(PosedCamera(Camera(projection, 1600, 900, name), cam_from_ego))
    return posed


def _crossed(grid: VoxelGrid, occupied: Any, frame: dict[str, Any]) -> Any:
    """Voxels that rays from the centres of occupied voxels to the LiDAR cross."""
    centres = grid.centre_of(np.argwhere(occupied))
    ego_from_lidar = np.array(frame["lidar_points"]["lidar2ego"], np.float64)
    return (beam_marks(grid, centres, ego_from_lidar) & 1) > 0


def main() -> None:
    """Print the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, nargs="*", default=[])
    parser.add_argument("--later", type=int, default=0)
    parser.add_argument("--drive", type=Path)
    parser.add_argument("--occ3d", type=Path)
    parser.add_argument("--rig", type=Path)
    options = parser.parse_args()
    if options.worlds:
        print(world_table(options.worlds, options.later).as_text())
    if options.drive:
        print(line_table(options.drive).as_text())
    if options.occ3d and options.rig:
        print(occ3d_table(options.occ3d, options.rig).as_text())


if __name__ == "__main__":
    main()
