"""Where along a sight line no scan observed: the samples of single lines, sorted into parts."""

import numpy as np

from intervis.arrays import Float64Array
from intervis.kernels import kernel
from intervis.sight.kernels.batch import FIRST, INCREMENT, IS_UNOBSERVED, STEP_M, new_batch
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

    One line is marched at a time, so that its classified samples are at the front of the batch.
    """
    batch, sums = new_batch(scans, model), new_line_sums(1)
    first, second = np.empty((1, 3)), np.empty((1, 3))
    parts = parts_m.shape[1]
    for line in range(begin, stop):
        first[0], second[0] = starts[line], ends[line]
        order_ends(first, second)
        swapped = False
        for axis in range(3):
            swapped |= first[0, axis] != starts[line, axis]
        march(scans, first, second, model, batch, sums)
        for m in range(batch.offsets[0, 1]):
            position = (m + batch.lines[0, FIRST]) * batch.lines[0, INCREMENT]
            if swapped:
                position = 1.0 - position
            part = min(int(position * parts), parts - 1)
            parts_m[line, part] += batch.samples[IS_UNOBSERVED, m] * batch.lines[0, STEP_M]
