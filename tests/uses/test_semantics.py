"""Classes of blockers, and scenes without a class: a hedge before a wall, and real scans."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from intervis.drives import Box, Drive, Frame, open_drive
from intervis.errors import ArgumentError, DriveError, PointsError, ScanError, SettingsError
from intervis.sight import Scene
from intervis.transform import rigid
from intervis.uses import ClassedReturns, blocker_shares, classed_returns, labelled_scene
from intervis.uses.registration import registered_scene
from intervis.uses.semantics.blockers import blocker_table
from intervis.uses.semantics.parked import is_parked, parked_tracks
from labelled_walls import BESIDE_Y_M, WALL_X_M, walls_from, write_walls

ARRAYS = ("state", "probability", "blocker", "clearance", "observed")
BEHIND_HEDGE = np.array([[WALL_X_M - 0.1, y, z] for y in (-0.6, 0.0, 0.6) for z in (-1.0, 0.0)])
"""Ends right before the wall, each at most 0.6 m beside the line through the hedge's middle."""


@pytest.fixture
def drive(tmp_path):
    return open_drive(write_walls(tmp_path / "walls"))


def same_answers(one, other):
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True) for name in ARRAYS
    )


# --- the class of a blocker ---


def test_the_hedge_and_the_wall_are_named(drive):
    labelled = labelled_scene(drive, 0)
    # Lines of 20 m: through the hedge; past it, through the wall; and one that ends before both.
    sight = labelled.sight([0, 0, 0], [[20, 0, 0], [20, 9, 0], [5, 0, 0]])
    assert sight.state.tolist() == [0, 0, 1]
    assert labelled.blocker_classes(sight).tolist() == ["vegetation", "building", ""]
    assert labelled.blocker_classes(sight, within_m=1e-6)[:2].tolist() == ["unlabelled"] * 2
    square = labelled.sight([[0, 0, 0], [1, 0, 0]], [[20, 0, 0], [20, 9, 0]])
    assert labelled.blocker_classes(square).tolist() == [["vegetation", "building"]] * 2


def test_classes_follow_the_points_into_the_frame_of_the_scene(drive):
    """As seen from frame 1, the hedge stands at y from -7 to -5."""
    labelled = labelled_scene(drive, 1, frames=[0, 1])
    assert len(labelled.scene) == 2
    sight = labelled.sight([0, -BESIDE_Y_M, 0], [[20, -BESIDE_Y_M, 0], [20, 3, 0]])
    assert labelled.blocker_classes(sight).tolist() == ["vegetation", "building"]
    hedge = labelled.returns.points[labelled.returns.are(["vegetation"])]
    assert hedge[:, 1].min() == pytest.approx(-7, abs=0.1)
    assert hedge[:, 1].max() == pytest.approx(-5, abs=0.1)


@pytest.mark.parametrize("distance_m", [0.0, 0.9, 1.1])
def test_a_place_has_the_class_of_the_nearest_return_within_a_metre(distance_m):
    returns = ClassedReturns.of_labels(
        np.array([[5.0, 0, 0], [5, 3, 0], [np.nan, 0, 0]]), [10, 0, 1]
    )
    names = returns.names_at([[5, -distance_m, 0], [5, 3 + distance_m, 0], [np.nan, 0, 0]])
    assert names.tolist() == ["car" if distance_m < 1 else "unlabelled", "unlabelled", "unlabelled"]


def test_nearest_returns_are_those_of_a_search_over_all(rng):
    points, labels = rng.normal(size=(300, 3)), rng.choice([10, 50, 70], 300)
    places = rng.normal(size=(80, 3))
    returns = ClassedReturns.of_labels(points, labels)
    names = {10: "car", 50: "building", 70: "vegetation"}
    for place, found in zip(places, returns.names_at(places, 0.4), strict=True):
        distance_m = np.linalg.norm(points - place, axis=1)
        nearest = distance_m.argmin()
        assert found == (names[labels[nearest]] if distance_m[nearest] < 0.4 else "unlabelled")


def test_shares_sum_to_one_and_are_sorted():
    shares = blocker_shares(np.array([["car", ""], ["building", "car"], ["", "unlabelled"]]))
    assert list(shares.items()) == [("car", 0.5), ("building", 0.25), ("unlabelled", 0.25)]
    assert blocker_shares([]) == blocker_shares(["", ""]) == {}
    table = blocker_table(["car", "", "building", "car"])
    assert table.rows == (("car", "2", "66.7 %"), ("building", "1", "33.3 %"))
    with pytest.raises(PointsError, match="classes must be names"):
        blocker_shares([1.0])


