"""The paper's printed numbers agree with its own formulas, to the last digit."""

import math

import pytest

from intervis.lab.paper import printed_values
from intervis.method.measures import (
    average_redundancy_removal,
    decreasing_calculation,
    two_point_intervisibility,
)


@pytest.mark.parametrize("tau", printed_values.TAUS)
def test_table_2_follows_from_its_granularity(tau):
    row, n = printed_values.TABLE_2[tau], math.ceil(printed_values.N_FOV / tau)
    assert row.SP == row.N + n - 1
    assert 0 <= 2 * n - 2 - row.N <= 50  # nodes on the hull
    assert round(average_redundancy_removal(printed_values.N_RAW, n), 2) == row.ARR
    edges = row.TPI / 100 * 3 * row.N
    assert decreasing_calculation(printed_values.N_RAW, edges) == pytest.approx(row.DCP, abs=0.0051)
    assert row.TPI < printed_values.ceiling_of_tpi(n, row.N)


@pytest.mark.parametrize("tau", printed_values.TAUS)
def test_table_3_adds_up_and_prints_one_deviation_twice(tau):
    row = printed_values.TABLE_3[tau]
    assert row.S1 + row.S2 + row.S3 == pytest.approx(row.TIME, abs=1.01e-4)
    assert row.AS1 + row.AS2 + row.AS3 == pytest.approx(row.ATIME, abs=2e-4)
    assert row.STD / row.VAR == pytest.approx(math.sqrt(10 / 9), abs=2e-3)


def test_table_4_stands_at_the_ceiling():
    ours = printed_values.TABLE_4[printed_values.PROPOSED]
    interpolation = printed_values.TABLE_4[printed_values.INTERPOLATION_POINTS]
    assert ours.nodes == math.ceil(printed_values.N_FOV / printed_values.TAU_TABLE_4)
    for row, elements in ((ours, 1121), (interpolation, 39_973)):
        edges = row.TPI / 100 * 3 * elements
        assert decreasing_calculation(printed_values.N_RAW, edges) == pytest.approx(
            row.DCP, abs=0.0051
        )
        assert 0 <= printed_values.ceiling_of_tpi(row.nodes, elements) - row.TPI < 0.1
        all_edges = elements + row.nodes - 1
        assert two_point_intervisibility(all_edges, elements) == pytest.approx(row.TPI, abs=0.1)


def test_no_plausible_mesh_of_the_raw_scan_reaches_the_printed_rate():
    n = printed_values.N_RAW
    for hull in (10, 100, 1000, 10_000):
        assert (
            printed_values.ceiling_of_tpi(n, 2 * n - 2 - hull)
            < printed_values.TABLE_4[printed_values.GLOBAL_POINTS].TPI
        )
    assert (
        printed_values.ceiling_of_tpi(n, 2 * n - 2 - 10_500)
        > printed_values.TABLE_4[printed_values.GLOBAL_POINTS].TPI
    )
