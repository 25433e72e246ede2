"""The occupancy model as kernels read it: scalars and tables, passed at run time.

`intervis.sight.occupancy_model` defines the quantities and holds their values.
"""

from typing import NamedTuple

from intervis.arrays import Float64Array


class Parameters(NamedTuple):
    """Scalar parameters of the occupancy model."""

    step_m: float
    end_margin_m: float
    attenuation_per_m: float
    base_optical_depth: float
    end_occluded_depth: float
    end_occluded_power: float
    below_ground_m: float
    surface_from_m: float
    surface_to_m: float
    end_surface_m: float
    grazing_samples: float
    free_depth_m: float
    dynamic_max_depth_m: float
    dynamic_min_height_m: float
    dynamic_max_height_m: float
    motion_step_m: float
    motion_reach_m: float
    dynamic_occupied_log_odds: float
    dynamic_free_log_odds: float
    change_time_s: float
    disappeared: float
    appeared: float
    disappeared_unbracketed: float
    appeared_unbracketed: float
    max_changed: float
    sharpness: float
    observed_max_unobserved_m: float
    observed_max_unobserved_fraction: float
    observed_max_occluded_space_m: float
    occluded_min_surface: float
    depth_from_m: float
    height_from_m: float
    assumed_from_m: float
    known_height_entries: float
    entries_per_m: float
    log_odds_from: float
    entries_per_log_odds: float


class Thresholds(NamedTuple):
    """Probabilities that decide on the state of a line, for one stated risk.

    Visible from `visible_from` on (mostly observed lines) or `visible_unobserved_from` on (others);
    occluded up to `occluded_to`. A value that no probability reaches: never.
    """

    visible_from: float
    visible_unobserved_from: float
    occluded_to: float


class Tables(NamedTuple):
    """Curves of the occupancy model, sampled.

    `depth_log_odds` (3 D + 1,): volumetric returns, surface returns, then dropouts, each from
    `depth_from_m` in steps of 1 / `entries_per_m`, then 0 for an unobserved direction.
    `height_log_odds` (H + G,): over known ground `known_height_entries` from `height_from_m` in the
    same steps, the first one for no ground at all; then over assumed ground from `assumed_from_m`.
    `occupancies` (P,): probability of log-odds from `log_odds_from` in steps of 1 /
    `entries_per_log_odds`. `scan_weights` (K, K): row n holds the weights of n + 1 scans.
    """

    depth_log_odds: Float64Array
    height_log_odds: Float64Array
    occupancies: Float64Array
    scan_weights: Float64Array


class OccupancyModel(NamedTuple):
    """All numbers of `intervis.sight.occupancy_model`."""

    parameters: Parameters
    tables: Tables
