"""The model's tables against its definition: engine and reference implementation share them."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from intervis.sight import occupancy_model as model
from intervis.sight.kernels.classify import _state
from intervis.sight.kernels.parameters import Parameters

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


@pytest.mark.parametrize("name", ["volumetric", "surface"])
def test_depth_tables_follow_their_curves_without_bias(rng, name):
    flat = TABLES.depth_log_odds
    half = len(flat) // 2
    table = flat[:half] if name == "volumetric" else flat[half : 2 * half]
    depth_m = rng.uniform(-4.0, 20.0, 200_000)
    curve = np.interp(depth_m, model.FITTED["depth_m"], model.FITTED[f"{name}_log_odds"])
    error = looked_up(table, depth_m, -4.0, 20.0) - curve
    steepest = np.abs(np.diff(model.FITTED[f"{name}_log_odds"]) / np.diff(model.FITTED["depth_m"]))
    assert np.abs(error).max() <= steepest.max() / 40 + 1e-9
    rising = (depth_m > -0.3) & (depth_m < 0.1)
    assert abs(error[rising].mean()) < 0.01
    assert flat[-1] == 0.0, "an unobserved direction contributes nothing"


def test_the_height_table_follows_its_curve(rng):
    height_m = rng.uniform(-0.45, 6.0, 100_000)
    curve = np.interp(height_m, model.FITTED["height_m"], model.FITTED["height_log_odds"])
    error = looked_up(TABLES.height_log_odds, height_m, -0.5, 20.0) - curve
    assert np.abs(error).max() < 0.1
    assert abs(error.mean()) < 2e-3
    # the first entry: of NaN, the height above unknown ground
    assert TABLES.height_log_odds[0] == model.FITTED["unknown_height_log_odds"]


def test_scan_weights_decay_and_sum_to_a_power():
    for count in range(1, 7):
        weights = TABLES.scan_weights[count - 1]
        assert (weights[count:] == 0).all()
        assert weights[1:count] == pytest.approx(0.6 * weights[: count - 1])
        assert weights.sum() == pytest.approx(sum(0.6**k for k in range(count)) ** 0.7)


def test_every_fitted_number_reaches_the_engine():
    """A changed number of the file changes the model that kernels receive."""
    scalars = [name for name in model.FITTED if name in Parameters._fields]
    assert len(scalars) == 10
    for name in scalars:
        changed = model.model_of({**model.FITTED, name: 0.123})
        assert getattr(changed.parameters, name) == 0.123
    for name in ("surface_log_odds", "volumetric_log_odds", "height_log_odds"):
        moved = [value + 1.0 for value in model.FITTED[name]]
        changed = model.model_of({**model.FITTED, name: moved})
        assert not all(
            np.array_equal(one, other)
            for one, other in zip(changed.tables, model.MODEL.tables, strict=True)
        )


def test_the_file_says_where_its_numbers_come_from():
    path = Path(model.__file__).with_name(model.FITTED_FILE)
    provenance = tomllib.loads(path.read_text())["provenance"]
    assert {"command", "curves", "probability", "weights", "thresholds"} <= set(provenance)


def test_states_follow_their_definition_near_every_threshold(rng):
    """Random lines around each limit, and exactly on it, against the text of the definition."""
    p = PARAMETERS
    limits = {
        "probability": p.visible_min_probability,
        "surface": p.visible_max_surface,
        "unobserved": p.visible_max_unobserved,
        "occluded_space_m": p.visible_max_occluded_space_m,
    }
    seen = set()
    for _ in range(4000):
        v = {
            name: limit * rng.choice([0.9, 1.0, 1.1], p=[0.5, 0.2, 0.3])
            for name, limit in limits.items()
        }
        v["probability"] = p.visible_min_probability * rng.choice([0.99, 1.0, 1.01])
        if rng.random() < 0.2:
            v["surface"] = p.occluded_min_surface * rng.choice([0.99, 1.0, 1.01])
        length_m = rng.uniform(0.5, 12.0)
        allowed_m = min(3.0, 0.5 * max(length_m - 2 * 0.4, 0.0))
        unobserved_m = allowed_m * rng.choice([0.95, 1.0, 1.05])
        visible = (
            v["probability"] >= 0.85
            and v["surface"] < 0.3
            and v["unobserved"] < 0.25
            and unobserved_m <= allowed_m
            and v["occluded_space_m"] <= 1.0
        )
        expected = 0 if v["surface"] > 0.95 else 1 if visible else -1
        found = _state(
            v["probability"],
            v["surface"],
            v["unobserved"],
            unobserved_m,
            v["occluded_space_m"],
            length_m,
            p.visible_min_probability,
            p,
        )
        assert found == expected
        possible = model.may_be_visible(
            v["surface"], v["unobserved"], unobserved_m, v["occluded_space_m"], length_m
        )
        assert (possible and v["probability"] >= 0.85) == visible
        seen.add(expected)
    assert seen == {-1, 0, 1}
