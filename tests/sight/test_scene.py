"""Scene: reciprocity, many lines at once, and what it does with bad input."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_scans import street_scan, turned

from intervis import Frame, analyze
from intervis.errors import PointsError, PoseError, SceneError, SettingsError
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene, Sensor, Sight
from intervis.sight.occupancy_model import thresholds_for

coordinate = st.floats(-60.0, 60.0, allow_nan=False)
point = st.tuples(coordinate, coordinate, st.floats(-3.0, 8.0, allow_nan=False))


@pytest.fixture(scope="module")
def scene() -> Scene:
    scene = Scene(sensor="HDL-64E")
    for number in range(3):
        pose = turned(0.2 * number, 2.0 * number, -0.5 * number)
        scene.add(street_scan(pose, seed=number), pose)
    return scene


def same(one, other) -> bool:
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name in ("state", "probability", "blocker", "clearance", "observed")
    )


@settings(max_examples=200, deadline=None)
@given(a=point, b=point)
def test_answers_are_reciprocal_to_the_last_bit(scene, a, b):
    assert same(scene.sight(a, [b]), scene.sight(b, [a]))


def test_many_lines_are_reciprocal_to_the_last_bit(scene, rng):
    a, b = rng.normal(0, 15, (2, 5000, 3)) * [1, 1, 0.1]
    assert same(scene.sight_lines(a, b), scene.sight_lines(b, a))


def test_many_viewpoints_are_as_one_at_a_time(scene, rng):
    viewpoints, targets = rng.normal(0, 10, (4, 3)), rng.normal(0, 20, (300, 3))
    together = scene.sight(viewpoints, targets)
    assert together.state.shape == (4, 300)
    assert together.blocker.shape == (4, 300, 3)
    for row, viewpoint in enumerate(viewpoints):
        alone = scene.sight(viewpoint, targets)
        assert np.array_equal(together.state[row], alone.state)
        assert np.array_equal(together.probability[row], alone.probability)
        assert np.array_equal(together.clearance[row], alone.clearance)


def test_company_makes_no_difference(scene, rng, monkeypatch):
    """A line's answer is the same to the last bit, whichever lines and threads work beside it."""
    targets = rng.normal(0, 20, (3000, 3))
    monkeypatch.setenv("INTERVIS_THREADS", "1")
    whole = scene.sight([0.0, 0, 0], targets)
    monkeypatch.setenv("INTERVIS_THREADS", "3")
    assert same(whole, scene.sight([0.0, 0, 0], targets))
    for part in (slice(0, 1), slice(7, 84), slice(1500, 2999)):
        one = scene.sight([0.0, 0, 0], targets[part])
        assert np.array_equal(one.probability, whole.probability[part])
        assert np.array_equal(one.clearance, whole.clearance[part])
        assert np.array_equal(one.blocker, whole.blocker[part], equal_nan=True)


def test_targets_that_cannot_be_written_to_are_taken(scene, rng):
    targets = rng.normal(0, 20, (10, 3))
    targets.setflags(write=False)
    assert same(scene.sight([0.0, 0, 0], targets), scene.sight([0.0, 0, 0], targets.copy()))


def test_lines_within_a_range_are_the_dense_answer_picked(scene, rng):
    viewpoints, targets = rng.normal(0, 10, (6, 3)), rng.normal(0, 20, (200, 3))
    targets[7] = np.nan
    row, column, sparse = scene.sight_within(viewpoints, targets, 12.0)
    dense = scene.sight(viewpoints, targets, max_range_m=12.0)
    away = np.linalg.norm(targets[None] - viewpoints[:, None], axis=2)
    # np.nonzero goes row by row: the order that is promised.
    np.testing.assert_array_equal([row, column], np.nonzero(away <= 12.0))
    assert len(row) > 20
    assert np.array_equal(sparse.state, dense.state[row, column])
    assert np.isnan(dense.probability[away > 12.0]).all()
    assert (dense.state[away > 12.0] == UNKNOWN).all()


