"""The choice of sites against enumeration, and the worth of a set against random trials."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intervis.errors import PointsError, SettingsError
from intervis.uses.sites import choice as choice_module
from intervis.uses.sites import objective as objective_module
from intervis.uses.sites.choice import GREEDY_SHARE, choose, greedy_choice
from intervis.uses.sites.objective import Objective

PROBABILITIES = st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]) | st.floats(0, 1, width=32)


@st.composite
def problems(draw: st.DrawFn) -> tuple[Objective, int]:
    places, targets = draw(st.integers(1, 7)), draw(st.integers(1, 5))
    row = st.lists(PROBABILITIES, min_size=targets, max_size=targets)
    seen = np.array(draw(st.lists(row, min_size=places, max_size=places)), np.float32)
    weight = draw(st.lists(st.sampled_from([0.5, 1, 3]), min_size=targets, max_size=targets))
    count = draw(st.integers(1, places))
    views = draw(st.integers(1, min(count, 3)))
    combine = draw(st.sampled_from(["best", "independent"]))
    return Objective(seen, np.array(weight), views, combine), count


def worth(objective: Objective, chosen: tuple[int, ...]) -> float:
    """E[min(N, views)] / views by its definition: over all outcomes of the chosen sites."""
    total = 0.0
    for target, weight in enumerate(objective.weight):
        own = [float(objective.probability[nth, target]) for nth in chosen]
        if objective.combine == "best":  # a uniform number decides for all sites
            levels = sorted({0.0, 1.0, *own})
            expected = sum(
                (high - low) * min(sum(one >= high for one in own), objective.views)
                for low, high in itertools.pairwise(levels)
            )
        else:
            expected = 0.0
            for outcome in itertools.product((0, 1), repeat=len(own)):
                chance = np.prod([p if hit else 1 - p for p, hit in zip(own, outcome, strict=True)])
                expected += float(chance) * min(sum(outcome), objective.views)
        total += weight * expected / objective.views
    return total


def test_a_search_over_few_targets_stops_as_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gain over three targets takes no less time than one over a thousand."""
    world = Objective(
        np.random.default_rng(3).uniform(0, 1, (30, 3)).astype(np.float32), np.ones(3)
    )
    looked: list[int] = []
    gain = objective_module.Views.gain

    def counted(views: objective_module.Views, nth: int) -> float:
        looked.append(nth)
        return gain(views, nth)

    monkeypatch.setattr(objective_module.Views, "gain", counted)
    monkeypatch.setitem(choice_module.MOST_WORK, "exact", 2e5)
    found = choose(world, 6, "exact")
    assert found.evaluations <= 200 + 100
    assert len(looked) <= 400
    assert found.bound >= found.value


@given(problems(), st.data())
def test_the_worth_is_that_of_its_definition(problem: tuple[Objective, int], data) -> None:
    objective, _ = problem
    chosen = tuple(data.draw(st.permutations(range(len(objective)))))[:4]
    assert objective.value(list(chosen)) == pytest.approx(worth(objective, chosen), abs=1e-12)
    enough = objective.views_of(list(chosen)).enough
    one = Objective(objective.probability, objective.weight, objective.views, "best")
    if objective.combine == "independent":  # best is the least of all dependences
        assert objective.value(list(chosen)) >= one.value(list(chosen)) - 1e-12
    for target in range(len(objective.weight)):
        own = [float(objective.probability[nth, target]) for nth in chosen]
        if objective.combine == "best":
            largest = sorted([*own, 0.0, 0.0, 0.0], reverse=True)
            assert enough[target] == pytest.approx(largest[objective.views - 1], abs=1e-12)
        else:
            fewer = sum(
                np.prod([p if hit else 1 - p for p, hit in zip(own, hits, strict=True)])
                for hits in itertools.product((0, 1), repeat=len(own))
                if sum(hits) < objective.views
            )
            assert enough[target] == pytest.approx(1.0 - fewer, abs=1e-12)


@given(problems())
def test_a_site_adds_less_to_a_larger_set(problem: tuple[Objective, int]) -> None:
    objective, _ = problem
    views = objective.empty()
    before = [views.gain(nth) for nth in range(len(objective))]
    for nth in range(len(objective)):
        views = views.with_site(nth)
        after = [views.gain(other) for other in range(len(objective))]
        assert all(0.0 <= new <= old for new, old in zip(after, before, strict=True))  # to the bit
        before = after


@given(problems())
def test_lazy_greedy_is_plain_greedy(problem: tuple[Objective, int]) -> None:
    objective, count = problem
    views, sites = objective.empty(), []
    for _ in range(count):
        gains = [views.gain(n) if n not in sites else -1.0 for n in range(len(objective))]
        sites.append(int(np.argmax(gains)))  # of equal gains the first
        views = views.with_site(sites[-1])
    found = greedy_choice(objective, count)
    assert list(found.sites) == sites
    assert found.value == pytest.approx(worth(objective, found.sites), abs=1e-9)


@given(problems())
def test_choices_against_enumeration(problem: tuple[Objective, int]) -> None:
    objective, count = problem
    every = itertools.combinations(range(len(objective)), count)
    best = max(worth(objective, chosen) for chosen in every)
    greedy, exact = choose(objective, count, "greedy"), choose(objective, count, "exact")
    assert exact.method == "exact"
    assert exact.value == pytest.approx(best, abs=1e-9)
    assert worth(objective, exact.sites) == pytest.approx(best, abs=1e-9)
    assert exact.bound == pytest.approx(best, abs=1e-9)
    assert len(set(exact.sites)) == len(set(greedy.sites)) == count
    assert greedy.value >= GREEDY_SHARE * best - 1e-9
    assert greedy.bound >= best - 1e-9
    assert greedy.share_of_best * best <= greedy.value + 1e-9
    assert sum(exact.gains) == pytest.approx(exact.value)


