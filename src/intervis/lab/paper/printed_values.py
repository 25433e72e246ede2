"""The numbers that the paper prints in its Tables 2, 3 and 4."""

from typing import NamedTuple

N_RAW = 125_148
"""Returns of the paper's raw scan (Table 4, global points)."""

N_FOV = 20_008
"""Returns in the paper's field of view (Table 4, interpolation points)."""


class Table2Row(NamedTuple):
    """Finite elements N, tested pairs SP, and three shares in per cent."""

    N: int
    SP: int
    ARR: float
    TPI: float
    DCP: float


class Table3Row(NamedTuple):
    """Seconds of one run, mean seconds of ten runs (A...), two deviations in 1/100 s."""

    S1: float
    S2: float
    S3: float
    TIME: float
    AS1: float
    AS2: float
    AS3: float
    ATIME: float
    VAR: float
    STD: float


class Table4Row(NamedTuple):
    """Nodes, three shares in per cent (None where the paper prints a dash), seconds."""

    nodes: int
    ARR: float | None
    TPI: float
    DCP: float | None
    time_s: float


GLOBAL_POINTS, INTERPOLATION_POINTS = "global points", "interpolation points"
PROPOSED = "the paper's method"
"""The three methods of Table 4; the paper calls its own "ours"."""

TABLE_2 = {
    10: Table2Row(3982, 5982, 98.40, 47.61, 95.46),
    20: Table2Row(1984, 2984, 99.20, 44.17, 97.90),
    30: Table2Row(1320, 1986, 99.47, 41.04, 98.70),
    40: Table2Row(987, 1487, 99.60, 38.57, 99.09),
    50: Table2Row(786, 1186, 99.68, 35.79, 99.33),
    60: Table2Row(653, 986, 99.73, 35.78, 99.44),
    70: Table2Row(557, 842, 99.77, 33.87, 99.55),
    80: Table2Row(488, 738, 99.80, 30.94, 99.64),
    90: Table2Row(432, 654, 99.82, 31.33, 99.68),
    100: Table2Row(388, 588, 99.84, 30.50, 99.72),
}
"""By granularity tau."""

TABLE_3 = {
    10: Table3Row(
        0.0010, 0.0053, 0.3854, 0.3917, 0.00083, 0.00515, 0.36934, 0.37532, 0.9197, 0.9695
    ),
    20: Table3Row(
        0.0008, 0.0026, 0.1696, 0.1730, 0.00080, 0.00281, 0.16817, 0.17178, 0.5848, 0.6165
    ),
    30: Table3Row(
        0.0008, 0.0018, 0.1105, 0.1131, 0.00076, 0.00183, 0.11383, 0.11642, 0.2544, 0.2682
    ),
    40: Table3Row(
        0.0008, 0.0015, 0.0858, 0.0881, 0.00075, 0.00150, 0.08842, 0.09067, 0.1532, 0.1615
    ),
    50: Table3Row(
        0.0008, 0.0013, 0.0808, 0.0829, 0.00074, 0.00157, 0.08625, 0.08856, 0.2615, 0.2757
    ),
    60: Table3Row(
        0.0009, 0.0011, 0.0619, 0.0639, 0.00078, 0.00116, 0.06341, 0.06535, 0.1819, 0.1918
    ),
    70: Table3Row(
        0.0007, 0.0011, 0.0651, 0.0669, 0.00079, 0.00107, 0.06327, 0.06513, 0.4069, 0.4289
    ),
    80: Table3Row(
        0.0009, 0.0010, 0.0592, 0.0611, 0.00075, 0.00091, 0.05188, 0.05354, 0.1563, 0.1648
    ),
    90: Table3Row(
        0.0009, 0.0009, 0.0521, 0.0539, 0.00072, 0.00093, 0.05130, 0.05295, 0.1732, 0.1825
    ),
    100: Table3Row(
        0.0008, 0.0008, 0.0459, 0.0475, 0.00073, 0.00088, 0.04672, 0.04833, 0.2473, 0.2607
    ),
}
"""By granularity tau."""

TABLE_4 = {
    GLOBAL_POINTS: Table4Row(125_148, None, 50.72, None, 1163.876),
    INTERPOLATION_POINTS: Table4Row(20_008, 84.01, 50.01, 52.08, 17.537),
    PROPOSED: Table4Row(572, 99.54, 50.25, 98.65, 0.1044),
}
"""By method."""

TAUS = tuple(TABLE_2)
"""The granularities of Tables 2 and 3."""

TAU_TABLE_4 = 35
"""The granularity of Table 4: 20,008 returns in kernels of 35 give 572 nodes."""

RUNS = 10
"""Runs per mean of Table 3."""

CAMERA_HZ, LIDAR_HZ = 25.0, 10.0
"""Rates of the paper's camera and scanner."""


def ceiling_of_tpi(n: int, elements: int) -> float:
    """The greatest TPI of a mesh of n nodes, per cent: all its N + n - 1 edges over 3 N.

    Examples
    --------
    The paper's method in Table 4 has 572 nodes and, from its DCP, 1121 elements:

    >>> round(ceiling_of_tpi(572, 1121), 2)
    50.31
    """
    return 100.0 * (elements + n - 1) / (3 * elements) if elements else 0.0
