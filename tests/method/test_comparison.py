"""Global points and interpolation points against plain loops that share none of their code."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import intervis
from intervis.errors import PointsError, SettingsError
from intervis.method.analysis import Analysis
from intervis.method.comparison import global_points, interpolation_points
from intervis.method.mesh import build_mesh

seeds = st.integers(0, 2**32 - 1)


def street(seed: int, count: int) -> np.ndarray:
    """A rough ground with walls and posts around a sensor at the origin."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-30, 30, (count, 2)), rng.normal(-1.7, 0.1, count)])
    raised = rng.random(count) < 0.3
    points[raised, 2] += rng.uniform(0, 4, raised.sum())
    return points


def obstacles_by_hand(points, viewpoint, buffer_m, target_margin_m, slack):
    """For each target: its obstacles, and whether a point is within `slack` of the decision."""
    sure, doubtful = [], []
    for i, (qx, qy, qz) in enumerate(points - viewpoint):
        reach = (qx * qx + qy * qy) ** 0.5
        count, doubt = 0, False
        for j, (px, py, pz) in enumerate(points - viewpoint):
            if i == j:
                continue
            along = (px * qx + py * qy) / reach
            beside = abs(px * qy - py * qx) / reach
            margins = (
                buffer_m - beside,
                along,
                reach - target_margin_m - along,
                pz - qz * along / reach,
            )
            doubt |= abs(min(margins)) < slack
            count += min(margins) > 0
        sure.append(count)
        doubtful.append(doubt)
    return np.array(sure), np.array(doubtful)


@given(seeds, st.integers(2, 60), st.floats(0.05, 3.0), st.floats(0.0, 2.0))
@settings(max_examples=25, deadline=None)
def test_global_points_agree_with_two_nested_loops(seed, count, buffer_m, target_margin_m):
    points = street(seed, count)
    viewpoint = np.array([0.3, 0.1, 0.2])
    result = global_points(
        points, viewpoint=viewpoint, buffer_m=buffer_m, target_margin_m=target_margin_m
    )
    sure, doubtful = obstacles_by_hand(points, viewpoint, buffer_m, target_margin_m, 1e-4)
    assert doubtful.mean() < 0.2 or count < 10
    np.testing.assert_array_equal(result.obstacles[~doubtful], sure[~doubtful])
    assert result.comparisons == count**2


def crossings_by_hand(offset, edges, target_margin_m):
    """Every sight line against every edge of the mesh, by the signs of four triangles."""

    def turn(a, b, c):
        return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])

    p0 = np.zeros(3)
    above, crossed = np.zeros(len(offset), int), np.zeros(len(offset), int)
    for i, target in enumerate(offset):
        reach = np.hypot(target[0], target[1])
        for j, k in edges:
            a, b = offset[j], offset[k]
            if i in (j, k) or turn(p0, target, a) * turn(p0, target, b) >= 0:
                continue
            if turn(a, b, p0) * turn(a, b, target) >= 0:
                continue
            s = turn(a, b, target) / (turn(a, b, target) - turn(a, b, p0))
            w = turn(p0, target, a) / (turn(p0, target, a) - turn(p0, target, b))
            if s * reach > target_margin_m:
                crossed[i] += 1
                above[i] += a[2] + w * (b[2] - a[2]) > (1 - s) * target[2]
    return above, crossed


@given(seeds, st.integers(3, 80), st.floats(0.0, 3.0), st.booleans())
@settings(max_examples=25, deadline=None)
def test_interpolation_points_agree_with_all_lines_against_all_edges(
    seed, count, target_margin_m, ahead
):
    points = street(seed, count)
    if ahead:  # as in a camera's view: the surface ends before the viewpoint does
        points[:, 0] = np.abs(points[:, 0]) + 6.0
    viewpoint = np.array([0.31, 0.17, 0.2])
    result = interpolation_points(points, viewpoint=viewpoint, target_margin_m=target_margin_m)
    offset = points - viewpoint
    edges = build_mesh(offset[:, :2]).edges
    above, crossed = crossings_by_hand(offset, edges, target_margin_m)
    np.testing.assert_array_equal(result.obstacles, above)
    assert result.comparisons == crossed.sum()


