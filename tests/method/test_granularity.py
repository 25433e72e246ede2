"""tau chosen from the data: within the tolerance, within the budget, with hysteresis."""

import itertools
from math import ceil

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import intervis
from intervis import Settings, analyze
from intervis.errors import SettingsError
from intervis.method import granularity
from intervis.method.granularity import (
    BUDGET_SHARE,
    TAU_CANDIDATES,
    TPI_LOST,
    TauHysteresis,
    choose_tau,
    floor_nodes,
    machine_speed_factor,
    predicted_ms,
)

tolerances = st.floats(0.1, 25.0)
returns_in_view = st.integers(1, 300_000)


def test_candidates_ascend_by_about_a_fifth_and_the_measured_loss_decreases():
    for below, above in itertools.pairwise(TAU_CANDIDATES):
        assert below < above <= below * 1.25 + 1
    lost = [points for _, points in TPI_LOST]
    assert lost == sorted(lost, reverse=True)


@given(tolerances, tolerances)
def test_a_stricter_tolerance_never_has_a_lower_floor(one, other):
    strict, loose = sorted((one, other))
    assert floor_nodes(strict) >= floor_nodes(loose)


def test_the_floor_follows_the_measured_curve():
    for nodes, lost in TPI_LOST:
        assert floor_nodes(lost) == nodes
    # Linear in the logarithm of the nodes: half way between two losses is the geometric mean.
    for (few, more_lost), (many, less_lost) in itertools.pairwise(TPI_LOST):
        assert floor_nodes((more_lost + less_lost) / 2) == ceil((few * many) ** 0.5)
    assert (floor_nodes(50.0), floor_nodes(1e-9)) == (TPI_LOST[0][0], TPI_LOST[-1][0])


@given(returns_in_view, tolerances)
def test_the_floor_is_kept_and_the_next_step_would_break_it(n_fov, tolerance):
    floor = floor_nodes(tolerance)
    tau = choose_tau(n_fov, Settings(tau="auto", tpi_tolerance=tolerance))
    assert tau == 1 or ceil(n_fov / tau) >= floor
    coarser = [step for step in TAU_CANDIDATES if step > tau]
    assert not coarser or ceil(n_fov / coarser[0]) < floor


@given(returns_in_view, tolerances, st.floats(1.0, 500.0), st.floats(0.2, 5.0))
def test_a_budget_is_met_or_the_floor_says_why_not(n_fov, tolerance, budget_ms, speed_factor):
    asked = Settings(tau="auto", tpi_tolerance=tolerance, time_budget_ms=budget_ms)
    tau = choose_tau(n_fov, asked, speed_factor=speed_factor)
    coarsest = choose_tau(n_fov, asked.with_changes(time_budget_ms=None))
    assert tau <= coarsest
    assert predicted_ms(n_fov, tau, speed_factor) <= budget_ms or tau == coarsest
    if tau > 1 and tau != coarsest:  # and it is the finest that meets it
        finer = max(step for step in TAU_CANDIDATES if step < tau)
        assert predicted_ms(n_fov, finer, speed_factor) > BUDGET_SHARE * budget_ms


@given(st.integers(2_000, 60_000), st.lists(st.floats(0.92, 1.08), min_size=1, max_size=20))
def test_tau_is_kept_while_the_returns_in_view_vary_by_8_percent(n_fov, wobble):
    hysteresis = TauHysteresis(Settings(tau="auto", tpi_tolerance=6.0))
    first = hysteresis.choose(n_fov)
    assert {hysteresis.choose(int(n_fov * share)) for share in wobble} == {first}


@given(st.lists(returns_in_view, min_size=1, max_size=20), tolerances)
def test_hysteresis_never_breaks_the_floor(counts, tolerance):
    hysteresis = TauHysteresis(Settings(tau="auto", tpi_tolerance=tolerance))
    for n_fov in counts:
        tau = hysteresis.choose(n_fov)
        assert tau == 1 or ceil(n_fov / tau) >= floor_nodes(tolerance)


def test_hysteresis_refuses_a_fixed_tau():
    with pytest.raises(SettingsError, match="auto"):
        TauHysteresis(Settings(tau=35))


def test_analyze_takes_the_granularity_that_is_chosen(rng):
    ground = np.column_stack([rng.uniform(5, 40, (6000, 2)), rng.normal(-1.7, 0.02, 6000)])
    settings = Settings(tau="auto", tpi_tolerance=10.0)
    result = analyze(ground, settings=settings)
    assert result.measures.n == ceil(6000 / choose_tau(6000, settings))
    assert result.settings.tau == "auto"


def test_the_speed_factor_of_this_machine_is_a_positive_number():
    assert 0 < machine_speed_factor() < 1000


