"""Pictures show the analysis: counts, projections and borders calculated by hand."""

import subprocess
import sys
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_hex
from PIL import Image

from intervis.drives import Frame
from intervis.errors import MissingExtraError
from intervis.method.analysis import Analysis, analyze
from intervis.plots import figures, sight_figure
from intervis.plots.style import FAINT, INTERVISIBLE, NODE
from intervis.settings import Settings
from intervis.sight import Sight
from small_drive import CAMERA_CENTRE_VELO, MemoryDrive


def analyzed(drive: MemoryDrive, **settings) -> tuple[Frame, Analysis]:
    frame = drive[drive.frame_numbers[0]]
    return frame, analyze(
        frame.points,
        camera=frame.camera,
        cam_from_velo=frame.cam_from_velo,
        settings=Settings(**({"tau": 4} | settings)),
    )


@pytest.fixture(scope="module")
def with_camera() -> tuple[Frame, Analysis]:
    return analyzed(MemoryDrive())


@pytest.fixture(scope="module")
def without_camera() -> tuple[Frame, Analysis]:
    return analyzed(MemoryDrive(with_camera=False))


def collections(axes, kind) -> dict:
    return {c.get_label(): c for c in axes.collections if type(c) is kind}


def test_pictures_are_files_of_page_width(with_camera, tmp_path):
    paths = figures.save_pictures(*with_camera, tmp_path / "new" / "pictures")
    assert [path.stem for path in paths] == [
        "overview",
        "camera",
        "scan",
        "surface",
        "intervisibility",
    ]
    for path in paths:
        with Image.open(path) as picture:
            assert picture.width == 1400, path
            pixels = np.asarray(picture.convert("L"))
        assert pixels.std() > 5, f"{path} is blank"
        # Nothing is cut off: the rim of the page is white.
        rim = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
        assert (rim > 250).all(), path


def test_text_does_not_overlap_and_stays_on_the_page(with_camera, without_camera):
    for frame, analysis in (with_camera, without_camera):
        drawn = [figures.overview(frame, analysis), figures.surface(analysis)]
        drawn += [figures.intervisibility(analysis), figures.scan_from_above(frame, analysis)]
        for figure in drawn:
            figure.canvas.draw()
            renderer = figure.canvas.get_renderer()
            boxes = [
                text.get_window_extent(renderer)
                for axes in figure.axes
                for text in (axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label)
                if text.get_text()
            ]
            boxes += [legend.get_window_extent(renderer) for legend in figure.legends]
            for nth, box in enumerate(boxes):
                assert box.x0 >= 0
                assert box.y0 >= 0
                assert box.x1 <= figure.bbox.x1
                assert box.y1 <= figure.bbox.y1
                for other in boxes[:nth]:
                    assert not box.overlaps(other)


def test_camera_dots_are_the_returns_in_view_where_they_project(with_camera):
    frame, analysis = with_camera
    axes = figures.camera_view(frame, analysis).axes[0]
    (dots,) = axes.collections
    assert len(dots.get_offsets()) == len(analysis.in_view)
    # By hand: 100 px focal length, principal point (100, 40), axes x right, y down, z forward.
    x, y, z = (frame.points[analysis.in_view].astype(np.float64) - CAMERA_CENTRE_VELO).T
    by_hand = np.column_stack([100 - 100 * y / x, 40 - 100 * z / x])
    order = np.lexsort(by_hand.T)
    shown = np.asarray(dots.get_offsets())
    np.testing.assert_allclose(shown[np.lexsort(shown.T)], by_hand[order], atol=1e-3)
    # Far returns first, so that near ones are drawn over them.
    assert (np.diff(np.asarray(dots.get_array())) <= 0).all()


def test_states_are_drawn_where_returns_project(with_camera, tmp_path):
    frame, _ = with_camera
    Image.new("RGB", (frame.camera.width_px, frame.camera.height_px)).save(tmp_path / "image.png")
    frame = replace(frame, image_path=tmp_path / "image.png")
    viewpoint, count = np.array([4.0, 1.0, 0.0]), len(frame.points)
    state = np.arange(count, dtype=np.int8) % 3 - 1
    places = np.full((count, 3), np.nan)
    sight = Sight(state, np.full(count, 0.5), places, np.zeros(count), np.zeros(count))
    image, above = sight_figure.sight_picture(frame, sight, viewpoint).axes
    (dots,) = image.collections
    x, y, z = (frame.points.astype(np.float64) - CAMERA_CENTRE_VELO).T
    by_hand = np.column_stack([100 - 100 * y / x, 40 - 100 * z / x])[x > 0]
    shown, order = np.asarray(dots.get_offsets()), np.lexsort(by_hand.T)
    drawn = np.lexsort(shown.T)
    np.testing.assert_allclose(shown[drawn], by_hand[order], atol=1e-3)
    colours = [to_hex(colour) for colour in dots.get_facecolors()[drawn]]
    names = {-1: FAINT, 0: NODE, 1: INTERVISIBLE}
    assert colours == [names[one] for one in state[x > 0][order]]
    legend = [text.get_text() for text in above.figure.legends[0].get_texts()]
    assert [text.split(",")[0] for text in legend] == [
        "unknown",
        "occluded",
        "visible",
        "viewpoint",
    ]
    assert above.get_title(loc="left") == "From above"
    tilted = sight_figure.sight_picture(frame, sight, viewpoint, tilt_deg=44.7).axes[1]
    assert tilted.get_title(loc="left") == "Along the sensor's z axis, 45 degrees off upright"
    frame = replace(frame, image_path=None)
    (alone,) = sight_figure.sight_picture(frame, sight, viewpoint).axes
    assert "z axis" not in alone.get_title(loc="left")
    (alone,) = sight_figure.sight_picture(frame, sight, viewpoint, tilt_deg=44.7).axes
    assert alone.get_title(loc="left").endswith("Along the sensor's z axis, 45 degrees off upright")


