"""The whole method: invariants, real frames, and the errors for malformed input."""

import inspect
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import intervis
from intervis import Camera, PointsError, PoseError, Settings, SettingsError, analyze
from intervis.errors import CameraError, IntervisError
from intervis.method import analysis as analysis_module
from intervis.method.mesh import build_mesh
from intervis.method.sampling import sample_kernels, sample_radius, sample_stride
from intervis.method.surface import whitening

CAM_FROM_VELO = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
CAMERA = Camera(np.array([[700.0, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]]), 1242, 375)


def street(seed, n=1500):
    """Ground, two facades and a few boxes, in front of the sensor."""
    rng = np.random.default_rng(seed)
    along, across = rng.uniform(4, 60, n), rng.uniform(-9, 9, n)
    ground = np.column_stack([along, across, np.full(n, -1.7) + rng.normal(0, 0.02, n)])
    facade = np.column_stack(
        [along, np.sign(across) * 10 + rng.normal(0, 0.02, n), rng.uniform(-1.7, 4, n)]
    )
    return np.vstack([ground, facade])


def rotated(points, angle_rad, shift):
    return Rotation.from_euler("z", angle_rad).apply(points) + shift


@settings(max_examples=25)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(-3, 3),
    st.sampled_from(["ground", "euclidean", "mahalanobis"]),
    st.sampled_from(["elevation", "sight_angle"]),
)
def test_a_rigid_motion_of_points_and_viewpoint_changes_nothing(seed, angle_rad, metric, criterion):
    points, viewpoint, shift = street(seed), np.array([0.3, 0.1, 0.0]), np.array([4.0, -7.0, 2.5])
    chosen = Settings(view="circle", tau=20, metric=metric, criterion=criterion)
    here = analyze(points, viewpoint=viewpoint, settings=chosen)
    there = analyze(
        rotated(points, angle_rad, shift),
        viewpoint=rotated(viewpoint, angle_rad, shift),
        settings=chosen,
    )
    assert there.nodes.tolist() == here.nodes.tolist()
    assert there.edges.tolist() == here.edges.tolist()
    assert there.node_intervisible.tolist() == here.node_intervisible.tolist()
    assert there.edge_intervisible.tolist() == here.edge_intervisible.tolist()
    assert there.measures == here.measures
    assert there.cut == pytest.approx(here.cut)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_the_order_of_the_scan_changes_nothing(seed):
    points = street(seed)
    shuffle = np.random.default_rng(seed).permutation(len(points))
    here = analyze(points, settings=Settings(tau=20))
    there = analyze(points[shuffle], settings=Settings(tau=20))
    assert sorted(shuffle[there.nodes].tolist()) == here.nodes.tolist()
    assert there.measures == here.measures
    own = {frozenset(here.nodes[e].tolist()) for e in here.edges[here.edge_intervisible]}
    again = {
        frozenset(shuffle[there.nodes][e].tolist()) for e in there.edges[there.edge_intervisible]
    }
    assert again == own


