"""Calibration: likelihood, gradient and fits against the engine and against known models."""

import tomllib

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from intervis.cli import exit_code
from intervis.lab.calibrate import curves, probability
from intervis.lab.calibrate.granularity import fit_times
from intervis.lab.calibrate.line_set import QueryLines, sample_table
from intervis.lab.calibrate.outcome import Outcome, compared
from intervis.lab.calibrate.plan import fingerprints
from intervis.sight import Scene
from intervis.sight import occupancy_model as model
from intervis.sight.answers import sum_lines
from intervis.sight.kernels.classify import _probability

FITTED = model.FITTED
DEPTH_M, HEIGHT_M = (np.array(FITTED[name], float) for name in ("depth_m", "height_m"))


def wall_scan(x_m, rng):
    """A wall with a gap, and the ground: returns of a dense scanner at the origin."""
    azimuth, elevation = np.meshgrid(
        np.radians(np.arange(-60, 60, 0.4)), np.radians(np.linspace(-20, 5, 40))
    )
    rays = np.stack(
        [
            np.cos(azimuth) * np.cos(elevation),
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
        ],
        axis=-1,
    ).reshape(-1, 3)
    with np.errstate(divide="ignore"):
        to_wall, to_ground = x_m / rays[:, 0], np.where(rays[:, 2] < 0, -1.7 / rays[:, 2], np.inf)
    gap = np.abs(rays[:, 1] / rays[:, 0] * x_m - 2.0) < 1.0
    range_m = np.minimum(np.where(gap, np.inf, to_wall), to_ground)
    hit = range_m < 60.0
    return rays[hit] * (range_m[hit] + rng.normal(0.0, 0.02, hit.sum()))[:, None]


@pytest.fixture(scope="module")
def queries():
    """Lines through a scene of three scans; what is visible is decided by a coin."""
    rng = np.random.default_rng(3)
    scene = Scene()
    for number in range(3):
        pose = np.eye(4)
        pose[0, 3] = 0.8 * number
        scene.add(wall_scan(12.0 - 0.8 * number, rng), pose, 0.1 * number)
    starts = rng.uniform([2, -4, -1.2], [6, 4, 1.0], (120, 3))
    ends = rng.uniform([8, -6, -1.5], [25, 6, 2.0], (120, 3))
    return QueryLines("made", scene.packed_scans(0.12), starts, ends, rng.random(120) < 0.5)


@pytest.fixture(scope="module")
def table(queries):
    return sample_table([queries], DEPTH_M, HEIGHT_M)


def shipped_theta():
    return np.concatenate(
        [
            FITTED["volumetric_log_odds"],
            FITTED["surface_log_odds"],
            FITTED["height_log_odds"],
            np.log([FITTED["attenuation_per_m"], FITTED["base_optical_depth"]]),
        ]
    )


def likelihood_of(table):
    matrix = curves.design_matrix(table, FITTED["weight_decay"], FITTED["correlation"])
    return curves._Likelihood(table, matrix, len(DEPTH_M))


def test_the_likelihood_sees_the_optical_depths_of_the_engine(queries, table):
    """Curves between knots here, tables in steps of 5 cm and 1/32 there."""
    x, _, _ = likelihood_of(table).optical_depth(shipped_theta())
    sums = sum_lines(queries.scans, queries.starts, queries.ends)
    expected = FITTED["base_optical_depth"] + sums.free + sums.surface + sums.unobserved
    assert expected.max() > 1.0, "some lines must be occluded"
    np.testing.assert_allclose(x, expected, rtol=0.05, atol=0.02)


def test_the_gradient_is_that_of_differences(table):
    likelihood = likelihood_of(table)
    theta = shipped_theta() + np.random.default_rng(0).normal(0, 0.2, len(shipped_theta()))
    by_differences = approx_fprime(theta, lambda values: likelihood(values)[0], 1e-6)
    np.testing.assert_allclose(likelihood(theta)[1], by_differences, rtol=1e-3, atol=2e-6)


def test_a_fit_finds_answers_that_were_drawn_from_a_known_model(queries, table):
    """The fitted curves explain drawn answers as well as the model that drew them."""
    x, _, _ = likelihood_of(table).optical_depth(shipped_theta())
    drawn = np.random.default_rng(1).random(len(x)) < np.exp(-x)
    known = sample_table(
        [QueryLines(queries.label, queries.scans, queries.starts, queries.ends, drawn)],
        DEPTH_M,
        HEIGHT_M,
    )
    fitted = curves.fit_curves(known, DEPTH_M, HEIGHT_M)
    assert fitted.loss <= curves.loss_of(known, FITTED) + 1e-3
    inverted = sample_table(
        [QueryLines(queries.label, queries.scans, queries.starts, queries.ends, ~drawn)],
        DEPTH_M,
        HEIGHT_M,
    )
    assert curves.loss_of(inverted, FITTED) > 2.0 * curves.loss_of(known, FITTED)