@pytest.mark.realdata
@pytest.mark.parametrize("tolerance", [3.0, 6.0])
def test_the_tolerance_is_kept_in_the_mean_of_real_frames(shared_data, tolerance):
    drive = intervis.open_drive(shared_data / "kitti_object")
    lost = []
    for frame in drive:
        where = {"camera": frame.camera, "cam_from_velo": frame.cam_from_velo}

        def tpi(tau, frame=frame, where=where):
            settings = Settings(tau=tau, tpi_tolerance=tolerance)
            return analyze(frame.points, settings=settings, **where).measures.TPI

        lost.append(max(map(tpi, (4, 6, 8, 10))) - tpi("auto"))
    assert np.mean(lost) <= tolerance


def test_hysteresis_uses_the_speed_factor_it_is_given():
    """On a machine ten times as slow the same budget allows fewer nodes."""
    settings = Settings(tau="auto", tpi_tolerance=20.0, time_budget_ms=40.0)
    fast, slow = (
        TauHysteresis(settings).choose(20_000, speed_factor=factor) for factor in (0.2, 10.0)
    )
    assert fast < slow
    assert fast == choose_tau(20_000, settings, speed_factor=0.2)


@given(st.lists(returns_in_view, min_size=1, max_size=20), st.floats(2.0, 200.0))
@example([11_028, 9_589], 2.0)
def test_with_a_budget_no_frame_is_predicted_to_take_longer_unless_the_floor_demands_it(
    counts, budget_ms
):
    settings = Settings(tau="auto", tpi_tolerance=6.0, time_budget_ms=budget_ms)
    hysteresis = TauHysteresis(settings)
    for n_fov in counts:
        tau = hysteresis.choose(n_fov, speed_factor=1.0)
        within = predicted_ms(n_fov, tau, 1.0) <= BUDGET_SHARE * budget_ms
        # A coarser one may be kept that the floor allows, but not with the margin for a new choice.
        assert within or tau >= choose_tau(int(n_fov / 1.15), settings, speed_factor=1e9)
        assert -(-n_fov // tau) >= floor_nodes(6.0) or tau == 1


@pytest.mark.parametrize("slower", [0.3, 1.0, 3.0])
def test_the_budget_is_kept_on_a_machine_whose_speed_was_measured_wrongly(slower):
    """Frames take `slower` times what is predicted; two frames are enough to learn it."""
    hysteresis = TauHysteresis(Settings(tau="auto", tpi_tolerance=50.0, time_budget_ms=25.0))
    chosen = []
    for frame in range(12):
        tau = hysteresis.choose(20_000, speed_factor=1.0)
        taken_ms = slower * predicted_ms(20_000, tau, 1.0)
        if frame == 5:
            taken_ms *= 20.0  # held up by chance: it alone changes nothing
        elif frame > 0:
            assert taken_ms <= 25.0
        hysteresis.learn(20_000, tau, taken_ms, speed_factor=1.0)
        chosen.append(tau)
    # the finest that is within the budget, as if the speed had been known
    known = choose_tau(20_000, hysteresis.settings, speed_factor=slower)
    assert set(chosen[2:]) == {known}


def test_a_granularity_finer_than_the_budget_allows_is_not_kept():
    hysteresis = TauHysteresis(Settings(tau="auto", time_budget_ms=30.0))
    kept = [hysteresis._keeps(tau, 100_000, 8) for tau in (5, 7, 8, 12, 13)]
    assert kept == [False, False, True, True, False]


def test_without_a_budget_times_change_nothing():
    hysteresis = TauHysteresis(Settings(tau="auto", tpi_tolerance=6.0))
    first = hysteresis.choose(20_000)
    hysteresis.learn(20_000, first, 1e6)
    assert hysteresis.choose(20_000) == first
    hysteresis.learn(20_000, 2 * first, 1.0)  # but the granularity of an earlier run is taken over
    assert hysteresis.tau == 2 * first


def test_the_speed_of_the_machine_is_the_median_of_seven_triangulations(monkeypatch):
    """Of 1000 points each; 2, 4, ... 14 ms in some order: 8 ms in the middle."""
    taken_s = iter(1e-3 * np.array([6.0, 14, 2, 8, 12, 4, 10, 99]))
    clock_s, counts = [100.0], []

    def triangulated(points):
        counts.append(points.shape)
        clock_s[0] += next(taken_s)

    monkeypatch.setattr(granularity, "perf_counter", lambda: clock_s[0])
    monkeypatch.setattr(granularity, "Delaunay", triangulated)
    factor = granularity.machine_speed_factor.__wrapped__()
    assert factor == pytest.approx(8.0 / granularity.REFERENCE_DELAUNAY_MS)
    assert counts == [(1000, 2)] * 7


@pytest.mark.parametrize(
    ("tau", "best", "keeps"),
    [(5, 8, True), (8, 5, True), (5, 10, False), (10, 5, False), (8, 8, True), (6, 10, False)],
)
def test_tau_is_kept_within_a_factor_of_1_6(tau, best, keeps):
    """On the bounds too: 8 / 1.6 = 5 and 5 * 1.6 = 8."""
    hysteresis = TauHysteresis(Settings(tau="auto"))
    assert hysteresis._keeps(tau, 100_000, best) == keeps
    assert not hysteresis._keeps(tau, 100, best), "too few nodes"
