"""Eq. 3 to 8 against scipy's distances, values on paper, and networkx-free brute force."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import csgraph_from_dense, dijkstra
from scipy.spatial import distance as scipy_distance

from intervis import Settings
from intervis.method.neighbours import nearest_neighbours
from intervis.method.surface import (
    build_surface,
    chart_coordinates,
    cohesion_force,
    direct_reach,
    flow_paths,
    repulsion_force,
    whitening,
)

ORIGIN = np.zeros(3)
METRICS = ["mahalanobis", "normalized", "euclidean", "ground"]
CHARTS = ["ground", "angles", "polar"]


def cloud(seed, n=60):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)) @ rng.normal(size=(3, 3)) + rng.normal(size=3) * 5


@given(st.integers(0, 2**32 - 1))
def test_equation_4_is_the_mahalanobis_distance(seed):
    points = cloud(seed)
    weight, used = whitening(points, "mahalanobis")
    assert used == "mahalanobis"
    inverse_covariance = np.linalg.inv(np.cov(points.T))
    for a, b in [(0, 1), (5, 40), (59, 3)]:
        expected = scipy_distance.mahalanobis(points[a], points[b], inverse_covariance)
        assert np.linalg.norm((points[a] - points[b]) @ weight) == pytest.approx(expected, rel=1e-6)


@given(st.integers(0, 2**32 - 1))
def test_equation_5_is_the_normalised_euclidean_distance(seed):
    points = cloud(seed)
    weight, used = whitening(points, "normalized")
    assert used == "normalized"
    expected = scipy_distance.seuclidean(points[0], points[1], points.var(axis=0, ddof=1))
    assert np.linalg.norm((points[0] - points[1]) @ weight) == pytest.approx(expected)


def test_a_singular_covariance_falls_back_to_equation_5(rng):
    flat = np.column_stack([rng.normal(size=(50, 2)), np.full(50, -1.7)])
    weight, used = whitening(flat, "mahalanobis")
    assert used == "normalized"
    assert np.isfinite(weight).all()
    assert weight[2, 2] == 0.0  # an axis without spread carries no distance
    assert np.allclose(weight.diagonal()[:2], 1 / flat[:, :2].std(axis=0, ddof=1))


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 50))
def test_mahalanobis_is_independent_of_the_units_of_each_axis(seed, scale):
    points = cloud(seed)
    stretched = points * [scale, 1.0, 1 / scale]
    before, after = (p @ whitening(p, "mahalanobis")[0] for p in (points, stretched))
    assert np.allclose(
        scipy_distance.pdist(before), scipy_distance.pdist(after), rtol=1e-5, atol=1e-7
    )


def test_single_points_have_a_metric():
    for metric in ("mahalanobis", "normalized", "euclidean", "ground"):
        assert np.isfinite(whitening(np.ones((1, 3)), metric)[0]).all()


def brute_force_paths(y, neighbours, reached):
    """Bellman and Ford's relaxation until nothing changes, islands joined one at a time."""
    direct = np.linalg.norm(y, axis=1)
    distance = np.where(reached, direct, np.inf)
    pairs = {(i, int(j)) for i in range(len(y)) for j in neighbours[i]}
    pairs |= {(j, i) for i, j in pairs}
    while True:
        for _ in range(len(y)):
            for i, j in pairs:
                way = distance[i] + np.linalg.norm(y[i] - y[j])
                distance[j] = min(distance[j], way)
        islands = np.flatnonzero(np.isinf(distance))
        if not len(islands):
            return distance
        nearest = islands[np.argmin(direct[islands])]
        distance[nearest] = direct[nearest]


@given(st.integers(0, 2**32 - 1), st.integers(1, 25))
def test_flow_distance_is_the_shortest_path(seed, n):
    rng = np.random.default_rng(seed)
    y = rng.normal(size=(n, 3)) * 5
    neighbours = nearest_neighbours(y, 8)[:, :2]  # few ways on, so that islands occur
    reached = rng.random(n) < 0.2
    distance, parent = flow_paths(y, neighbours, reached)
    assert np.allclose(distance, brute_force_paths(y, neighbours, reached))
    for i in range(n):
        if parent[i] >= 0:
            step = np.linalg.norm(y[i] - y[parent[i]])
            assert distance[i] == pytest.approx(distance[parent[i]] + step)
        else:
            assert distance[i] == pytest.approx(np.linalg.norm(y[i]))
    assert (distance >= np.linalg.norm(y, axis=1) - 1e-9).all()  # never shorter than straight