def test_invariants_of_a_result():
    result = analyze(street(0), camera=CAMERA, cam_from_velo=CAM_FROM_VELO)
    measures = result.measures
    assert measures.n == len(result.nodes) == -(-measures.n_fov // 35)
    assert measures.SP == measures.N + measures.n - 1
    assert np.isin(result.nodes, result.in_view).all()
    assert np.allclose(result.node_points, street(0)[result.nodes])
    assert 0 < measures.TPI_unique <= 100
    assert result.node_intervisible[result.edges[result.edge_intervisible]].all()
    assert result.node_intervisible[result.triangles[result.region]].all()
    in_tree = result.tree_parent >= -1
    assert result.node_intervisible[in_tree].all()
    assert in_tree[result.tree_parent[result.tree_parent >= 0]].all()
    assert np.allclose(result.laplacian.sum(axis=1), 0)
    assert result.times.total == pytest.approx(
        sum(seconds for stage, seconds in result.times.items() if stage != "total")
    )
    assert 0 < result.fiedler_cut()


def test_the_viewpoint_is_the_camera_by_default():
    points = street(0)
    baseline_term = np.array([[0, 0, 0, -350.0], [0, 0, 0, 0], [0, 0, 0, 0]])
    shifted = Camera(CAMERA.projection + baseline_term, 1242, 375)
    # P[0, 3] = -F B with B = 0.5 m: the camera is half a metre to the right of the sensor.
    result = analyze(points, camera=shifted, cam_from_velo=CAM_FROM_VELO)
    assert np.allclose(result.viewpoint, [0, -0.5, 0])
    assert analyze(points).viewpoint.tolist() == [0, 0, 0]
    assert analyze(points, viewpoint=(5, 0, 1)).viewpoint.tolist() == [5, 0, 1]


SAMPLERS = {
    "kernel": lambda points, p0: sample_kernels(points, 35, p0),
    "stride": lambda points, p0: sample_stride(len(points), 35),
    "radius": lambda points, p0: sample_radius(points, 2.0, p0),
}


@pytest.mark.parametrize("chart", ["ground", "polar", "angles"])
@pytest.mark.parametrize("sampling", ["kernel", "stride", "radius"])
@pytest.mark.parametrize("metric", ["mahalanobis", "normalized", "euclidean", "ground"])
def test_every_setting_reaches_its_stage(chart, sampling, metric):
    points, p0 = street(1), np.array([1.0, 0.5, 0.2])
    chosen = Settings(chart=chart, sampling=sampling, metric=metric, radius_m=2.0, gate="none")
    free = analyze(points, viewpoint=p0, settings=chosen)
    assert free.nodes.tolist() == SAMPLERS[sampling](points, p0).tolist()
    whitened = points[free.nodes] @ whitening(points[free.nodes], metric)[0]
    length = np.linalg.norm(whitened[free.edges[:, 0]] - whitened[free.edges[:, 1]], axis=1)
    assert np.allclose(free.edge_length, length)
    azimuth_rad = np.arctan2(*(points[free.nodes] - p0)[:, 1::-1].T)
    on_ground = chart == "ground"
    assert np.allclose(
        np.arctan2(*free.chart[:, ::-1].T) if on_ground else free.chart[:, 0], azimuth_rad
    )
    assert free.edges.tolist() == build_mesh(free.chart).edges.tolist()
    assert free.edge_intervisible.any()
    for gate in ("degree", "mean", "shortest", "star_minimum"):
        gated = analyze(points, viewpoint=p0, settings=chosen.with_changes(gate=gate))
        assert not (gated.edge_intervisible & ~free.edge_intervisible).any()
        # No edge is shorter than the shortest of its star; every other gate lets some pass.
        assert gated.edge_intervisible.any() == (gate != "shortest")


def test_weights_reach_the_laplacian_and_the_cut():
    # A right triangle with sides 3, 4 and 5 over the ground. By elevation only the first two nodes
    # see each other: the second is beyond the first and higher, the third is the lowest, and at
    # the second the angle theta_1 between P0 and the third is 90 degrees, where no line applies.
    points = np.array([[10.0, 0, -1], [13, 0, 0], [13, 4, -2]])
    plain = Settings(tau=1, gate="none", criterion="elevation")
    by_length = analyze(points, settings=plain)
    assert by_length.edges.tolist() == [[0, 1], [0, 2], [1, 2]]
    assert by_length.node_intervisible.tolist() == [True, True, False]
    assert by_length.laplacian.toarray().tolist() == [[8, -3, -5], [-3, 7, -4], [-5, -4, 9]]
    assert by_length.cut == (5 + 4) / 2
    by_unit = analyze(points, settings=plain.with_changes(weights="unit"))
    assert by_unit.edge_length.tolist() == [3, 5, 4]
    assert by_unit.laplacian.toarray().tolist() == [[2, -1, -1], [-1, 2, -1], [-1, -1, 2]]
    assert by_unit.cut == (1 + 1) / 2
    # The unit triangle's normalised Laplacian is 3/2 I - 1/2 (all ones): eigenvalues 0, 3/2, 3/2.
    spectrum = np.linalg.eigvalsh(by_unit.normalized_laplacian.toarray())
    assert np.allclose(spectrum, [0, 1.5, 1.5])
    assert not np.allclose(np.linalg.eigvalsh(by_length.normalized_laplacian.toarray()), spectrum)


def test_inputs_are_not_changed():
    points, viewpoint, pose = street(0).astype(np.float32), np.zeros(3), CAM_FROM_VELO.copy()
    copies = points.copy(), viewpoint.copy(), pose.copy()
    points.setflags(write=False)
    analyze(points, camera=CAMERA, cam_from_velo=pose, viewpoint=viewpoint)
    for now, before in zip((points, viewpoint, pose), copies, strict=True):
        assert np.array_equal(now, before)


def test_views_of_an_array_and_both_float_types_agree():
    scan = np.column_stack([street(0), np.ones(3000)]).astype(np.float32)
    plain = analyze(scan[:, :3].copy())
    for other in (scan, np.asfortranarray(scan), scan[:, :3].astype(np.float64), scan.tolist()):
        assert (
            analyze(np.asarray(other, dtype=getattr(other, "dtype", np.float64))).measures
            == plain.measures
        )


def test_points_that_are_not_finite_are_counted_and_keep_the_indices():
    points = street(0)
    holes = np.insert(
        points, [0, 100, 200], [[np.nan, 0, 0], [0, np.inf, 0], [5, 5, -np.inf]], axis=0
    )
    result = analyze(holes)
    assert (result.measures.n_dropped, result.measures.n_raw) == (3, 3000)
    assert np.allclose(holes[result.nodes], result.node_points)
    assert result.measures.TPI == analyze(points).measures.TPI


@pytest.mark.parametrize(
    "points",
    [
        np.array([[10.0, 0, -1]]),
        np.array([[10.0, 0, -1], [12, 0, -1]]),
        np.array([[10.0, 0, -1], [12, 0, -1], [11, 1, -1]]),
        np.column_stack([np.arange(5.0, 50), np.zeros(45), np.zeros(45)]),
        np.tile([[10.0, 1, -1]], (50, 1)),
        np.tile([[1.0, 0, 0]], (4, 1)),
    ],
    ids=["one", "two", "three", "collinear", "all equal", "all at the viewpoint"],
)
@pytest.mark.parametrize("tau", [1, 35])
def test_few_or_degenerate_points_give_a_small_result(points, tau):
    for chart, metric in itertools.product(
        ["ground", "angles", "polar"], ["ground", "mahalanobis"]
    ):
        chosen = Settings(tau=tau, chart=chart, metric=metric)
        result = analyze(points, viewpoint=(1, 0, 0), settings=chosen)
        assert result.measures.n == -(-len(points) // tau)
        assert 0 <= result.measures.TPI <= 100
        assert len(result.region) == len(result.triangles)
        result.fiedler_cut()


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        (np.zeros((5, 3), np.int64), "must be float32 or float64 metres, got int64"),
        (np.zeros((5, 2)), r"must have the shape \(N, 3\) or \(N, 4\), got \(5, 2\)"),
        (np.zeros(5), r"got \(5,\)"),
        (np.zeros((5, 3), complex), "complex128"),
        ([["a", "b", "c"]], "float32 or float64"),
        (np.empty((0, 3)), "no return is in view"),
        (np.full((5, 3), np.nan), "0 are returns"),
    ],
)
def test_malformed_points_get_a_clear_message(points, sentence):
    with pytest.raises(PointsError, match=sentence):
        analyze(points)


