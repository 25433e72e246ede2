"""Time of one frame: `make bench`. Medians; kernels are compiled before the first timed run."""

import pytest

from intervis import Settings, analyze


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
    benchmark.extra_info["ms"] = {stage: 1e3 * s for stage, s in result.times.items()}