def test_the_borders_of_the_view_are_those_of_the_camera(with_camera):
    frame, analysis = with_camera
    lines = figures.scan_from_above(frame, analysis).axes[0].lines
    # 200 px wide at 100 px focal length: 45 degrees to either side of x, left one first.
    slopes = [np.diff(line.get_ydata())[0] / np.diff(line.get_xdata())[0] for line in lines]
    np.testing.assert_allclose(slopes, [1.0, -1.0], atol=1e-9)
    for line in lines:
        np.testing.assert_allclose(line.get_xydata()[0], CAMERA_CENTRE_VELO[:2], atol=1e-9)


def test_a_named_view_has_its_own_borders():
    drive = MemoryDrive(with_camera=False)
    for view, count in (("front", 2), ("wide", 2), ("circle", 0)):
        frame, analysis = analyzed(drive, view=view)
        assert len(figures.scan_from_above(frame, analysis).axes[0].lines) == count
    lines = figures.scan_from_above(*analyzed(drive, view="front")).axes[0].lines
    np.testing.assert_allclose([np.diff(line.get_ydata())[0] > 0 for line in lines], [True, False])


def test_the_scan_is_shown_whole(with_camera):
    frame, analysis = with_camera
    axes = figures.scan_from_above(frame, analysis).axes[0]
    shown = {c.get_label(): len(c.get_offsets()) for c in axes.collections}
    assert shown["returns in view"] == len(analysis.in_view)
    assert shown["returns out of view"] == len(frame.points) - len(analysis.in_view)


def test_the_mesh_shows_what_is_intervisible(with_camera):
    _, analysis = with_camera
    axes = figures.intervisibility(analysis).axes[0]
    (region,) = collections(axes, PolyCollection).values()
    assert len(region.get_paths()) == analysis.region.sum() > 0
    lines = collections(axes, LineCollection)
    assert len(lines["intervisible edge"].get_segments()) == analysis.edge_intervisible.sum() > 0
    assert len(lines["other edge"].get_segments()) == (~analysis.edge_intervisible).sum()
    shown = {c.get_label(): c.get_offsets() for c in axes.collections}
    np.testing.assert_array_equal(
        shown["intervisibility point"], analysis.node_points[analysis.node_intervisible, :2]
    )
    assert len(shown["other node"]) == (~analysis.node_intervisible).sum()
    np.testing.assert_allclose(shown["viewpoint"][0], CAMERA_CENTRE_VELO[:2], atol=1e-9)


def test_the_surface_shows_nodes_before_and_after(with_camera):
    _, analysis = with_camera
    axes = figures.surface(analysis).axes[0]
    shown = {c.get_label(): np.asarray(c.get_offsets()) for c in axes.collections}
    np.testing.assert_allclose(
        shown["node as measured"], (analysis.node_points - analysis.viewpoint)[:, :2], atol=1e-9
    )
    np.testing.assert_array_equal(shown["node on the auxiliary surface"], analysis.chart)


@pytest.mark.parametrize("chart", ["ground", "angles", "polar"])
@pytest.mark.parametrize("metric", ["euclidean", "mahalanobis"])
def test_every_chart_and_metric_can_be_drawn(chart, metric):
    _, analysis = analyzed(MemoryDrive(), chart=chart, metric=metric)
    figures.surface(analysis).canvas.draw()


@pytest.mark.parametrize("returns", [1, 2, 3])
def test_tiny_scans_can_be_drawn(returns, tmp_path):
    points = np.array([[5.0, 1, -1], [6.0, 0, -1], [7.0, 3, 0]], np.float32)[:returns]
    analysis = analyze(points, settings=Settings(tau=1))
    assert len(figures.save_pictures(Frame(number=0, points=points), analysis, tmp_path)) == 4


def test_equal_points_can_be_drawn(tmp_path):
    points = np.full((9, 3), 4.0, np.float32)
    analysis = analyze(points, settings=Settings(tau=1))
    assert len(figures.save_pictures(Frame(number=0, points=points), analysis, tmp_path)) == 4


def test_holes_in_a_scan_can_be_drawn(tmp_path):
    frame = MemoryDrive()[0]
    frame.points[::7] = np.nan
    analysis = analyze(frame.points, camera=frame.camera, cam_from_velo=frame.cam_from_velo)
    assert len(figures.save_pictures(frame, analysis, tmp_path)) == 5


def test_without_matplotlib_the_message_names_the_extra(with_camera, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"intervis\[plots\]"):
        figures.save_pictures(*with_camera, tmp_path / "pictures")
    assert not (tmp_path / "pictures").exists()


def test_drawing_leaves_global_settings_unchanged(with_camera):
    before = dict(matplotlib.rcParams)
    figures.overview(*with_camera)
    assert dict(matplotlib.rcParams) == before


def test_drawing_needs_no_pyplot(tmp_path):
    code = (
        "import sys, numpy as np\n"
        "from intervis.method.analysis import analyze\n"
        "from intervis.plots import figures\n"
        "analysis = analyze(np.random.default_rng(0).uniform(1, 9, (90, 3)))\n"
        "figures.intervisibility(analysis).savefig(sys.argv[1])\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "a.png")], check=True)