def test_all_points_behind_the_camera():
    with pytest.raises(PointsError, match="no return is in view of the camera"):
        analyze(street(0) * [-1, 1, 1], camera=CAMERA, cam_from_velo=CAM_FROM_VELO)


@pytest.mark.parametrize(
    "viewpoint", [(1, 2), (1, 2, np.nan), "abc", (1, 2, np.inf), np.zeros((1, 3))]
)
def test_malformed_viewpoints(viewpoint):
    with pytest.raises(PointsError, match="viewpoint must be three"):
        analyze(street(0), viewpoint=viewpoint)


def test_malformed_cameras_and_extrinsics():
    with pytest.raises(CameraError, match="needs its extrinsics"):
        analyze(street(0), camera=CAMERA)
    with pytest.raises(CameraError, match="without a camera"):
        analyze(street(0), cam_from_velo=CAM_FROM_VELO)
    for extrinsics in (np.eye(3), np.diag([1.0, 1, -1, 1]), np.eye(4) * 2, np.full((4, 4), np.nan)):
        with pytest.raises(PoseError, match="cam_from_velo"):
            analyze(street(0), camera=CAMERA, cam_from_velo=extrinsics)
    with pytest.raises(CameraError):
        Camera(np.eye(3), 10, 10)
    with pytest.raises(CameraError):
        Camera(CAMERA.projection, 0, 10)
    with pytest.raises(CameraError):
        Camera(np.zeros((3, 4)), 10, 10)


@pytest.mark.parametrize("tau", [0, -3, 2.5, "many", None, 2**31, 2**63 - 1])
def test_impossible_tau(tau):
    with pytest.raises(SettingsError, match="tau"):
        Settings(tau=tau)


