"""MPCS and Algorithm 1 (Eq. 13) on small stars by hand, and against the pseudo code as a loop."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intervis import Settings
from intervis.method.criteria import (
    apply_criteria,
    elevation_angle_rad,
    gate_threshold,
    intervisible_region,
    mix_planes_criterion,
    reachable_tree,
    unoccluded,
)
from intervis.method.mesh import build_mesh, star_centroids
from intervis.method.surface import build_surface

ORIGIN = np.zeros(3)


def theta_1_deg(points, viewpoint, source, target):
    """theta_1 (Eq. 13): the angle at i between the directions to P0 and to j; NaN for no angle."""
    to_viewpoint, to_neighbour = viewpoint - points[source], points[target] - points[source]
    norms = np.linalg.norm(to_viewpoint, axis=1) * np.linalg.norm(to_neighbour, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = (to_viewpoint * to_neighbour).sum(axis=1) / norms
    return np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0)))


@pytest.mark.parametrize("criterion", ["elevation", "sight_angle"])
def test_the_signs_decide_as_the_angles_do(rng, criterion):
    """Lines 6 and 8 by the angle itself: more and less than 90 degrees."""
    points = np.vstack([rng.normal(size=(300, 3)) * 10, rng.integers(-2, 3, (300, 3))])
    viewpoint = np.array([1.0, 0.0, 0.5])
    source, target = rng.integers(0, 600, (2, 20_000))
    theta = theta_1_deg(points, viewpoint, source, target)
    height = elevation_angle_rad(points, viewpoint) if criterion == "sight_angle" else points[:, 2]
    rise = height[target] - height[source]
    expected = ((theta > 90.0) & (rise > 0)) | ((theta < 90.0) & (rise < 0))
    near = np.abs(theta - 90.0) < 1e-9  # by rounding alone, but for right angles
    found = mix_planes_criterion(points, viewpoint, source, target, criterion)
    assert (found == expected)[~near].all()
    assert 5_000 < expected.sum() < 15_000


def test_equation_13_on_paper():
    points = np.array([[2.0, 0, 0], [4, 0, 0], [1, 0, 0], [2, 3, 0], [3, 1, 0]])
    i, j = np.zeros(4, int), np.array([1, 2, 3, 4])
    # beyond: 180; in front: 0; square to the sight line: 90; beyond and aside: 135 degrees
    assert np.allclose(theta_1_deg(points, ORIGIN, i, j), [180, 0, 90, 135])
    assert np.isnan(theta_1_deg(np.zeros((2, 3)), ORIGIN, np.array([0]), np.array([1])))


def test_elevation_angles_on_paper():
    points = np.array([[3.0, 4, 5], [1, 0, 0], [0, 2, -2]])
    assert np.allclose(np.rad2deg(elevation_angle_rad(points, ORIGIN)), [45, 0, -45])


def test_interpretations_of_the_threshold_on_paper():
    # A path 0 - 1 - 2 with lengths 2 and 5: degrees 2, 7, 5.
    source, target = np.array([0, 1, 1, 2]), np.array([1, 2, 0, 1])
    length = np.array([2.0, 5, 2, 5])
    expected = {
        "degree": [2, 7, 5],
        "mean": [2, 3.5, 5],
        "shortest": [2, 2, 5],
        "star_minimum": [2, 2, 5],
    }
    for gate, values in expected.items():
        assert gate_threshold(source, target, length, 3, gate).tolist() == values


def intervisible_pair(neighbour, criterion):
    """Whether the second point of a pair is intervisible from the first at (10, 0, -1)."""
    points = np.array([[10.0, 0, -1], neighbour])
    result = apply_criteria(
        points,
        ORIGIN,
        np.array([[0, 1]]),
        np.array([1.0]),
        np.array([50.0, 50.0]),
        np.array([0.5, 0.5]),
        Settings(gate="none", criterion=criterion),
    )
    return bool(result.half_edge[0])


@pytest.mark.parametrize(
    ("neighbour", "by_elevation", "by_sight_angle"),
    [
        ((12.0, 0, -0.5), True, True),  # beyond and higher: visible over i
        ((12.0, 0, -1.0), False, True),  # flat ground beyond: equal z, larger elevation angle
        ((12.0, 0, -1.1), False, True),  # a little lower, still above the sight line over i
        ((12.0, 0, -1.3), False, False),  # under the sight line, which is at z = -1.2 there
        ((8.0, 0, -1.5), True, True),  # in front and lower: does not occlude i
        ((8.0, 0, -1.0), False, True),  # flat ground in front
        ((8.0, 0, -0.5), False, False),  # in front and higher: occludes i
    ],
)
def test_lines_6_and_8(neighbour, by_elevation, by_sight_angle):
    assert intervisible_pair(neighbour, "elevation") is by_elevation
    assert intervisible_pair(neighbour, "sight_angle") is by_sight_angle


def test_sight_line_criterion_on_paper():
    """Seven columns of a wall 10 m away, and a post 5 m away beside the first of them."""
    azimuth_rad = np.deg2rad(np.arange(7.0))
    wall = np.column_stack([10 * np.cos(azimuth_rad), 10 * np.sin(azimuth_rad), np.zeros(7)])
    post = 0.5 * wall[:1] - [0, 0.01, 0]
    returns = np.vstack([wall, post])
    # The post is among the six nearest in angle of columns 0 to 2; from column 3 on (three columns
    # on either side of it) there are always six columns that are nearer.
    assert unoccluded(returns, returns, ORIGIN).tolist() == [False] * 3 + [True] * 5
    assert unoccluded(wall[2:4], returns, ORIGIN).tolist() == [False, True]
    before = np.vstack([wall, wall[:1] * 0.9])  # a metre before it: the same surface at 10 m
    assert unoccluded(before, before, ORIGIN).all()


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_sight_line_criterion_equals_a_loop(seed, n):
    rng = np.random.default_rng(seed)
    returns, p0 = rng.normal(size=(n, 3)) * 10, rng.normal(size=3)
    offset = returns - p0
    range_m = np.linalg.norm(offset, axis=1)
    expected = []
    for i in range(0, n, 2):
        cosine = offset @ offset[i] / (range_m * range_m[i])
        beside = np.argsort(-cosine)[: min(7, n)]
        expected.append(not any(range_m[k] < 0.9 * range_m[i] - 0.5 for k in beside))
    assert unoccluded(returns[::2], returns, p0).tolist() == expected


def literal_algorithm_1(points, p0, edges, length, flow, l_gc, criterion):
    """The pseudo code, one node and one neighbour at a time."""
    star = {i: {} for i in range(len(points))}
    for (a, b), l1 in zip(edges.tolist(), length.tolist(), strict=True):
        star[a][b] = star[b][a] = l1

    def gate(i, j):
        d_min = sum(star[i].values())
        return star[i][j] < d_min < flow[i]

    def height(k):
        if criterion == "elevation":
            return points[k, 2]
        x, y, z = points[k] - p0
        return np.arctan2(z, np.hypot(x, y))

    found = set()
    for i, neighbours in star.items():
        if neighbours and all(l1 < l_gc[i] for l1 in neighbours.values()):
            continue
        for j, l1 in neighbours.items():
            if not gate(i, j) or not l1 > l_gc[i]:
                continue
            a, b = p0 - points[i], points[j] - points[i]
            theta = np.degrees(np.arccos(np.clip(a @ b / np.sqrt((a @ a) * (b @ b)), -1, 1)))
            if (theta > 90 and height(j) > height(i)) or (theta < 90 and height(j) < height(i)):
                found.add(i)
                if gate(j, i):
                    found.add(j)
    node = [i in found for i in range(len(points))]
    edge = [a in found and b in found and gate(a, b) and gate(b, a) for a, b in edges.tolist()]
    return node, edge


@given(st.integers(0, 2**32 - 1), st.integers(3, 60), st.sampled_from(["elevation", "sight_angle"]))
def test_equals_the_pseudo_code(seed, n, criterion):
    rng = np.random.default_rng(seed)
    points = rng.uniform([4, -15, -2], [50, 15, 2], (n, 3))
    p0 = rng.normal(size=3)
    surface = build_surface(points, p0, Settings())
    mesh = build_mesh(surface.chart)
    y = surface.metric_position
    length = np.linalg.norm(y[mesh.edges[:, 0]] - y[mesh.edges[:, 1]], axis=1)
    l_gc = np.linalg.norm(y - star_centroids(mesh, y), axis=1)
    args = (points, p0, mesh.edges, length, surface.flow_distance, l_gc)
    result = apply_criteria(*args, Settings(criterion=criterion))
    node, edge = literal_algorithm_1(*args, criterion)
    assert result.node.tolist() == node
    assert result.edge.tolist() == edge
    # The centroid is never as far as the longest edge: "every edge is shorter" cannot be.
    assert not result.handed_over.any()


def test_the_gate_compares_the_degree_with_the_flow_distance():
    """Line 1: the row sum of edge lengths must stay under the flow distance."""
    points = np.array([[10.0, 0, -1], [11, 0, -1], [10, 1, -1]])
    edges, length = np.array([[0, 1], [0, 2], [1, 2]]), np.array([1.0, 1.0, np.sqrt(2)])
    for flow, passes in ((10.0, True), (1.5, False)):
        result = apply_criteria(
            points,
            ORIGIN,
            edges,
            length,
            np.full(3, flow),
            np.full(3, 0.1),
            Settings(gate="degree"),
        )
        assert result.gate.all() == passes
        assert result.edge.any() == passes


def test_region_needs_three_points_and_two_edges():
    triangles, sides = (  # the edges are 0 - 1, 0 - 2, 1 - 2, 1 - 3, 2 - 3
        np.array([[0, 1, 2], [1, 3, 2]]),
        np.array([[0, 2, 1], [3, 4, 2]]),
    )
    every = np.ones(4, bool)

    def region(node, edge):
        return intervisible_region(triangles, sides, np.array(node), np.array(edge)).tolist()

    assert region(every, np.array([1, 1, 0, 0, 0], bool)) == [True, False]
    assert region(every, np.array([1, 0, 0, 0, 1], bool)) == [False, False]
    assert region(every, np.array([0, 0, 1, 1, 0], bool)) == [False, True]
    assert region([True, True, False, True], np.ones(5, bool)) == [False, False]
    none = np.empty((0, 3), int)
    assert intervisible_region(none, none, every, np.ones(5, bool)).shape == (0,)


def test_tree_on_paper():
    # 0 - 1 - 2 in a row and a way 0 - 3 - 2 that is longer; 4 hangs on an edge that is not
    # intervisible; 5 is no intervisibility point.
    edges = np.array([[0, 1], [0, 3], [1, 2], [2, 3], [2, 4], [4, 5]])
    position = np.array([[1.0, 0, 0], [2, 0, 0], [3, 0, 0], [2, 3, 0], [4, 0, 0], [5, 0, 0]])
    node = np.array([True, True, True, True, True, False])
    edge = np.array([True, True, True, True, False, False])
    parent = np.array([-1, 0, 1, 0, 2, 4])
    tree = reachable_tree(edges, position, np.arange(6.0) + 1, parent, node, edge)
    assert tree.tolist() == [-1, 0, 1, 0, -2, -2]


def test_tree_starts_at_the_nearest_point_where_none_is_reached_directly():
    edges, row = np.array([[0, 1], [1, 2]]), np.array([[1.0, 0, 0], [2, 0, 0], [3, 0, 0]])
    node, edge = np.array([False, True, True]), np.array([False, True])
    tree = reachable_tree(edges, row, np.array([1.0, 2, 3]), np.array([-1, 0, 1]), node, edge)
    assert tree.tolist() == [-2, -1, 1]
    nothing = np.zeros(3, bool)
    assert (
        reachable_tree(edges, row, np.ones(3), np.full(3, -1), nothing, nothing[:2]).tolist()
        == [-2] * 3
    )


def test_the_gate_and_the_centroid_are_compared_strictly():
    """Line 1 on its bounds: l1 < D_min < l3, and a neighbour farther than l_gc."""
    # A path 0 - 1 - 2 with lengths 2 and 5, gated by the mean edge of each star: 2, 3.5, 5.
    points = np.array([[10.0, 0, -1], [12, 0, -1], [17, 0, -1]])
    edges, length = np.array([[0, 1], [1, 2]]), np.array([2.0, 5.0])

    def result(flow, l_gc, gate="mean"):
        chosen = Settings(gate=gate, criterion="sight_angle", concave_boundary="every")
        return apply_criteria(points, ORIGIN, edges, length, np.array(flow), np.array(l_gc), chosen)

    # half edges 0 -> 1, 1 -> 2, 1 -> 0, 2 -> 1: only 1 -> 0 is shorter than its star's mean
    assert result([9.0] * 3, [0.1] * 3).gate.tolist() == [False, False, True, False]
    assert result([9.0, 3.5, 9.0], [0.1] * 3).gate.tolist() == [False] * 4
    assert result([9.0, 3.6, 9.0], [0.1] * 3).gate.tolist() == [False, False, True, False]
    # without a gate: flat ground, seen from above, is intervisible along the path
    every = result([9.0] * 3, [0.1] * 3, "none")
    assert every.half_edge.tolist() == [True] * 4
    on_bound = result([9.0] * 3, [2.0, 2.0, 5.0], "none")
    assert on_bound.half_edge.tolist() == [False, True, False, False], "l1 is not farther than l_gc"
    assert not on_bound.handed_over.any(), "and not nearer"


@pytest.mark.parametrize(
    ("concave_boundary", "l_gc", "expected"),
    [
        ("any", [2.1, 2.1, 0.1, 0.0], [True, True, False, False]),
        ("any", [2.0, 2.0, 5.0, 0.0], [False, False, False, False]),
        ("every", [2.1, 2.1, 5.1, 0.0], [True, False, True, False]),
        ("every", [2.1, 5.1, 4.9, 0.0], [True, True, False, False]),
        ("every", [np.nan, np.nan, np.nan, np.nan], [False] * 4),
    ],
)
def test_lines_2_to_4_hand_over_nodes_whose_edges_are_short(concave_boundary, l_gc, expected):
    """A path 0 - 1 - 2 with lengths 2 and 5, and node 3 without an edge."""
    points = np.array([[10.0, 0, -1], [12, 0, -1], [17, 0, -1], [40, 9, -1]])
    for gate in ("none", "degree", "mean", "shortest", "star_minimum"):
        result = apply_criteria(
            points,
            ORIGIN,
            np.array([[0, 1], [1, 2]]),
            np.array([2.0, 5.0]),
            np.full(4, 50.0),
            np.array(l_gc),
            Settings(gate=gate, criterion="sight_angle", concave_boundary=concave_boundary),
        )
        assert result.handed_over.tolist() == expected
        assert not result.node[3]
        if np.isnan(l_gc[0]) and gate == "none":  # no centroid: every neighbour is farther
            assert result.half_edge.all()


def test_an_edge_is_intervisible_only_where_both_of_its_directions_pass_the_gate():
    """Edges 0-1, 0-2, 1-2 of 1, 4 and 3: the stars' means are 2.5, 2 and 3.5."""
    points = np.array([[10.0, 0, 0], [11, 0, 0], [14, 0, 0]])
    result = apply_criteria(
        points,
        ORIGIN,
        np.array([[0, 1], [0, 2], [1, 2]]),
        np.array([1.0, 4.0, 3.0]),
        np.full(3, 50.0),
        np.zeros(3),
        Settings(gate="mean", criterion="sight_line"),
        returns=points[:1],
    )
    # 0 -> 1, 1 -> 0 and 2 -> 1 pass; nothing occludes a node, but for the first return
    assert result.gate.tolist() == [True, False, False, True, False, True]
    occluded = unoccluded(points, points[:1], ORIGIN)
    assert occluded.tolist() == [True, True, False]
    assert result.half_edge.tolist() == [True, False, False, True, False, False]
    plain = apply_criteria(
        points,
        ORIGIN,
        np.array([[0, 1], [0, 2], [1, 2]]),
        np.array([1.0, 4.0, 3.0]),
        np.full(3, 50.0),
        np.zeros(3),
        Settings(gate="mean", criterion="sight_line"),
        returns=points[2:],
    )
    assert plain.half_edge.tolist() == [True, False, False, True, False, True]
    assert plain.node.all()
    assert plain.edge.tolist() == [True, False, False], "1 -> 2 does not pass"


