"""Delaunay triangulation, against rational numbers."""

import numpy as np
import pytest
from exact_double import all_triangles, check, exact, inside, last_bits, turn
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import intervis
from intervis.delaunay import triangulate, triangulation
from intervis.delaunay.divide import part_bounds
from intervis.delaunay.order import spatial_order
from intervis.errors import PointsError

seeds = st.integers(0, 2**32 - 1)
lengths = st.floats(-10.0, 10.0).filter(lambda x: abs(x) > 1e-60)  # see SMALLEST in `order`
angles = st.one_of(st.just(0.0), st.floats(1e-60, 1.6))
scales = st.sampled_from([1e-150, 1e-12, 1e-3, 1.0, 3.7, 1e7, 1e150])


def checked(positions):
    positions = np.asarray(positions, np.float64)
    before = positions.copy()
    found = triangulate(positions)
    np.testing.assert_array_equal(positions, before)
    check(positions, found.triangles, found.opposite, found.vertex)
    return found


@pytest.fixture(params=[1, 6], autouse=True, scope="module")
def parts(request):
    """Small sets too are triangulated in parts, which are then merged."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(triangulation, "PARTS", request.param)
        patch.setattr(triangulation, "WORTH_PARTS", 3)
        yield request.param


def corners(found):
    return {tuple(sorted(triangle)) for triangle in found.triangles.tolist()}


def pairs(elements, least=1, most=40):
    return st.lists(st.tuples(elements, elements), min_size=least, max_size=most)


@given(pairs(st.integers(0, 3), most=14))
@settings(max_examples=50)
def test_small_grids_have_the_triangles_of_the_definition(positions):
    """Copies, collinear positions and four on one circle are frequent here."""
    assert corners(checked(positions)) == all_triangles(positions)


@given(seeds, st.integers(3, 12))
@settings(max_examples=40)
def test_random_positions_have_the_triangles_of_the_definition(seed, count):
    positions = np.random.default_rng(seed).normal(size=(count, 2))
    assert corners(checked(positions)) == all_triangles(positions)


@given(pairs(st.floats(-1e7, 1e7).filter(lambda x: x == 0 or abs(x) > 1e-90)))
@settings(max_examples=40)
@example([(0.0, 0.0), (1.0, 1e-12), (2.0, -1e-12), (1e7, 1e7), (-0.0, 0.0)])
def test_any_numbers(positions):
    checked(positions)


@given(seeds, scales, st.integers(3, 80))
@settings(max_examples=40)
def test_random_positions_of_any_scale(seed, scale, count):
    checked(scale * np.random.default_rng(seed).normal(size=(count, 2)))


@given(st.integers(1, 12), st.integers(1, 12), angles, scales)
@settings(max_examples=40)
def test_grids_as_they_are_and_turned(columns, lines, angle_rad, scale):
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(columns), np.arange(lines)))
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    checked(scale * np.column_stack([c * x - s * y, s * x + c * y]))


@given(st.integers(3, 60), scales, st.sampled_from([0.0, 0.1, 100.0]), st.booleans())
@settings(max_examples=40)
def test_circles(count, scale, shift, centre):
    angle_rad = 2 * np.pi * np.arange(count) / count
    circle = np.column_stack([np.cos(angle_rad), np.sin(angle_rad)]) + shift
    middle = np.full((int(centre), 2), shift)
    checked(scale * np.vstack([circle, middle]))


def test_twelve_whole_numbers_on_one_circle():
    """All ties at once: the last position is cut off first, then the last of the others."""
    circle = [(x, y) for x in range(-5, 6) for y in range(-5, 6) if x * x + y * y == 25]
    assert len(circle) == 12
    found = checked(circle)
    assert corners(found) == all_triangles(circle)
    assert len(found.triangles) == 10
    near_last = sorted(circle, key=lambda p: (p[0] - 5) ** 2 + p[1] ** 2)[:3]
    assert tuple(sorted(circle.index(p) for p in near_last)) in corners(found)


@given(
    seeds,
    st.integers(3, 80),
    lengths,
    st.sampled_from([0.0, 1e-90, 1e-16, 1e-14, 1e-9]),
    st.booleans(),
)
@settings(max_examples=50)
def test_nearly_collinear_positions(seed, count, slope, noise, steep):
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, count)
    line = np.column_stack([x, slope * x + noise * rng.normal(size=count)])
    checked(line[:, ::-1] if steep else line)


@given(seeds, st.integers(1, 60), lengths, lengths, st.integers(0, 40))
@settings(max_examples=50)
def test_steps_of_the_last_bit(seed, count, x, y, steps):
    """Positions around one place, a few units in the last place away from it."""
    rng = np.random.default_rng(seed)
    place = np.array([x, y])
    checked(place + last_bits(place) * rng.integers(-steps, steps + 1, (count, 2)))


@given(seeds, lengths, lengths, st.integers(1, 25))
@settings(max_examples=40)
def test_a_line_disturbed_in_the_last_bit(seed, dx, dy, count):
    rng = np.random.default_rng(seed)
    along = rng.uniform(1, 2, (count, 1))
    line = along * [dx, dy] + 0.5
    line += last_bits(line) * rng.integers(-1, 2, line.shape)
    checked(np.vstack([line, line[::3], [[0.5, 0.7]]]))


@given(seeds, st.sampled_from([1e3, 1e9, 1e15]), st.integers(2, 40))
@settings(max_examples=15)
def test_two_clusters_far_apart(seed, distance, count):
    rng = np.random.default_rng(seed)
    cluster = rng.normal(size=(count, 2))
    for apart in ([distance, 0.0], [0.0, distance], [distance, distance / 3]):
        checked(np.vstack([cluster, rng.normal(size=(count, 2)) + apart]))


@given(seeds, st.integers(2, 60))
@settings(max_examples=40)
def test_clusters_within_clusters(seed, count):
    """Distances from 1e-90 to 1: more than one bounding square must divide them."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** -rng.choice([0.0, 5.0, 10.0, 45.0, 90.0], (count, 1))
    checked(np.vstack([size * rng.normal(size=(count, 2)), np.zeros((2, 2))]))