def test_a_tau_too_long_to_print_gets_a_clear_message():
    with pytest.raises(SettingsError, match="'tau' must be at most 2147483647"):
        Settings(tau=10**5000)


def test_the_greatest_tau_gives_one_node():
    result = analyze(street(0), settings=Settings(tau=2**31 - 1))
    assert (result.measures.n, result.measures.SP, result.measures.TPI) == (1, 0, 0.0)


def test_repr_and_signature_are_short():
    result = analyze(street(0), settings=Settings(tau=20))
    m = result.measures
    assert repr(result) == (
        f"<Analysis: {m.n} nodes, {m.SP} edges, {m.N} triangles, TPI {m.TPI:.1f} %>"
    )
    assert str(inspect.signature(analyze)).startswith("(points: 'ArrayLike', *, camera:")


def test_unknown_settings_name_the_nearest():
    with pytest.raises(SettingsError, match="did you mean 'criterion'"):
        Settings(criterium="elevation")


def test_every_error_has_one_root_and_a_public_name():
    defined = {
        name: error
        for name, error in vars(intervis.errors).items()
        if isinstance(error, type) and issubclass(error, BaseException)
    }
    assert len(defined) > 10
    for name, error in defined.items():
        assert issubclass(error, IntervisError)
        assert getattr(intervis, name) is error


def test_settings_survive_a_file(tmp_path):
    chosen = Settings(tau=7, influence_radius=3.5, criterion="elevation")
    path = tmp_path / "settings.toml"
    path.write_text(chosen.to_toml(), encoding="utf-8")
    assert Settings.from_toml(path) == chosen
    path.write_text("tau = 5\ncriterium = 1\n", encoding="utf-8")
    with pytest.raises(SettingsError, match="did you mean"):
        Settings.from_toml(path)
    path.write_text("tau = = 5", encoding="utf-8")
    with pytest.raises(SettingsError, match="not valid TOML"):
        Settings.from_toml(path)
    with pytest.raises(SettingsError, match="cannot read"):
        Settings.from_toml(tmp_path / "nowhere.toml")
    with pytest.raises(SettingsError, match="did you mean"):
        chosen.with_changes(taw=3)


@pytest.mark.realdata
@pytest.mark.parametrize("tau", [10, 35, 100])
def test_real_frames(shared_data, tau):
    """N, SP and ARR are exact functions of n; TPI stays under its ceiling."""
    drive = intervis.open_drive(shared_data / "kitti_object")
    for frame in drive:
        result = analyze(
            frame.points,
            camera=frame.camera,
            cam_from_velo=frame.cam_from_velo,
            settings=Settings(tau=tau),
        )
        measures = result.measures
        assert measures.n == -(-measures.n_fov // tau)
        assert measures.SP == measures.N + measures.n - 1
        assert 15 < measures.TPI < 100 * measures.SP / (3 * measures.N)
        assert np.array_equal(result.node_points, frame.points[result.nodes].astype(np.float64))


def test_stage_times_are_the_seconds_between_laps(monkeypatch):
    times_s = iter([10.0, 12.0, 12.5, 16.5, 17.5, 17.75])
    monkeypatch.setattr(analysis_module, "perf_counter", lambda: next(times_s))
    clock = analysis_module.Clock()
    for stage in ("fov", "sampling", "S1", "S2", "S3"):
        clock.lap(stage)
    expected = {"fov": 2.0, "sampling": 0.5, "S1": 4.0, "S2": 1.0, "S3": 0.25, "total": 7.75}
    assert dict(clock.times()) == expected


def test_returns_that_are_no_nodes_occlude_nodes():
    """A wall 10 m away, whose every other return is a node, and a post 5 m away before one."""
    y = np.arange(-10.0, 10.5, 0.5)
    wall = np.column_stack([10.0 + 0.3 * (np.arange(len(y)) // 2 % 2), y, np.zeros(len(y))])
    behind = 20  # the node at y = 0
    scan = wall.copy()
    scan[behind + 1] = [5.0, 0.0, 0.0]
    chosen = Settings(sampling="stride", tau=2, gate="none", criterion="sight_line")
    plain, occluded = (analyze(points, settings=chosen) for points in (wall, scan))
    assert plain.nodes.tolist() == occluded.nodes.tolist() == list(range(0, len(y), 2))
    node = behind // 2
    assert plain.node_intervisible[node]
    assert not occluded.node_intervisible[node]
    assert occluded.node_intervisible[[0, 1, -2, -1]].all()
