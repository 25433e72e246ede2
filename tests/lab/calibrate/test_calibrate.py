"""Calibration: likelihood, gradient and fits against the engine and against known models."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from intervis.cli import exit_code
from intervis.errors import SettingsError
from intervis.lab.calibrate import curves, left_out, probability, risk
from intervis.lab.calibrate.granularity import fit_times
from intervis.lab.calibrate.line_set import LineDepths, QueryLines, lines_of, sample_table
from intervis.lab.calibrate.outcome import Outcome, compared
from intervis.lab.calibrate.plan import Plan, fingerprints
from intervis.sight import Scene
from intervis.sight import occupancy_model as model
from intervis.sight.answers import answer_lines, sum_lines
from intervis.sight.kernels.classify import _probability

FITTED = model.FITTED
KNOTS = [np.array(FITTED[name], float) for name in curves.KNOTS]


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
    return sample_table([queries], *KNOTS)


def shipped_theta():
    return np.concatenate(
        [
            *(FITTED[name] for name in curves.CURVES),
            np.log([FITTED["attenuation_per_m"], FITTED["base_optical_depth"]]),
        ]
    )


def likelihood_of(table):
    matrix = curves.design_matrix(table, FITTED["weight_decay"], FITTED["correlation"])
    sizes = [len(KNOTS[0])] * 2 + [*map(len, KNOTS)]
    return curves._Likelihood(table, matrix, sizes, model.MODEL.parameters)


def test_the_likelihood_sees_the_optical_depths_of_the_engine(queries, table):
    """Curves between knots here, tables in steps of 5 cm and 1/32 there."""
    x, movable, _, _ = likelihood_of(table).optical_depth(shipped_theta())
    sums = sum_lines(queries.scans, queries.starts, queries.ends)
    expected = FITTED["base_optical_depth"] + sums.free + sums.surface + sums.unobserved
    expected += FITTED["end_occluded_depth"] * sums.end_occluded_m ** FITTED["end_occluded_power"]
    assert expected.max() > 1.0, "some lines must be occluded"
    np.testing.assert_allclose(x, expected, rtol=0.05, atol=0.02)
    assert sums.movable.max() > 1.0
    np.testing.assert_allclose(movable, sums.movable, rtol=0.05, atol=0.02)
    lines = curves.line_depths(table, FITTED)
    p = probability.line_probability(lines, model.MODEL.parameters)
    answers = answer_lines(queries.scans, queries.starts, queries.ends, paired=True)
    # Optical depths near 1 that differ by 5 % change P by 0.03.
    np.testing.assert_allclose(p, answers.probability, atol=0.04)


def test_the_gradient_is_that_of_differences(table):
    likelihood = likelihood_of(table)
    theta = shipped_theta() + np.random.default_rng(0).normal(0, 0.2, len(shipped_theta()))
    by_differences = approx_fprime(theta, lambda values: likelihood(values)[0], 1e-6)
    np.testing.assert_allclose(likelihood(theta)[1], by_differences, rtol=1e-3, atol=2e-6)


def test_a_fit_finds_answers_that_were_drawn_from_a_known_model(queries, table):
    """The fitted curves explain drawn answers as well as the model that drew them."""
    p = probability.line_probability(curves.line_depths(table, FITTED), model.MODEL.parameters)
    drawn = np.random.default_rng(1).random(len(p)) < p
    known, inverted = (
        sample_table([replace(queries, visible=visible)], *KNOTS) for visible in (drawn, ~drawn)
    )
    fitted = curves.fit_curves(known, FITTED)
    assert fitted.loss <= curves.loss_of(known, FITTED) + 1e-3
    assert curves.loss_of(inverted, FITTED) > 2.0 * curves.loss_of(known, FITTED)


def test_weights_are_chosen_by_the_smallest_loss(table):
    fitted = curves.fit_curves(table, FITTED)
    decay, correlation, losses = curves.choose_weights(table, fitted, FITTED)
    assert losses[decay, correlation] == min(losses.values())
    assert len(losses) == len(curves.DECAYS) * len(curves.CORRELATIONS)


def test_some_lines_of_a_table_are_a_table_of_these_lines(queries):
    rows = np.random.default_rng(5).random(len(queries.starts)) < 0.4
    part = replace(
        queries,
        starts=queries.starts[rows],
        ends=queries.ends[rows],
        visible=queries.visible[rows],
    )
    chosen, expected = lines_of(sample_table([queries], *KNOTS), rows), sample_table([part], *KNOTS)
    assert curves.loss_of(chosen, FITTED) == pytest.approx(curves.loss_of(expected, FITTED))
    for name in ("line", "scans", "movable", "time_gap_s"):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(expected, name))


def test_numbers_are_worse_on_a_source_that_they_never_saw(queries, monkeypatch):
    """Two sources with opposite answers: what is fitted without one is wrong on it."""
    p = probability.line_probability(
        curves.line_depths(sample_table([queries], *KNOTS), FITTED), model.MODEL.parameters
    )
    sets = [
        replace(queries, visible=p > 0.5, sources=("a",), family="a"),
        replace(queries, visible=p <= 0.5, sources=("b",), family="b"),
    ]
    monkeypatch.setattr(left_out, "curve_lines", lambda *_: iter(sets))
    monkeypatch.setattr(left_out, "check_inputs", lambda *_: None)
    found = list(left_out.leave_each_out(Plan(), None, ["a", "b"]))
    assert [(one.name, one.lines) for one in found] == [("a", 120), ("b", 120)]
    for one in found:
        assert one.fitted_without > one.fitted_with + 0.2


def test_what_cannot_be_left_out_is_told_in_a_sentence():
    with pytest.raises(SettingsError, match="no 'vlp' to leave out: it has hdl-64e"):
        left_out.checked_sources(Plan(matrix={"curves": [1]}), ["vlp"])
    with pytest.raises(SettingsError, match="nothing is left to fit"):
        left_out.checked_sources(Plan(), [])


NUMBERS = dict(zip(probability.NAMES, (1.8, 4.0, 0.6, 0.3, 0.25, 0.15, 0.2, 0.5), strict=True))


def made_lines(rng, count, bracketed, visible=None):
    x = rng.exponential(0.7, count)
    return LineDepths(
        optical_depth=x,
        movable=x * rng.uniform(0.0, 1.0, count),
        end_occluded_m=rng.uniform(0.0, 20.0, count) * (rng.random(count) < 0.3),
        time_gap_s=rng.uniform(0.0, 3.0, count),
        bracketed=np.full(count, bracketed),
        visible=np.zeros(count, bool),
        weight=np.ones(count),
    )


@pytest.mark.parametrize("bracketed", [True, False])
def test_the_line_probability_is_that_of_the_engine(rng, bracketed):
    """For any parameters, not only the shipped ones."""
    lines = made_lines(rng, 500, bracketed)
    parameters = model.MODEL.parameters._replace(**NUMBERS)
    at_end = 0.2 * lines.end_occluded_m**0.5
    expected = [
        _probability(x, movable, gap_s, bracketed, parameters)
        for x, movable, gap_s in zip(
            lines.optical_depth + at_end, lines.movable, lines.time_gap_s, strict=True
        )
    ]
    np.testing.assert_allclose(probability.line_probability(lines, parameters), expected, rtol=1e-9)


def test_sharpness_change_and_ends_are_found_again(rng):
    parameters = model.MODEL.parameters._replace(**NUMBERS)
    parts = [made_lines(rng, 40_000, bracketed) for bracketed in (True, False)]
    names = vars(parts[0])
    lines = LineDepths(**{n: np.concatenate([getattr(part, n) for part in parts]) for n in names})
    p = probability.line_probability(lines, parameters)
    lines = replace(lines, visible=rng.random(len(p)) < p)
    found, loss = probability.fit_probability(lines)
    assert loss <= probability.probability_loss(lines, parameters) + 1e-5
    assert found["sharpness"] == pytest.approx(1.8, rel=0.05)
    assert found["end_occluded_power"] == pytest.approx(0.5, abs=0.1)
    changed = 1.0 - np.exp(-1.0 / found["change_time_s"])
    for name in probability.NAMES[2:6]:
        expected = NUMBERS[name] * (1.0 - np.exp(-0.25))
        assert found[name] * changed == pytest.approx(expected, abs=0.03)


def test_thresholds_of_risk_follow_their_bound_by_hand():
    """Three scans of four lines; the bound is (sum of wrong fractions + 1) / 4."""
    sureness = np.array([0.6, 0.7, 0.8, 0.9])
    units = [risk.Unit(sureness, np.array([False, True, True, True]))] * 3
    # From 0.6 on: wrong 3/4, bound 7/16, all called. From 0.7 on: bound 1/4, 3/4 called.
    (low, middle, high) = risk.thresholds(units, (0.3, 0.34, 0.44))
    assert low == risk.NEVER
    assert 0.6 < middle <= 0.7
    assert high <= 0.6
    none = risk.Unit(np.empty(0), np.empty(0, bool))
    assert risk.thresholds([none] * 3, (0.2,)) == [risk.NEVER]


def test_thresholds_keep_their_risk_on_new_scans(rng):
    """Scans of one kind: of new ones, the words are wrong no more often than stated."""

    def scans(count):
        units = []
        for hard in rng.uniform(0.0, 0.3, count):
            sureness = rng.uniform(0.5, 1.0, 100)
            right = rng.random(100) < np.minimum(sureness + 0.3 - hard, 1.0)
            units.append(risk.Unit(sureness, right))
        return units

    (limit,) = risk.thresholds(scans(400), (0.05,))
    called = [unit.right[unit.sureness >= limit] for unit in scans(2000)]
    wrong = 1.0 - np.concatenate(called).mean()
    assert 0.02 < wrong <= 0.05


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
stages = ["curves", "thresholds"]
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("inputs = 3", "inputs"),
        ("[[inputs]]\ndrive = 'x'\npairs = '0:1'\nprotocols = ['never']\nstages = []", "protocols"),
        ("nonsense", "no valid TOML"),
        ("inputs = []", "curves"),
        ("[matrix]\ncurves = [1]", "thresholds"),
        ("[matrix]\nlines = 3", "matrix.lines"),
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
        dict.fromkeys(("loss_shipped", "loss_curves", "loss_probability"), 0.1),
    )
    monkeypatch.setattr("intervis.lab.calibrate.fit.calibrate_model", lambda *_, **__: outcome)
    for _ in range(2):
        assert exit_code([*plan_of_a_street, "--out", str(tmp_path / "out")]) == 0
    written = tomllib.loads((tmp_path / "out" / "occupancy_model.toml").read_text())
    assert written["numbers"] == {"sharpness": 1}