# --- leaving classes out ---


def test_without_the_hedge_another_scan_shows_the_wall(drive):
    """Scan 1 saw the way to the wall but for 1.6 m right behind the hedge at most."""
    whole = labelled_scene(drive, 0, frames=[1])
    assert whole.sight([0, 0, 0], BEHIND_HEDGE).occluded.all()
    cut = labelled_scene(drive, 0, frames=[1], without=["vegetation"])
    seen = cut.sight([0, 0, 0], BEHIND_HEDGE, risk=0.1)
    assert seen.visible.all()
    assert (seen.probability > 0.95).all()
    alone = labelled_scene(drive, 0, without=["vegetation"])
    assert alone.sight([0, 0, 0], BEHIND_HEDGE).unknown.all()


def test_without_the_hedge_one_scan_knows_nothing_there(drive):
    cut = labelled_scene(drive, 0, without=["vegetation"])
    sight = cut.sight([0, 0, 0], BEHIND_HEDGE)
    assert not sight.occluded.any()
    assert (sight.observed < 0.1).all()  # neither behind the hedge nor before it
    beside = cut.sight([0, 0, 0], [[11.9, 6, 0]])
    assert beside.visible.all()
    assert beside.observed[0] > 0.99


@pytest.mark.parametrize("frames", [(), (1,)])
def test_what_was_left_out_can_only_have_occluded(drive, frames, rng):
    cut = labelled_scene(drive, 0, frames=frames, without=["vegetation"])
    ends = rng.uniform([1, -9, -1], [14, 9, 1], (3000, 3))
    before = cut.whole.sight([0, 0, 0], ends, moment_s=None if frames else 0.0)
    after, bare = cut.sight([0, 0, 0], ends), cut.scene.sight([0, 0, 0], ends)
    assert after.visible[before.visible].all()
    assert not after.occluded[before.unknown].any()
    assert same_answers(after[before.occluded], bare[before.occluded])
    assert (after.visible >= bare.visible).all()
    for nth in range(0, 3000, 300):
        one = cut.explain([0, 0, 0], ends[nth])
        assert (one.state, one.probability) == (after.state[nth], after.probability[nth])


def test_space_before_the_hedge_stays_visible(drive):
    """The beams that met the hedge crossed it; a strict risk does not trust the prior alone."""
    cut = labelled_scene(drive, 0, without=["vegetation"])
    ends = [[7.0, y, z] for y in (-0.5, 0.0, 0.5) for z in (-0.8, 0.0)]
    sight, bare = (one.sight([0, 0, 0], ends, risk=0.02) for one in (cut, cut.scene))
    assert sight.visible.all()
    assert (sight.observed > 0.99).all()
    assert bare.unknown.all()
    assert (bare.observed < 0.01).all()


def test_what_is_left_is_counted(drive):
    points, labels = walls_from(0.0)
    cut = labelled_scene(drive, 0, without=["vegetation"])
    assert cut.left_out == np.count_nonzero(labels == 70) > 0
    np.testing.assert_array_equal(cut.targets, points[labels == 50])
    assert set(cut.returns.names_at(cut.targets).tolist()) == {"building"}
    both = labelled_scene(drive, 0, frames=[1], without=["vegetation"])
    assert both.left_out == cut.left_out + np.count_nonzero(walls_from(BESIDE_Y_M)[1] == 70)


def test_without_nothing_nothing_changes(drive):
    ends = drive[0].points[::37].astype(float) * 1.2
    for numbers in ((), (1,)):
        labelled = labelled_scene(drive, 0, frames=numbers, without=())
        scene = registered_scene(drive, drive[0], numbers)
        sight = labelled.sight([0.5, 0, 0], ends)
        assert same_answers(sight, scene.sight([0.5, 0, 0], ends))
        np.testing.assert_array_equal(labelled.targets, drive[0].points)
        assert (labelled.left_out, labelled.without) == (0, ())
    alone = Scene.from_scan(drive[0].points).sight([0.5, 0, 0], ends)
    assert same_answers(labelled_scene(drive, 0).sight([0.5, 0, 0], ends), alone)