def test_a_range_ends_where_it_says(scene):
    """Targets 3, 4 and 5 m away, of which one is as far as the range."""
    viewpoint, targets = np.zeros(3), np.array([[3.0, 0, 0], [0, 4.0, 0], [3.0, 4.0, 0]])
    for limit_m, within in ((5.0, 3), (4.999, 2), (4.0, 2), (3.0, 1), (0.5, 0)):
        sight = scene.sight(viewpoint, targets, max_range_m=limit_m)
        assert np.isfinite(sight.probability).tolist() == [k < within for k in range(3)]
        row, column, near = scene.sight_within(viewpoint, targets, limit_m)
        assert column.tolist() == list(range(within))
        assert row.tolist() == [0] * within
        assert row.dtype == column.dtype == np.int64
        assert same(near, sight[:within])


@pytest.mark.parametrize("risk", [0.001, 0.0199, 0.02, 0.2])
def test_states_follow_the_thresholds_of_the_risk(scene, rng, risk):
    targets = rng.normal(0, 15, (2000, 3)) * [1, 1, 0.1]
    sight = scene.sight([1.0, 0, 0], targets, risk=risk)
    limits = thresholds_for(risk)
    p = sight.probability
    assert (p[sight.occluded] <= limits.occluded_to).all()
    assert np.isfinite(sight.blocker[sight.occluded]).all()
    assert (p[sight.visible] >= min(limits.visible_from, limits.visible_unobserved_from)).all()
    unobserved_m = (1.0 - sight.observed) * (np.linalg.norm(targets - [1, 0, 0], axis=1) - 0.8)
    assert not (sight.visible & (p < limits.visible_unobserved_from) & (unobserved_m > 3.01)).any()
    assert (sight.visible | (p < limits.visible_unobserved_from)).all()


def test_the_unobserved_length_of_a_line_is_measured_outside_its_margins(scene):
    """Straight up from the sensor: no beam is above 2 degrees."""
    found = scene.unobserved_length([0.0, 0, 4.0], [0.0, 0, 10.0])
    assert found == pytest.approx(6.0 - 2 * 0.4, abs=0.3)  # give or take a step
    assert scene.unobserved_length([0.0, 0, 0], [3.0, 0, 0]) == 0.0


def test_lines_within_a_range_come_in_ascending_order(scene, rng):
    viewpoints, targets = rng.normal(0, 10, (6, 3)), rng.normal(0, 20, (200, 3))
    row, column, _ = scene.sight_within(viewpoints, targets, 15.0)
    assert len(row) > 20
    order = list(zip(row.tolist(), column.tolist(), strict=True))
    assert order == sorted(order)


def test_masks_length_and_indexing_follow_the_states(scene, rng):
    targets = rng.normal(0, 15, (400, 3)) * [1, 1, 0.1]
    sight = scene.sight([1.0, 0, 0], targets)
    assert len(sight) == 400
    masks = np.array([sight.visible, sight.occluded, sight.unknown])
    assert (masks.sum(axis=0) == 1).all()
    assert np.array_equal(sight.state, masks.T @ [VISIBLE, OCCLUDED, UNKNOWN])
    assert same(sight[sight.occluded], scene.sight([1.0, 0, 0], targets[sight.occluded]))
    assert sight[3].probability == sight.probability[3]
    assert np.array_equal(sight[5:9].blocker, sight.blocker[5:9], equal_nan=True)
    many = scene.sight([[1.0, 0, 0], [0.0, 1, 0]], targets)
    assert len(many) == 2
    assert same(many[0], sight)
    assert many[many.visible].blocker.shape == (np.count_nonzero(many.visible), 3)


def made_sight(shape) -> Sight:
    """Answers that carry their own flat index: line k has probability k and blocker (k, k, k)."""
    number = np.arange(np.prod(shape, dtype=int), dtype=np.float64).reshape(shape)
    state = (number % 3 - 1).astype(np.int8)
    return Sight(state, number, np.stack([number] * 3, axis=-1), -number, number / 2)


index = st.integers(-2, 1)
keys = st.one_of(
    index,
    st.slices(2),
    st.just(Ellipsis),
    st.none(),
    st.lists(index, max_size=4).map(lambda chosen: np.array(chosen, dtype=np.int64)),
)


