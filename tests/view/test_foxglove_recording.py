"""A recording for Foxglove, decoded with the library of MCAP, against the answers of the scene."""

import errno
import io
import json
import os

import numpy as np
import pytest
from recorded_street import AHEAD, END, REQUEST, SIZE_M, recorded, rounded, scene_of, street_drive

from intervis.sight import explain
from intervis.uses.registration import query_moment_s
from intervis.view.recordings import foxglove_recording
from intervis.view.recordings.foxglove_file import _WatchedFile

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed: intervis[viewer]")
mcap_reader = pytest.importorskip("mcap.reader", reason="mcap is not installed")
mcap_protobuf = pytest.importorskip("mcap_protobuf.decoder", reason="mcap-protobuf-support is not")

NUMPY_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}
"""By the numbers of foxglove.PackedElementField.NumericType."""

ALL_ENTITIES = 1
"""Of foxglove.SceneEntityDeletion.Type."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return street_drive(tmp_path_factory.mktemp("street"))


@pytest.fixture(scope="module")
def path(drive, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording")
    return recorded(drive, folder / "street.mcap", foxglove_recording)


@pytest.fixture(scope="module")
def messages(path):
    """(topic, log time): message; JSON as a dict."""
    found = {}
    with path.open("rb") as file:
        reader = mcap_reader.make_reader(file)
        factory = mcap_protobuf.DecoderFactory()
        for schema, channel, message in reader.iter_messages():
            if channel.message_encoding == "json":
                decoded = json.loads(message.data)
            else:
                decoded = factory.decoder_for(channel.message_encoding, schema)(message.data)
            assert (channel.topic, message.log_time) not in found
            found[channel.topic, message.log_time] = decoded
    return found


def records(message, stride):
    """The packed records of a message, by the fields that it describes."""
    record = np.dtype(
        {
            "names": [field.name for field in message.fields],
            "formats": [NUMPY_TYPES[field.type] for field in message.fields],
            "offsets": [field.offset for field in message.fields],
            "itemsize": stride,
        }
    )
    return np.frombuffer(message.data, record)


def coordinates(points):
    return np.array([[point.x, point.y, point.z] for point in points])


def entities(update):
    return {entity.id: entity for entity in update.entities}


def test_returns_have_the_states_and_probabilities_of_the_scene(drive, messages):
    for number in drive.frame_numbers:
        cloud = messages["/returns", drive.timestamps_ns[number]]
        assert cloud.frame_id == "sensor"
        assert cloud.timestamp.ToNanoseconds() == drive.timestamps_ns[number]
        returns = records(cloud, cloud.point_stride)
        points = rounded(drive, number, returns["row"])
        recorded = np.column_stack([returns[axis] for axis in "xyz"])
        assert recorded == pytest.approx(points, abs=1e-5)
        scene = scene_of(drive, number)
        sight = scene.sight(AHEAD, points, moment_s=query_moment_s(scene))
        assert (returns["state"] == sight.state).all()
        assert returns["probability"] == pytest.approx(sight.probability, abs=1e-6)
        colours = {
            state: set(zip(*(one[c].tolist() for c in ("red", "green", "blue")), strict=True))
            for state in (1, 0, -1)
            for one in [returns[returns["state"] == state]]
        }
        assert [len(found) for found in colours.values()] == [1, 1, 1]
        assert len(set.union(*colours.values())) == 3


def test_the_measures_count_the_states(drive, messages):
    for number in drive.frame_numbers:
        time_ns = drive.timestamps_ns[number]
        measures, cloud = messages["/measures", time_ns], messages["/returns", time_ns]
        state = records(cloud, cloud.point_stride)["state"]
        counted = [measures[name] for name in ("visible", "occluded", "unknown")]
        assert counted == [int((state == value).sum()) for value in (1, 0, -1)]
        assert measures["visible_percent"] == pytest.approx(100 * np.mean(state == 1))
        assert measures["frame"] == number


def test_the_sensor_moves_as_the_poses_say(drive, messages):
    for number in drive.frame_numbers:
        sensor, camera = messages["/tf", drive.timestamps_ns[number]].transforms
        assert (sensor.parent_frame_id, sensor.child_frame_id) == ("world", "sensor")
        assert (camera.parent_frame_id, camera.child_frame_id) == ("sensor", "camera")
        frame = drive[number]
        assert coordinates([sensor.translation])[0] == pytest.approx(frame.pose[:3, 3])
        q = sensor.rotation
        x_axis = [
            1 - 2 * (q.y**2 + q.z**2),
            2 * (q.x * q.y + q.z * q.w),
            2 * (q.x * q.z - q.y * q.w),
        ]
        assert x_axis == pytest.approx(frame.pose[:3, 0], abs=1e-9)
        assert coordinates([camera.translation])[0] == pytest.approx(frame.viewpoint_velo)


def test_states_on_the_image_lie_where_the_returns_are(drive, messages):
    image = pytest.importorskip("PIL.Image")
    time_ns, frame = drive.timestamps_ns[0], drive[0]
    cloud, annotations = messages["/returns", time_ns], messages["/camera/states", time_ns]
    calibration = messages["/camera/calibration", time_ns]
    jpeg = messages["/camera/image", time_ns]
    size = (calibration.width, calibration.height)
    assert image.open(io.BytesIO(jpeg.data)).size == size
    returns = records(cloud, cloud.point_stride)
    points = np.column_stack([*(returns[axis] for axis in "xyz"), np.ones(len(returns))])
    u, v, depth = (frame.camera.projection @ frame.cam_from_velo) @ points.T
    scale = np.divide(size, (frame.camera.width_px, frame.camera.height_px))
    pixels = np.column_stack([u / depth, v / depth]) * scale
    inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels < size).all(axis=1)
    assert inside.sum() > 100
    for shown, state in zip(annotations.points, (0, 1, -1), strict=True):
        expected = pixels[inside & (returns["state"] == state)]
        assert np.array([[p.x, p.y] for p in shown.points]) == pytest.approx(expected, abs=0.01)
    assert list(calibration.P)[:3] == list(calibration.K)[:3]


def test_an_object_is_drawn_and_deleted_when_it_is_gone(drive, messages):
    updates = [messages["/scene", drive.timestamps_ns[number]] for number in (0, 1)]
    for update in updates:
        assert [one.type for one in update.deletions] == [ALL_ENTITIES]
    objects = entities(updates[0])["objects"]
    ends = coordinates(objects.lines[0].points).reshape(-1, 2, 3)
    lengths = np.sort(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
    assert lengths == pytest.approx(np.sort(np.repeat(SIZE_M, 4)))
    # turned by a quarter: the length lies along y
    assert np.ptp(ends.reshape(-1, 3), axis=0) == pytest.approx(SIZE_M[[1, 0, 2]])
    assert ends.reshape(-1, 3).mean(axis=0) == pytest.approx([20, 3, -1])
    assert objects.texts[0].text.startswith("Car & van, ")
    assert "objects" not in entities(updates[1])


def test_line_and_viewpoint_are_drawn_and_explained(drive, messages):
    for number in drive.frame_numbers:
        time_ns = drive.timestamps_ns[number]
        scene = scene_of(drive, number)
        said = explain(scene, AHEAD, END, moment_s=query_moment_s(scene))
        assert messages["/sight_lines", time_ns].message == said.text
        drawn = entities(messages["/scene", time_ns])
        assert coordinates(drawn["sight_lines"].lines[0].points) == pytest.approx(
            np.array([AHEAD, END])
        )
        spheres = [sphere.pose.position for sphere in drawn["sight_lines"].spheres]
        blockers = [said.blocker] if np.isfinite(said.blocker).all() else []
        assert coordinates(spheres).tolist() == [blocker.tolist() for blocker in blockers]
        (viewpoint,) = drawn["viewpoint"].spheres
        assert coordinates([viewpoint.pose.position]).tolist() == [list(AHEAD)]


def test_cells_of_the_ground_have_the_states_of_their_places(drive, messages):
    grid = messages["/blind_spots", drive.timestamps_ns[0]]
    cells = records(grid, grid.cell_stride).reshape(-1, grid.column_count)
    assert grid.row_stride == grid.column_count * grid.cell_stride
    rows, columns = np.indices(cells.shape)
    x = grid.pose.position.x + (columns + 0.5) * grid.cell_size.x
    y = grid.pose.position.y + (rows + 0.5) * grid.cell_size.y
    scene = scene_of(drive, 0)
    known = np.isfinite(cells["probability"])
    xy = np.column_stack([x[known], y[known]])
    targets = np.column_stack([xy, scene.ground_height(xy) + 1.0])
    sight = scene.sight(AHEAD, targets, moment_s=query_moment_s(scene))
    assert (sight.state == cells["state"][known]).mean() > 0.999  # the last bit of x may differ
    assert len(set(sight.state.tolist())) == 3
    shown = cells["alpha"] > 0
    assert not (cells["state"][shown] == 1).any()
    assert shown.sum() > 100


def test_the_file_says_what_it_holds(path, drive):
    with path.open("rb") as file:
        reader = mcap_reader.make_reader(file)
        (metadata,) = list(reader.iter_metadata())
        assert reader.get_header().profile == "intervis-view"
        assert reader.get_summary().statistics.message_count == 2 * 9
    assert metadata.metadata["state"] == "1 visible, 0 occluded, -1 unknown"
    assert metadata.metadata["times"] == "of the drive"


def test_a_failure_leaves_no_file(drive, tmp_path):
    with (
        pytest.raises(RuntimeError, match="on the way"),
        foxglove_recording(tmp_path / "r.mcap", drive, [0], REQUEST),
    ):
        raise RuntimeError("on the way")
    assert list(tmp_path.iterdir()) == []


class _FullDisk(io.BytesIO):
    """A file that takes ten bytes."""

    def write(self, content):
        if self.tell() + len(content) > 10:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(content)


def test_a_file_that_is_full_keeps_the_positions_of_one_that_is_not():
    """The SDK compares positions with its own, and panics where a full file stands still."""
    full, whole = _WatchedFile(_FullDisk()), io.BytesIO()
    positions = []
    for file in (full, whole):
        file.write(b"12345678")
        file.seek(2)
        file.write(b"ab")
        file.seek(0, os.SEEK_END)
        file.write(b"x" * 7)  # too much for the full one
        here = file.seek(0, os.SEEK_CUR)
        file.seek(3)
        file.write(b"cd")
        positions.append((here, file.seek(1, os.SEEK_CUR), file.seek(-2, os.SEEK_END)))
    assert positions[0] == positions[1] == (15, 6, 13)
    with pytest.raises(OSError, match="No space left"):
        full.check()


def test_a_file_with_room_holds_what_was_written():
    file = _FullDisk()
    watched = _WatchedFile(file)
    watched.write(b"12345678")
    watched.seek(2)
    watched.write(b"ab")
    watched.flush()
    watched.check()
    assert file.getvalue() == b"12ab5678"