@given(seeds, st.integers(1, 200))
@settings(max_examples=40)
def test_of_copies_the_lowest_row_has_the_edges(seed, count):
    rng = np.random.default_rng(seed)
    distinct = rng.normal(size=(max(3, count // 4), 2))
    checked(distinct[rng.integers(0, len(distinct), count)])


@pytest.mark.parametrize("count", [40, 100, 300])
def test_many_positions_in_one_cell(rng, count):
    """Far more than are sorted by x, then y, with many of one x, and copies."""
    far = [[1e9, 0.0], [0.0, 1e9]]
    column = np.column_stack([rng.integers(0, 2, count), rng.normal(size=count)])
    for cluster in (rng.normal(size=(count, 2)), column, rng.integers(0, 9, (count, 2))):
        checked(np.vstack([far, cluster]))


@given(seeds, st.booleans())
@settings(max_examples=25)
def test_neither_rows_nor_scale_matter(seed, whole):
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 7, (40, 2)) * 1.0 if whole else rng.normal(size=(40, 2))
    positions = np.unique(positions, axis=0)
    order = rng.permutation(len(positions))
    plain = corners(triangulate(positions))
    mixed = triangulate(2.0**-30 * positions[order])
    assert {tuple(sorted(order[list(three)].tolist())) for three in corners(mixed)} == plain


@pytest.mark.parametrize("positions", [[], [[1.0, 2]], [[1.0, 2]] * 4, [[0.0, 0], [3, 4]]])
def test_fewer_than_three_positions_have_no_triangle(positions):
    found = checked(np.reshape(positions, (-1, 2)))
    assert found.triangles.shape == (0, 3)
    assert found.opposite.shape == (0,)


def test_what_is_smaller_than_all_powers_counts_as_zero():
    found = triangulate(np.array([[0.0, 0], [1, 0], [0, 1], [1e-200, 0], [1, 5e-324]]))
    assert found.vertex.tolist() == [0, 1, 2, 0, 1]
    assert corners(found) == {(0, 1, 2)}
    checked(5e-324 * np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]]))
    checked(1.7e308 * np.array([[0.0, 0], [1, 0], [0, -1], [1, 1]]))


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_refused(wrong):
    with pytest.raises(PointsError, match="finite"):
        triangulate(np.array([[0.0, 0], [1, wrong], [0, 1], [2, 2]]))