def test_weights_are_chosen_by_the_smallest_loss(table):
    fitted = curves.fit_curves(table, DEPTH_M, HEIGHT_M)
    decay, correlation, losses = curves.choose_weights(table, fitted, DEPTH_M, HEIGHT_M)
    assert losses[decay, correlation] == min(losses.values())
    assert len(losses) == len(curves.DECAYS) * len(curves.CORRELATIONS)


def made_lines(rng, count, theta, single):
    x = rng.exponential(0.7, count)
    lines = probability.JudgedLines(
        optical_depth=x,
        surface=x,
        unobserved=np.zeros(count),
        unobserved_m=np.zeros(count),
        occluded_space_m=np.zeros(count),
        length_m=np.full(count, 10.0),
        time_gap_s=rng.uniform(0.0, 3.0, count),
        single_scan=np.full(count, single),
        visible=np.zeros(count, bool),
        weight=np.ones(count),
    )
    p = probability.line_probability(lines, theta)
    return lines, rng.random(count) < p


@pytest.mark.parametrize("single", [True, False])
def test_the_line_probability_is_that_of_the_engine(rng, single):
    """For any parameters, not only the shipped ones."""
    theta = np.array([1.8, 4.0, 0.6, 0.3, 0.25, 0.15])
    lines, _ = made_lines(rng, 500, theta, single)
    parameters = model.MODEL.parameters._replace(**dict(zip(probability.NAMES, theta, strict=True)))
    expected = [
        _probability(x, gap_s, single, parameters)
        for x, gap_s in zip(lines.optical_depth, lines.time_gap_s, strict=True)
    ]
    np.testing.assert_allclose(probability.line_probability(lines, theta), expected, rtol=1e-12)


def test_sharpness_and_change_are_found_again(rng):
    theta = np.array([1.8, 4.0, 0.6, 0.3, 0.25, 0.15])
    parts = []
    for single in (True, False):
        lines, visible = made_lines(rng, 40_000, theta, single)
        parts.append(probability.JudgedLines(**{**vars(lines), "visible": visible}))
    lines = probability.joined(parts)
    found, loss = probability.fit_probability(lines)
    assert loss <= probability.probability_loss(lines, theta) + 1e-5
    assert found["sharpness"] == pytest.approx(1.8, rel=0.05)
    changed = 1.0 - np.exp(-1.0 / found["change_time_s"])
    for name, value in zip(probability.NAMES[2:], theta[2:], strict=True):
        assert found[name] * changed == pytest.approx(value * (1.0 - np.exp(-0.25)), abs=0.02)


def test_thresholds_are_the_smallest_that_are_right_often_enough():
    value = np.array([0.5, 0.6, 0.7, 0.8, 0.9])
    right = np.array([False, True, False, True, True])
    candidates = np.arange(0.5, 0.95, 0.1)
    everything = np.ones(5, bool)
    assert probability._smallest(candidates, value, right, everything, 0.99) == 0.8
    assert probability._smallest(candidates, value, right, everything, 0.6) == 0.5
    without = right | ~everything
    without[2] = True
    assert probability._smallest(candidates, value, without, everything, 0.99) == 0.6


def test_times_are_found_again_and_the_budget_covers_nine_in_ten(rng):
    n_fov, nodes = rng.uniform(5e3, 3e4, 400), rng.uniform(100, 2e4, 400)
    time_ms = (0.5 + 1e-3 * (0.2 * n_fov + 8.0 * nodes)) * rng.uniform(0.9, 1.1, 400)
    times = fit_times(n_fov, nodes, time_ms)
    assert times.return_us == pytest.approx(0.2, rel=0.1)
    assert times.node_us == pytest.approx(8.0, rel=0.03)
    predicted = times.frame_ms + 1e-3 * (times.return_us * n_fov + times.node_us * nodes)
    within = time_ms <= predicted / times.budget_share
    assert within.mean() == pytest.approx(0.9, abs=0.02)


def test_a_plan_without_granularity_is_told_in_a_sentence(tmp_path, capsys):
    plan = tmp_path / "plan.toml"
    plan.write_text("inputs = []")
    asked = ["calibrate", "--data", str(tmp_path), "--out", str(tmp_path), "--plan", str(plan)]
    assert exit_code([*asked, "--only", "granularity"]) == 2
    assert "[granularity]" in capsys.readouterr().err
    assert exit_code([*asked, "--only", "everything"]) == 2
    assert "one of model, granularity" in capsys.readouterr().err