def scipy_paths(y, neighbours, reached):
    """The same by scipy.sparse.csgraph: P0 is one more node, joined to one island after another."""
    n, tiny = len(y), np.finfo(float).tiny
    i, j = np.repeat(np.arange(n), neighbours.shape[1]), neighbours.ravel()
    length = np.maximum(np.linalg.norm(y[i] - y[j], axis=1), tiny)
    direct = np.maximum(np.linalg.norm(y, axis=1), tiny)
    roots = np.flatnonzero(reached)
    while True:
        graph = np.full((n + 1, n + 1), np.inf)
        graph[i, j] = graph[j, i] = length
        graph[n, roots] = direct[roots]
        found = dijkstra(csgraph_from_dense(graph, null_value=np.inf), indices=n)[:n]
        islands = np.flatnonzero(np.isinf(found))
        if not len(islands):
            return found
        roots = np.append(roots, islands[np.argmin(direct[islands])])


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.booleans())
def test_flow_distance_equals_scipys_dijkstra(seed, n, grid):
    rng = np.random.default_rng(seed)
    # On a small grid many paths have one length, and points coincide.
    y = rng.integers(-3, 4, (n, 3)).astype(float) if grid else rng.normal(size=(n, 3)) * 5
    neighbours = nearest_neighbours(y, 8)[:, :3]
    reached = rng.random(n) < 0.2
    distance, parent = flow_paths(y, neighbours, reached)
    assert np.allclose(distance, scipy_paths(y, neighbours, reached), rtol=1e-14, atol=1e-300)
    on_path = parent >= 0
    step = np.linalg.norm(y[on_path] - y[parent[on_path]], axis=1)
    assert np.allclose(distance[on_path], distance[parent[on_path]] + step)


def test_of_paths_of_one_length_the_lowest_node_comes_before():
    # A diamond: (2, 0) is as far over node 2 as over node 1.
    y = np.array([[2.0, 0, 0], [1, 1, 0], [1, -1, 0]])
    for neighbours in ([[1, 2], [0, 2], [0, 1]], [[2, 1], [2, 0], [1, 0]]):
        reached = np.array([False, True, True])
        distance, parent = flow_paths(y, np.array(neighbours), reached)
        assert distance[0] == 2 * np.sqrt(2)
        assert parent.tolist() == [1, -1, -1]


def test_flow_on_paper():
    # P0 reaches (3, 0) only; (3, 4) follows over a way of 3 + 4.
    y = np.array([[3.0, 0, 0], [3.0, 4, 0]])
    distance, parent = flow_paths(y, np.array([[1], [0]]), np.array([True, False]))
    assert distance.tolist() == [3.0, 7.0]
    assert parent.tolist() == [-1, 0]


def test_the_viewpoint_reaches_the_nearest_point_of_each_direction():
    points = np.array([[5.0, 0.01, 0], [9, 0.01, 0], [0.01, 7, 0], [0.01, 6, 0]])
    assert direct_reach(points, ORIGIN, points).tolist() == [True, False, False, True]


def test_sectors_are_two_degrees_wide():
    # 60 points at -29.5, -28.5, ... 29.5 degrees; the mean lies at 0, where a sector starts.
    azimuth_rad = np.deg2rad(np.arange(-30, 30) + 0.5)
    range_m = np.where(np.arange(60) % 2 == 0, 10.0, 20.0)
    range_m = np.where(azimuth_rad < 0, range_m[::-1], range_m)  # symmetric about the x axis
    points = np.column_stack(
        [range_m * np.cos(azimuth_rad), range_m * np.sin(azimuth_rad), np.zeros(60)]
    )
    assert direct_reach(points, ORIGIN, points).tolist() == (range_m == 10.0).tolist()


def test_forces_keep_at_least_half_the_ground_range():
    points = np.array([[10.0, 0, 0], [0, 10, 0]])
    toward_p0_m = np.array([[-9.0, 0, 0], [0, -4, 0]])
    ground = chart_coordinates(points, toward_p0_m, ORIGIN, "ground")
    assert np.allclose(ground, [[5, 0], [0, 6]])
    polar = chart_coordinates(points, toward_p0_m, ORIGIN, "polar")
    assert np.allclose(polar, [[0, np.log(5)], [np.pi / 2, np.log(6)]])


