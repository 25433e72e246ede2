"""Answers for many sight lines: the rules of `evidence` applied to what the engine finds."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array
from intervis.kernels import in_parts, kernel
from intervis.sight import occupancy_model as evidence
from intervis.sight.atlas import Memory
from intervis.sight.block import new_block
from intervis.sight.engine import judge_some, odds_table_of, put_in_order
from intervis.sight.findings import new_findings
from intervis.sight.meeting import meet_surface
from intervis.sight.occupancy_model import MODEL, Model

VISIBLE, OCCLUDED, UNKNOWN = 1, 0, -1
_AT_ONCE = 256


class Rules(NamedTuple):
    """When a line is called what, and which lines are judged: see `evidence`."""

    visible_from: float
    visible_seen: float
    visible_hidden: float
    occluded_seen: float
    unknown_m: float
    unknown_share: float
    shadow_m: float
    end_m: float
    noise: float
    sharpness: float
    change_s: float
    gone: float
    came: float
    most_changed: float
    max_range_m: float


class Answers(NamedTuple):
    """State, probability, blocker and clearance of L lines, as in `intervis.sight.Sight`."""

    state: NDArray[np.int8]
    probability: Float64Array
    blocker: Float64Array
    clearance: Float64Array


@kernel
def _is_able(a: Float64Array, b: Float64Array, max_range_m: float) -> bool:
    """Whether a line can be judged: its length is a number, and no greater than asked for."""
    length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    return bool(np.isfinite(length) and length <= max_range_m)


@kernel
def _probability_of(exponent: float, apart_s: float, rules: Rules) -> float:
    """P(visible) of a line; `evidence.probability` and `evidence.changes` in one."""
    moved = 1.0 - np.exp(-apart_s / rules.change_s)
    gone = min(rules.gone * moved, rules.most_changed)
    came = min(rules.came * moved, rules.most_changed)
    fair = (0.5 - came) / (0.5 - gone)
    still = 1.0 / (1.0 + fair * np.expm1(exponent) ** rules.sharpness)
    return float(gone + (1.0 - gone - came) * still)


@kernel
def _state_of(
    probability: float,
    seen: float,
    hidden: float,
    unknown_m: float,
    shadow_m: float,
    length: float,
    rules: Rules,
) -> int:
    """What a line is called."""
    if seen > rules.occluded_seen:
        return 0
    judged_m = max(length - 2.0 * rules.end_m, 0.0)
    if (
        probability >= rules.visible_from
        and seen < rules.visible_seen
        and hidden < rules.visible_hidden
        and unknown_m <= min(rules.unknown_m, rules.unknown_share * judged_m)
        and shadow_m <= rules.shadow_m
    ):
        return 1
    return -1


@kernel
def _answer_part(
    memory: Memory,
    starts: Float64Array,
    ends: Float64Array,
    paired: bool,
    model: Model,
    odds_table: Float64Array,
    rules: Rules,
    begin: int,
    stop: int,
    answers: Answers,
) -> None:
    block, in_sensor = new_block(memory, model), np.empty((2, 3))
    first, second = np.empty((_AT_ONCE, 3)), np.empty((_AT_ONCE, 3))
    which = np.empty(_AT_ONCE, np.int64)
    found = new_findings(_AT_ONCE)
    at = begin
    while at < stop:
        count = 0
        while at < stop and count < _AT_ONCE:
            a = starts[at if paired else at // len(ends)]
            b = ends[at if paired else at % len(ends)]
            answers.state[at] = -1
            answers.probability[at] = np.nan
            answers.clearance[at] = np.nan
            answers.blocker[at] = np.nan
            if _is_able(a, b, rules.max_range_m):
                first[count], second[count] = a, b
                which[count] = at
                count += 1
            at += 1
        put_in_order(first[:count], second[:count])
        judge_some(memory, first[:count], second[:count], model, odds_table, block, found)
        for i in range(count):
            line, a, b = which[i], first[i], second[i]
            length = np.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
            seen, hidden = found.seen[i], found.hidden[i]
            exponent = rules.noise + found.open[i] + seen + hidden
            probability = _probability_of(exponent, found.apart_s[i], rules)
            unknown_m, shadow_m = found.unknown_m[i], found.shadow_m[i]
            state = _state_of(probability, seen, hidden, unknown_m, shadow_m, length, rules)
            answers.state[line] = state
            answers.probability[line] = probability
            answers.clearance[line] = found.clearance_m[i]
            if state == 0:
                answers.clearance[line] = -meet_surface(
                    memory.cells,
                    block.charts[found.worst_scan[i]],
                    a,
                    b,
                    length,
                    found.worst_m[i],
                    in_sensor,
                    answers.blocker[line],
                )


def answer_lines(
    memory: Memory,
    starts: Float64Array,
    ends: Float64Array,
    *,
    paired: bool,
    max_range_m: float | None = None,
    visible_from: float = evidence.VISIBLE_FROM,
    model: Model = MODEL,
) -> Answers:
    """Answers for the lines between points of the scene.

    Parameters
    ----------
    memory : Memory
    starts, ends : (S, 3) and (E, 3) float64 arrays
        Contiguous; a line with an end that is not finite stays unknown.
    paired : bool
        The i-th start with the i-th end, L = S = E lines; otherwise each start with each end,
        L = S E lines, those of one start one after another.
    max_range_m : float or None
        Longer lines stay unknown.
    visible_from : float
        Least probability at which a line is called visible.
    model : Model

    Returns
    -------
    Answers
        Of L lines.
    """
    count = len(ends) if paired else len(starts) * len(ends)
    answers = Answers(
        np.empty(count, np.int8), np.empty(count), np.empty((count, 3)), np.empty(count)
    )
    seen_once = len(memory.position) == 1
    rules = Rules(
        visible_from=float(visible_from),
        visible_seen=evidence.VISIBLE_SEEN,
        visible_hidden=evidence.VISIBLE_HIDDEN,
        occluded_seen=evidence.OCCLUDED_SEEN,
        unknown_m=evidence.UNKNOWN_M,
        unknown_share=evidence.UNKNOWN_SHARE,
        shadow_m=evidence.SHADOW_M,
        end_m=evidence.END_M,
        noise=evidence.NOISE,
        sharpness=evidence.SHARPNESS,
        change_s=evidence.CHANGE_S,
        gone=evidence.GONE_SEEN_ONCE if seen_once else evidence.GONE,
        came=evidence.CAME_SEEN_ONCE if seen_once else evidence.CAME,
        most_changed=evidence.MOST_CHANGED,
        max_range_m=np.inf if max_range_m is None else float(max_range_m),
    )
    table = odds_table_of(model)

    def work(begin: int, stop: int) -> None:
        _answer_part(memory, starts, ends, paired, model, table, rules, begin, stop, answers)

    in_parts(work, count, least=512)
    return answers
