"""The sensors of the simulated vehicle: their extrinsics, the cameras, the calibration files."""

from dataclasses import dataclass, field
from datetime import datetime

import numpy as np
from scipy.spatial.transform import Rotation

from intervis.arrays import Float64Array
from intervis.camera import Camera
from intervis.transform import inverse, rigid

WIDTH_PX, HEIGHT_PX = 1242, 375
FOCAL_PX, CX_PX, CY_PX = 721.5377, 609.5593, 172.854
BASELINES_M = {"00": 0.0, "01": 0.54, "02": -0.06, "03": 0.48}
"""Distance of each camera to the right of camera 0."""


def _rotation(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Float64Array:
    """(3, 3) about x, then about the fixed y, then about the fixed z."""
    return np.asarray(Rotation.from_euler("xyz", [roll_rad, pitch_rad, yaw_rad]).as_matrix())


def _printed(matrix: Float64Array) -> Float64Array:
    """Rounded to the digits of the files, so that readers and renderer use the same numbers."""
    return np.array([float(f"{number:.12e}") for number in matrix.ravel()]).reshape(matrix.shape)


def _numbers(matrix: Float64Array) -> str:
    return " ".join(f"{number:.12e}" for number in np.ravel(matrix))


@dataclass(frozen=True, eq=False)
class SensorRig:
    """Extrinsics and cameras of the simulated vehicle.

    Attributes
    ----------
    cam0_from_velo, velo_from_imu : (4, 4) float64 arrays
        Rigid motions; camera 0 before rectification.
    rectification : (3, 3) float64 array
        KITTI's R_rect_00.
    """

    cam0_from_velo: Float64Array = field(
        default_factory=lambda: _printed(
            rigid(
                _rotation(0.004, -0.007, 0.003) @ [[0, -1, 0], [0, 0, -1], [1, 0, 0]],
                [-0.004, -0.075, -0.272],
            )
        )
    )
    rectification: Float64Array = field(
        default_factory=lambda: _printed(_rotation(-0.003, 0.006, 0.002))
    )
    velo_from_imu: Float64Array = field(
        default_factory=lambda: _printed(
            rigid(_rotation(0.012, 0.002, -0.001), [-0.81, 0.32, -0.8])
        )
    )

    def seen_from(self, velo_from_scanner: Float64Array) -> "SensorRig":
        """The same cameras for a scanner elsewhere on the vehicle: (4, 4)."""
        return SensorRig(
            _printed(self.cam0_from_velo @ velo_from_scanner),
            self.rectification,
            _printed(inverse(velo_from_scanner) @ self.velo_from_imu),
        )

    @property
    def cam_from_velo(self) -> Float64Array:
        """(4, 4) the rectified camera frame from the LiDAR frame."""
        return rigid(self.rectification, [0.0, 0.0, 0.0]) @ self.cam0_from_velo

    def camera(self, number: str = "02") -> Camera:
        """One of the cameras ``00`` to ``03``."""
        projection = np.array(
            [
                [FOCAL_PX, 0.0, CX_PX, -FOCAL_PX * BASELINES_M[number]],
                [0.0, FOCAL_PX, CY_PX, 0.0],
                [0.0, 0.0, 1.0, 0.0],
            ]
        )
        return Camera(_printed(projection), WIDTH_PX, HEIGHT_PX, f"image_{number}")

    def calibration_files(self, time: datetime) -> dict[str, str]:
        """Names and texts of the three calibration files of KITTI's raw layout."""
        when = f"calib_time: {time:%d-%b-%Y %H:%M:%S}\n"
        cameras = ""
        for number in BASELINES_M:
            camera = self.camera(number)
            cameras += (
                f"S_rect_{number}: {_numbers(np.array([WIDTH_PX, HEIGHT_PX], float))}\n"
                f"R_rect_{number}: {_numbers(self.rectification)}\n"
                f"P_rect_{number}: {_numbers(camera.projection)}\n"
            )
        return {
            "calib_cam_to_cam.txt": f"{when}corner_dist: 9.950000e-02\n{cameras}",
            "calib_velo_to_cam.txt": when
            + _motion(self.cam0_from_velo)
            + "delta_f: 0.000000e+00 0.000000e+00\ndelta_c: 0.000000e+00 0.000000e+00\n",
            "calib_imu_to_velo.txt": when + _motion(self.velo_from_imu),
        }


def _motion(pose: Float64Array) -> str:
    return f"R: {_numbers(pose[:3, :3])}\nT: {_numbers(pose[:3, 3])}\n"