@given(seeds, st.floats(0.01, 6.2))
@settings(max_examples=20, deadline=None)
def test_a_rotation_changes_no_result(seed, angle_rad):
    points = street(seed, 200)
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    rotated = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
    for method in (global_points, interpolation_points):
        before, after = method(points).obstacles, method(rotated).obstacles
        # Single precision may move a point across the edge of a line buffer.
        assert np.mean(before != after) <= (0.02 if method is global_points else 0.0)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_one_more_point_never_clears_a_line(seed):
    points = street(seed, 150)
    fewer = global_points(points[:-1]).obstacles
    assert (global_points(points).obstacles[:-1] >= fewer).all()


def test_a_wall_on_flat_ground_occludes_what_the_intercept_theorem_says():
    # P0 1.7 m above the ground, wall of 0.5 m at 10 m: shadow to 10 * 1.7 / (1.7 - 0.5) = 14.17 m.
    x = np.arange(4.0, 30.0, 0.25)
    grid = np.array([[a, b] for a in x for b in np.arange(-2.0, 2.01, 0.25)])
    points = np.column_stack([grid, np.where(grid[:, 0] == 10, -1.2, -1.7)])
    shadow = (grid[:, 0] > 10) & (grid[:, 0] < 10 * 1.7 / 1.2)
    middle = np.abs(grid[:, 1]) <= 0.5
    visible = global_points(points, buffer_m=0.15, target_margin_m=0.2).node_intervisible
    np.testing.assert_array_equal(visible[middle], ~shadow[middle])
    visible = interpolation_points(points, target_margin_m=0.0).node_intervisible
    # The surface slopes down behind the wall for one row: the shadow is the same.
    np.testing.assert_array_equal(visible[middle], ~shadow[middle])


@pytest.mark.parametrize(("beside_m", "occluded"), [(0.09, 1), (0.11, 0), (-0.09, 1)])
def test_the_line_buffer_is_a_tenth_of_a_metre_to_each_side(beside_m, occluded):
    scan = np.array([[10.0, 0, 0], [5.0, beside_m, 1.0]])
    assert global_points(scan).obstacles[0] == occluded


@pytest.mark.parametrize(("before_m", "occluded"), [(0.45, 0), (0.55, 1)])
def test_the_last_half_metre_before_the_target_is_not_compared(before_m, occluded):
    x = 10.0 - before_m
    scan = np.array([[10.0, 0, 0], [x, -1, 1.0], [x, 1, 1.0]])
    assert interpolation_points(scan).obstacles[0] == occluded
    assert global_points(np.vstack([scan, [[x, 0, 1.0]]])).obstacles[0] == occluded


def test_the_measures_are_those_of_the_mesh_of_the_same_points():
    points = street(5, 400)
    for method in (global_points, interpolation_points):
        result = method(points)
        m = result.measures
        assert isinstance(result, Analysis)
        assert (m.n, m.n_raw, m.ARR) == (400, 400, 0.0)
        assert m.SP == m.N + m.n - 1
        both = result.node_intervisible[result.edges].all(axis=1)
        assert pytest.approx(100 * both.sum() / (3 * m.N)) == m.TPI
        assert result.lines_clear == pytest.approx(100 * result.node_intervisible.mean())
        clear_triangles = result.node_intervisible[result.triangles].all(axis=1)
        np.testing.assert_array_equal(result.region, clear_triangles)
        np.testing.assert_array_equal(result.tree_parent == -1, result.node_intervisible)
        a, b = (result.node_points[result.edges[:, end], :2] for end in (0, 1))
        np.testing.assert_allclose(result.edge_length, np.hypot(*(a - b).T), rtol=1e-9)


def test_copies_have_one_result_and_rows_without_return_are_left_out():
    points = street(8, 120)
    stacked = np.vstack([points, points[:30], [[np.nan, 0, 0], [0, np.inf, 0]]])
    untouched = stacked.copy()
    for method in (global_points, interpolation_points):
        result = method(stacked)
        np.testing.assert_array_equal(stacked, untouched)
        assert (result.measures.n, result.measures.n_dropped) == (150, 2)
        np.testing.assert_array_equal(result.obstacles[:30], result.obstacles[120:])


def test_three_returns_or_a_line_of_them_are_enough():
    line = np.column_stack([np.arange(3.0, 9), np.zeros(6), np.full(6, -1.0)])
    assert interpolation_points(line).node_intervisible.all()
    assert global_points(line[:1]).node_intervisible.all()