@given(
    shape=st.sampled_from([(2,), (2, 2), (2, 3)]),
    key=st.one_of(keys, st.tuples(keys), st.tuples(keys, keys), st.tuples(keys, keys, keys)),
)
def test_every_index_takes_the_same_lines_of_every_array(shape, key):
    sight = made_sight(shape)
    try:
        chosen = np.asarray(sight.probability[key])
    except IndexError:  # too many indices, or two ellipses
        with pytest.raises(IndexError):
            sight[key]
        return
    part = sight[key]
    assert np.array_equal(part.probability, chosen)
    assert np.array_equal(part.state, chosen % 3 - 1)
    assert np.array_equal(part.clearance, -chosen)
    assert np.array_equal(part.blocker, np.stack([chosen] * 3, axis=-1))


def test_a_mask_takes_the_same_lines_of_every_array():
    sight = made_sight((2, 3))
    for key in (sight.visible, (slice(None), np.array([True, False, True])), ([True, False], 2)):
        chosen = sight.probability[key]
        assert np.array_equal(sight[key].blocker, np.stack([chosen] * 3, axis=-1))


def test_a_sight_iterates_over_its_first_axis_and_has_no_truth_value():
    lines = list(made_sight((3,)))
    assert [float(one.probability) for one in lines] == [0.0, 1.0, 2.0]
    assert all(one.blocker.shape == (3,) for one in lines)
    assert [one.state.shape for one in made_sight((2, 3))] == [(3,), (3,)]
    for sight in (made_sight((3,)), lines[0], made_sight((0,))):
        with pytest.raises(TypeError, match="masks visible, occluded and unknown"):
            bool(sight)
    for act in (len, iter, list):
        with pytest.raises(TypeError, match="one line"):
            act(lines[0])


def test_scenes_and_sights_print_what_they_hold(scene):
    assert repr(scene).startswith("<Scene: 3 scans, ")
    assert repr(scene).endswith(" MB>")
    assert repr(Scene()) == "<Scene: 0 scans, 0.0 MB>"
    sight = scene.sight([0.0, 0, 0], [[3.0, 0, 0], [0.0, 0, 60.0], [np.nan, 0, 0]])
    assert repr(sight) == "<Sight: 3 lines, 1 visible, 0 occluded, 2 unknown>"
    assert repr(sight[0]) == "<Sight: 1 line, 1 visible, 0 occluded, 0 unknown>"
    assert repr(Scene.from_scan(street_scan(beams=8))).startswith("<Scene: 1 scan, ")
    both = scene.sight(np.zeros((2, 3)), [[3.0, 0, 0]])
    assert repr(both) == "<Sight: 2 x 1 lines, 2 visible, 0 occluded, 0 unknown>"


def test_blockers_lie_on_their_lines_and_only_occluded_lines_have_one(scene, rng):
    a, b = rng.normal(0, 15, (2, 4000, 3)) * [1, 1, 0.1]
    sight = scene.sight_lines(a, b)
    blocked = sight.state == OCCLUDED
    assert blocked.sum() > 100
    assert np.isfinite(sight.blocker[blocked]).all()
    assert np.isnan(sight.blocker[~blocked]).all()
    assert (sight.clearance[blocked] <= 0).all()
    assert (sight.clearance[sight.state == VISIBLE] >= 0).all()
    to_blocker = np.linalg.norm(sight.blocker - a, axis=1) + np.linalg.norm(
        sight.blocker - b, axis=1
    )
    length = np.linalg.norm(a - b, axis=1)
    assert np.allclose(to_blocker[blocked], length[blocked], atol=1e-6)


def test_input_is_never_changed(rng):
    scan = street_scan()
    targets = rng.normal(0, 20, (50, 3))
    scan_before, targets_before = scan.copy(), targets.copy()
    Scene.from_scan(scan).sight([1.0, 0, 0], targets)
    assert np.array_equal(scan, scan_before)
    assert np.array_equal(targets, targets_before)


@pytest.mark.parametrize(
    "viewpoint",
    [[np.nan, 0, 0], [np.inf, 0, 0], [0.0, 0], "here", [[np.nan, 0.0, 0.0]], [[0, 0], [0]]],
)
def test_a_bad_viewpoint_is_one_clear_error(scene, viewpoint):
    with pytest.raises(PointsError):
        scene.sight(viewpoint, np.zeros((2, 3)))


