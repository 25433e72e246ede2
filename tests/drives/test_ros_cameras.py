"""Cameras of recordings, which rosbags writes: calibrations, images of all encodings, times."""

import io
import logging
from pathlib import Path

import numpy as np
import pytest
from bag_writer import FORMATS, Recorder, recording_path
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from intervis import Camera, open_drive
from intervis.drives.ros_image import decode_camera_info, decode_image
from intervis.drives.ros_messages import camera_info_message, compressed_image_message
from intervis.errors import CalibrationError, DriveError, ScanError
from intervis.transform import inverse, rigid, transform

STEP_NS = 100_000_000
WIDTH_PX, HEIGHT_PX = 6, 4
OPTICAL = rigid(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), [0.4, 0.1, -0.2])
"""velodyne_from_optical: x right, y down, z ahead."""
K = np.array([[5.0, 0, 3], [0, 5, 2], [0, 0, 1]])
P = np.array([[4.0, 0, 3.1, -0.8], [0, 4, 2.1, 0], [0, 0, 1, 0]])
RECTIFICATION = Rotation.from_euler("xyz", [1.0, -2.0, 0.5], degrees=True).as_matrix()
POINTS = np.random.default_rng(3).uniform(-20, 20, (200, 3)).astype(np.float32)


class CameraRecorder(Recorder):
    """Writes the messages of cameras as well."""

    def write_info(self, topic, frame_id="optical", projection=P, distortion=(), **more):
        new = self.kinds["sensor_msgs/msg/CameraInfo"]
        roi = self.kinds["sensor_msgs/msg/RegionOfInterest"](
            **{"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        )
        letters = "DKRP" if self.ros1 else "dkrp"
        matrices = (np.array(distortion, float), K.ravel(), RECTIFICATION.ravel(), projection)
        named = {n: np.ravel(m) for n, m in zip(letters, matrices, strict=True)}
        sizes = {"height": HEIGHT_PX, "width": WIDTH_PX, "binning_x": 0, "binning_y": 0} | more
        message = new(
            header=self.header(0, frame_id), distortion_model="plumb_bob", roi=roi, **named, **sizes
        )
        self.write(topic, message, 0)

    def write_image(self, topic, pixels, time_ns, encoding="rgb8", pad=0):
        rows = pixels.reshape(len(pixels), -1)
        data = np.pad(rows, ((0, 0), (0, pad))).ravel()
        message = self.kinds["sensor_msgs/msg/Image"](
            header=self.header(time_ns, "optical"),
            **{"height": HEIGHT_PX, "width": WIDTH_PX, "encoding": encoding, "is_bigendian": 0},
            **{"step": rows.shape[1] + pad, "data": data.view(np.uint8)},
        )
        self.write(topic, message, time_ns)

    def write_png(self, topic, pixels, time_ns):
        image = pytest.importorskip("PIL.Image", reason="Pillow (extra plots) is not installed")
        file = io.BytesIO()
        image.fromarray(pixels).save(file, "PNG")
        message = self.kinds["sensor_msgs/msg/CompressedImage"](
            header=self.header(time_ns, "optical"),
            format="png",
            data=np.frombuffer(file.getvalue(), np.uint8),
        )
        self.write(topic, message, time_ns)


def pixels(number, channels=3):
    rng = np.random.default_rng(number)
    return rng.integers(0, 256, (HEIGHT_PX, WIDTH_PX, channels), dtype=np.uint8)


def moved(east_m):
    return rigid(np.eye(3), [east_m, 0, 0])


def record(path, kind, write, *, moves_m=0.0, optical=OPTICAL):
    """Three clouds 0.1 s apart of a vehicle that moves, a camera on it, and what `write` adds."""
    with CameraRecorder(path, kind) as recorder:
        for nth in range(-1, 4):
            recorder.write_transform("map", "velodyne", moved(moves_m * nth), nth * STEP_NS)
        if optical is not None:
            recorder.write_transform("velodyne", "optical", optical, 0, "/tf_static")
        for nth in range(3):
            recorder.write_cloud(POINTS, nth * STEP_NS)
        write(recorder)
    return path


def pixels_of(camera, cam_from_velo):
    """Pixels of the points ahead by the frame's camera, homogeneous division written out."""
    in_cam = transform(cam_from_velo, POINTS)
    u, v, depth = camera.projection[:, :3] @ in_cam.T + camera.projection[:, 3:]
    ahead = depth > 0.5
    return np.column_stack([u, v])[ahead] / depth[ahead, None], ahead


@pytest.mark.parametrize("kind", FORMATS)
def test_a_raw_camera_is_projected_to_by_k_and_has_the_nearest_images(tmp_path, kind):
    def write(recorder):
        recorder.write_info("/front/camera_info")
        for number, time_ns in ((0, -40_000_000), (1, 130_000_000), (2, 260_000_000)):
            recorder.write_image("/front/image_raw", pixels(number), time_ns, pad=2)

    drive = open_drive(record(recording_path(tmp_path, kind), kind, write))
    assert (drive.camera_names, drive.camera_name) == (("front",), "front")
    assert (drive[0].camera.width_px, drive[0].camera.height_px) == (WIDTH_PX, HEIGHT_PX)
    for number in (0, 1):
        frame = drive[number]
        assert frame.has_image
        assert np.array_equal(frame.image, pixels(number))
        found, ahead = pixels_of(frame.camera, frame.cam_from_velo)
        in_optical = (inverse(OPTICAL) @ np.column_stack([POINTS, np.ones(len(POINTS))]).T)[:3]
        expected = (K @ in_optical)[:, ahead]
        assert np.allclose(found, (expected[:2] / expected[2]).T)
    # 0.06 s from the last cloud: no image of that frame.
    assert not drive[2].has_image
    assert drive[2].image is None


def test_a_rectified_camera_is_projected_to_by_r_and_p(tmp_path):
    def write(recorder):
        recorder.write_info("/cam/camera_info", distortion=(0.3, 0.1, 0, 0, 0))
        recorder.write_image("/cam/image_raw", pixels(8), 0)
        recorder.write_image("/cam/image_rect", pixels(9), 0)

    frame = open_drive(record(tmp_path / "a.bag", "ros1", write))[0]
    assert np.array_equal(frame.image, pixels(9))
    found, ahead = pixels_of(frame.camera, frame.cam_from_velo)
    rectified = RECTIFICATION @ transform(inverse(OPTICAL), POINTS).T
    expected = (P @ np.vstack([rectified, np.ones(len(POINTS))]))[:, ahead]
    assert np.allclose(found, (expected[:2] / expected[2]).T)


def test_a_moving_camera_stands_where_it_was_at_the_time_of_its_image(tmp_path):
    """10 m/s: in the 0.02 s to the image the vehicle moves by 0.2 m."""

    def write(recorder):
        recorder.write_info("/front/camera_info")
        recorder.write_image("/front/image_raw", pixels(0), STEP_NS + 20_000_000)

    drive = open_drive(record(tmp_path / "a.bag", "ros1", write, moves_m=1.0))
    apart = drive[1].cam_from_velo @ inverse(drive[0].cam_from_velo)
    centre = transform(inverse(drive[1].cam_from_velo), np.zeros(3))
    assert np.allclose(centre, OPTICAL[:3, 3] + [0.2, 0, 0])
    assert np.allclose(apart[:3, :3], np.eye(3))


def test_compressed_images_are_read_where_there_are_no_others(tmp_path):
    def write(recorder):
        recorder.write_info("/front/camera_info")
        recorder.write_png("/front/image_raw/compressed", pixels(5), 0)
        recorder.write_png("/front/image_raw/compressedDepth", pixels(6), 0)

    frame = open_drive(record(tmp_path / "a.bag", "ros1", write))[0]
    assert np.array_equal(frame.image, pixels(5))


def test_the_front_camera_is_the_default_and_others_are_named(tmp_path):
    def write(recorder):
        for name in ("cam/back", "cam/front"):
            recorder.write_info(f"/{name}/camera_info")

    path = record(tmp_path / "a.bag", "ros1", write)
    drive = open_drive(path)
    assert (drive.camera_names, drive.camera_name) == (("cam_back", "cam_front"), "cam_front")
    assert open_drive(path, camera="cam_back").camera_name == "cam_back"
    assert drive[0].image is None
    with pytest.raises(DriveError, match="available cameras: cam_back, cam_front"):
        open_drive(path, camera="side")


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"frame_id": "elsewhere"}, "no fixed transform leads from the scanner's frame 'velodyne'"),
        ({"binning_x": 2}, "its images are binned or cut"),
        ({"width": 0}, "a camera's image must have 1 to"),
        ({"projection": np.full((3, 4), np.nan)}, "must be a finite"),
    ],
)
def test_a_camera_that_cannot_be_used_is_left_out_and_told(tmp_path, caplog, values, reason):
    path = record(
        *(tmp_path / "a.bag", "ros1"),
        lambda recorder: recorder.write_info("/front/camera_info", **values),
        moves_m=1.0,
    )
    with caplog.at_level(logging.WARNING, "intervis"):
        drive = open_drive(path)
    assert drive.camera_names == ()
    assert drive[0].camera is None
    (said,) = [entry.getMessage() for entry in caplog.records]
    assert said.startswith(f"the camera front of {path} is left out: ")
    assert reason in said


