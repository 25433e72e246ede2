"""How time and memory grow with the number of points: scans of one street, 10,000 to a million.

The beams of one scanner at one place are made denser, as many more in elevation as in azimuth, so
that the scans differ in their number of returns only.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import sqrt
from typing import Any

import numpy as np

from intervis.arrays import Float32Array
from intervis.delaunay import triangulate
from intervis.lab.speed.peak_memory import peak_bytes
from intervis.lab.speed.timing import Timing, Work, interleaved
from intervis.lab.worlds.scanner import Scanner
from intervis.lab.worlds.street.layout import build_street
from intervis.method.analysis import analyze
from intervis.plots.tables import Table
from intervis.progress import Progress, reporter
from intervis.settings import Settings
from intervis.sight import Scene

SIZES = (10_000, 30_000, 100_000, 300_000, 1_000_000)
"""Returns that the scans have, about."""

COLUMNS_PER_BEAM = 32.5
"""As of an HDL-64E."""

RETURNED = 0.895
"""Share of the beams that return from the street."""


@dataclass(frozen=True, eq=False)
class Growth:
    """Time and memory of a work over scans of several sizes.

    Attributes
    ----------
    work : str
    sizes : tuple of int
        Points of each scan, ascending.
    median_s : tuple of float
        Median time of each, seconds.
    times_s : tuple of lists of float
        All times of each.
    peak_bytes : tuple of int or None
        Memory taken at the peak, beside the scan and what was there before; None where the system
        does not tell.
    """

    work: str
    sizes: tuple[int, ...]
    median_s: tuple[float, ...]
    times_s: tuple[list[float], ...]
    peak_bytes: tuple[int, ...] | None

    @property
    def exponent(self) -> float:
        """Exponent k of the time ~ n^k that fits best, by least squares of the logarithms.

        Examples
        --------
        >>> Growth("a", (10, 100, 1000), (1.0, 10.0, 100.0), ([], [], []), None).exponent
        1.0
        """
        slope = np.polyfit(np.log(self.sizes), np.log(self.median_s), 1)[0]
        return round(float(slope), 6)

    @property
    def bytes_per_point(self) -> tuple[float, ...] | None:
        """Memory at the peak for each point of the scan."""
        if self.peak_bytes is None:
            return None
        return tuple(peak / size for peak, size in zip(self.peak_bytes, self.sizes, strict=True))


def _triangulation(scan: Float32Array) -> object:
    return triangulate(scan[:, :2].astype(np.float64))


def _region(scan: Float32Array) -> object:
    return analyze(scan, settings=Settings(tau=1, view="circle"))


WORKS: dict[str, Callable[[Float32Array], object]] = {
    "triangulation from above": _triangulation,
    "raw scan to region, tau 1, full circle": _region,
    "a scan made a scene": Scene.from_scan,
}
"""What is measured, by name."""


def street_scan(returns: int) -> Float32Array:
    """(N, 3) scan of the built-in street with about so many returns, metres.

    Raises
    ------
    MissingExtraError
        The packages of the extra ``lab`` are not installed.
    """
    beams = max(2, round(sqrt(returns / RETURNED / COLUMNS_PER_BEAM)))
    elevations_deg = tuple(np.linspace(2.0, -24.8, beams).tolist())
    columns = round(returns / RETURNED / beams)
    scanner = Scanner(elevations_deg=elevations_deg, columns=columns)
    world = build_street(0)
    pose = world.vehicle_pose_at(0.0)
    points, _ = scanner.scan(world.at(0.0), pose, np.random.default_rng(0))
    return points


def growth(
    sizes: Sequence[int] = SIZES, rounds: int = 5, *, progress: Progress | None = None
) -> list[Growth]:
    """Time the works on scans of several sizes, interleaved, and measure their memory one by one.

    Parameters
    ----------
    sizes : sequence of int
        Returns that the scans have, about; ascending, at least two.
    rounds : int
        Rounds of the timing, at least 3.
    progress : callable, optional
        Called `growth_steps` times.
    """
    note = reporter(progress)
    scans = [street_scan(size) for size in sizes]
    works = [
        Work(name, "intervis", partial(call, scan), len(scan))
        for name, call in WORKS.items()
        for scan in scans
    ]
    timings = interleaved(works, rounds, longest_s=60.0, progress=note)
    found = []
    for name in WORKS:
        own = [timing for timing in timings if timing.group == name]
        peaks = []
        for scan in scans:
            peaks.append(peak_bytes(name, scan))
            note(f"{name}, memory")
        found.append(_growth(name, own, peaks))
    return found


def growth_steps(sizes: Sequence[int], rounds: int) -> int:
    """How often `growth` calls its progress."""
    return len(WORKS) * len(sizes) * (rounds + 2)


def _growth(name: str, timings: Sequence[Timing], peaks: Sequence[int | None]) -> Growth:
    known = tuple(peak for peak in peaks if peak is not None)
    return Growth(
        name,
        tuple(timing.size for timing in timings),
        tuple(timing.median_s for timing in timings),
        tuple(timing.times_s for timing in timings),
        known if len(known) == len(timings) else None,
    )


def growth_table(found: Sequence[Growth], notes: Sequence[str] = ()) -> Table:
    """A row for each work and size: points, median, bytes a point at the peak, exponent."""
    rows = []
    for one in found:
        bytes_per_point = one.bytes_per_point
        for place, (size, median_s) in enumerate(zip(one.sizes, one.median_s, strict=True)):
            first = place == 0
            rows.append(
                (
                    one.work if first else "",
                    f"n^{one.exponent:.2f}" if first else "",
                    f"{size:,}",
                    f"{1e3 * median_s:.1f}",
                    "" if bytes_per_point is None else f"{bytes_per_point[place]:.0f}",
                )
            )
    headings = ("work", "time", "points", "ms", "bytes a point")
    told = "ms: median; time: fitted to the medians; bytes a point: at the peak, beside the scan."
    return Table("Growth", headings, tuple(rows), (told, *notes))


def growth_dict(found: Sequence[Growth]) -> list[dict[str, Any]]:
    """All of it for a JSON file."""
    return [
        {
            "work": one.work,
            "exponent": one.exponent,
            "points": one.sizes,
            "median_s": one.median_s,
            "times_s": one.times_s,
            "peak_bytes": one.peak_bytes,
        }
        for one in found
    ]
