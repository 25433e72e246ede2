"""Fuzzing of the public calls: a short run over all of them, and what the tool finds."""

import importlib
import random
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import intervis
from intervis import uses
from intervis.errors import PointsError

TOOLS = Path(__file__).resolve().parents[2] / "tools"
sys.path.insert(0, str(TOOLS))
fuzzing = importlib.import_module("fuzzing")
fuzz_calls = importlib.import_module("fuzz_calls")
call_targets = importlib.import_module("call_targets")
odd_values = importlib.import_module("odd_values")
TARGETS = call_targets.targets()


@pytest.mark.parametrize("target", TARGETS)
def test_odd_arguments_are_answered_or_refused_in_one_sentence(target, monkeypatch):
    """A short run; `make fuzz` is the long one, and the one that measures time."""
    monkeypatch.setattr(fuzzing, "SLOW_S", float("inf"))
    outcome = fuzz_calls.fuzz(target, count=25, seed=1)
    assert not outcome.faults
    assert outcome.counts["read"] + outcome.counts["refused"] == 25
    # That a text is refused is checked here: odd keys of `calibration_of` are all frames alike.
    assert outcome.counts["refused"] > 0 or target == "Drive.calibration_of"


def test_every_public_name_is_fuzzed_or_makes_no_call():
    targets = {name.split(".")[0].split("[")[0] for name in TARGETS}
    known = {
        *(*call_targets.STORES, *call_targets.CONSTANTS, *call_targets.MADE_BY),
        *call_targets.NOT_YET,
    }
    public = {*intervis.__all__, *uses.__all__}
    errors = {name for name in intervis.__all__ if name.endswith("Error")}
    assert public - errors - known <= targets
    assert known <= public  # none of them is a name of the past


class Made:
    """A call whose one argument decides what happens."""

    def __init__(self, action):
        self.action, self.valid = action, object()

    def __call__(self, value):
        return 1 if value is self.valid else self.action(value)


def refuse(error):
    def action(value):
        raise error

    return action


def change(value):
    if isinstance(value, np.ndarray) and value.flags.writeable and value.dtype.kind == "f":
        value[...] = 7.0


@pytest.mark.parametrize(
    ("action", "kind"),
    [
        (lambda value: 1, "read"),
        (refuse(PointsError("one sentence.")), "refused"),
        (refuse(PointsError("two\nlines.")), "raw"),
        (refuse(ValueError("raised outside of the package")), "raw"),
        (lambda value: np.asarray("x", float), "raw"),
        (lambda value: warnings.warn("leaked", UserWarning, stacklevel=1), "raw"),
        (lambda value: len(bytearray(2**31)), "raw"),
    ],
)
def test_outcomes_are_told_apart(monkeypatch, action, kind):
    made = Made(action)
    call = call_targets.Call(made, {"value": made.valid})
    monkeypatch.setattr(fuzz_calls, "targets", lambda: {"made": call})
    outcome = fuzz_calls.fuzz("made", count=10, seed=3)
    assert outcome.counts[kind] == 10
    assert sum(outcome.faults.values()) == (10 if kind == "raw" else 0)


def test_an_argument_that_is_changed_is_found(monkeypatch):
    call = call_targets.Call(lambda value: None, {"value": np.zeros((3, 3))})
    monkeypatch.setattr(fuzz_calls, "targets", lambda: {"made": call})
    assert not fuzz_calls.fuzz("made", count=60, seed=0).faults
    call = call_targets.Call(change, {"value": np.zeros((3, 3))})
    with pytest.raises(AssertionError, match="value was changed"):
        fuzz_calls.made(call, {"value": np.ones((2, 3))})


def test_a_seed_repeats_its_arguments_and_another_does_not():
    call = TARGETS["Scene.sight"]

    def kinds(seed):
        chosen = [
            fuzz_calls.odd_arguments(call.arguments, random.Random(f"{seed} {n}"))
            for n in range(50)
        ]
        return [[type(value) for value in arguments.values()] for arguments in chosen]

    assert kinds(0) == kinds(0)
    assert kinds(0) != kinds(1)


@pytest.mark.parametrize("valid", [np.zeros((4, 3)), 3, 2.5, "text", [1], (), {"x": 1}, None, len])
def test_every_kind_of_argument_has_odd_ones(valid):
    found = [odd_values.odd(valid, random.Random(n)) for n in range(300)]
    assert len({type(value) for value in found}) > 10