def test_cohesion_equation_3_on_paper():
    y = np.array([[0.0, 0, 0], [2, 0, 0], [0, 4, 0]])
    force = cohesion_force(y, np.array([[1, 2], [0, 2], [0, 1]]), 0.5)
    assert np.allclose(force[0], 0.5 * np.array([1.0, 2.0, 0.0]))  # alpha D towards the middle
    assert np.linalg.norm(force[0]) == pytest.approx(0.5 * np.hypot(1, 2))


def test_repulsion_equation_6_on_paper():
    # R = 10, beta small enough not to be lowered: D' = 5, so rho = 1/2 and
    # beta (1/rho - 1) / rho^2 R = beta * 1 * 4 * 10, along +x.
    y = np.array([[5.0, 0, 0], [10.0, 0, 0], [20.0, 0, 0]])
    distance, parent = np.array([5.0, 10.0, 20.0]), np.array([-1, 0, 1])
    force = repulsion_force(y, distance, parent, 1e-3, 10.0)
    assert np.allclose(force, [[0.04, 0, 0], [0, 0, 0], [0, 0, 0]])


@given(st.floats(0.05, 0.95), st.floats(1e-6, 1.0))
def test_repulsion_is_minus_the_gradient_of_the_field_of_equation_7(rho, beta):
    radius = 7.0

    def field(r):  # Eq. 7 in units of R
        return 0.5 * beta * (1 / r - 1) ** 2

    step = 1e-6
    slope = -(field(rho + step) - field(rho - step)) / (2 * step)
    y = np.array([[rho * radius, 0, 0]])
    limit = 0.5 / (3 * rho**-4 - 2 * rho**-3)
    force = repulsion_force(y, np.array([rho * radius]), np.array([-1]), beta, radius)[0, 0]
    assert force == pytest.approx(slope * radius * min(1.0, limit / beta), rel=1e-4)


@given(st.lists(st.floats(0.5, 60), min_size=2, max_size=40), st.floats(0, 100))
def test_repulsion_keeps_the_order_along_the_sight_line(ranges, beta):
    along = np.sort(np.array(ranges))
    y = np.column_stack([along, np.zeros_like(along), np.zeros_like(along)])
    force = repulsion_force(y, along, np.full(len(along), -1), beta, None)
    assert (np.diff(along + force[:, 0]) >= -1e-9).all()
    assert (force[along > np.median(along)] == 0).all()  # zero beyond the influence radius


@pytest.mark.parametrize("chart", ["ground", "angles", "polar"])
def test_charts_keep_the_direction_from_the_viewpoint(chart, rng):
    points, viewpoint = rng.normal(size=(50, 3)) * 10, np.array([1.0, -2.0, 0.5])
    moved_m = rng.normal(size=(50, 3))
    coordinates = chart_coordinates(points, moved_m, viewpoint, chart)
    offset = points - viewpoint
    azimuth_rad = np.arctan2(offset[:, 1], offset[:, 0])
    if chart == "ground":
        assert np.allclose(np.arctan2(coordinates[:, 1], coordinates[:, 0]), azimuth_rad)
    else:
        assert np.allclose(coordinates[:, 0], azimuth_rad)
    if chart == "angles":
        expected = np.arcsin(offset[:, 2] / np.linalg.norm(offset, axis=1))
        assert np.allclose(coordinates[:, 1], expected)


def test_without_forces_the_ground_chart_is_the_ground_plane(rng):
    points, viewpoint = rng.normal(size=(50, 3)) * 10, np.array([1.0, -2.0, 0.5])
    surface = build_surface(points, viewpoint, Settings(cohesion=0.0, repulsion=0.0))
    assert np.allclose(surface.chart, (points - viewpoint)[:, :2])
    polar = build_surface(
        points, viewpoint, Settings(cohesion=0.0, repulsion=0.0, chart="polar")
    ).chart
    assert np.allclose(np.exp(polar[:, 1]), np.linalg.norm((points - viewpoint)[:, :2], axis=1))


def test_forces_even_out_the_distribution(rng):
    """The near field of a scan is thinned: its share of nodes in the inner quarter of the area."""
    range_m = np.exp(rng.uniform(np.log(4), np.log(60), 2000))  # as dense as 1 / r^2
    azimuth_rad = rng.uniform(-0.7, 0.7, 2000)
    points = np.column_stack(
        [range_m * np.cos(azimuth_rad), range_m * np.sin(azimuth_rad), np.full(2000, -1.7)]
    )
    plain = build_surface(points, ORIGIN, Settings(cohesion=0.0, repulsion=0.0)).chart
    moved = build_surface(points, ORIGIN, Settings(cohesion=0.0, repulsion=0.1)).chart
    near = 6.0
    assert (np.linalg.norm(moved, axis=1) < near).sum() < (
        np.linalg.norm(plain, axis=1) < near
    ).sum()


