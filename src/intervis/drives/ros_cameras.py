"""Cameras of a recording: each ``CameraInfo``, with the images beside it on the same camera's name.

Images of ``/front/image_rect`` or ``/front/image_raw/compressed`` belong to ``/front/camera_info``.
Rectified images are projected to by P, others by K, without distortion. A frame has the image
nearest in time, if one lies within `WITHIN_NS`; where poses are known, the camera is placed where
it was when that image was taken.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from intervis.arrays import Float64Array, UInt8Array
from intervis.camera import Camera
from intervis.drives.calibration import CameraCalibration
from intervis.drives.camera_choice import pick_named_camera
from intervis.drives.pose_track import nearest_time
from intervis.drives.ros_encoding import Encoding
from intervis.drives.ros_image import (
    CameraInfo,
    decode_camera_info,
    decode_compressed_image,
    decode_image,
)
from intervis.drives.ros_places import Places, Way
from intervis.drives.ros_recording import Recording, Stamped
from intervis.errors import CalibrationError, CameraError, PoseError
from intervis.transform import checked_pose, inverse, rigid

log = logging.getLogger(__name__)

INFO = "sensor_msgs/CameraInfo"
DECODERS: dict[str, Callable[[bytes, Encoding, Path], UInt8Array]] = {
    "sensor_msgs/Image": decode_image,
    "sensor_msgs/CompressedImage": decode_compressed_image,
}
INFO_NAME = "camera_info"

WITHIN_NS = 50_000_000
"""An image belongs to a frame within this time of its cloud: half of the time of a sweep."""

NO_DISTORTION = 1e-9
"""Coefficients of distortion that are no larger are none."""


@dataclass(frozen=True, eq=False)
class ImageReader:
    """Reads an image of a recording when it is asked for."""

    recording: Recording
    topic: str
    kind: str
    image: Stamped

    def __call__(self) -> UInt8Array:
        """The image (H, W, 3)."""
        content, encoding = self.recording.read(self.topic, self.image)
        name = self.recording.root / self.topic.strip("/")
        return DECODERS[self.kind](content, encoding, name)


@dataclass(frozen=True, eq=False)
class FrameCamera:
    """A camera as the frames see it.

    Attributes
    ----------
    name : str
    camera : Camera
    cam_from_cloud : mapping of str to (4, 4) float64 array
        The projection's frame from that of the clouds, by the name of the latter.
    clouds : sequence of Stamped
    ways : mapping of str to Way
    image_readers : mapping of int to ImageReader
        By frame number; a frame may have none.
    """

    name: str
    camera: Camera
    cam_from_cloud: Mapping[str, Float64Array]
    clouds: Sequence[Stamped] = field(repr=False)
    ways: Mapping[str, Way] = field(repr=False)
    image_readers: Mapping[int, ImageReader] = field(repr=False)

    def calibration(self, number: int) -> CameraCalibration:
        """Camera and extrinsics of a frame, at the time of its image."""
        cloud = self.clouds[number]
        way = self.ways[cloud.frame_id]
        cam_from_velo = self.cam_from_cloud[cloud.frame_id] @ way.cloud_from_velo
        if number in self.image_readers:
            now = way.pose(cloud.time_ns)
            then = way.pose(self.image_readers[number].image.time_ns)
            if now is not None and then is not None:
                cam_from_velo = cam_from_velo @ inverse(then) @ now
        return CameraCalibration(self.camera, cam_from_velo)


def chosen_camera(
    recording: Recording,
    asked: str | None,
    clouds: Sequence[Stamped],
    ways: Mapping[str, Way],
    places: Places,
) -> tuple[tuple[str, ...], FrameCamera | None]:
    """The names of the cameras of a recording, and the one to use; None where there is none.

    The default is the first with "front" in its name, otherwise the first.

    Raises
    ------
    DriveError
        There is no camera of the name that is asked for.
    """
    found: dict[str, FrameCamera] = {}
    for topic in recording.topics(INFO):
        if not recording.has_messages(topic) or topic.rpartition("/")[2] != INFO_NAME:
            continue
        name = topic.removesuffix(INFO_NAME).strip("/").replace("/", "_") or "camera"
        try:
            found[name] = _camera(recording, topic, name, clouds, ways, places)
        except (CalibrationError, CameraError, PoseError) as error:
            log.warning("the camera %s of %s is left out: %s", name, recording.root, error)
    names = tuple(sorted(found))
    usual = next((name for name in names if "front" in name.lower()), "")
    chosen = pick_named_camera(asked, list(names), usual, recording.root)
    return names, None if chosen is None else found[chosen]


def _camera(
    recording: Recording,
    topic: str,
    name: str,
    clouds: Sequence[Stamped],
    ways: Mapping[str, Way],
    places: Places,
) -> FrameCamera:
    """A camera and its images.

    Raises
    ------
    CalibrationError, CameraError, PoseError
        It has no calibration, or no fixed place beside the scanner.
    """
    content = next(recording.messages(topic), None)
    if content is None:
        raise CalibrationError("its calibration is damaged.")
    info = decode_camera_info(*content, recording.root)
    if not info.is_whole:
        raise CalibrationError("its images are binned or cut, which is not read.")
    images = _image_topic(recording, topic.removesuffix(INFO_NAME))
    is_rectified = images is None or "rect" in images[0]
    camera, cam_from_optical = _projection(info, name, is_rectified)
    if not is_rectified and np.abs(info.distortion).max(initial=0.0) > NO_DISTORTION:
        log.warning(
            "the images of the camera %s are distorted: what is drawn into them is off towards"
            " their edges. Record rectified images (image_rect).",
            name,
        )
    cam_from_cloud = {}
    for frame_id in ways:
        optical_from_cloud = places.fixed(info.frame_id, frame_id)
        if optical_from_cloud is None:
            raise CalibrationError(
                f"no fixed transform leads from the scanner's frame {frame_id!r:.80} to"
                f" {info.frame_id!r:.80}."
            )
        cam_from_cloud[frame_id] = cam_from_optical @ optical_from_cloud
    return FrameCamera(
        name, camera, cam_from_cloud, clouds, ways, _nearest_images(recording, images, clouds)
    )


def _projection(info: CameraInfo, name: str, is_rectified: bool) -> tuple[Camera, Float64Array]:
    """The camera, and its frame from the optical one: P and R for rectified images, K for others.

    P is 0 where nobody has calibrated for rectification: then K holds for both.
    """
    if is_rectified and info.projection.any():
        camera = Camera(info.projection, info.width_px, info.height_px, name)
        if not info.rectification.any():
            return camera, np.eye(4)
        return camera, checked_pose(rigid(info.rectification, np.zeros(3)), "its rectification")
    if not info.intrinsic.any():
        raise CalibrationError("its CameraInfo holds no calibration.")
    intrinsic = np.column_stack([info.intrinsic, np.zeros(3)])
    return Camera(intrinsic, info.width_px, info.height_px, name), np.eye(4)


def _image_topic(recording: Recording, beside: str) -> tuple[str, str] | None:
    """The topic with images of a camera, and their kind; rectified and uncompressed ones first."""
    kinds = {
        topic: kind
        for topic, kind in recording.topics(*DECODERS).items()
        if topic.startswith(beside) and "depth" not in topic.lower()
    }
    filled = [topic for topic in kinds if recording.has_messages(topic)]
    best = min(
        filled,
        key=lambda topic: ("rect" not in topic, kinds[topic] != "sensor_msgs/Image", topic),
        default=None,
    )
    return None if best is None else (best, kinds[best])


def _nearest_images(
    recording: Recording, images: tuple[str, str] | None, clouds: Sequence[Stamped]
) -> dict[int, ImageReader]:
    """A reader of the nearest image of each cloud that has one."""
    if images is None:
        return {}
    stamped = recording.stamped(images[0])
    times_ns = [one.time_ns for one in stamped]
    nearest = [nearest_time(times_ns, cloud.time_ns, WITHIN_NS) for cloud in clouds]
    return {
        number: ImageReader(recording, *images, stamped[place])
        for number, place in enumerate(nearest)
        if place is not None
    }
