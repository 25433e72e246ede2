"""Eq. 15 to 17 against the rows of the paper's Tables 2 and 4, to the last printed digit."""

from collections.abc import Mapping

import pytest

from intervis.method.measures import (
    average_redundancy_removal,
    decreasing_calculation,
    measure,
    two_point_intervisibility,
)

N_RAW, N_FOV = 125_148, 20_008

TABLE_2 = [  # tau, N, SP, ARR, TPI, DCP
    (10, 3982, 5982, 98.40, 47.61, 95.46),
    (20, 1984, 2984, 99.20, 44.17, 97.90),
    (30, 1320, 1986, 99.47, 41.04, 98.70),
    (40, 987, 1487, 99.60, 38.57, 99.09),
    (50, 786, 1186, 99.68, 35.79, 99.33),
    (60, 653, 986, 99.73, 35.78, 99.44),
    (70, 557, 842, 99.77, 33.87, 99.55),
    (80, 488, 738, 99.80, 30.94, 99.64),
    (90, 432, 654, 99.82, 31.33, 99.68),
    (100, 388, 588, 99.84, 30.50, 99.72),
]
TABLE_4 = [  # nodes, N that its TPI and DCP imply, ARR, TPI, DCP
    (20_008, 39_973, 84.01, 50.01, 52.08),
    (572, 1_121, 99.54, 50.25, 98.65),
]


@pytest.mark.parametrize(("tau", "elements", "edges", "arr", "tpi", "dcp"), TABLE_2)
def test_rows_of_table_2(tau, elements, edges, arr, tpi, dcp):
    n = -(-N_FOV // tau)
    assert edges == elements + n - 1
    assert f"{average_redundancy_removal(N_RAW, n):.2f}" == f"{arr:.2f}"
    # TPI is printed with two digits: the number of edges that gives it gives DCP as well.
    intervisible = tpi / 100 * 3 * elements
    assert two_point_intervisibility(round(intervisible), elements) == pytest.approx(tpi, abs=0.02)
    assert f"{decreasing_calculation(N_RAW, intervisible):.2f}" == f"{dcp:.2f}"


@pytest.mark.parametrize(("n", "elements", "arr", "tpi", "dcp"), TABLE_4)
def test_rows_of_table_4(n, elements, arr, tpi, dcp):
    assert f"{average_redundancy_removal(N_RAW, n):.2f}" == f"{arr:.2f}"
    assert f"{decreasing_calculation(N_RAW, tpi / 100 * 3 * elements):.2f}" == f"{dcp:.2f}"
    hull = 2 * n - 2 - elements
    assert 3 <= hull < 50  # N = 2n - 2 - h with a hull of plausible size


def test_ceiling_of_tpi_is_just_over_a_half():
    frame = measure(
        n_raw=N_RAW, n_dropped=0, n_fov=N_FOV, n=572, elements=1121, edges=1692, intervisible=1692
    )
    assert frame.TPI_unique == 100.0
    assert frame.TPI == pytest.approx(100 * 1692 / 3363)
    assert 50 < frame.TPI < 50.5


def test_measures_of_nothing_are_zero_and_readable_by_name():
    empty = measure(n_raw=0, n_dropped=3, n_fov=0, n=0, elements=0, edges=0, intervisible=0)
    assert dict(empty)["TPI"] == 0.0
    assert empty["n_dropped"] == 3
    with pytest.raises(KeyError):
        empty["TPX"]


def test_a_record_is_a_mapping():
    record = measure(n_raw=90, n_dropped=3, n_fov=9, n=4, elements=2, edges=5, intervisible=3)
    assert isinstance(record, Mapping)
    names = ["n_raw", "n_dropped", "n_fov", "n", "N", "SP", "ARR", "TPI", "TPI_unique", "DCP"]
    assert list(record) == list(record.keys()) == names
    assert len(record) == 10
    assert "TPI" in record
    assert "values" not in record  # an attribute of every mapping, but no measure
    assert record.get("TPX", -1.0) == -1.0
    assert record == dict(record.items())
    assert record != {**record, "n": 5}
    assert (record["TPI"], record.TPI_unique) == (50.0, 60.0)