@given(seeds, st.integers(1, 60), st.booleans())
@settings(max_examples=30)
def test_edges_and_areas_are_those_of_the_triangles(seed, count, whole):
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 6, (count, 2)) * 1.0 if whole else rng.normal(size=(count, 2))
    found = triangulate(positions)
    sides = {
        tuple(sorted((three[k], three[k - 1])))
        for three in found.triangles.tolist()
        for k in range(3)
    }
    assert [tuple(edge) for edge in found.edges().tolist()] == sorted(sides)
    area = [turn(*exact(positions[three])) / 2 for three in found.triangles]
    np.testing.assert_allclose(found.areas(positions), np.array(area, float), rtol=1e-9)


def test_an_area_is_positive_where_rounding_would_make_it_zero():
    """Multiples of 0.1 are not quite on a line in doubles."""
    multiples = np.array([4, 34, 1])
    positions = np.column_stack([0.1 * multiples, 0.5 * multiples])
    found = checked(positions)
    a, b, c = positions[found.triangles[0]]
    assert (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) == 0.0
    area = turn(*exact(positions[found.triangles[0]])) / 2
    assert found.areas(positions).tolist() == [pytest.approx(float(area), rel=1e-12)]


def test_parts_cover_the_vertices_and_stay_few(rng, parts):
    for positions in (rng.normal(size=(3000, 2)), rng.integers(0, 40, (3000, 2)) * 1.0):
        count = len(positions)
        cut, row = np.empty(count, np.int16), np.empty(count, np.int32)
        distinct = spatial_order(positions, np.empty(2 * count), row, cut, row.copy())
        bounds = part_bounds(cut[:distinct], parts)
        assert bounds[0] == 0
        assert bounds[-1] == distinct
        assert (np.diff(bounds) > 0).all()
        assert parts <= len(bounds) - 1 < max(2, 2 * parts)


@pytest.mark.parametrize("threads", ["1", "3"])
def test_threads_change_nothing(monkeypatch, rng, threads):
    positions = rng.normal(size=(20_000, 2))
    plain = triangulate(positions)
    monkeypatch.setenv("INTERVIS_THREADS", threads)
    again = triangulate(positions)
    for name in ("triangles", "opposite", "vertex"):
        np.testing.assert_array_equal(getattr(again, name), getattr(plain, name))


@pytest.mark.realdata
def test_a_real_scan_over_the_ground_and_in_angles(shared_data):
    """All returns of a scan; in doubles, and in rational numbers where doubles could be wrong."""
    frame = intervis.open_drive(shared_data / "kitti_object")[0]
    xyz = np.asarray(frame.points[:, :3], np.float64)
    angles = np.column_stack(
        [np.arctan2(xyz[:, 1], xyz[:, 0]), np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1]))]
    )
    unsure = 0
    for positions in (xyz[:, :2], angles):
        found = triangulate(positions)
        distinct = np.unique(found.vertex)
        assert len(distinct) == len(np.unique(positions, axis=0))
        outside = np.count_nonzero(found.opposite < 0)
        assert len(found.triangles) == 2 * len(distinct) - 2 - outside
        area = found.areas(positions)
        assert (area > 0).all()
        assert area.sum() == pytest.approx(ConvexHull(positions).volume, rel=1e-12)
        unsure += locally_delaunay(positions, found)
    assert unsure > 0


def locally_delaunay(positions, found):
    """How many inner edges had to be judged in rational numbers; all have an empty circle."""
    half = np.flatnonzero(found.opposite > np.arange(len(found.opposite)))
    three = found.triangles[half // 3]
    twin = found.opposite[half]
    across = found.triangles.ravel()[np.where(twin % 3 == 0, twin + 2, twin - 1)]
    a, b, c = (positions[three[:, k]] - positions[across] for k in range(3))
    terms = [
        (p**2).sum(axis=1)[:, None] * np.column_stack([q[:, 0] * r[:, 1], -q[:, 1] * r[:, 0]])
        for p, q, r in ((a, b, c), (b, c, a), (c, a, b))
    ]
    det, size = np.sum(terms, axis=(0, 2)), np.abs(terms).sum(axis=(0, 2))
    sure = np.abs(det) > 1e-14 * size
    assert (det[sure] < 0).all()
    for corners_of, fourth in zip(three[~sure], across[~sure], strict=True):
        assert not inside(*exact(positions[[*corners_of, fourth]]))
    return np.count_nonzero(~sure)