def test_distorted_images_are_told(tmp_path, caplog):
    def write(recorder):
        recorder.write_info("/front/camera_info", distortion=(0.3, 0, 0, 0, 0))
        recorder.write_image("/front/image_raw", pixels(0), 0)

    path = record(tmp_path / "a.bag", "ros1", write, moves_m=1.0)
    with caplog.at_level(logging.WARNING, "intervis"):
        open_drive(path)
    (said,) = [entry.getMessage() for entry in caplog.records]
    assert "the images of the camera front are distorted" in said


RGB = pixels(1)


@pytest.mark.parametrize(
    ("encoding", "stored", "expected"),
    [
        ("rgb8", RGB, RGB),
        ("bgr8", RGB[..., ::-1], RGB),
        ("8UC3", RGB[..., ::-1], RGB),
        ("rgba8", np.dstack([RGB, RGB[..., :1]]), RGB),
        ("bgra8", np.dstack([RGB[..., ::-1], RGB[..., :1]]), RGB),
        ("mono8", RGB[..., :1], np.repeat(RGB[..., :1], 3, axis=2)),
        (
            "mono16",
            (RGB[..., :1].astype("<u2") * 256 + 77).view(np.uint8),
            np.repeat(RGB[..., :1], 3, axis=2),
        ),
    ],
)
def test_the_encodings_of_images(tmp_path, encoding, stored, expected):
    def write(recorder):
        recorder.write_info("/c/camera_info")
        recorder.write_image("/c/image_raw", np.ascontiguousarray(stored), 0, encoding)

    frame = open_drive(record(tmp_path / "a.bag", "ros1", write))[0]
    assert np.array_equal(frame.image, expected)


