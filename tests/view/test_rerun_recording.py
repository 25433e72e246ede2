"""A recording for Rerun, read back with Rerun's own reader, against the answers of the scene."""

import io
import threading

import numpy as np
import pytest
from recorded_street import AHEAD, END, REQUEST, SIZE_M, recorded, rounded, scene_of, street_drive

from intervis.method.analysis import analyze
from intervis.sight import explain
from intervis.uses.registration import query_moment_s
from intervis.view.recordings import rerun_recording

pytest.importorskip("rerun", reason="rerun-sdk is not installed: pip install 'intervis[viewer]'")
from rerun.chunk import RrdReader

SENSOR = "/world/sensor"
CLASS = {0: 0, 1: 1, -1: 2}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return street_drive(tmp_path_factory.mktemp("street"))


@pytest.fixture(scope="module")
def path(drive, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording")
    return recorded(drive, folder / "street.rrd", rerun_recording)


@pytest.fixture(scope="module")
def chunks(path):
    return RrdReader(path).stream().to_chunks()


def static(chunks, entity):
    """The columns of the static data of an entity, which is logged once."""
    (chunk,) = [one for one in chunks if one.entity_path == entity and one.is_static]
    return columns_of(chunk.to_record_batch(), 0)


def at_frame(chunks, entity, number):
    """The columns of an entity at a frame; none where it has no row there."""
    found = {}
    for chunk in chunks:
        if chunk.entity_path != entity or chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        for row, frame in enumerate(batch.column("frame").to_pylist()):
            if frame == number:
                found |= columns_of(batch, row)
    return found


def columns_of(batch, row):
    """The cells of a row; times as whole nanoseconds."""
    cells = {name: batch.column(name) for name in batch.schema.names}
    if "time" in cells:
        cells["time"] = cells["time"].cast("int64")
    return {name: column[row].as_py() for name, column in cells.items()}


def pose_of(columns):
    """(4, 4) from the translation and the quaternion (x, y, z, w) of an entity."""
    (x, y, z, w), (shift,) = (
        columns["Transform3D:quaternion"][0],
        columns["Transform3D:translation"],
    )
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = shift
    return pose


def test_returns_have_the_states_and_probabilities_of_the_scene(drive, chunks):
    for number in drive.frame_numbers:
        columns = at_frame(chunks, f"{SENSOR}/returns", number)
        points = rounded(drive, number, np.array(columns["row"]))
        assert len(points) == REQUEST.most_returns
        assert np.array(columns["Points3D:positions"]) == pytest.approx(points, abs=1e-5)
        scene = scene_of(drive, number)
        sight = scene.sight(AHEAD, points, moment_s=query_moment_s(scene))
        assert columns["Points3D:class_ids"] == [CLASS[state] for state in sight.state.tolist()]
        assert columns["probability"] == pytest.approx(sight.probability, abs=1e-6)
        assert min(np.bincount(columns["Points3D:class_ids"])) > 20


def test_probability_has_the_colours_of_the_scale(drive, chunks):
    columns = at_frame(chunks, f"{SENSOR}/returns", 0)
    probability = np.array(columns["probability"])
    colours = np.array(columns["probability_colour"])
    assert set(colours & 255) == {255}
    # the scale runs from dark blue to yellow: its green channel rises all the way
    green = (colours >> 16 & 255)[np.argsort(probability, kind="stable")]
    assert (np.diff(green) >= 0).all()
    assert green[0] < 40
    assert green[-1] > 200


def test_states_have_their_names_and_are_logged_once(chunks):
    context = static(chunks, "/")["AnnotationContext:context"]
    named = {entry["class_id"]: entry["class_description"]["info"]["label"] for entry in context[0]}
    assert named == {0: "occluded", 1: "visible", 2: "unknown"}
    assert static(chunks, "/world")["ViewCoordinates:xyz"]
    assert static(chunks, f"{SENSOR}/returns")["Points3D:radii"]


def test_frames_and_times_are_those_of_the_drive(drive, chunks):
    for number in drive.frame_numbers:
        columns = at_frame(chunks, "/measures/visible_percent", number)
        assert columns["time"] == drive.timestamps_ns[number]


def test_the_sensor_moves_as_the_poses_say(drive, chunks):
    origin = static(chunks, "/__properties/world_origin_m")
    shift = np.array([origin[axis][0] for axis in "xyz"])
    assert (shift == np.round(drive[0].pose[:3, 3])).all()
    for number in drive.frame_numbers:
        pose = pose_of(at_frame(chunks, SENSOR, number))
        pose[:3, 3] += shift
        assert pose == pytest.approx(drive[number].pose, abs=1e-5)


def test_the_pinhole_projects_as_the_camera_does(drive, chunks):
    image = pytest.importorskip("PIL.Image")
    frame = drive[0]
    columns = at_frame(chunks, f"{SENSOR}/camera", 0)
    points = np.column_stack([np.array([[9.0, 2, 0.5], [30, -4, -1], [6, 0, 0.2]]), np.ones(3)])
    in_pinhole = points @ np.linalg.inv(pose_of(columns)).T
    matrix = np.reshape(columns["Pinhole:image_from_camera"][0], (3, 3)).T  # by columns
    recorded = in_pinhole[:, :3] @ matrix.T
    expected = points @ (frame.camera.projection @ frame.cam_from_velo).T
    width_px, height_px = columns["Pinhole:resolution"][0]
    scale = np.array([width_px / frame.camera.width_px, height_px / frame.camera.height_px])
    pixels = recorded[:, :2] / recorded[:, 2:]
    assert pixels == pytest.approx(scale * expected[:, :2] / expected[:, 2:], abs=0.01)
    blob = at_frame(chunks, f"{SENSOR}/camera/image", 0)["EncodedImage:blob"][0]
    assert image.open(io.BytesIO(bytes(blob))).size == (width_px, height_px)


def test_an_object_is_drawn_and_cleared_when_it_is_gone(drive, chunks):
    first = at_frame(chunks, f"{SENSOR}/objects", 0)
    assert first["Boxes3D:half_sizes"][0] == pytest.approx(SIZE_M / 2)
    assert first["Boxes3D:centers"][0] == pytest.approx([20, 3, -1])
    assert first["Boxes3D:labels"][0].startswith("Car & van, ")
    half = np.sqrt(0.5)
    assert first["Boxes3D:quaternions"][0] == pytest.approx([0, 0, half, half])
    assert "Clear:is_recursive" in at_frame(chunks, f"{SENSOR}/objects", 1)


def test_the_line_is_explained_as_by_python(drive, chunks):
    for number in drive.frame_numbers:
        scene = scene_of(drive, number)
        said = explain(scene, AHEAD, END, moment_s=query_moment_s(scene))
        assert at_frame(chunks, "/sight_lines/1", number)["TextLog:text"] == [said.text]
        strip = at_frame(chunks, f"{SENSOR}/sight_lines", number)["LineStrips3D:strips"][0]
        assert np.array(strip) == pytest.approx(np.array([AHEAD, END]))
        (percent,) = at_frame(chunks, "/measures/sight_line_1_percent", number)["Scalars:scalars"]
        assert percent == pytest.approx(100 * said.probability)


def test_cells_of_blind_spots_lie_around_cells_that_are_not_visible(drive, chunks):
    columns = at_frame(chunks, f"{SENSOR}/blind_spots", 0)
    corners = np.array(columns["Mesh3D:vertex_positions"]).reshape(-1, 4, 3)
    scene = scene_of(drive, 0)
    middles = corners.mean(axis=1)
    judged = scene.sight(AHEAD, middles + np.array([0, 0, 1.0]), moment_s=query_moment_s(scene))
    # the grid judges at 1 m above the same ground; float32 moves a middle by micrometres
    assert judged.visible.mean() < 0.01
    assert np.ptp(corners, axis=1)[:, :2] == pytest.approx(0.8, abs=1e-4)


def test_the_region_is_that_of_the_method(drive, chunks):
    frame = drive[0]
    expected = analyze(
        frame.points, camera=frame.camera, cam_from_velo=frame.cam_from_velo, viewpoint=AHEAD
    )
    columns = at_frame(chunks, f"{SENSOR}/method/region", 0)
    assert len(columns["Mesh3D:triangle_indices"]) == expected.region.sum() > 0
    corners = np.array(columns["Mesh3D:vertex_positions"])[columns["Mesh3D:triangle_indices"]]
    nodes = frame.points[expected.nodes][expected.triangles[expected.region]]
    assert corners == pytest.approx(nodes, abs=1e-5)


def test_the_recording_opens_with_views_of_scan_camera_and_charts(path):
    (blueprint,) = RrdReader(path).blueprints()
    names = []
    for chunk in RrdReader(path).stream(store=blueprint).to_chunks():
        batch = chunk.to_record_batch()
        if "ViewBlueprint:display_name" in batch.schema.names:
            names += batch.column("ViewBlueprint:display_name")[0].as_py()
    assert {"Sight", "Probability", "World", "Camera", "States, %"} <= set(names)


def test_a_failure_leaves_neither_a_file_nor_a_thread(drive, tmp_path):
    before = threading.active_count()
    with (
        pytest.raises(RuntimeError, match="on the way"),
        rerun_recording(tmp_path / "r.rrd", drive, [0], REQUEST),
    ):
        raise RuntimeError("on the way")
    assert list(tmp_path.iterdir()) == []
    assert threading.active_count() <= before
