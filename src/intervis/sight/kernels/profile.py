"""Where along a sight line no scan observed: its samples, sorted into parts."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import kernel
from intervis.sight.kernels.batch import (
    BATCH_LINES,
    FIRST,
    INCREMENT,
    IS_UNOBSERVED,
    STEP_M,
    Batch,
    lay_out,
    new_batch,
)
from intervis.sight.kernels.line_sums import new_line_sums
from intervis.sight.kernels.march import march, order_ends
from intervis.sight.kernels.packed_scans import PackedScans
from intervis.sight.kernels.parameters import OccupancyModel


@kernel
def add_unobserved_parts(
    scans: PackedScans,
    starts: Float64Array,
    ends: Float64Array,
    model: OccupancyModel,
    begin: int,
    stop: int,
    parts_m: Float64Array,
) -> None:
    """Add the unobserved metres of lines `begin` to `stop` to `parts_m` (L, P), start to end.

    As many lines are marched at a time as one batch holds: it then still has their samples.
    """
    batch, sums = new_batch(scans, model), new_line_sums(BATCH_LINES)
    first, second = np.empty((BATCH_LINES, 3)), np.empty((BATCH_LINES, 3))
    parameters, at = model.parameters, begin
    while at < stop:
        most = min(BATCH_LINES, stop - at)
        first[:most], second[:most] = starts[at : at + most], ends[at : at + most]
        order_ends(first[:most], second[:most])
        count = lay_out(
            first[:most],
            second[:most],
            0,
            parameters.step_m,
            parameters.end_margin_m,
            batch.lines,
            batch.offsets,
        )
        march(scans, first[:count], second[:count], model, batch, sums)
        for i in range(count):
            is_swapped = False
            for axis in range(3):
                is_swapped |= first[i, axis] != starts[at + i, axis]
            _add_parts(batch, i, is_swapped, parts_m[at + i])
        at += count


@kernel
def _add_parts(batch: Batch, i: int, is_swapped: bool, parts_m: Float64Array) -> None:
    """Add the unobserved metres of the i-th line of a batch to its parts (P,)."""
    begin, parts = batch.offsets[i, 0], len(parts_m)
    for m in range(begin, batch.offsets[i, 1]):
        position = (m - begin + batch.lines[i, FIRST]) * batch.lines[i, INCREMENT]
        if is_swapped:
            position = 1.0 - position
        part = min(int(position * parts), parts - 1)
        parts_m[part] += batch.samples[IS_UNOBSERVED, m] * batch.lines[i, STEP_M]
