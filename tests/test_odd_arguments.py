"""Odd arguments of public calls, one of each kind that was once a raw error (`make fuzz-calls`)."""

import warnings

import numpy as np
import pytest

import intervis
from intervis import uses
from intervis.arguments import path_of, shown
from intervis.arrays import array_of, numbers_of
from intervis.errors import (
    ArgumentError,
    CameraError,
    DriveError,
    IntervisError,
    OutputError,
    PointsError,
    PoseError,
    SceneError,
    SettingsError,
)
from intervis.method.neighbours import nearest_neighbours
from intervis.sight import sensor_named, sensor_of_scan
from intervis.uses.voxels.camera_voxels import PosedCamera

Y, Z = np.meshgrid(np.arange(-5, 5, 0.1), np.arange(-1.5, 1.5, 0.1))
WALL = np.stack([np.full(Y.size, 10.0), Y.ravel(), Z.ravel()], axis=1)
SCENE = intervis.Scene.from_scan(WALL)
ROUTE = uses.Route.through([[0, 0, 0], [9, 0, 0]])
GRID = uses.VoxelGrid([0, -2, -1], 1.0, (4, 4, 2))
FAR = np.array([1e308, 0.0, 0.0])


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: intervis.analyze(WALL, settings="tau"), ArgumentError, "settings must be a Set"),
        (lambda: intervis.analyze(WALL, tau_for=5), ArgumentError, "tau_for must be a function"),
        (lambda: intervis.analyze(WALL, viewpoint=FAR), PointsError, "viewpoint must be within 1e"),
        (lambda: intervis.analyze(1e300 * WALL), PointsError, "no return is in view"),
        (lambda: intervis.Settings.from_toml(3), ArgumentError, "path must be a text or a Path"),
        (lambda: intervis.Settings(tau=np.eye(3)), SettingsError, "setting 'tau'"),
        (lambda: intervis.Camera(np.full((3, 4), "x"), 9, 9), CameraError, "matrix of numbers"),
        (lambda: sensor_named(None), ArgumentError, "the name of a sensor must be a str"),
        (lambda: sensor_of_scan("x"), PointsError, r"points_velo must have the shape \(N, 3\)"),
        (lambda: intervis.open_drive(3), DriveError, "path of a drive must be a text or a Path"),
        (lambda: intervis.open_drive("a\nb"), DriveError, r"is no path: 'a\\nb'"),
        (lambda: intervis.open_drive("9" * 5000), DriveError, "is no path: '999"),
        (lambda: intervis.open_drive(".", camera=2), DriveError, "a camera must be a name or"),
        (lambda: intervis.Frame(0, "x"), PointsError, r"points must have the shape \(N, 3\)"),
        (lambda: intervis.Frame(0.5, WALL), ArgumentError, "number must be whole numbers"),
        (
            lambda: intervis.Frame(0, WALL, {"time": np.zeros(3)}),
            PointsError,
            "3000 points need as many values of 'time'",
        ),
        (lambda: SCENE.ground_height([["a", "b"]]), PointsError, "xy must be numbers, got"),
        (lambda: SCENE.sight_boxes(FAR, [np.eye(4)], [[1, 1, 1]]), PointsError, "within 1e"),
        (lambda: SCENE.sight_boxes([0, 0, 0], [np.eye(4)], "x"), PointsError, "size_m must be num"),
        (lambda: SCENE.sight_boxes([0, 0, 0], np.eye(4), [[1, 1, 1]]), PoseError, "the shape"),
        (lambda: SCENE.sight_within([FAR], [[0, 0, 0]], 9.0), PointsError, "within 1e"),
        (lambda: SCENE.packed_scans(1e308), SceneError, "moment_s needs the time"),
        (lambda: SCENE.add(WALL, np.eye(4) + np.diag(FAR, 1)[:4, :4]), PoseError, "rigid motion"),
        (lambda: SCENE.add(WALL, None, 1e308), SettingsError, "timestamp_s must be at most 1e"),
        (lambda: SCENE.sight([0, 0, 0], WALL)["x"], IndexError, "a Sight of 3000 lines has none"),
        (lambda: intervis.explain(None, [0, 0, 0], [1, 0, 0]), ArgumentError, "scene must be a S"),
        (lambda: nearest_neighbours(WALL * np.nan, 4), PointsError, "points must be finite"),
        (lambda: uses.Agent("a", {"x": np.eye(4)}), ArgumentError, "frames of an agent"),
        (lambda: uses.Agent("a", {0: np.eye(4)}).pose_at([]), ArgumentError, "frame must be whole"),
        (lambda: uses.Agent("a", np.eye(4), body=3), PointsError, "has no volume"),
        (lambda: uses.mutual_sight(SCENE, None, [0]), ArgumentError, "agents must be a list"),
        (lambda: uses.blind_spots("x"), ArgumentError, "grid must be a VisibilityGrid, got 'x'"),
        (lambda: uses.objects_of_frame(None, SCENE, [0, 0, 0]), ArgumentError, "frame must be a F"),
        (lambda: uses.save_answers(None, [0, 0, 0], WALL, 1), ArgumentError, "path must be a text"),
        (
            lambda: uses.save_answers("a.csv", [0, 0, 0], WALL, SCENE.sight([0, 0, 0], WALL[:2])),
            PointsError,
            "3000 targets need as many answers",
        ),
        (
            lambda: uses.save_answers("a.txt", [0, 0, 0], WALL, SCENE.sight([0, 0, 0], WALL)),
            OutputError,
            "the answers are written as",
        ),
        (lambda: uses.Route("x", "x", "x", "x"), PointsError, "a route's points must be numbers"),
        (lambda: ROUTE.at("x"), PointsError, "chainage_m must be numbers"),
        (lambda: ROUTE.locate([1, 2, 3]), PointsError, r"xy must have the shape \(M, 2\)"),
        (lambda: ROUTE.with_heights(1.0), PointsError, "2 places need as many heights"),
        (
            lambda: uses.Route.through([[0, 0, 0], [9, 0, 0]], time_s=[0, 5e-324]),
            PointsError,
            "times of a route are too close",
        ),
        (lambda: uses.read_route(None), ArgumentError, "path must be a text or a Path"),
        (lambda: uses.route_of_drive("x"), ArgumentError, "drive must be a Drive"),
        (lambda: uses.targets_along(SCENE, ROUTE, "ab", WALL), ArgumentError, "names must be a l"),
        (lambda: uses.zones_along(SCENE, None, []), ArgumentError, "route must be a Route"),
        (lambda: uses.zones_along(SCENE, ROUTE, [], at_pose_times=1), ArgumentError, "True or F"),
        (lambda: uses.AASHTO.stopping_m("x"), PointsError, "speed_mps must be numbers"),
        (lambda: uses.AASHTO.stopping_m([1, 2], [1, 2, 3]), PointsError, "do not fit together"),
        (lambda: uses.AASHTO.changed(eye_m="x"), PointsError, "eye heights must be numbers"),
        (lambda: uses.sight_distances(SCENE, ROUTE, None), ArgumentError, "standard must be a Si"),
        (lambda: uses.survey_of(None, ROUTE), ArgumentError, "drive must be a Drive"),
        (lambda: uses.route_on_road(None, ROUTE), ArgumentError, "survey must be a Survey"),
        (lambda: uses.Zone("z", "x"), PointsError, "the corners of zone 'z' must be numbers"),
        (lambda: uses.visibility_grid(SCENE, FAR, WALL), PointsError, "viewpoint must be within"),
        (
            lambda: uses.visibility_grid(SCENE, [0, 0, 0], WALL, height_m=1e6),
            SettingsError,
            "height_m must be at most 1000 m",
        ),
        (lambda: uses.bev_grid(None), ArgumentError, "scans must be a list"),
        (lambda: uses.bev_grid([3]), PointsError, "each scan must be a pair"),
        (lambda: uses.VoxelGrid([0, 0, 0], 1, (1, 1, 10**400)), SettingsError, "has at most 40"),
        (lambda: GRID.index_of("x"), PointsError, "points must be numbers"),
        (lambda: uses.Carver(None), ArgumentError, "grid must be a VoxelGrid, got None"),
        (lambda: uses.Carver(GRID, lift_m=np.zeros(3)), PointsError, "lift_m must have the shape"),
        (lambda: uses.MaskSettings(GRID, classes={"x": 1}), SettingsError, "whole numbers from 0"),
        (lambda: uses.frame_masks(None, 0, None), ArgumentError, "drive must be a Drive"),
        (lambda: uses.PosedScan(WALL, np.eye(4), labels=[1]), PointsError, "as many labels"),
        (lambda: uses.masks_of(GRID, []), SceneError, "masks need a scan of the frame itself"),
        (lambda: intervis.warm_up(progress=3), ArgumentError, "progress must be a function"),
        (lambda: PosedCamera(None, np.eye(4)), ArgumentError, "camera must be a Camera"),
    ],
)
def test_an_odd_argument_is_refused_in_one_sentence(call, error, message):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(error, match=message) as refusal:
            call()
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 400
    assert isinstance(refusal.value, IntervisError | IndexError)