def test_malformed_arguments_get_a_clear_message():
    with pytest.raises(PointsError, match="no return"):
        global_points(np.full((3, 3), np.nan))
    with pytest.raises(SettingsError, match="buffer_m"):
        global_points(street(0, 5), buffer_m=0.0)
    with pytest.raises(SettingsError, match="target_margin_m"):
        interpolation_points(street(0, 5), target_margin_m=-1.0)


def test_a_walk_crosses_triangles_without_area():
    # Three returns on one line 1e-9 m off it make a triangle without area; a wall lies beyond it.
    fan = [[20.0, y, -1.7] for y in (-3.0, -1.0, 1.0, 3.0)]
    sliver = [[12.0, -1.0, -1.7], [12.0 + 1e-9, 0.1, -1.7], [12.0, 1.0, -1.7]]
    wall = [[8.0, y, 1.0] for y in (-3.0, 0.0, 3.0)]
    result = interpolation_points(np.array(fan + sliver + wall + [[4.0, 0.2, -1.7]]))
    assert (result.obstacles[:7] > 0).all()
    assert result.node_intervisible[7:].all()


@pytest.mark.realdata
@pytest.mark.parametrize("number", [0, 2])
def test_a_walk_misses_no_crossing_on_a_real_frame(shared_data, number):
    """A walk ends at P0 or at the hull, so its crossings are all there are."""
    frame = intervis.open_drive(shared_data / "kitti_object")[number]
    camera = {"camera": frame.camera, "cam_from_velo": frame.cam_from_velo}
    result = interpolation_points(frame.points, **camera, target_margin_m=0.0)
    offset = result.node_points - result.viewpoint
    target = np.random.default_rng(0).choice(len(offset), 60, replace=False)
    start, stop = offset[result.edges[:, 0]], offset[result.edges[:, 1]]
    agree = 0
    for i in target:
        q = offset[i]
        side = [q[0] * p[:, 1] - q[1] * p[:, 0] for p in (start, stop)]
        share = side[0] / np.where(side[0] == side[1], 1.0, side[0] - side[1])
        cross = start + share[:, None] * (stop - start)
        left = (cross @ np.array([q[0], q[1], 0])) / (q[0] ** 2 + q[1] ** 2)
        crossed = (side[0] * side[1] < 0) & (left > 0) & (left < 1 - 1e-9)
        above = crossed & (cross[:, 2] > left * q[2])
        agree += above.sum() == result.obstacles[i]
    assert agree >= 59  # lines through a node count its edges once here and the other way there


@pytest.mark.parametrize("method", [global_points, interpolation_points])
def test_the_result_is_a_flat_surface_around_the_viewpoint(method):
    points, viewpoint = street(3, 40), np.array([0.31, 0.17, 0.2])
    result = method(points, viewpoint=viewpoint)
    ground = (points - viewpoint)[:, :2]
    assert np.allclose(result.chart, ground)
    assert np.allclose(result.flow_distance, [np.hypot(x, y) for x, y in ground])
    assert result.edges.tolist() == build_mesh(ground).edges.tolist()
    length = [np.hypot(*(ground[a] - ground[b])) for a, b in result.edges]
    assert np.allclose(result.edge_length, length)
    assert np.allclose(result.edge_weight, length)
    clear = result.obstacles == 0
    assert result.node_intervisible.tolist() == clear.tolist()
    assert result.edge_intervisible.tolist() == [
        bool(clear[a] and clear[b]) for a, b in result.edges
    ]
    region = [
        clear[triangle].all()  # with three clear nodes all three edges are
        for triangle in result.triangles
    ]
    assert result.region.tolist() == region
    assert result.tree_parent.tolist() == np.where(clear, -1, -2).tolist()
    assert not result.handed_over.any()
    assert (result.settings.tau, result.settings.metric, result.settings.chart) == (
        1,
        "ground",
        "ground",
    )
    assert 0 < clear.sum() < len(points)
    # the cut, Eq. 12: the length of the edges between the two sides
    across = sum(d for d, (a, b) in zip(length, result.edges, strict=True) if clear[a] != clear[b])
    assert result.cut == pytest.approx(across / 2)