def test_the_order_of_the_returns_changes_nothing(drive, tmp_path, rng):
    order = rng.permutation(len(drive[0].points))
    other = open_drive(write_walls(tmp_path / "shuffled", order=order))
    ends = drive[0].points[::37].astype(float) * 1.2
    for without in ((), ("vegetation",)):
        one, two = (labelled_scene(each, 0, without=without) for each in (drive, other))
        sights = [each.sight([0.5, 0, 0], ends) for each in (one, two)]
        # Not to the bit: the spacing of the beams is estimated from some of the returns.
        np.testing.assert_array_equal(sights[0].state, sights[1].state)
        assert one.left_out == two.left_out
        assert one.blocker_classes(sights[0]).tolist() == two.blocker_classes(sights[1]).tolist()


def test_the_beams_are_those_of_the_whole_scan(tmp_path):
    """Where 40 returns are left, the spacing cannot be told from them."""
    points, _ = walls_from(0.0)
    folder = tmp_path / "few"
    folder.mkdir()
    np.column_stack([points, points[:, 0]]).astype("<f4").tofile(folder / "000000.bin")
    labels = np.full(len(points), 70, "<u4")
    labels[:: len(points) // 39] = 50
    labels.tofile(folder / "000000.label")
    cut = labelled_scene(open_drive(folder), 0, without=["vegetation"]).scene
    whole = Scene.from_scan(points)
    # A column of the range image is as wide as the beams lie apart, 0.3 degrees.
    assert cut.packed_scans().columns.tolist() == whole.packed_scans().columns.tolist()
    assert whole.packed_scans().columns[0] == pytest.approx(360 / 0.3, rel=0.02)
    assert cut.sensor is None


# --- names ---


def test_labels_without_a_name_are_named_by_their_number():
    returns = ClassedReturns.of_labels(np.zeros((4, 3)), [7, 0, 70, 300])
    assert returns.names == ("unlabelled", "class 7", "vegetation", "class 300")
    assert returns.are(["class 7", "vegetation"]).tolist() == [True, False, True, False]
    assert returns.are(["unlabelled"]).tolist() == [False, True, False, False]
    own = ClassedReturns.of_labels(np.zeros((3, 3)), [1, 2, 3], {1: "tree", 2: "tree", 3: ""})
    assert own.names == ("unlabelled", "tree", "class 3")
    assert own.are(["tree"]).tolist() == [True, True, False]


def test_cars_that_do_not_move_are_parked():
    returns = ClassedReturns.of_labels(np.zeros((3, 3)), [10, 252, 70])
    assert returns.are(["parked car"]).tolist() == [True, False, False]
    assert returns.are(["car"]).tolist() == [True, False, False]
    assert returns.are(["moving-car"]).tolist() == [False, True, False]
    assert "parked vegetation" not in returns.choices
    with pytest.raises(SettingsError, match="nothing says which 'vegetation' is parked"):
        returns.are(["parked vegetation"])


def box(x, category="car", size=(4.0, 2.0, 1.5), **more):
    return Box(rigid(np.eye(3), [x, 0, 0]), np.array(size), category, **more)


def test_returns_have_the_category_of_their_box():
    # A box of 4 x 2 x 1.5 m, grown by 0.2 m but not downwards, and a small one in it.
    points = np.array(
        [[12.1, 0, 0], [12.3, 0, 0], [10, 1.1, 0], [10, 0, 0.9], [10, 0, -0.8], [9, 0, 0.0]]
    )
    boxes = [box(9.0, "person", (0.5, 0.5, 1.5)), box(10.0)]
    for order in (boxes, boxes[::-1]):
        returns = ClassedReturns.in_boxes(points, order)
        names = [returns.names[index] for index in returns.class_index]
        assert names == ["car", "unlabelled", "car", "car", "unlabelled", "person"]
    turned = Box(rigid([[0, -1, 0], [1, 0, 0], [0, 0, 1]], [10, 0, 0]), boxes[1].size_m, "car")
    assert ClassedReturns.in_boxes(points, [turned]).are(["car"]).tolist() == [
        *(False, False, True, True, False, True)
    ]


@pytest.mark.parametrize(
    ("attributes", "track", "parked"),
    [
        (("vehicle.parked",), "drives", True),
        (("vehicle.moving",), "stands", False),
        (("vehicle.stopped",), "stands", False),
        (("object_action_parked",), "", True),
        (("cycle.without_rider",), "stands", True),
        ((), "drives", False),
        ((), "", None),
        ((), "another", None),
    ],
)
def test_attributes_count_before_tracks(attributes, track, parked):
    one = box(10.0, attributes=attributes, track=track)
    assert is_parked(one, {"stands": True, "drives": False}) is parked
    returns = ClassedReturns.in_boxes(
        np.array([[10.0, 0, 0]]), [one], {"stands": True, "drives": False}
    )
    if parked is None:
        with pytest.raises(SettingsError, match="nothing says which 'car' is parked"):
            returns.are(["parked car"])
    else:
        assert returns.are(["parked car"]).tolist() == [parked]
    assert returns.are(["car"]).all()


def tracked(places_m, times_s, poses=True):
    """A drive whose scanner drives 1 m a frame past one box at these places of the world."""
    numbers = range(len(places_m))
    shift = {n: rigid(np.eye(3), [float(n), 0, 0]) for n in numbers}
    return Drive(
        root=None,
        name="tracked",
        layout="made",
        scan_paths=dict.fromkeys(numbers),
        poses=shift if poses else None,
        timestamps_ns={n: round(1e9 * time_s) for n, time_s in enumerate(times_s)},
        read_boxes=lambda n: (box(places_m[n] - n, track="a"), box(0.0)),
    )


@pytest.mark.parametrize(
    ("places_m", "times_s", "parked"),
    [
        ([20.0, 20.02, 19.99], [0, 0.1, 0.2], {"a": True}),  # annotations scatter
        ([20.0, 20.1, 20.2], [0, 0.1, 0.2], {"a": False}),  # 1 m/s
        ([20.0, 20.0, 21.5], [0, 5, 10], {"a": False}),  # waited, then left
        ([20.0, 20.4, 20.0], [0, 5, 10], {"a": True}),
        ([20.0], [0], {}),
    ],
)
def test_a_track_that_stands_is_parked(places_m, times_s, parked):
    assert parked_tracks(tracked(places_m, times_s)) == parked
    assert parked_tracks(tracked(places_m, times_s, poses=False)) == {}


# --- faults ---


def test_a_class_that_is_not_there_is_told_with_those_that_are(drive):
    with pytest.raises(SettingsError) as told:
        labelled_scene(drive, 0, without=["vegetation", "car"])
    assert str(told.value) == (
        "there is no class 'car': choose from building, unlabelled, vegetation."
    )
    with pytest.raises(ArgumentError, match="classes must be a list of names, as \\['car'\\]"):
        labelled_scene(drive, 0, without="car")
    with pytest.raises(ArgumentError):
        labelled_scene(drive, 0, without=[3])


def test_a_class_of_another_frame_is_no_fault(drive, tmp_path):
    walls_from(0.0)[1].astype("<u4").tofile(tmp_path / "walls/000000.label")
    np.full(len(walls_from(6.0)[1]), 50, "<u4").tofile(tmp_path / "walls/000001.label")
    cut = labelled_scene(drive, 0, frames=[1], without=["vegetation"])
    assert cut.left_out == np.count_nonzero(walls_from(0.0)[1] == 70)


def test_nothing_left_is_told(drive):
    with pytest.raises(SettingsError, match="no return is left without vegetation, building"):
        labelled_scene(drive, 0, without=["vegetation", "building"])


def test_labels_that_do_not_fit_are_told(drive, tmp_path):
    path = tmp_path / "walls/000000.label"
    path.write_bytes(path.read_bytes()[:-4])
    with pytest.raises(ScanError, match=r"000000\.label have .* bytes, but the .* points"):
        labelled_scene(drive, 0)
    with pytest.raises(PointsError, match="2 points need as many labels"):
        ClassedReturns.of_labels(np.zeros((2, 3)), [1, 2, 3])
    with pytest.raises(PointsError, match="2 points need as many labels, whole numbers"):
        ClassedReturns.of_labels(np.zeros((2, 3)), [1.5, 2])
    with pytest.raises(PointsError, match="labels must be from 0"):
        ClassedReturns.of_labels(np.zeros((2, 3)), [-1, 2])


def test_frames_without_classes_are_told(tmp_path):
    plain = open_drive(write_walls(tmp_path / "plain", labels=False))
    told = "frame 0 has neither labels of its points nor boxes"
    with pytest.raises(DriveError, match=told):
        labelled_scene(plain, 0, without=["vegetation"])
    labelled = labelled_scene(plain, 0)
    assert labelled.returns is None
    with pytest.raises(DriveError, match=told):
        labelled.blocker_classes(labelled.sight([0, 0, 0], [[20, 0, 0]]))
    with pytest.raises(DriveError, match=told):
        classed_returns(plain[0])
    with pytest.raises(DriveError, match="frame 7 has neither"):
        classed_returns(Frame(7, np.zeros((1, 3)), read_boxes=tuple))


def test_a_frame_without_labels_among_others_is_told(drive, tmp_path):
    (tmp_path / "walls/000001.label").unlink()
    again = open_drive(tmp_path / "walls")
    with pytest.raises(DriveError, match="frame 1 has neither labels"):
        labelled_scene(again, 0, frames=[1], without=["vegetation"])
    # Named by the frame that has labels, where nothing is left out.
    labelled = labelled_scene(again, 0, frames=[1])
    sight = labelled.sight([0, 0, 0], [[20, 0, 0]])
    assert labelled.blocker_classes(sight).tolist() == ["vegetation"]


# --- real scans ---


@pytest.mark.realdata
def test_every_occluded_line_of_a_real_scan_has_a_class(shared_data):
    drive = open_drive(shared_data / "semantickitti")
    labelled = labelled_scene(drive, 0)
    sight = labelled.sight([16, 0, 0], labelled.targets[::5])
    classes = labelled.blocker_classes(sight)
    assert ((classes != "") == sight.occluded).all()
    shares = blocker_shares(classes)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert set(shares) <= set(labelled.returns.names)
    assert all(more >= less for more, less in pairwise(shares.values()))
    assert shares["unlabelled"] < 0.1
    met = np.isfinite(sight.blocker).all(axis=1)
    distance_m, _ = cKDTree(labelled.targets).query(sight.blocker[met])
    assert np.quantile(distance_m, 0.95) < 0.5
    assert np.quantile(distance_m, 0.99) < 0.8
    cut = labelled_scene(drive, 0, without=["vegetation"])
    assert cut.left_out == 24_514  # by numpy, over the file of labels
    after = cut.sight([16, 0, 0], labelled.targets[::5])
    assert not (cut.blocker_classes(after) == "vegetation").any()
    assert after.visible[sight.visible].all()
    assert after.occluded.sum() < sight.occluded.sum()


@pytest.mark.realdata
def test_vehicles_of_argoverse_that_stand_are_parked(shared_data):
    pytest.importorskip("pyarrow", reason="pyarrow, which reads Argoverse 2, is not installed")
    drive = open_drive(next((shared_data / "av2/val").iterdir()))
    tracks = parked_tracks(drive)
    places = [
        {box.track: (frame.pose @ box.velo_from_box)[:3, 3] for box in frame.boxes}
        for frame in drive
    ]
    for track, parked in tracks.items():
        # Two sweeps 0.1 s apart: 3 cm are 0.3 m/s.
        moved_m = np.linalg.norm(places[1][track] - places[0][track])
        assert parked == (moved_m < 0.03)
    assert {*tracks.values()} == {True, False}
    cut = labelled_scene(drive, 0, without=["parked REGULAR_VEHICLE"])
    every = labelled_scene(drive, 0, without=["REGULAR_VEHICLE"])
    assert 100 < cut.left_out < every.left_out
    bollards = labelled_scene(drive, 0, without=["BOLLARD"])
    stated = sum(box.returns for box in drive[0].boxes if box.category == "BOLLARD")
    assert bollards.left_out > 0
    assert stated > 0


def test_up_stays_that_of_the_whole_scan_when_the_ground_is_left_out(tmp_path, rng):
    road = np.column_stack([rng.uniform(-12, 12, (9000, 2)), np.full(9000, -2.0)])
    wall = np.column_stack([np.full(900, 11.0), rng.uniform(-9, 9, 900), rng.uniform(-2, 3, 900)])
    s = np.sqrt(0.5)
    points = np.concatenate([road, wall]) @ np.array([[s, 0, s], [0, 1, 0], [-s, 0, s]])
    rows = np.column_stack([points, np.zeros(len(points))]).astype("<f4")
    rows.tofile(tmp_path / "000000.bin")
    np.repeat([40, 50], [9000, 900]).astype("<u4").tofile(tmp_path / "000000.label")
    cut = labelled_scene(open_drive(tmp_path), 0, without=["road"])
    assert cut.left_out == 9000
    assert cut.whole.tilt_deg == pytest.approx(45.0, abs=0.5)
    assert cut.scene.up == pytest.approx(cut.whole.up, abs=1e-12)  # normalised once more
