"""Fuzzing of the public calls: odd arguments are answered, or refused in one sentence.

For each call of ``tools/call_targets.py`` one to three of its valid arguments are replaced by odd
ones (``tools/odd_values.py``), again and again. An outcome is

- read: an answer;
- refused: an `IntervisError`, or one of `PLAIN` that a ``raise`` of the package raised, with one
  line of text;
- raw: any other exception, one that came out of numpy, scipy or Python itself, a warning, or an
  array that was passed in and changed;
- slow: more than two seconds.

Memory is bounded. Odd numbers ask for little that honestly takes long, such as a million places. A
call that does not come back within five minutes ends the process. Runs with the same seed and count
are the same. ``NUMBA_BOUNDSCHECK=1`` checks the bounds of the kernels as well; give such a run a
cache of its own (``NUMBA_CACHE_DIR``).
"""

import faulthandler
import logging
import random
import sys
import warnings
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from call_targets import Call, targets
from fuzzing import BoundedMemory, Outcome, judged, run_targets
from odd_values import odd

HANG_S = 300
PLAIN = (TypeError, ValueError, IndexError)


def fuzz(name: str, count: int, seed: int, hang_s: float | None = None) -> Outcome:
    """Make `count` odd calls of one target; one that takes `hang_s` seconds ends the process."""
    call = targets()[name]
    logging.getLogger("intervis").addHandler(logging.NullHandler())
    logging.getLogger("intervis").propagate = False
    outcome = Outcome(name)
    kind, fault = judged(partial(made, call, call.arguments))  # kernels are loaded here
    if kind not in ("read", "slow"):  # which may compile
        outcome.counts["raw"] += 1
        outcome.faults[f"the valid call: {fault}"] += 1
    with warnings.catch_warnings(), BoundedMemory():
        warnings.simplefilter("error")
        for number in range(count):
            rng = random.Random(f"{seed} {name} {number}")
            arguments = odd_arguments(call.arguments, rng)
            if hang_s is not None:
                faulthandler.dump_traceback_later(hang_s, exit=True)
            kind, fault = judged(partial(made, call, arguments), PLAIN)
            faulthandler.cancel_dump_traceback_later()
            outcome.counts[kind] += 1
            if kind in ("raw", "slow"):
                changed = [key for key in arguments if arguments[key] is not call.arguments[key]]
                outcome.faults[f"{fault}, first in call {number} ({', '.join(changed)})"] += 1
    _merge(outcome)
    return outcome


def odd_arguments(valid: Mapping[str, Any], rng: random.Random) -> dict[str, Any]:
    """The arguments with one to three odd ones."""
    chosen = rng.sample(sorted(valid), min(len(valid), rng.choice((1, 1, 1, 2, 3))))
    return {key: odd(value, rng) if key in chosen else value for key, value in valid.items()}


def made(call: Call, arguments: Mapping[str, Any]) -> None:
    """Make a call, and check that it leaves the arrays as they are."""
    arrays = {key: value for key, value in arguments.items() if type(value) is np.ndarray}
    before = {key: value.tobytes() for key, value in arrays.items()}
    call.function(**arguments)
    for key, value in arrays.items():
        if value.tobytes() != before[key]:
            raise AssertionError(f"{key} was changed")


def _merge(outcome: Outcome) -> None:
    """One line for each place of the code, with the message of its first fault."""
    firsts: dict[str, str] = {}
    for fault, times in list(outcome.faults.items()):
        first = firsts.setdefault(fault.split(": ")[0], fault)
        if first != fault:
            outcome.faults[first] += times
            del outcome.faults[fault]


def main(arguments: Sequence[str] | None = None) -> int:
    """Fuzz the calls and print a table; 1 if anything was raw or slow."""
    description = "Fuzz the public calls with odd arguments."
    return run_targets(
        partial(fuzz, hang_s=HANG_S),
        list(targets()),
        arguments,
        description=description,
        count=1500,
    )


if __name__ == "__main__":
    sys.exit(main())
