"""Where an occluded line meets the surface, and the shift that clears it: against plain loops."""

import math

import numpy as np
import pytest

from intervis.sight.kernels.occluder import locate_occluder
from intervis.sight.kernels.packed_scans import FROM_SCENE

UNIT_M = 1.0 / 128.0
LOWEST, ROWS_PER_UNIT = -0.5, 64.0
"""Row r of the images below lies at the pseudo-elevation -0.5 + r / 64."""


def scan_of(image, pose=None, offset=0, before=()):
    """Pixels and descriptor of one range image (columns, rows), in units of 1/128 m."""
    columns, rows = image.shape
    descriptor = np.zeros(FROM_SCENE + 12)
    descriptor[:FROM_SCENE] = UNIT_M, offset, columns, rows, LOWEST, ROWS_PER_UNIT
    from_scene = np.eye(4) if pose is None else np.linalg.inv(pose)
    descriptor[FROM_SCENE:] = from_scene[:3].ravel()
    return np.concatenate(
        [np.asarray(before, np.int16), image.astype(np.int16).ravel()]
    ), descriptor


def column_and_row(image, u, v, w):
    """Fractional column and row of a point, its planar range: from the text of `projection`."""
    rho = math.hypot(u, v)
    across, along = sorted((abs(u), abs(v)))
    m = across / along if along else 0.0
    turn = m * (1.3147 - m * (0.2343 + 0.0804 * m))
    turn = turn if abs(v) <= abs(u) else 2.0 - turn
    turn = turn if u >= 0 else 4.0 - turn
    turn = turn if v >= 0 else 8.0 - turn
    elevation = w / rho if abs(w) < rho else math.copysign(2.0 - rho / abs(w), w)
    row = (elevation - LOWEST) * ROWS_PER_UNIT
    return turn / 8.0 * image.shape[0], row, max(rho, abs(w))


def is_a_return(value):
    """Not 0, and not negative and odd: a dropout."""
    return value > 0 or (value < 0 and value % 2 == 0)


def depth_by_definition(image, u, v, w):
    """Depth behind the surface; None where nothing was observed."""
    column, row, planar_range = column_and_row(image, u, v, w)
    if not 0.0 <= row < image.shape[1] - 1:
        return None
    pair = image[min(int(column), image.shape[0] - 1), int(row) : int(row) + 2]
    low, high = np.abs(pair)
    fraction = row - int(row)
    nearer = high if fraction >= 0.5 else low
    if not is_a_return(pair[1 if fraction >= 0.5 else 0]):
        return None
    one_surface = abs(low - high) < 0.1 * min(low, high)
    units = low + (high - low) * fraction if one_surface else nearer
    return planar_range - units * UNIT_M


def crossing_by_definition(image, start, along, length, occluder_m):
    """Distance along the line where the depth changes its sign, step by step outwards."""

    def depth(at):
        return depth_by_definition(image, *(start + at * along))

    def zero_between(near, far):
        """Distance of the zero between two neighbouring samples; None: no change of sign."""
        d_near, d_far = depth(near), depth(far)
        if d_near is None or d_far is None or d_near * d_far > 0.0:
            return None
        return far if d_near == d_far else near + (far - near) * d_near / (d_near - d_far)

    for n in range(1, 16):
        for sign in (-1.0, 1.0):  # towards the first end first
            far = occluder_m + sign * 0.1 * n
            if not 0.0 <= far <= length:
                continue
            zero = zero_between(occluder_m + sign * 0.1 * (n - 1), far)
            if zero is not None:
                return zero
    return occluder_m


def shift_by_definition(image, u, v, w):
    """Smallest shift after which the scan saw farther or nothing: up, down, left, right."""
    columns, rows = image.shape
    column, row, planar_range = column_and_row(image, u, v, w)
    c, r = min(int(column), columns - 1), math.floor(row + 0.5)
    if not 0 <= r < rows:
        return 0.0
    shifts = [10.0]
    up_m, beside_m = planar_range / ROWS_PER_UNIT, 2.0 * math.pi * math.hypot(u, v) / columns
    for step_m, dc, dr in ((up_m, 0, 1), (up_m, 0, -1), (beside_m, 1, 0), (beside_m, -1, 0)):
        if step_m == 0.0:
            continue
        n = 1
        while n * step_m < 10.0 and 0 <= r + n * dr < rows:
            units = abs(int(image[(c + n * dc) % columns, r + n * dr]))
            seen = is_a_return(image[(c + n * dc) % columns, r + n * dr])
            if not seen or units * UNIT_M > planar_range:
                shifts.append(n * step_m)
                break
            n += 1
    return min(shifts)


def located(pixels, descriptor, a, b, occluder_m):
    """Point and shift that the kernel finds."""
    blocker, scratch = np.empty(3), np.empty((2, 3))
    a, b = np.asarray(a, float), np.asarray(b, float)
    length = float(np.linalg.norm(b - a))
    shift = locate_occluder(pixels, descriptor, a, b, length, occluder_m, scratch, blocker)
    return blocker, shift


