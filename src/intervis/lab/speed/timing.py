"""Times of several pieces of work, interleaved, so that a busy machine slows all of them down."""

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median, quantiles
from time import perf_counter

from intervis.progress import Progress, reporter

LEAST_ROUNDS = 3


@dataclass(frozen=True)
class Work:
    """A piece of work.

    Attributes
    ----------
    group : str
        What is done; works of one group do the same job.
    by : str
        Who does it: ``intervis``, or the name of another tool.
    call : function without arguments
        Does it once.
    size : int
        Number of points, lines or nodes.
    """

    group: str
    by: str
    call: Callable[[], object]
    size: int


@dataclass
class Timing:
    """Times of a piece of work, seconds, one for each round."""

    group: str
    by: str
    size: int
    times_s: list[float] = field(default_factory=list)

    @property
    def median_s(self) -> float:
        """Median of the times."""
        return median(self.times_s)

    @property
    def spread(self) -> float:
        """Half the distance of the quartiles, as a share of the median.

        Examples
        --------
        >>> Timing("a", "intervis", 1, [1.0, 2.0, 3.0]).spread
        0.5
        """
        first, _, third = quantiles(self.times_s, method="exclusive")
        return (third - first) / 2 / self.median_s


def interleaved(
    works: Sequence[Work],
    rounds: int,
    *,
    longest_s: float = 20.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> list[Timing]:
    """Time works in turn: each round does all of them once, in an order drawn anew.

    Before the first round each is done once without being timed, which compiles kernels and fills
    caches.

    Parameters
    ----------
    works : sequence of Work
        What is timed.
    rounds : int
        Rounds, at least 3.
    longest_s : float
        A work that has taken longer in all is left out of further rounds, after three.
    seed : int
        Seed of the orders.
    progress : callable, optional
        Called ``len(works) * (rounds + 1)`` times.
    """
    rng, note = random.Random(seed), reporter(progress)
    timings = [Timing(work.group, work.by, work.size) for work in works]
    for work in works:
        work.call()
        note(f"{work.group}, {work.by}")
    for _ in range(max(rounds, LEAST_ROUNDS)):
        for place in rng.sample(range(len(works)), len(works)):
            work, timing = works[place], timings[place]
            if len(timing.times_s) < LEAST_ROUNDS or sum(timing.times_s) < longest_s:
                start = perf_counter()
                work.call()
                timing.times_s.append(perf_counter() - start)
            note(f"{work.group}, {work.by}")
    return timings