@pytest.mark.parametrize(
    ("metric", "chart"),
    list(itertools.product(METRICS, CHARTS)),
)
@pytest.mark.parametrize("n", [1, 2, 3, 9])
def test_few_equal_or_collinear_points_give_finite_surfaces(metric, chart, n):
    for points in (
        np.tile([5.0, 1.0, -1.0], (n, 1)),
        np.column_stack([np.arange(1.0, n + 1), np.zeros(n), np.zeros(n)]),
        np.zeros((n, 3)),
    ):
        surface = build_surface(points, ORIGIN, Settings(metric=metric, chart=chart))
        assert np.isfinite(surface.chart).all()
        assert np.isfinite(surface.flow_distance).all()


def reached_by_definition(points, viewpoint, y):
    """The nearest point of each sector of 2 degrees, counted from the direction of the mean."""
    offset = points - viewpoint
    mean = offset.mean(axis=0)
    nearest = {}
    for i, (east, north, _) in enumerate(offset):
        turn_deg = np.degrees(np.arctan2(north, east) - np.arctan2(mean[1], mean[0])) % 360.0
        sector = int(turn_deg // 2.0)
        if sector not in nearest or np.linalg.norm(y[i]) < np.linalg.norm(y[nearest[sector]]):
            nearest[sector] = i
    return [i in nearest.values() for i in range(len(points))]


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_direct_reach_equals_a_loop_over_sectors(seed):
    rng = np.random.default_rng(seed)
    viewpoint = rng.normal(size=3) * 5
    # all around the viewpoint, and denser to one side, so that the mean has a direction
    points = viewpoint + rng.normal(size=(300, 3)) * 8 + rng.normal(size=3) * 4
    y = points - viewpoint
    reached = direct_reach(points, viewpoint, y)
    assert reached.tolist() == reached_by_definition(points, viewpoint, y)
    assert 50 < reached.sum() < 180


def test_a_sector_starts_at_the_direction_of_the_mean():
    """On it, half a degree left of it and half a degree right of it: two sectors."""
    c, s = 10 * np.cos(np.deg2rad(0.5)), 10 * np.sin(np.deg2rad(0.5))
    points = np.array([[5.0, 0, 0], [c, s, 0], [c, -s, 0]])
    assert direct_reach(points, ORIGIN, points).tolist() == [True, False, True]
    assert direct_reach(points[:1], ORIGIN, points[:1]).tolist() == [True]
    assert direct_reach(points[:0], ORIGIN, points[:0]).shape == (0,)


def test_cohesion_pulls_each_point_to_the_mean_of_its_neighbours():
    y = np.array([[0.0, 0, 0], [2, 0, 0], [0, 4, 6]])
    force = cohesion_force(y, np.array([[1, 2], [0, 2], [0, 1]]), 0.5)
    # means: (1, 2, 3), (0, 2, 3), (1, 0, 0)
    assert force.tolist() == [[0.5, 1, 1.5], [-1, 1, 1.5], [0.5, -2, -3]]
    assert cohesion_force(y, np.empty((3, 0), int), 0.5).tolist() == [[0.0] * 3] * 3


def repulsion_by_definition(y, distance, parent, scale, radius):
    """Eq. 6 one point at a time; beta is lowered for the order along the flow to be kept."""
    radius = np.median(distance) if radius is None else radius
    force = np.zeros_like(y)
    pushed = []
    for i in range(len(y)):
        step = y[i] - (y[parent[i]] if parent[i] >= 0 else 0.0)
        if 0.0 < distance[i] < radius and step.any():
            pushed.append((i, distance[i] / radius, step / np.linalg.norm(step)))
    if pushed:
        # d/drho (rho + beta (rho^-3 - rho^-2)) >= 1/2 at the smallest rho, where it is least
        beta = min(scale, min(0.5 / (3 / rho**4 - 2 / rho**3) for _, rho, _ in pushed))
        for i, rho, direction in pushed:
            force[i] = beta * (1 / rho - 1) / rho**2 * radius * direction
    return force


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([1e-3, 0.1, 50.0]),
    st.sampled_from([None, 0.5, 3.0, 40.0]),
)
def test_repulsion_equals_a_loop(seed, scale, radius):
    rng = np.random.default_rng(seed)
    y = rng.normal(size=(40, 3)) * 4
    distance, parent = flow_paths(y, nearest_neighbours(y, 8), rng.random(40) < 0.1)
    if radius == 0.5:
        y, distance = 0.1 * y, 0.1 * distance
    expected = repulsion_by_definition(y, distance, parent, scale, radius)
    assert np.allclose(repulsion_force(y, distance, parent, scale, radius), expected)
    assert (parent == 0).any() or (parent < 0).any()


