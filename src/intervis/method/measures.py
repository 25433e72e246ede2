"""The paper's measures (Sec. 4, Eq. 15 to 17)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields


class Record(Mapping[str, float]):
    """Base of dataclasses of numbers that are also mappings: ``m["TPI"]``, ``dict(m)``, ``in``."""

    def __iter__(self) -> Iterator[str]:
        """Names of the fields, in order."""
        return (field.name for field in fields(self))  # type: ignore[arg-type]

    def __len__(self) -> int:
        return len(fields(self))  # type: ignore[arg-type]

    def __getitem__(self, name: str) -> float:
        if name not in tuple(self):
            raise KeyError(name)
        value: float = getattr(self, name)
        return value


@dataclass(frozen=True, eq=False)
class Measures(Record):
    """The paper's measures of one frame; a mapping from their names as well.

    Attributes
    ----------
    n_raw : int
        Returns of the raw scan.
    n_dropped : int
        Rows of the scan that are no return, left out: NaN, infinite, or all three coordinates 0.
    n_fov : int
        Returns in the field of view.
    n : int
        Nodes after sampling.
    N : int
        Finite elements (triangles).
    SP : int
        Unique undirected edges, the pairs that are compared: N + n - 1.
    ARR, TPI, TPI_unique, DCP : float
        Eq. 15, Eq. 16, the share of unique edges, and Eq. 17, in per cent. TPI cannot exceed
        100 SP / (3 N), just over 50, because 3 N counts every inner edge twice.

    Examples
    --------
    >>> result = measure(n_raw=9, n_dropped=0, n_fov=9, n=4, elements=2, edges=5, intervisible=3)
    >>> result.TPI, result["TPI"], "TPI" in result
    (50.0, 50.0, True)
    """

    n_raw: int
    n_dropped: int
    n_fov: int
    n: int
    N: int
    SP: int
    ARR: float
    TPI: float
    TPI_unique: float
    DCP: float


def average_redundancy_removal(n_raw: int, n: int) -> float:
    """ARR (Eq. 15), per cent: the share of raw points that are no node.

    Examples
    --------
    >>> round(average_redundancy_removal(125_148, 572), 2)
    99.54
    """
    return 100.0 * (1.0 - n / n_raw) if n_raw else 0.0


def two_point_intervisibility(intervisible_edges: int, elements: int) -> float:
    """TPI (Eq. 16), per cent: intervisible edges divided by three times the finite elements."""
    return 100.0 * intervisible_edges / (3 * elements) if elements else 0.0


def unique_intervisibility(intervisible_edges: int, edges: int) -> float:
    """TPI_unique, per cent: the share of the unique edges that are intervisible, up to 100."""
    return 100.0 * intervisible_edges / edges if edges else 0.0


def decreasing_calculation(n_raw: int, intervisible_edges: float) -> float:
    """DCP (Eq. 17), per cent: sight lines saved, compared with one for each raw point.

    Examples
    --------
    Table 2, tau = 10: N = 3982 and TPI = 47.61 % of 3 N edges.

    >>> round(decreasing_calculation(125_148, 0.4761 * 3 * 3982), 2)
    95.46
    """
    return 100.0 * (1.0 - intervisible_edges / n_raw) if n_raw else 0.0


def measure(
    *, n_raw: int, n_dropped: int, n_fov: int, n: int, elements: int, edges: int, intervisible: int
) -> Measures:
    """All measures of a frame from its counts."""
    return Measures(
        n_raw=n_raw,
        n_dropped=n_dropped,
        n_fov=n_fov,
        n=n,
        N=elements,
        SP=edges,
        ARR=average_redundancy_removal(n_raw, n),
        TPI=two_point_intervisibility(intervisible, elements),
        TPI_unique=unique_intervisibility(intervisible, edges),
        DCP=decreasing_calculation(n_raw, intervisible),
    )
