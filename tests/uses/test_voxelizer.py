"""SemanticKITTI's masks against a plain double of the tool, one voxel at a time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis.uses.voxels.voxel_grid import VoxelGrid
from intervis.uses.voxels.voxelizer import blocked_masks, tool_keeps, voted_labels

F = np.float32


class Double:
    """The tool's grid as a dictionary, walked with numpy's float32 scalars."""

    def __init__(self, occupied: np.ndarray, corner: list[float], cell_m: float) -> None:
        self.filled = {tuple(index) for index in np.argwhere(occupied).tolist()}
        self.shape, self.corner, self.cell = occupied.shape, [F(c) for c in corner], F(cell_m)
        self.by: dict[tuple[int, ...], object] = {}

    def order(self):
        sx, sy, sz = self.shape
        for shell in range(min(sx, -(-sy // 2))):
            yield from ((sx - 1 - shell, j, k) for j in range(sy) for k in range(sz))
            for j in (shell, sy - 1 - shell):
                yield from ((i, j, k) for i in range(sx - shell - 1) for k in range(sz))

    def blocker(self, voxel: tuple[int, int, int], end: list[float]) -> object:
        along, crossing, between, step, out = [], [], [], [], []
        for axis in range(3):
            centre = F(
                float(F(self.corner[axis] + F(F(voxel[axis]) * self.cell))) + 0.5 * float(self.cell)
            )
            along.append(F(F(end[axis]) - centre))
            with np.errstate(divide="ignore"):
                if along[axis] < 0:
                    crossing.append(F(-0.5 * float(self.cell) / float(along[axis])))
                    between.append(F(-self.cell / along[axis]))
                    step.append(-1)
                    out.append(0)
                else:
                    crossing.append(F(np.float64(0.5 * float(self.cell)) / np.float64(along[axis])))
                    between.append(F(self.cell / along[axis]))
                    step.append(1)
                    out.append(self.shape[axis])
        goal = [int((F(end[a]) - self.corner[a]) / self.cell) for a in range(3)]
        place, passed, found = list(voxel), [], None
        table = (2, 1, 2, 1, 2, 2, 0, 0)
        while all(0 <= place[a] < self.shape[a] for a in range(3)):
            if tuple(place) in self.filled:
                found = tuple(place)
                break
            passed.append(tuple(place))
            bits = (
                (crossing[0] < crossing[1]) * 4
                + (crossing[0] < crossing[2]) * 2
                + (crossing[1] < crossing[2])
            )
            axis = table[int(bits)]
            place[axis] += step[axis]
            crossing[axis] = F(crossing[axis] + between[axis])
            if place[axis] == out[axis] or place == goal:
                break
        for each in passed:
            self.by[each] = found
        return found

    def masks(self, sensors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        occluded: dict[tuple[int, ...], object] = {}
        self.by = {}
        for voxel in self.order():
            if voxel not in self.by:
                self.by[voxel] = self.blocker(voxel, [0.0, 0.0, 0.0])
            occluded[voxel] = self.by[voxel]
        invalid = dict(occluded)
        for sensor in sensors:
            self.by = {}
            for voxel in self.order():
                if invalid[voxel] is None:
                    continue
                if voxel not in self.by:
                    self.by[voxel] = self.blocker(voxel, list(sensor))
                if self.by[voxel] is None:
                    invalid[voxel] = None
        first, second = np.zeros(self.shape, bool), np.zeros(self.shape, bool)
        for voxel, by in occluded.items():
            first[voxel] = by is not None
        for voxel, by in invalid.items():
            second[voxel] = by is not None and voxel not in self.filled
        return first, second


@given(
    st.tuples(st.integers(1, 9), st.integers(1, 10), st.integers(1, 5)),
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.05, 0.2, 0.5]),
)
@settings(max_examples=60)
def test_every_voxel_is_as_in_the_tool(shape, seed, share) -> None:
    rng = np.random.default_rng(seed)
    cell_m = 0.2
    corner = [0.0, -0.5 * shape[1] * cell_m, -0.3]
    occupied = rng.random(shape) < share
    sensors = rng.uniform(-0.4, 0.4, (3, 3)) + np.array([0.6, 0.0, 0.0])
    grid = VoxelGrid(corner, cell_m, shape)
    occluded, invalid = blocked_masks(grid, occupied, sensors)
    expected = Double(occupied, corner, cell_m).masks(sensors.astype(np.float32))
    assert np.array_equal(occluded, expected[0])
    assert np.array_equal(invalid, expected[1])


def test_masks_on_paper() -> None:
    """A column of voxels at x = 1 m: it blocks itself and what lies behind, seen from (0, 0, 0)."""
    grid = VoxelGrid([0.0, -0.1, -0.1], 0.2, (10, 1, 1))
    occupied = np.zeros(grid.shape, bool)
    occupied[5] = True
    occluded, invalid = blocked_masks(grid, occupied, np.array([[1.95, 0.0, 0.0]]))
    assert occluded[:, 0, 0].tolist() == [False] * 5 + [True] * 5
    assert not invalid.any()  # the later sensor sees the far side
    _, alone = blocked_masks(grid, occupied, np.empty((0, 3)))
    assert alone[:, 0, 0].tolist() == [False] * 6 + [True] * 4  # the occupied one is valid


def test_the_first_voxel_of_a_walk_downwards_is_not_looked_at() -> None:
    """A walk in a negative direction stops on reaching index 0: that voxel blocks no other."""
    grid = VoxelGrid([0.0, -0.1, -0.1], 0.2, (4, 1, 1))
    occupied = np.zeros(grid.shape, bool)
    occupied[0] = True
    occluded, _ = blocked_masks(grid, occupied, np.empty((0, 3)))
    assert occluded[:, 0, 0].tolist() == [True, False, False, False]


def test_what_the_tool_enters() -> None:
    points = np.array(
        [
            [2.4, 3.0, 0],  # on the car in x, beside it in y
            [2.4, 1.9, 0],  # on the car
            [0.0, 2.4, 0],  # nearer than 2.5 m
            [69.9, 0, 0],
            [70.1, 0, 0],
            [np.nan, 0, 0],
        ],
        np.float32,
    )
    assert tool_keeps(points).tolist() == [True, False, False, True, False, False]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_labels_are_voted(seed) -> None:
    rng = np.random.default_rng(seed)
    grid = VoxelGrid([0, 0, 0], 1.0, (3, 2, 2))
    points, labels = rng.uniform(-0.5, 3.5, (80, 3)), rng.integers(0, 4, 80).astype(np.uint16)
    occupied, label = voted_labels(grid, [(points[:30], labels[:30]), (points[30:], labels[30:])])
    for voxel in np.ndindex(grid.shape):
        here = [
            int(one)
            for point, one in zip(points, labels, strict=True)
            if all(voxel[a] <= point[a] < voxel[a] + 1 for a in range(3))
        ]
        assert occupied[voxel] == bool(here)
        counts = {one: here.count(one) for one in here}
        best = max(counts.values(), default=0)
        assert label[voxel] == min((one for one in counts if counts[one] == best), default=0)


@pytest.mark.realdata
def test_a_real_scan_blocks_as_a_straight_line_does(shared_data) -> None:
    """The tool's answer depends on the order of visiting: hold it to straight lines, loosely."""
    from intervis.drives import open_drive

    frame = open_drive(shared_data / "semantickitti" / "000000.bin")[0]
    grid = VoxelGrid([0.0, -25.6, -2.0], 0.2, (256, 256, 32))
    kept = tool_keeps(frame.points)
    occupied, label = voted_labels(grid, [(frame.points[kept], frame.point_classes[kept])])
    assert (label[~occupied] == 0).all()
    occluded, invalid = blocked_masks(grid, occupied, np.empty((0, 3)))
    assert occluded[occupied].all()
    assert np.array_equal(invalid, occluded & ~occupied)
    rng = np.random.default_rng(0)
    index = rng.integers(0, grid.shape, (4000, 3))
    share = np.linspace(0.0, 1.0, 2000)[:-1, None]
    same = 0
    for voxel in index:
        on_line, inside = grid.index_of(grid.centre_of(voxel) * (1.0 - share))
        on_line = on_line[inside & (on_line > 0).all(axis=1)]
        same += bool(occupied[tuple(on_line.T)].any()) == bool(occluded[tuple(voxel)])
    assert same > 0.93 * len(index)