@pytest.mark.parametrize(
    "targets",
    [
        np.zeros(4),
        np.zeros((2, 2)),
        np.zeros((1, 2, 3)),
        np.zeros((0, 2, 3)),
        ["a"],
        "abc",
        [[1, 2, 3], [1]],
    ],
)
def test_targets_of_a_wrong_shape_are_one_clear_error(scene, targets):
    with pytest.raises(PointsError):
        scene.sight([0.0, 0, 0], targets)


@pytest.mark.parametrize("target", [[5, 0, 0], np.array([5.0, 0, 0], np.float32)])
def test_one_point_is_one_target(scene, target):
    one = scene.sight([0, 0, 1], target)
    assert one.state.shape == (1,)
    assert same(one, scene.sight([0, 0, 1], np.asarray(target, float)[None]))
    assert same(one, scene.sight_lines([0, 0, 1], target))
    assert scene.sight(np.ones((2, 3)), target).blocker.shape == (2, 1, 3)
    with pytest.raises(PointsError, match="1 starts and 2 ends"):
        scene.sight_lines([0, 0, 1], [target, target])
    assert len(scene.sight_within([0.0, 0, 0], target, 9.0)[2]) == 1


def test_a_frame_in_place_of_its_points_is_told(scene):
    frame = Frame(number=0, points=street_scan())
    for act in (scene.add, Scene.from_scan, analyze):
        with pytest.raises(PointsError, match=r"pass frame\.points"):
            act(frame)


def test_targets_that_are_not_finite_are_unknown(scene):
    sight = scene.sight([0.0, 0, 0], [[3.0, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0]])
    assert sight.state.tolist() == [VISIBLE, UNKNOWN, UNKNOWN]
    assert np.isnan(sight.probability[1:]).all()


@pytest.mark.parametrize("targets", [[], np.empty((0, 3)), np.empty((0, 4), np.float32)])
def test_no_targets_give_no_answers(scene, targets):
    assert scene.sight([0.0, 0, 0], targets).state.shape == (0,)
    assert scene.sight(np.zeros((2, 3)), targets).blocker.shape == (2, 0, 3)


def test_a_scene_without_scans_says_so():
    with pytest.raises(SceneError, match="holds no scan"):
        Scene().sight([0.0, 0, 0], [[1.0, 0, 0]])


def test_poses_that_are_no_rigid_motion_are_refused():
    scene = Scene()
    for pose in (np.diag([2.0, 1, 1, 1]), np.diag([-1.0, 1, 1, 1]), np.eye(3), np.full((4, 4), 0)):
        with pytest.raises(PoseError):
            scene.add(street_scan(), pose)
    assert len(scene) == 0


def test_settings_out_of_range_are_refused():
    with pytest.raises(SettingsError):
        Scene(max_scans=0)
    with pytest.raises(SettingsError, match="choose one of"):
        Scene(sensor="HDL-65E")
    with pytest.raises(SettingsError):
        Scene.from_scan(street_scan()).sight_within([[0.0, 0, 0]], [[1.0, 0, 0]], np.nan)


NO_NUMBERS = [np.nan, np.inf, -np.inf, "noon", None, [1.0, 2.0], 10**400]


@pytest.mark.parametrize("value", [-1.0, 0, *NO_NUMBERS])
def test_a_range_is_a_positive_length(scene, value):
    if value is not None:
        with pytest.raises(SettingsError, match="max_range_m"):
            scene.sight([0.0, 0, 0], [[1.0, 0, 0]], max_range_m=value)
    with pytest.raises(SettingsError, match="max_range_m"):
        scene.sight_within([[0.0, 0, 0]], [[1.0, 0, 0]], value)


@pytest.mark.parametrize("value", [-0.1, 0.0, 0.0009, 0.21, "x", *NO_NUMBERS])
def test_the_risk_is_between_its_limits(scene, value):
    with pytest.raises(SettingsError, match="risk"):
        scene.sight([0.0, 0, 0], [[1.0, 0, 0]], risk=value)
    with pytest.raises(SettingsError, match="risk"):
        scene.sight_lines([[0.0, 0, 0]], [[1.0, 0, 0]], risk=value)