def test_other_encodings_are_refused_in_one_sentence(tmp_path):
    def write(recorder):
        recorder.write_info("/c/camera_info")
        recorder.write_image("/c/image_raw", pixels(1, 1), 0, "bayer_rggb8")

    frame = open_drive(record(tmp_path / "a.bag", "ros1", write))[0]
    assert frame.points.shape == POINTS.shape
    with pytest.raises(ScanError, match="images of the encoding 'bayer_rggb8', and rgb8"):
        _ = frame.image


def test_what_is_written_is_what_rosbags_reads():
    store = get_typestore(Stores.ROS2_HUMBLE)
    camera = Camera(P, 640, 480, "made")
    info = store.deserialize_cdr(
        camera_info_message(camera, 3_000_000_007, "optical"), "sensor_msgs/msg/CameraInfo"
    )
    assert (info.header.stamp.sec, info.header.stamp.nanosec) == (3, 7)
    assert (info.header.frame_id, info.width, info.height) == ("optical", 640, 480)
    assert info.p.tolist() == P.ravel().tolist()
    assert info.k.tolist() == P[:, :3].ravel().tolist()
    assert info.r.tolist() == np.eye(3).ravel().tolist()
    assert (info.d.tolist(), info.binning_x, info.roi.width) == ([0.0] * 5, 0, 0)
    image = store.deserialize_cdr(
        compressed_image_message(b"\xff\xd8 made", 10**9, "optical"),
        "sensor_msgs/msg/CompressedImage",
    )
    assert (image.header.stamp.sec, image.format) == (1, "jpeg")
    assert image.data.tobytes() == b"\xff\xd8 made"


def test_messages_that_are_none_are_refused():
    with pytest.raises(CalibrationError, match="no CameraInfo"):
        decode_camera_info(b"\0\1\0\0" + bytes(40), "cdr", Path("a.mcap"))
    with pytest.raises(ScanError, match="no Image"):
        decode_image(b"\0\1\0\0" + bytes(10), "cdr", Path("a.mcap"))