def test_a_far_return_is_no_return():
    """It changes nothing, and overflows nowhere."""
    with_far = np.vstack([WALL, [[1e300, 1e300, -1e300], FAR]])
    assert sensor_of_scan(with_far) == sensor_of_scan(WALL)
    one, other = (intervis.Scene.from_scan(points) for points in (WALL, with_far))
    targets = np.array([[9.0, 1, 0], [30, 1, 0]])
    assert (
        one.sight([0, 0, 0], targets).probability.tolist()
        == other.sight([0, 0, 0], targets).probability.tolist()
    )


def test_far_places_have_no_ground_and_no_place_on_a_route():
    assert np.isnan(SCENE.ground_height([[1e308, 0.0]])).all()
    assert np.isnan(ROUTE.locate([[1e308, 0.0]])).all()
    assert not GRID.index_of([[1e308, np.nan, 0.0]])[1].any()


def test_masked_entries_are_no_values():
    masked = np.ma.masked_array([1.0, 2.0], [False, True])
    assert np.isnan(array_of(masked, "x")).tolist() == [False, True]
    with pytest.raises(PointsError, match="x has masked entries"):
        numbers_of(np.ma.masked_array([1, 2], [False, True]), "x")
    assert numbers_of(np.ma.masked_array([1, 2], [False, False]), "x").tolist() == [1.0, 2.0]


def test_other_layouts_of_the_same_numbers_have_the_same_answer():
    expected = SCENE.sight([0, 0, 0], WALL).probability
    read_only = WALL.copy()
    read_only.setflags(write=False)
    for same in (read_only, np.asfortranarray(WALL), np.repeat(WALL, 2, axis=0)[::2]):
        assert np.array_equal(SCENE.sight([0, 0, 0], same).probability, expected)


class Silent:
    def __repr__(self):
        raise RuntimeError


def test_what_a_message_shows_is_short_and_has_one_line():
    assert shown(np.eye(3)).startswith("array([[1., 0., 0.], [0., 1., 0.]")
    assert shown(10**5000) == "a int"
    assert shown(Silent()) == "a Silent"
    assert len(shown("x" * 1000)) < 100


@pytest.mark.parametrize("path", [b"bytes", None, "a\0b", "a\rb"])
def test_what_is_no_path_is_refused(path):
    with pytest.raises(ArgumentError, match=r"^out "):
        path_of(path, "out")