@pytest.mark.parametrize("value", [value for value in NO_NUMBERS if value is not None])
def test_times_are_finite_numbers(value):
    scene = Scene()
    with pytest.raises(SettingsError, match="timestamp_s"):
        scene.add(street_scan(), None, value)
    scene.add(street_scan(), None, 0.0)
    with pytest.raises(SettingsError, match="moment_s"):
        scene.sight([0.0, 0, 0], [[1.0, 0, 0]], moment_s=value)


@pytest.mark.parametrize(
    "options",
    [{"sensor": 5}, {"sensor": Sensor}]
    + [{name: v} for name in ("max_scans", "max_bytes") for v in (1.5, "many", None, True, -1)],
)
def test_a_scene_checks_its_options_at_once(options):
    with pytest.raises(SettingsError, match=next(iter(options))):
        Scene(**options)


def test_a_moment_needs_to_know_when_each_scan_was_taken():
    scene = Scene()
    scene.add(street_scan(), None, 3.0)
    assert scene.sight([0.0, 0, 0], [[1.0, 0, 0]], moment_s=3.5).state[0] == VISIBLE
    scene.add(street_scan(seed=1))
    assert scene.timestamps_s[0] == 3.0
    assert np.isnan(scene.timestamps_s[1])
    with pytest.raises(SceneError, match="time of every scan"):
        scene.sight([0.0, 0, 0], [[1.0, 0, 0]], moment_s=3.5)
    with pytest.raises(SettingsError, match="timestamp_s"):
        scene.add(street_scan(), None, np.nan)
    timed = Scene()
    timed.add(street_scan(), None, 0.0)
    with pytest.raises(SettingsError, match="moment_s"):
        timed.sight([0.0, 0, 0], [[1.0, 0, 0]], moment_s=np.inf)


@pytest.mark.parametrize(
    "scan",
    [
        np.zeros((0, 3), np.float32),
        np.array([[10.0, 0.0, 0.0]], np.float32),
        np.full((5, 4), np.nan),
        np.zeros((100, 3)),
    ],
)
def test_hardly_any_returns_leave_everything_unknown(scan):
    sight = Scene.from_scan(scan).sight([0.0, 1.0, 0.0], [[20.0, 20, 0], [0, -30, 1], [5, 5, 9]])
    assert (sight.state == UNKNOWN).all()


def test_a_line_of_no_length_is_visible(scene):
    sight = scene.sight([3.0, 1.0, 0.0], [[3.0, 1.0, 0.0]])
    assert sight.state[0] == VISIBLE


def test_space_never_scanned_is_unknown(scene):
    targets = [[0.0, 0, 60.0], [300.0, 300, 250], [5.0, -400, 300.0]]  # no surface on the way
    assert (scene.sight([0.0, 0, 0.5], targets).state == UNKNOWN).all()
    assert (scene.sight([200.0, 200, 0], [[205.0, 200, 0], [230, 200, 1]]).state == UNKNOWN).all()


def test_targets_at_the_end_of_the_numbers_are_unknown(scene):
    targets = [[1e308, 1e308, 0.0], [-1e200, 5.0, 1.0], [1e150, -1e150, 1e150], [3e7, 1e7, 2.0]]
    assert (scene.sight([0.0, 0, 0.5], targets).state == UNKNOWN).all()


def test_a_viewpoint_inside_a_house_sees_nothing(scene):
    sight = scene.sight([8.0, 14.0, 0.0], [[8.0, 0.0, 0.0], [0.0, -6.0, 0.0], [8.0, 17.0, 0.0]])
    assert (sight.state != VISIBLE).all()


def test_more_caution_calls_fewer_lines_visible(scene, rng):
    targets = rng.normal(0, 15, (2000, 3)) * [1, 1, 0.1]
    lenient = scene.sight([1.0, 0, 0], targets, risk=0.2)
    usual = scene.sight([1.0, 0, 0], targets)
    careful = scene.sight([1.0, 0, 0], targets, risk=0.001)
    for one, other in ((lenient, usual), (usual, careful)):
        assert other.unknown.sum() >= one.unknown.sum()
        assert np.array_equal(other.state, np.where(other.unknown, UNKNOWN, one.state))
        assert np.array_equal(one.probability, other.probability, equal_nan=True)
    assert careful.unknown.sum() > lenient.unknown.sum()
