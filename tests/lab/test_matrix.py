"""The matrix on a wall whose lines are labelled by hand."""

from collections.abc import Callable
from itertools import islice

import numpy as np
import pytest

from intervis.errors import SettingsError
from intervis.lab.cli.matrix import matrix
from intervis.lab.truth import matrix_baselines
from intervis.lab.truth.baselines import InputScans
from intervis.lab.truth.cells import cells, exact_lines, lines_without_echo, random_of, scan_of
from intervis.lab.truth.label_check import check_labels
from intervis.lab.truth.matrix import evaluate_cells, honestly_answerable
from intervis.lab.truth.matrix_baselines import VIEWPOINTS, cell_query_sets, evaluate_baselines
from intervis.lab.truth.methods import Method, Predictions
from intervis.lab.worlds.beam_pattern import PATTERNS
from intervis.lab.worlds.places import PLACES
from intervis.lab.worlds.ray_casting import RayCaster


def test_lines_beside_a_wall_are_answerable_as_worked_by_hand() -> None:
    # A wall of 8 x 8 m at x = 10, seen by a cone of 19 degrees about x (at x = 10: 3.4 m).
    low, high = [10.0, -4, -4], [10.0, 4, 4]
    wall = RayCaster(
        np.array([[low, [10, 4, -4], high], [low, high, [10, -4, 4]]], dtype=np.float64)
    )
    scan = PATTERNS["livox"]().scan(wall, np.eye(4), np.random.default_rng(0))
    starts = np.array([[8.0, -1, 0], [8, -1, 0], [8, 0, 0], [8, 3.9, 0], [5, -3, 0]])
    ends = np.array([[8.0, 1, 0], [-8, -1, 0], [14, 0, 0], [14, 3.9, 0], [5, 0, 0]])
    visible = np.array([True, True, False, False, True])
    # Inside the cone; behind the scanner; through the scanned wall; through the wall outside the
    # cone; from outside the cone into it.
    found = honestly_answerable(wall, scan, starts, ends, visible)
    assert found.tolist() == [True, False, True, False, False]


def test_lines_have_exact_labels_and_repeat() -> None:
    place = PLACES["crossing"](0)
    scan = PATTERNS["ring"]().scan(place.caster, np.eye(4) + _up(1.7), np.random.default_rng(1))
    first, again = (exact_lines(place, scan, 90, np.random.default_rng(2)) for _ in range(2))
    assert np.array_equal(first.ends, again.ends)
    anywhere = first.kind == 2
    blocked = place.caster.blocked(first.starts[anywhere], first.ends[anywhere])
    assert np.array_equal(~blocked, first.visible[anywhere])


def test_lines_without_echo_follow_beams_that_returned_nothing() -> None:
    place, (cell,) = PLACES["dark-cars"](0), cells(["vlp-16"], ["upright"], ["dark-cars"])
    rng = random_of(cell, 0)
    scan = scan_of(cell, place, rng)
    lines = lines_without_echo(place, scan, 200, rng)
    assert 100 < len(lines.ends) <= 200
    assert 0.2 < lines.visible.mean() < 0.99, "behind dark cars, and in the open"
    blocked = place.caster.blocked(lines.starts, lines.ends)
    assert np.array_equal(~blocked, lines.visible)
    origin = scan.pose[:3, 3]
    toward = lines.ends - origin
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    silent = scan.pattern.directions[~np.isfinite(scan.ranges_m)] @ scan.pose[:3, :3].T
    assert ((toward @ silent.T).max(axis=1) > 1 - 1e-9).all()
    assert (np.linalg.norm(lines.starts - origin, axis=1) < 2.0).all()
    height_m = lines.ends[:, 2] - place.ground(lines.ends[:, :2])[:, 2]
    assert (height_m > 0.1).all()


def test_cells_without_sense_are_left_out() -> None:
    names = {(cell.scanner, cell.mount, cell.world) for cell in cells()}
    assert ("terrestrial", "tilted", "street") not in names
    assert ("vlp-16", "mast", "hall") not in names
    assert ("qt64", "upside-down", "forest") in names


def test_a_cell_is_scored() -> None:
    (result,) = evaluate_cells(cells(["vlp-16"], ["upright"], ["hall"]), lines=60)
    assert 0 < result.own_returns <= 1
    assert 0 <= result.answerable <= 1
    assert set(result.by_kind) == {"returns", "beam points", "anywhere", "space"}


def test_labels_of_surrounding_returns_are_right_and_others_are_not() -> None:
    checks = {(c.reference, c.surrounded): c for c in islice(check_labels(), 4)}
    coarse, dense = "tilted, coarse", "level, dense"
    assert {check.world for check in checks.values()} == {"street"}
    assert checks[coarse, False].occluded_right < 0.9
    for reference in (coarse, dense):
        assert checks[reference, True].occluded_right > 0.98
        assert checks[reference, True].visible_right > 0.995
        assert 0 < checks[reference, True].occluded < checks[reference, False].occluded


def test_baselines_answer_the_same_exactly_labelled_returns() -> None:
    chosen = cells(["vlp-16"], ["upright"], ["hall"])
    first, again = (list(cell_query_sets(chosen, 3)) for _ in range(2))
    assert [one.label for one in first] == [f"vlp-16 upright hall {n}" for n in range(VIEWPOINTS)]
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.targets, other.targets)
        caster = PLACES["hall"](3).caster
        hit_m = caster.first_hit(np.tile(one.viewpoint, (len(one.targets), 1)), one.targets)
        missing_m = np.linalg.norm(one.targets - one.viewpoint, axis=1) - hit_m
        assert missing_m[one.visible].max() < 0.5 < missing_m[~one.visible].max()
    # A method that knows the labels scores 1, and one that knows nothing 0.
    answers = {one.viewpoint.tobytes(): one.visible for one in first}
    oracle = _method("oracle", lambda viewpoint, targets: answers[viewpoint.tobytes()] * 1.0)
    blind = _method("blind", lambda viewpoint, targets: np.ones(len(targets)))
    result = evaluate_baselines(chosen, seed=3, methods=[oracle, blind])
    assert [one.mean.mcc for one in result.results] == [1.0, 0.0]
    assert result.target_count == sum(len(one.targets) for one in first)


def test_labels_and_baselines_exclude_each_other() -> None:
    with pytest.raises(SettingsError, match="choose one of them"):
        matrix(labels=True, baselines=True)


def test_the_check_of_labels_takes_no_names() -> None:
    with pytest.raises(SettingsError, match="leave out the names"):
        matrix(scanners="vlp-16", labels=True)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(SettingsError, match="'vlp' is not one of"):
        matrix(scanners="vlp")


def _method(name: str, answer: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Method:
    def predict(inputs: InputScans, viewpoint: np.ndarray, targets: np.ndarray) -> Predictions:
        return Predictions(answer(viewpoint, targets), None, 0.0, 0.0)

    return Method(name, "default", predict)


def _up(height_m: float) -> np.ndarray:
    shift = np.zeros((4, 4))
    shift[2, 3] = height_m
    return shift


def test_the_folder_of_the_tables_is_made_before_the_work(tmp_path, monkeypatch) -> None:
    seen = []
    monkeypatch.setattr(
        matrix_baselines, "run_methods", lambda *_: seen.append(out.is_dir()) or ((), (), 0)
    )
    out = tmp_path / "new" / "tables"
    matrix(scanners="ring", mounts="upright", worlds="hall", baselines=True, out=out)
    assert seen == [True]
    assert (out / "baselines.md").is_file()
