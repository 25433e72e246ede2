"""How long one frame takes: `make bench`. Medians; kernels are compiled before the clock starts.

The frame is KITTI raw's first where the real scans lie beside the project, else a simulated one.
"""

from pathlib import Path

import pytest

from intervis import Settings, analyze, open_drive
from intervis.worlds import simulate

REAL = (
    Path(__file__).resolve().parents[2]
    / "shared/data/kitti_raw/2011_09_26/2011_09_26_drive_9001_sync"
)


@pytest.fixture(scope="session")
def frame(tmp_path_factory):
    path = REAL if REAL.is_dir() else simulate(tmp_path_factory.mktemp("world"), frames=1)
    drive = open_drive(path)
    return drive[drive.frame_numbers[0]]


@pytest.mark.parametrize("tau", [1, 10, 35, 100])
def test_raw_scan_to_region(benchmark, frame, tau):
    """The paper: 0.1044 s at 572 nodes (tau = 35), MATLAB on an i7-8750H."""
    settings = Settings(tau=tau)

    def run():
        return analyze(
            frame.points, camera=frame.camera, cam_from_velo=frame.cam_from_velo, settings=settings
        )

    run()
    result = benchmark(run)
    benchmark.extra_info["nodes"] = result.measures.n
    benchmark.extra_info["ms"] = {k: 1e3 * result.times[k] for k in result.times.keys()}  # noqa: SIM118
