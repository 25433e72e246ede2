"""Recordings in the formats of ROS, written by rosbags; their content is chosen by the tests."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("rosbags", reason="rosbags, which writes the recordings, is not installed")
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START_NS = 1_700_000_000_123_456_789
FORMATS = ("ros1", "sqlite3", "mcap")


class Recorder:
    """Writes messages to one recording; times are nanoseconds after `START_NS`."""

    def __init__(self, path: Path, kind: str, compression: str = ""):
        self.ros1 = kind == "ros1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_HUMBLE)
        if self.ros1:  # the store has no messages of tf2
            transforms = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(transforms, "tf2_msgs/msg/TFMessage"))
        self.kinds = self.store.types
        if self.ros1:
            self.writer = rosbag1.Writer(path)
            if compression:
                self.writer.set_compression(rosbag1.Writer.CompressionFormat[compression.upper()])
        else:
            self.writer = rosbag2.Writer(
                path, version=9, storage_plugin=StoragePlugin[kind.upper()]
            )
            if compression:
                self.writer.set_compression(
                    rosbag2.CompressionMode[compression.upper()], rosbag2.CompressionFormat.ZSTD
                )
        self.connections = {}

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *_):
        self.writer.close()

    def header(self, time_ns, frame_id):
        seconds, nanoseconds = divmod(START_NS + time_ns if time_ns is not None else 0, 10**9)
        stamp = self.kinds["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
        more = {"seq": 7} if self.ros1 else {}
        return self.kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id, **more)

    def write(self, topic, message, time_ns):
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialize = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        self.writer.write(
            self.connections[topic], START_NS + time_ns, bytes(serialize(message, kind))
        )

    def cloud(self, points, time_ns, frame_id="velodyne", **more):
        """A message with x, y, z (and further columns) as float32."""
        names = ("x", "y", "z", "intensity")[: points.shape[1]]
        field = self.kinds["sensor_msgs/msg/PointField"]
        return self.kinds["sensor_msgs/msg/PointCloud2"](
            header=self.header(time_ns, frame_id),
            height=1,
            width=len(points),
            fields=[
                field(name=name, offset=4 * nth, datatype=7, count=1)
                for nth, name in enumerate(names)
            ],
            is_bigendian=False,
            point_step=4 * len(names),
            row_step=4 * len(names) * len(points),
            data=np.frombuffer(points.astype("<f4").tobytes(), np.uint8),
            is_dense=True,
        )

    def write_cloud(self, points, time_ns, topic="/points", frame_id="velodyne", later_ns=5_000):
        """A cloud that is recorded some time after its stamp."""
        self.write(topic, self.cloud(points, time_ns, frame_id), (time_ns or 0) + later_ns)

    def pose(self, pose, kind, position, orientation):
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        return self.kinds[f"geometry_msgs/msg/{kind}"](
            **{
                position: self.kinds[
                    f"geometry_msgs/msg/{'Vector3' if position == 'translation' else 'Point'}"
                ](*pose[:3, 3].tolist()),
                orientation: self.kinds["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w),
            }
        )

    def write_transform(self, parent, child, pose, time_ns, topic="/tf", recorded_ns=None):
        stamped = self.kinds["geometry_msgs/msg/TransformStamped"](
            header=self.header(time_ns, parent),
            child_frame_id=child,
            transform=self.pose(pose, "Transform", "translation", "rotation"),
        )
        message = self.kinds["tf2_msgs/msg/TFMessage"](transforms=[stamped])
        self.write(topic, message, time_ns if recorded_ns is None else recorded_ns)

    def write_odometry(self, pose, time_ns, parent="odom", child="base_link", topic="/odom"):
        twist = self.kinds["geometry_msgs/msg/Twist"](
            linear=self.kinds["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0),
            angular=self.kinds["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0),
        )
        covariance = np.zeros(36)
        message = self.kinds["nav_msgs/msg/Odometry"](
            header=self.header(time_ns, parent),
            child_frame_id=child,
            pose=self.kinds["geometry_msgs/msg/PoseWithCovariance"](
                pose=self.pose(pose, "Pose", "position", "orientation"), covariance=covariance
            ),
            twist=self.kinds["geometry_msgs/msg/TwistWithCovariance"](
                twist=twist, covariance=covariance
            ),
        )
        self.write(topic, message, time_ns)


def recording_path(folder: Path, kind: str) -> Path:
    return folder / ("drive.bag" if kind == "ros1" else "drive")