def test_a_right_angle_satisfies_neither_line():
    """theta_1 of 90 degrees exactly: (10, 0, -1) and a step (1, 0, 10) up, or (-1, 0, -10) down."""
    for step in ([1.0, 0.0, 10.0], [-1.0, 0.0, -10.0]):
        for criterion in ("elevation", "sight_angle"):
            assert not intervisible_pair(np.array([10.0, 0.0, -1.0]) + step, criterion)


def test_theta_1_along_one_sight_line_is_0_or_180_degrees_whatever_the_rounding(rng):
    direction = rng.normal(size=(2000, 1, 3))
    points = (direction * np.array([1.0, 1.3, 0.6])[:, None]).reshape(-1, 3)
    i = np.arange(0, len(points), 3)
    assert np.allclose(theta_1_deg(points, ORIGIN, i, i + 1), 180.0, atol=1e-4)
    assert np.allclose(theta_1_deg(points, ORIGIN, i, i + 2), 0.0, atol=1e-4)


def test_the_margin_of_an_occluder_on_its_bound():
    """A node 10 m away: what is nearer than 0.9 * 10 - 0.5 = 8.5 m occludes it."""
    node = np.array([[10.0, 0, 0]])
    for range_m, clear in ((8.5, True), (8.4999, False)):
        assert unoccluded(node, np.array([[range_m, 0, 0]]), ORIGIN).tolist() == [clear]