def uneven_image(rng, columns=48, rows=64):
    """Walls of a few ranges with ripples, sparse missing pixels, some volumetric."""
    walls = np.repeat(
        np.repeat(rng.choice([400, 900, 1500], (columns // 4, rows // 8)), 4, 0), 8, 1
    )
    image = walls + rng.integers(-20, 20, walls.shape)
    image[rng.random(image.shape) < 0.1] *= -1
    image[rng.random(image.shape) < 0.02] = 0
    return image


def test_blockers_and_shifts_are_those_of_plain_loops(rng):
    """Random lines through random images, in a moved and turned sensor's frame."""
    yaw = 0.7
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    pose[:3, 3] = [3.0, -2.0, 0.5]
    moved = found = cleared = 0
    for _ in range(40):
        image = uneven_image(rng)
        pixels, descriptor = scan_of(image, pose, offset=7, before=[1] * 7)
        for _ in range(25):
            a, b = rng.normal(0.0, 1.0, (2, 3)) * [8.0, 8.0, 2.5] + pose[:3, 3]
            length = float(np.linalg.norm(b - a))
            occluder_m = rng.uniform(0.0, length)
            start = (a - pose[:3, 3]) @ pose[:3, :3]
            along = (b - a) @ pose[:3, :3] / length
            blocker, shift = located(pixels, descriptor, a, b, occluder_m)
            at = crossing_by_definition(image, start, along, length, occluder_m)
            assert blocker == pytest.approx(a + at * (b - a) / length, abs=1e-9)
            expected = shift_by_definition(image, *(start + occluder_m * along))
            assert shift == pytest.approx(expected, rel=1e-9)
            moved += at != occluder_m
            found += 0.0 < shift < 10.0
            cleared += shift == 0.0
    assert min(moved, found, cleared) > 100, "each way out must occur"


WALL = np.full((48, 64), 5 * 128)
"""A surface 5 m around the sensor. On the x axis, half way between two beams, all is exact."""


@pytest.mark.parametrize(
    ("start_x", "end_x", "occluder_m", "met_x"),
    [
        (2.0, 8.0, 3.75, 5.0),  # behind the surface: towards the first end
        (8.0, 2.0, 3.75, 5.0),
        (2.0, 8.0, 2.25, 5.0),  # in front of it: towards the second end
        (2.0, 8.0, 4.45, 5.0),  # 1.45 m behind: the last step of the search
        (2.0, 8.0, 4.55, 6.55),  # 1.55 m behind: nothing within 1.5 m
        (2.0, 8.0, 1.55, 5.0),
        (2.0, 8.0, 1.45, 3.45),
        (5.0, 8.0, 0.25, 5.25),  # the step to the surface itself lies before the first end
        (2.0, 5.0, 2.75, 4.75),  # ... and here beyond the second
        (5.0, 8.0, 0.1, 5.0),  # the ends themselves are part of the line
        (2.0, 5.0, 2.9, 5.0),
    ],
)
def test_the_surface_is_searched_one_and_a_half_metres_along_the_line(
    start_x, end_x, occluder_m, met_x
):
    pixels, descriptor = scan_of(WALL)
    ends = [start_x, 0.0, 0.0], [end_x, 0.0, 0.0]
    blocker, _ = located(pixels, descriptor, *ends, occluder_m)
    # 0.25 m and 0.75 m are no multiples of the 0.1 m steps: linear depth is interpolated exactly.
    assert blocker == pytest.approx([met_x, 0.0, 0.0], abs=1e-9)


def test_a_sample_on_the_surface_is_where_the_line_meets_it():
    """The first step towards the first end finds it: depth 0 there, -0.1 one step ahead."""
    pixels, descriptor = scan_of(WALL)
    blocker, _ = located(pixels, descriptor, [2.0, 0.0, 0.0], [8.0, 0.0, 0.0], 3.0)
    assert blocker == pytest.approx([5.0, 0.0, 0.0], abs=1e-12)


def test_of_surfaces_equally_far_the_one_towards_the_first_end_is_met():
    """A line along the circle around the sensor cuts the wall twice, 0.6 m either way."""
    pixels, descriptor = scan_of(WALL)
    half, x = 0.6, math.sqrt(25.0 - 0.6**2)
    for sign in (1.0, -1.0):
        ends = [x, -3.0 * sign, 0.0], [x, 3.0 * sign, 0.0]
        blocker, _ = located(pixels, descriptor, *ends, 3.0)
        assert blocker == pytest.approx([x, -half * sign, 0.0], abs=0.01)


def test_a_line_along_a_surface_meets_it_one_step_before_the_sample():
    """Depth 0 everywhere: the fraction of the step is 0, not 0 / 0."""
    image = np.full((48, 64), 5 * 128)
    pixels, descriptor = scan_of(image)
    # planar range is 5 m at all heights of a line up the wall
    blocker, _ = located(pixels, descriptor, [5.0, 0.0, -1.0], [5.0, 0.0, 1.0], 1.0)
    assert blocker == pytest.approx([5.0, 0.0, -0.1], abs=1e-12)
    blocker, _ = located(pixels, descriptor, [5.0, 0.0, -0.05], [5.0, 0.0, 1.0], 0.05)
    assert blocker == pytest.approx([5.0, 0.0, 0.1], abs=1e-12), "no room towards the first end"


SENSOR = 6.0  # metres from the sensor to the occluder of the tests below
ROW = 32  # of the direction straight ahead: (0 + 0.5) * 64


@pytest.mark.parametrize(
    ("open_column", "open_row", "expected_m"),
    [
        (0, ROW + 5, 5 * SENSOR / 64),
        (0, ROW - 7, 7 * SENSOR / 64),
        (3, ROW, 3 * 2 * math.pi * SENSOR / 48),
        (-2, ROW, 2 * 2 * math.pi * SENSOR / 48),
        (0, 63, 31 * SENSOR / 64),  # the highest row
        (0, 0, 32 * SENSOR / 64),  # the lowest row
        (12, ROW, 12 * 2 * math.pi * SENSOR / 48),  # 9.4 m, a quarter turn
        (13, ROW, 10.0),  # 10.2 m: more than is reported
        (-13, ROW, 10.0),
    ],
)
@pytest.mark.parametrize("gap", ["missing", "farther", "as far", "scattered"])
def test_the_shift_ends_where_the_scan_saw_farther_or_nothing(
    open_column, open_row, expected_m, gap
):
    image = WALL.copy()
    units = {"missing": 0, "farther": 6 * 128 + 1, "as far": 6 * 128, "scattered": -6 * 128 - 1}
    image[open_column, open_row] = units[gap]
    pixels, descriptor = scan_of(image)
    _, shift = located(pixels, descriptor, [2.0, 0.0, 0.0], [8.0, 0.0, 0.0], SENSOR - 2.0)
    assert shift == pytest.approx(10.0 if gap == "as far" else expected_m, rel=1e-12)


@pytest.mark.parametrize(
    ("elevation", "cleared"),
    [
        (-0.5 - 0.51 / 64, True),  # nearer to a row below the image
        (-0.5 - 0.49 / 64, False),
        (-0.5 + 63.49 / 64, False),
        (-0.5 + 63.51 / 64, True),
    ],
)
def test_beyond_the_rows_nothing_has_to_be_cleared(elevation, cleared):
    pixels, descriptor = scan_of(WALL)
    point = np.array([6.0, 0.0, 6.0 * elevation])
    _, shift = located(pixels, descriptor, point / 2.0, point * 1.5, np.linalg.norm(point) / 2.0)
    assert shift == (0.0 if cleared else 10.0)


@pytest.mark.parametrize(("row", "cleared"), [(-0.5, False), (63.5, True)])
def test_half_a_row_below_the_image_is_its_first_row_and_half_above_is_beyond(row, cleared):
    pixels, descriptor = scan_of(WALL)
    z = 6.0 * (LOWEST + row / ROWS_PER_UNIT)
    _, shift = located(pixels, descriptor, [5.0, 0.0, z], [7.0, 0.0, z], 1.0)
    assert shift == (0.0 if cleared else 10.0)


def test_a_direction_that_rounds_to_a_full_turn_lies_in_the_last_column():
    image = WALL.copy()
    image[-1, ROW + 3] = 0
    pixels, descriptor = scan_of(image)
    ends = [2.0, -1e-18, 0.0], [8.0, -1e-18, 0.0]
    _, shift = located(pixels, descriptor, *ends, SENSOR - 2.0)
    assert shift == 3 * SENSOR / 64


def test_straight_above_the_sensor_columns_have_no_width():
    """On the z axis only rows count: up and down; a shift of 0 m clears nothing."""
    columns, rows = 48, 64
    image = np.full((columns, rows), 5 * 128)
    image[:, 40] = 0
    pixels, descriptor = scan_of(image)
    descriptor[4] = 2.0 - 32 / 64  # ELEVATION_FROM: straight up is row 32
    _, shift = located(pixels, descriptor, [0.0, 0.0, 2.0], [0.0, 0.0, 8.0], 4.0)
    assert shift == pytest.approx(8 * 6.0 / 64)


def test_right_of_the_last_column_is_the_first():
    """The sensor's x axis is the border of the last column; the seam is no end."""
    image = WALL.copy()
    image[1, ROW] = 0
    pixels, descriptor = scan_of(image)
    ends = [2.0, -1e-3, 0.0], [8.0, -4e-3, 0.0]
    _, shift = located(pixels, descriptor, *ends, SENSOR - 2.0)
    assert shift == pytest.approx(2 * 2 * math.pi * SENSOR / 48, rel=1e-4)
