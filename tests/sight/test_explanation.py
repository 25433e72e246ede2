"""One sight line in words: each answer has its own, and no number that is not one gets through."""

import numpy as np
import pytest
from made_scans import street_scan

from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE, Scene, Sight, explain
from intervis.sight.explanation import explanation_of

START, END = np.zeros(3), np.array([3.0, 4.0, 0.0])


def answer(state, probability, clearance_m, blocker=(np.nan,) * 3):
    return Sight(
        np.array([state], np.int8),
        np.array([probability]),
        np.array([blocker], float),
        np.array([clearance_m]),
        np.array([0.5]),
    )


@pytest.mark.parametrize(
    ("given", "unobserved_m", "words"),
    [
        (
            answer(VISIBLE, 0.934, 0.456),
            0.4,
            [
                "Visible: ",
                "93 %",
                "crossed 4.6 of its 5.0 m",
                "clears the nearest surface",
                "0.5 m",
            ],
        ),
        (
            answer(VISIBLE, 0.9999, np.inf),
            0.0,
            ["more than 99 %", "no surface was observed beside it"],
        ),
        (
            answer(OCCLUDED, 0.02, -0.3, (1.5, 2.0, 0.0)),
            0.0,
            ["Occluded: ", "of 2 %", "2.5 m from", "at (1.5, 2.0, 0.0)", "0.3 m higher"],
        ),
        (
            answer(OCCLUDED, 0.02, -0.01, (1.5, -0.001, 0.0)),
            0.0,
            ["pass less than 0.1 m higher", "at (1.5, 0.0, 0.0)"],
        ),
        (
            answer(VISIBLE, 0.9, 0.001),
            4.99,
            ["crossed less than 0.1 of its 5.0 m", "clears the nearest surface by less than 0.1 m"],
        ),
        (answer(UNKNOWN, np.nan, np.inf), 0.0, ["Unknown: the ends are too far apart"]),
        (answer(OCCLUDED, 0.001, -0.3), 0.0, ["less than 1 %", "No single surface"]),
        (answer(UNKNOWN, 0.6, 0.2), 0.1, ["Unknown: not decided", "60 %", "disagree"]),
        (
            answer(UNKNOWN, 0.95, np.inf),
            3.2,
            ["not observed throughout; prior", "95 %", "3.2 of its 5.0 m"],
        ),
    ],
)
def test_each_answer_has_its_words(given, unobserved_m, words):
    said = str(explanation_of(START, END, given, unobserved_m))
    for word in words:
        assert word in said
    assert "nan" not in said
    assert "inf" not in said


def test_the_numbers_stand_beside_the_words():
    blocked = explanation_of(START, END, answer(OCCLUDED, 0.02, -0.3, (1.5, 2.0, 0.0)), 0.0)
    assert (blocked.state, blocked.length_m, blocked.blocker_m) == (OCCLUDED, 5.0, 2.5)
    assert blocked.clearance_m == -0.3


@pytest.mark.parametrize("state", [VISIBLE, OCCLUDED, UNKNOWN])
def test_no_length_is_printed_as_nothing(state):
    blocker = START if state == OCCLUDED else (np.nan,) * 3
    said = str(explanation_of(START, START, answer(state, 0.9, 0.0, blocker), 0.0))
    assert "0.0 m" not in said
    assert "0.0 of" not in said
    assert "less than 0.1 m" in said


@pytest.mark.parametrize(("length_m", "has_length"), [(0.049, False), (0.051, True)])
def test_a_line_shorter_than_its_print_has_no_length(length_m, has_length):
    end = (*START[:2], START[2] + length_m)
    said = str(explanation_of(START, end, answer(VISIBLE, 0.9, np.inf), 0.0))
    assert ("of its 0.1 m" in said) is has_length
    assert ("less than 0.1 m" in said) is not has_length


def test_a_line_of_absurd_length_has_no_answer():
    scene = Scene.from_scan(street_scan())
    for far in (1e12, 1e200, 1e308):
        said = str(explain(scene, [-far, 0, 0], [far, 0, 0]))
        assert said.startswith("Unknown: ")
        assert "nan" not in said
        assert "inf" not in said
        assert len(said) < 250


@pytest.mark.parametrize(
    ("probability", "words"),
    [(0.99, "99 %"), (0.9901, "more than 99 %"), (0.01, "1 %"), (0.0099, "less than 1 %")],
)
def test_percentages_are_never_0_or_100(probability, words):
    said = str(explanation_of(START, END, answer(VISIBLE, probability, np.inf), 0.0))
    assert said.startswith(f"Visible: with a probability of {words}. ")


@pytest.mark.parametrize(
    ("unobserved_m", "words"), [(0.5, "not decided"), (0.51, "not observed"), (0.7, "not observed")]
)
def test_half_a_metre_that_no_scan_observed_is_named(unobserved_m, words):
    said = str(explanation_of(START, END, answer(UNKNOWN, 0.6, np.inf), unobserved_m))
    assert said.startswith(f"Unknown: {words}")


@pytest.mark.parametrize("share", [0.0, 0.47, 0.53, 1.0])
def test_a_visible_line_that_mostly_no_scan_observed_says_so(share):
    length_m = float(np.linalg.norm(np.subtract(END, START)))
    said = str(explanation_of(START, END, answer(VISIBLE, 0.9, np.inf), share * length_m))
    assert said.endswith("prior knowledge of such space decides.") is (share > 0.5)


@pytest.mark.parametrize(("clearance_m", "words"), [(0.049, "less than 0.1 m"), (0.051, "0.1 m")])
def test_lengths_are_rounded_to_a_decimetre(clearance_m, words):
    said = str(explanation_of(START, END, answer(VISIBLE, 0.9, clearance_m), 0.0))
    assert said.endswith(f"it clears the nearest surface by {words}.")


def test_the_risk_and_the_time_of_a_query_reach_the_scene():
    class Asked(Scene):
        def sight(self, start, ends, *, risk, moment_s):
            self.lines = (start.tolist(), ends.tolist(), risk, moment_s)
            return answer(VISIBLE, 0.9, 1.0)

        def unobserved_length(self, start, end, *, moment_s):
            self.unobserved = (start.tolist(), end.tolist(), moment_s)
            return 1.25

    scene = Asked()
    explained = explain(scene, START, END, risk=0.1, moment_s=7.5)
    assert scene.lines == ([0, 0, 0], [[3, 4, 0]], 0.1, 7.5)
    assert scene.unobserved == ([0, 0, 0], [3, 4, 0], 7.5)
    assert explained.unobserved_m == 1.25
    explain(scene, START, END)
    assert scene.lines[2:] == (0.05, None)