@pytest.mark.parametrize("combine", ["best", "independent"])
def test_the_best_set_is_found_where_greedy_is_close_to_it(combine: str) -> None:
    gaps = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        world = Objective(rng.random((10, 30)).astype(np.float32) ** 4, rng.random(30), 1, combine)
        best = max(world.value(list(one)) for one in itertools.combinations(range(10), 3))
        assert choose(world, 3, "exact").value == pytest.approx(best, abs=1e-9)
        gaps.append(best - greedy_choice(world, 3).value)
    assert 0.0 < max(gaps) < 0.03  # greedy misses some, by little


def test_the_bound_is_the_least_of_three() -> None:
    rng = np.random.default_rng(5)
    world = Objective(rng.random((9, 50)).astype(np.float32) ** 2, np.ones(50))
    found = greedy_choice(world, 4)
    views = world.views_of(list(found.sites))
    left = sorted((views.gain(n) for n in range(9) if n not in found.sites), reverse=True)
    assert found.bound == pytest.approx(found.value + sum(left[:4]))
    assert found.bound < min(1.0, found.value / GREEDY_SHARE)
    # Places that see different targets: their own gains are the bound, and it is reached.
    apart = Objective(np.eye(4, dtype=np.float32), np.array([4.0, 3.0, 2.0, 1.0]))
    assert greedy_choice(apart, 2).bound == pytest.approx(0.7)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_lazy_computes_fewer_gains(seed: int) -> None:
    rng = np.random.default_rng(seed)
    seen = (rng.random((60, 300)) ** 6).astype(np.float32)
    found = greedy_choice(Objective(seen, np.ones(300)), 12)
    plain = sum(60 - nth for nth in range(12))
    assert found.evaluations < plain


def test_a_search_that_takes_too_long_is_no_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    world = Objective(rng.random((14, 40)).astype(np.float32) ** 3, np.ones(40))
    greedy, exact = choose(world, 5, "greedy"), choose(world, 5, "exact")
    assert exact.method == "exact"
    monkeypatch.setitem(choice_module.MOST_WORK, "exact", 1000.0 * 80)
    stopped = choose(world, 5, "exact")
    assert stopped.method == "greedy"
    assert greedy.value - 1e-12 <= stopped.value <= exact.value + 1e-12
    assert stopped.bound == pytest.approx(greedy.bound)
    assert stopped.bound >= exact.value


def test_auto_is_exact_for_few_sets_only(monkeypatch: pytest.MonkeyPatch) -> None:
    # The greedy choice takes the first place, which the best pair lacks.
    seen = np.array([[0, 1, 1, 1, 1, 0], [1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1]], np.float32)
    world = Objective(seen, np.ones(6))
    assert choose(world, 2).sites == (1, 2)
    monkeypatch.setattr(choice_module, "FEW_SETS", 2)
    found = choose(world, 2)
    assert (found.sites, found.method) == ((0, 1), "greedy")
    assert found.bound == pytest.approx(1.0)
    assert found.share_of_best == pytest.approx(5 / 6)


@pytest.mark.parametrize(
    ("count", "views", "method", "message"),
    [
        (4, 1, "auto", "4 places cannot be chosen from 3 candidates: give a number from 1 to 3"),
        (0, 1, "auto", "0 places cannot be chosen from 3 candidates"),
        (2, 3, "auto", "views must be from 1 to the number of places, 2, got 3: choose"),
        (1, 1, "best", "the method must be one of auto, greedy, exact, got 'best'"),
    ],
)
def test_choices_that_make_no_sense(count: int, views: int, method: str, message: str) -> None:
    world = Objective(np.zeros((3, 2), np.float32), np.ones(2), views)
    with pytest.raises(SettingsError, match=message):
        choose(world, count, method)


def test_worths_that_make_no_sense() -> None:
    seen = np.zeros((3, 2), np.float32)
    with pytest.raises(PointsError, match="probabilities need a weight for each column"):
        Objective(seen, np.ones(3))
    with pytest.raises(PointsError, match="not all 0"):
        Objective(seen, np.zeros(2))
    with pytest.raises(PointsError, match="not all 0"):
        Objective(seen, np.array([1.0, np.nan]))
    with pytest.raises(PointsError, match="out of reach is 0, not NaN"):
        Objective(np.full((1, 2), np.nan, np.float32), np.ones(2))
    with pytest.raises(SettingsError, match="views must be 1 or more"):
        Objective(seen, np.ones(2), 0)
    with pytest.raises(SettingsError, match="one of best, independent, got 'sum'"):
        Objective(seen, np.ones(2), 1, "sum")  # type: ignore[arg-type]


def test_all_candidates_and_very_many_need_no_search() -> None:
    seen = np.eye(400, dtype=np.float32)
    world = Objective(seen, np.ones(400))
    whole, most = choose(world, 400), choose(world, 399, "exact")
    assert (whole.method, whole.value, whole.bound) == ("exact", pytest.approx(1.0), whole.value)
    assert (most.method, most.value) == ("greedy", pytest.approx(399 / 400))


def test_what_sees_nothing_is_worth_nothing() -> None:
    found = choose(Objective(np.zeros((3, 2), np.float32), np.ones(2)), 2)
    assert (found.sites, found.value, found.bound, found.share_of_best) == ((0, 1), 0.0, 0.0, 1.0)