def test_provenance_identifies_drives_by_their_content(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        np.zeros((3, 4), np.float32).tofile(tmp_path / name / "0.bin")
    text = fingerprints(["two", "one", "street:1", "one"], tmp_path)
    assert [part.split()[0] for part in text.split("; ")] == ["one", "two"]
    np.ones((3, 4), np.float32).tofile(tmp_path / "one" / "0.bin")
    assert fingerprints(["two", "one"], tmp_path) != text


def test_the_outcome_is_read_back_as_the_package_reads_its_own():
    outcome = Outcome({"a": 1.5, "curve": [1.0, -2.25]}, {"inputs": 'drive "x"', "lines": 3})
    content = tomllib.loads(outcome.to_toml("Numbers."))
    assert content["numbers"] == {"a": 1.5, "curve": [1.0, -2.25]}
    assert content["provenance"] == {"inputs": 'drive "x"', "lines": 3}


def test_an_outcome_of_odd_texts_and_numpy_numbers_is_read_back():
    text = 'two\nlines\t"\\ \x00\x1f\x7f \x85 \u2028 ä'
    numbers = {"i": np.int64(3), "x": np.float32(0.5), "curve": np.array([1.0, 2.0])}
    numbers |= {"b": np.bool_(True), "rows": np.eye(2), "none": []}
    content = tomllib.loads(Outcome(numbers, {"text": text}).to_toml("Numbers."))
    assert content["provenance"]["text"] == text
    assert content["numbers"] == {
        "i": 3, "x": 0.5, "curve": [1, 2], "b": True, "rows": [[1, 0], [0, 1]], "none": []
    }  # fmt: skip
    assert content["numbers"]["b"] is True
    assert compared({"i": 4, "x": 1.0}, numbers) == (("i", "4", "3"), ("x", "1", "0.5"))
    assert "dr\\\\udcefve" in Outcome({}, {"name": "dr\udcefve"}).to_toml("Numbers.")


EVERY_STAGE = """
[[inputs]]
drive = "street:1"
pairs = "0:6"
protocols = ['single']
stages = ["curves", "weights", "probability", "thresholds"]
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("inputs = 3", "inputs"),
        ("[[inputs]]\ndrive = 'x'\npairs = '0:1'\nprotocols = ['never']\nstages = []", "protocols"),
        ("nonsense", "no valid TOML"),
        ("inputs = []", "curves"),
        (
            "[[inputs]]\ndrive = 'x'\npairs = '0:1'\nprotocols = ['map']\n"
            "stages = ['curves', 'weights', 'probability', 'thresholds']",
            "exact world",
        ),
        ("seed = -1\ninputs = []", "seed"),
        (EVERY_STAGE.replace("['single']", "[]"), "protocols"),
        (EVERY_STAGE + "[granularity]\ndrives = []", "granularity.drives"),
        ("a = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
        (EVERY_STAGE.replace("0:6", "0:24"), "has the frames 0 to 23"),
        (EVERY_STAGE.replace("0:6", "6:6"), "got 6:6"),
        (EVERY_STAGE.replace("street:1", "street:-1"), "got 'street:-1'"),
        (EVERY_STAGE + "[granularity]\ndrives = ['nowhere']", "nowhere"),
    ],
)
def test_a_plan_that_makes_no_sense_is_told_in_a_sentence(tmp_path, capsys, text, words):
    plan = tmp_path / "plan.toml"
    plan.write_text(text)
    out = tmp_path / "out"
    asked = ["calibrate", "--data", str(tmp_path), "--out", str(out), "--plan", str(plan)]
    assert exit_code(asked) == 2
    said = capsys.readouterr().err
    assert words in said
    assert len(said.splitlines()) == 1
    assert not out.exists()


@pytest.fixture
def plan_of_a_street(tmp_path, monkeypatch):
    """Words of a calibration that must not start."""

    def started(*_, **__):
        raise AssertionError("the work has started")

    monkeypatch.setattr("intervis.lab.calibrate.fit.calibrate_model", started)
    (tmp_path / "plan.toml").write_text(EVERY_STAGE)
    return ["calibrate", "--data", str(tmp_path), "--plan", str(tmp_path / "plan.toml")]


def test_a_file_of_other_origin_is_refused_before_the_work(plan_of_a_street, tmp_path, capsys):
    mine = tmp_path / "out" / "occupancy_model.toml"
    mine.parent.mkdir()
    mine.write_text("my = 'numbers'\n")
    assert exit_code([*plan_of_a_street, "--out", str(tmp_path / "out")]) == 2
    assert f"{mine} was not written by `intervis calibrate`" in capsys.readouterr().err
    assert mine.read_text() == "my = 'numbers'\n"


def test_a_folder_that_cannot_be_made_is_refused_before_the_work(
    plan_of_a_street, tmp_path, capsys
):
    assert exit_code([*plan_of_a_street, "--out", str(tmp_path / "plan.toml" / "out")]) == 2
    assert "cannot write in" in capsys.readouterr().err


def test_the_packages_own_files_may_be_replaced(plan_of_a_street, tmp_path, monkeypatch, capsys):
    outcome = Outcome(
        {"sharpness": 1.0},
        dict.fromkeys(("loss_curves_shipped", "loss_curves", "loss_probability"), 0.1),
    )
    monkeypatch.setattr("intervis.lab.calibrate.fit.calibrate_model", lambda *_, **__: outcome)
    for _ in range(2):
        assert exit_code([*plan_of_a_street, "--out", str(tmp_path / "out")]) == 0
    written = tomllib.loads((tmp_path / "out" / "occupancy_model.toml").read_text())
    assert written["numbers"] == {"sharpness": 1}
