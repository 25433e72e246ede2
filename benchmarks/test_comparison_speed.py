"""Time of the two methods that the paper compares with: `make bench`."""

from intervis.method.comparison import global_points, interpolation_points


def test_interpolation_points(benchmark, frame):
    """The paper: 17.537 s for 20,008 returns in view."""

    def run():
        return interpolation_points(
            frame.points, camera=frame.camera, cam_from_velo=frame.cam_from_velo
        )

    run()
    benchmark.extra_info["comparisons"] = benchmark(run).comparisons


def test_global_points(benchmark, frame):
    """The paper: 1163.876 s for 125,148 returns."""
    camera = {"camera": frame.camera, "cam_from_velo": frame.cam_from_velo}
    global_points(frame.points[:64], **camera)
    result = benchmark.pedantic(global_points, (frame.points,), camera, rounds=3)
    benchmark.extra_info["comparisons"] = result.comparisons
    benchmark.extra_info["sight lines s"] = result.times.S3
