"""The model's tables against its definition: engine and reference implementation share them."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from intervis.sight import occupancy_model as model
from intervis.sight.kernels.classify import _mostly_observed, _state
from intervis.sight.kernels.parameters import Parameters, Thresholds

TABLES, PARAMETERS = model.MODEL.tables, model.MODEL.parameters


def looked_up(table, value, start, per_unit):
    entry = np.floor((value - start) * per_unit).astype(int)
    return table[np.clip(entry, 0, len(table) - 1)]


def test_occupancies_are_the_logistic_function_without_bias(rng):
    log_odds = rng.uniform(-11.0, 11.0, 200_000)
    error = looked_up(TABLES.occupancies, log_odds, -12.0, 32.0) - 1.0 / (1.0 + np.exp(-log_odds))
    assert np.abs(error).max() <= 0.25 / 64 + 1e-9, "half an entry at the steepest slope"
    assert abs(error.mean()) < 1e-4
    # An offset of the entries would show as a bias where the function rises.
    steep = np.abs(log_odds) < 2.0
    assert abs(error[steep].mean()) < 2e-4


@pytest.mark.parametrize("name", ["volumetric", "surface", "dropout"])
def test_depth_tables_follow_their_curves_without_bias(rng, name):
    flat = TABLES.depth_log_odds
    third = len(flat) // 3
    begin = ["volumetric", "surface", "dropout"].index(name) * third
    table = flat[begin : begin + third]
    depth_m = rng.uniform(-4.0, 20.0, 200_000)
    curve = np.interp(depth_m, model.FITTED["depth_m"], model.FITTED[f"{name}_log_odds"])
    error = looked_up(table, depth_m, -4.0, 20.0) - curve
    steepest = np.abs(np.diff(model.FITTED[f"{name}_log_odds"]) / np.diff(model.FITTED["depth_m"]))
    assert np.abs(error).max() <= steepest.max() / 40 + 1e-9
    rising = (depth_m > -0.3) & (depth_m < 0.1)
    assert abs(error[rising].mean()) < 0.01
    assert flat[-1] == 0.0, "an unobserved direction contributes nothing"


@pytest.mark.parametrize("name", ["height", "assumed_height"])
def test_the_height_tables_follow_their_curves(rng, name):
    """Over known ground, and after it over assumed ground; both begin 8 m below it."""
    known = int(PARAMETERS.known_height_entries)
    parts = {
        "height": TABLES.height_log_odds[:known],
        "assumed_height": TABLES.height_log_odds[known:],
    }
    knots, values = model.FITTED[f"{name}_m"], model.FITTED[f"{name}_log_odds"]
    height_m = rng.uniform(-7.9, knots[-1], 100_000)
    error = looked_up(parts[name], height_m, -8.0, 20.0) - np.interp(height_m, knots, values)
    steepest = np.abs(np.diff(values) / np.diff(knots))
    assert np.abs(error).max() <= steepest.max() / 40 + 1e-9
    assert abs(error.mean()) < 2e-3
    # the first entry: of NaN, the height where no ground is known at all
    assert TABLES.height_log_odds[0] == model.FITTED["unknown_height_log_odds"]


def test_scan_weights_decay_and_sum_to_a_power():
    decay, correlation = model.FITTED["weight_decay"], model.FITTED["correlation"]
    for count in range(1, 7):
        weights = TABLES.scan_weights[count - 1]
        assert (weights[count:] == 0).all()
        assert weights[1:count] == pytest.approx(decay * weights[: count - 1])
        independent = sum(decay**k for k in range(count))
        assert weights.sum() == pytest.approx(independent ** (1.0 - correlation))


def test_every_fitted_number_reaches_the_engine():
    """A changed number of the file changes the model that kernels receive."""
    scalars = [name for name in model.FITTED if name in Parameters._fields]
    assert len(scalars) == 10  # attenuation, base, sharpness, 5 of change, 2 of occluded ends
    for name in scalars:
        changed = model.model_of({**model.FITTED, name: 0.123})
        assert getattr(changed.parameters, name) == 0.123
    for name in (
        "surface_log_odds",
        "volumetric_log_odds",
        "height_log_odds",
        "assumed_height_log_odds",
    ):
        moved = [value + 1.0 for value in model.FITTED[name]]
        changed = model.model_of({**model.FITTED, name: moved})
        assert not all(
            np.array_equal(one, other)
            for one, other in zip(changed.tables, model.MODEL.tables, strict=True)
        )


def test_the_file_says_where_its_numbers_come_from():
    path = Path(model.__file__).with_name(model.FITTED_FILE)
    provenance = tomllib.loads(path.read_text())["provenance"]
    assert {"command", "curves", "thresholds", "drives"} <= set(provenance)


def test_states_follow_their_definition_near_every_threshold(rng):
    """Random lines around each limit, and exactly on it, against the text of the definition."""
    limits = Thresholds(0.9, 0.96, 0.03)
    seen = set()
    for _ in range(4000):
        length_m = rng.uniform(0.5, 12.0)
        allowed_m = min(3.0, 0.5 * max(length_m - 2 * 0.4, 0.0))
        unobserved_m = allowed_m * rng.choice([0.95, 1.0, 1.05])
        occluded_m = rng.choice([0.9, 1.0, 1.1])
        p = rng.choice([0.03, 0.9, 0.96]) * rng.choice([0.99, 1.0, 1.01])
        mostly = unobserved_m <= allowed_m and occluded_m <= 1.0
        surface, expected = bool(rng.random() < 0.8), -1
        if p <= 0.03 and surface:
            expected = 0
        elif p >= 0.96 or (mostly and p >= 0.9):
            expected = 1
        found = _mostly_observed(unobserved_m, occluded_m, length_m, PARAMETERS)
        assert found == mostly
        assert bool(model.mostly_observed(unobserved_m, occluded_m, length_m)) == mostly
        assert _state(p, found, surface, limits) == expected
        seen.add((expected, mostly))
    assert seen == {(state, mostly) for state in (-1, 0, 1) for mostly in (True, False)}


def test_thresholds_are_those_of_the_next_lower_risk():
    fitted = {"risks": [0.001, 0.01, 0.1]}
    fitted |= {"visible_from": [0.99, 0.9, 0.8], "visible_unobserved_from": [2.0, 0.95, 0.9]}
    fitted |= {"occluded_to": [-1.0, 0.05, 0.1]}
    for risk, row in ((0.001, 0), (0.00999, 0), (0.01, 1), (0.05, 1), (0.1, 2), (0.2, 2)):
        expected = Thresholds(*(fitted[name][row] for name in Thresholds._fields))
        assert model.thresholds_for(risk, fitted) == expected


def test_numbers_chosen_by_hand_are_those_that_the_model_was_fitted_with():
    """Whoever changes one of them has to fit the others again."""
    chosen = {
        **{"step_m": 0.3, "end_margin_m": 0.4, "below_ground_m": 0.5},
        **{"surface_from_m": -0.2, "surface_to_m": 1.3, "end_surface_m": 0.2},
        **{"grazing_samples": 4, "free_depth_m": -0.7, "max_changed": 0.45},
        **{"dynamic_max_depth_m": 3, "dynamic_min_height_m": 0.2, "dynamic_max_height_m": 3},
        **{"motion_step_m": 1, "motion_reach_m": 6, "occluded_min_surface": 0.1},
        **{"observed_max_unobserved_m": 3, "observed_max_unobserved_fraction": 0.5},
        **{"observed_max_occluded_space_m": 1},
    }
    assert {name: getattr(PARAMETERS, name) for name in chosen} == chosen
    assert (model.SCANS, model.AGE_COST_M_PER_S) == (6, 20.0)
    assert (model.DEFAULT_RISK, model.RISK_RANGE) == (0.05, (0.001, 0.2))


def test_a_dynamic_sample_is_occupied_from_82_percent_on_and_free_up_to_5_percent():
    log_odds = [PARAMETERS.dynamic_occupied_log_odds, PARAMETERS.dynamic_free_log_odds]
    assert 1.0 / (1.0 + np.exp(-np.array(log_odds))) == pytest.approx([0.82, 0.05], abs=0.005)
