"""A synthetic scan for the tests of the paper's experiments."""

import numpy as np


def rough_ground(seed: int = 0, count: int = 4000) -> np.ndarray:
    """(count, 4) float32 returns ahead of the sensor: flat ground, one in five raised to 2 m."""
    rng = np.random.default_rng(seed)
    ground = np.column_stack([rng.uniform(4, 40, (count, 1)), rng.uniform(-15, 15, (count, 1))])
    rise = np.where(rng.random(count) < 0.2, rng.uniform(0, 2, count), 0.0)
    return np.column_stack([ground, -1.7 + rise, rng.random(count)]).astype(np.float32)