def test_repulsion_of_points_at_the_viewpoint_or_of_none_is_nothing():
    nothing = np.zeros((3, 3))
    parent = np.array([-1, 0, 0])
    assert repulsion_force(nothing, np.zeros(3), parent, 1.0, None).tolist() == nothing.tolist()
    assert repulsion_force(nothing[:0], np.zeros(0), parent[:0], 1.0, None).shape == (0, 3)
    # a copy of the point before it, half way to R: it has no direction to move in
    y = np.array([[5.0, 0, 0], [5.0, 0, 0], [20, 0, 0]])
    force = repulsion_force(y, np.array([5.0, 5.0, 20.0]), np.array([-1, 0, 1]), 1e-3, 10.0)
    assert np.allclose(force, [[0.04, 0, 0], [0, 0, 0], [0, 0, 0]])


def test_a_node_of_a_chain_is_pushed_away_from_the_node_before_it():
    # node 0 at (3, 0), node 1 at (3, 4) behind it: D' = 7; R = 14, so rho = 1/2.
    y = np.array([[3.0, 0, 0], [3, 4, 0]])
    force = repulsion_force(y, np.array([13.9, 7.0]), np.array([-1, 0]), 1e-3, 14.0)
    assert np.allclose(force[1], [0, 1e-3 * 1 * 4 * 14, 0])


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.sampled_from(METRICS))
def test_the_surface_is_built_from_its_parts(seed, metric):
    """Positions relative to P0, the sum of both forces, and the forces in metres on the chart."""
    points, viewpoint = cloud(seed), np.array([1.5, -2.0, 0.7])
    chosen = Settings(metric=metric, cohesion=0.2, repulsion=0.1, influence_radius=2.0)
    surface = build_surface(points, viewpoint, chosen)
    weight = whitening(points, metric)[0]
    y = (points - viewpoint) @ weight
    assert np.allclose(surface.metric_position, y)
    neighbours = nearest_neighbours(y, 8)
    reached = np.array(reached_by_definition(points, viewpoint, y))
    distance = scipy_paths(y, neighbours, reached)
    assert np.allclose(surface.flow_distance, distance)
    force = cohesion_force(y, neighbours, 0.2)
    force += repulsion_by_definition(y, distance, surface.flow_parent, 0.1, 2.0)
    assert np.allclose(surface.displacement, force)
    # in metres: the least displacement whose image under W is the force
    moved_m = np.linalg.lstsq(weight.T, force.T, rcond=None)[0].T
    expected = chart_coordinates(points, moved_m, viewpoint, "ground")
    assert np.allclose(surface.chart, expected)


def test_metrics_on_their_bounds():
    rng = np.random.default_rng(1)
    plain = rng.normal(size=(50, 3))
    # an axis whose variance is less than 1e-10 of the largest adds no distance
    for share, counts in ((2.5e-11, False), (4e-10, True)):
        scaled = plain * [1e3, 1e3 * np.sqrt(share), 1e3]
        scaled /= scaled.std(axis=0, ddof=1) / [1e3, 1e3 * np.sqrt(share), 1e3]
        weight, _ = whitening(scaled, "normalized")
        assert (weight[1, 1] > 0) == counts
    # two points span no volume
    assert whitening(plain[:2], "mahalanobis")[1] == "normalized"
    assert whitening(plain[:1], "mahalanobis")[1] == "euclidean"
    # along a line, with noise: correlations with eigenvalues of noise^2 and 3
    line = rng.normal(size=(200, 1)) * [1.0, 1.0, 1.0]
    for noise, used in ((1e-6, "normalized"), (1e-5, "normalized"), (1e-4, "mahalanobis")):
        noisy = line + noise * rng.normal(size=(200, 3))
        assert whitening(noisy, "mahalanobis")[1] == used
    assert whitening(plain, "ground")[0].tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 0]]
    assert whitening(plain, "euclidean")[0].tolist() == np.eye(3).tolist()
