"""Line of sight through observed space.

`Scene` remembers scans and answers who sees whom with visible, occluded or unknown; what these
mean is written in `intervis.sight.occupancy_model`.
"""

from intervis.sight.explanation import Explanation, explain
from intervis.sight.scene import OCCLUDED, UNKNOWN, VISIBLE, Scene, Sight
from intervis.sight.sensor import (
    GENERIC,
    HDL_32E,
    HDL_64E,
    OS1_128,
    SENSORS,
    VLP_16,
    Sensor,
    sensor_named,
    sensor_of_scan,
)

__all__ = [
    "GENERIC",
    "HDL_32E",
    "HDL_64E",
    "OCCLUDED",
    "OS1_128",
    "SENSORS",
    "UNKNOWN",
    "VISIBLE",
    "VLP_16",
    "Explanation",
    "Scene",
    "Sensor",
    "Sight",
    "explain",
    "sensor_named",
    "sensor_of_scan",
]
