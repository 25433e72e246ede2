"""Line of sight through observed space.

`Scene` holds posed scans and answers sight lines with visible, occluded or unknown.
`intervis.sight.occupancy_model` defines the three answers. `visible_mask` is a depth buffer: fast,
rough, and without "unknown".
"""

from intervis.sight.answers import OCCLUDED, UNKNOWN, VISIBLE
from intervis.sight.depth_buffer import visible_mask
from intervis.sight.explanation import Explanation, explain
from intervis.sight.scene import Scene
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
from intervis.sight.sight import Sight

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
    "visible_mask",
]
