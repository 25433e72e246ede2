"""A log of Argoverse 2, written from plain numbers; needs pyarrow."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

UP = (Rotation.from_euler("z", 10, degrees=True), np.array([1.35, 0.0, 1.64]))
DOWN = (Rotation.from_euler("x", 180, degrees=True), np.array([1.35, 0.0, 1.53]))
CAMERA = (Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.array([1.6, 0.0, 1.4]))
"""ego_from_sensor: the upper scanner turned by 10 degrees, the lower one upside down."""

TIMES_NS = (315966265259836000, 315966265360032000)
POINTS = np.array([[10.0, 2, 0.5], [-4, 3, 1], [25, -8, -0.25], [6, 6, 6], [1, -12, 0], [9, 0, 2]])
"""In the vehicle's frame; halves and quarters, which float16 holds."""

LASERS = np.array([0, 32, 31, 63, 5, 40], np.uint8)


def write_table(path: Path, **columns) -> Path:
    import pyarrow
    from pyarrow import feather

    path.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pyarrow.table(columns), str(path), compression="uncompressed")
    return path


def motions(*parts):
    """Columns of rigid motions."""
    quaternions = np.array([rotation.as_quat() for rotation, _ in parts])
    translations = np.array([translation for _, translation in parts], float)
    names = ("qx", "qy", "qz", "qw", "tx_m", "ty_m", "tz_m")
    return dict(zip(names, np.column_stack([quaternions, translations]).T, strict=True))


def write_log(root: Path) -> Path:
    """Two sweeps, and an image of 50 ms after the first; the vehicle drives 10 m/s along y."""
    ahead = Rotation.from_euler("z", 90, degrees=True)
    times_ns = [TIMES_NS[0], TIMES_NS[0] + 100_000_000, TIMES_NS[1]]
    poses = [(ahead, [100, 200, 3]), (ahead, [100, 201, 3]), (ahead, [100, 202, 3])]
    write_table(
        root / "city_SE3_egovehicle.feather",
        timestamp_ns=np.array(times_ns, np.int64),
        **motions(*poses),
    )
    write_table(
        root / "calibration/egovehicle_SE3_sensor.feather",
        sensor_name=["ring_front_center", "up_lidar", "down_lidar"],
        **motions(CAMERA, UP, DOWN),
    )
    write_table(
        root / "calibration/intrinsics.feather",
        sensor_name=["ring_front_center"],
        fx_px=[1776.0],
        fy_px=[1775.0],
        cx_px=[777.0],
        cy_px=[1013.0],
        k1=[-0.24],
        height_px=np.array([2048], np.uint16),
        width_px=np.array([1550], np.uint16),
    )
    image = root / f"sensors/cameras/ring_front_center/{TIMES_NS[0] + 50_000_000}.jpg"
    image.parent.mkdir(parents=True, exist_ok=True)
    image.write_bytes(b"")
    for nth, time_ns in enumerate(TIMES_NS):
        x, y, z = (POINTS + np.array([0, 0, nth])).astype(np.float16).T
        write_table(
            root / f"sensors/lidar/{time_ns}.feather",
            x=x,
            y=y,
            z=z,
            intensity=np.arange(6, dtype=np.uint8),
            laser_number=LASERS,
            offset_ns=np.arange(6, dtype=np.int32) * 1000,
        )
    return root