def test_directions_are_compared_whatever_the_range():
    """A node 0.8 m away is occluded at 0.2 m; a wall 10 m behind them is no nearer in direction."""
    azimuth_rad = np.deg2rad(np.arange(-4.5, 5.0))
    wall = 10.0 * np.column_stack([np.cos(azimuth_rad), np.sin(azimuth_rad), np.zeros(10)])
    returns = np.vstack([wall, [[0.2, 0, 0]]])
    assert unoccluded(np.array([[0.8, 0, 0]]), returns, ORIGIN).tolist() == [False]
    assert unoccluded(np.array([[0.8, 0, 0]]), wall, ORIGIN).tolist() == [True]
    assert unoccluded(np.zeros((1, 3)), returns, ORIGIN).tolist() == [True], "P0 itself"
    assert unoccluded(np.empty((0, 3)), returns, ORIGIN).shape == (0,)


def test_one_triangle_is_a_region():
    sides = np.array([[0, 2, 1]])
    nodes, known = np.ones(3, bool), np.ones(3, bool)
    assert intervisible_region(np.array([[0, 1, 2]]), sides, nodes, known).tolist() == [True]


def test_the_region_equals_a_loop_over_triangles(rng):
    mesh = build_mesh(rng.uniform(-10, 10, (60, 2)))
    node = rng.random(60) < 0.8
    edge = rng.random(len(mesh.edges)) < 0.6
    intervisible = {frozenset(pair) for pair in mesh.edges[edge].tolist()}
    expected = []
    for a, b, c in mesh.triangles.tolist():
        sides = sum(frozenset(pair) in intervisible for pair in ((a, b), (b, c), (c, a)))
        expected.append(bool(node[a] and node[b] and node[c] and sides >= 2))
    assert 0 < sum(expected) < len(expected)
    assert intervisible_region(mesh.triangles, mesh.sides, node, edge).tolist() == expected


def test_a_neighbour_is_farther_than_a_centroid_that_is_not_there():
    """Two nodes half a metre apart, without a triangle."""
    result = apply_criteria(
        np.array([[10.0, 0, -1], [10.5, 0, -1]]),
        ORIGIN,
        np.array([[0, 1]]),
        np.array([0.5]),
        np.full(2, 50.0),
        np.full(2, np.nan),
        Settings(gate="none", criterion="sight_angle"),
    )
    assert result.half_edge.tolist() == [True, True]
    assert not result.handed_over.any()


def test_the_tree_leads_to_lower_numbers_too():
    """Node 2 is the root; edges are given from the smaller number to the larger one."""
    edges, every = np.array([[0, 1], [1, 2]]), np.ones(3, bool)
    row = np.array([[3.0, 0, 0], [2, 0, 0], [1, 0, 0]])
    tree = reachable_tree(edges, row, np.array([3.0, 2, 1]), np.array([1, 2, -1]), every, every[:2])
    assert tree.tolist() == [1, 2, -1]
