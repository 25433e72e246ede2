"""Evaluation of a drive, against held-out returns or the triangles of its simulated world."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

from intervis.arrays import Float32Array, Float64Array
from intervis.drives import Drive
from intervis.errors import DriveError
from intervis.lab.truth.baselines import InputScans
from intervis.lab.truth.dynamic import dynamic_lines
from intervis.lab.truth.exact_world import Sampling, exact_query_sets
from intervis.lab.truth.labelled_targets import (
    HELD_OUT,
    HeldOutSettings,
    labelled_targets,
    targets_suffix,
)
from intervis.lab.truth.methods import Method, baseline_methods, engine
from intervis.lab.truth.pairs import Pairs, checked_poses, default_pairs
from intervis.lab.truth.protocols import Protocol, checked_protocol, distance_m, input_frames
from intervis.lab.truth.query_set import QuerySet, QuerySets
from intervis.lab.truth.results import EvaluationResult, run_methods
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.progress import Progress, reporter

MAX_SCANS = 40
"""A method gets at most so many scans: those whose poses are nearest to the viewpoint."""
SCAN_CACHE_SIZE = 64


def evaluate_held_out(
    drive: Drive,
    *,
    pairs: Pairs | None = None,
    protocol: str = "single",
    baselines: bool = False,
    progress: Progress | None = None,
    methods: Sequence[Method] | None = None,
    settings: HeldOutSettings = HELD_OUT,
) -> EvaluationResult:
    """Evaluate sight lines through a drive against the returns of held-out scans.

    Where the drive has timestamps, or the rate of its frames is given, the methods are queried for
    the time of scan j. They get every return of their scans, near ones too.

    Parameters
    ----------
    drive : Drive
        With poses.
    pairs : sequence of (i, j), optional
        Frame numbers: scan i gives the targets, pose j the viewpoint, scan j the labels. Default:
        see `intervis.lab.truth.pairs.default_pairs`.
    protocol : {"single", "past", "map"}
        Which scans a method gets, see `intervis.lab.truth.protocols`.
    baselines : bool
        Whether to evaluate the baselines too.
    progress : callable, optional
        Called with a note after each method has answered a query set.
    methods : sequence of Method, optional
        The methods to evaluate, instead of the engine (and the baselines).
    settings : HeldOutSettings
        Targets, labels, and the rate of a drive without timestamps.

    Returns
    -------
    EvaluationResult
        Static and dynamic sight lines are subsets of the targets; see
        `intervis.lab.truth.dynamic`.

    Raises
    ------
    DriveError
        No poses, no such frame, a frame paired with itself, a drive that moves too little, or a
        pair without any labelled point.
    SettingsError
        No such protocol.
    """
    known = checked_protocol(protocol)
    results, labels, target_count = run_methods(
        held_out_query_sets(drive, chosen_pairs(drive, pairs), known, settings),
        methods or methods_for(known, baselines=baselines),
        reporter(progress),
    )
    ground_truth = "held-out returns" + targets_suffix(settings.targets)
    return EvaluationResult(drive.name, ground_truth, known, labels, target_count, results)


def evaluate_world(
    drive: Drive,
    triangles_at: Callable[[int], Float64Array],
    *,
    frames: Sequence[int] | None = None,
    protocol: str = "single",
    baselines: bool = False,
    sampling: Sampling | None = None,
    progress: Progress | None = None,
    methods: Sequence[Method] | None = None,
) -> EvaluationResult:
    """Evaluate sight lines through a simulated drive against the triangles that were scanned.

    Where the drive has timestamps, the methods are queried for the time of the target frame.

    Parameters
    ----------
    drive : Drive
        With poses.
    triangles_at : callable
        Triangles (T, 3, 3) of the world at the time of a frame, in the frame of the poses.
    frames : sequence of int, optional
        Target frames. Default: three, spread evenly.
    protocol : {"single", "past", "map"}
        There is no reference scan here: ``past`` is all scans up to the target frame, ``map`` all
        scans.
    baselines, progress, methods
        As in `evaluate_held_out`.
    sampling : Sampling
        Number of viewpoints and targets; see `intervis.lab.truth.exact_world`.

    Returns
    -------
    EvaluationResult
        Subsets: kinds of targets, viewpoints in scanned space, and answerable lines.

    Raises
    ------
    DriveError
        No poses, or no such frame.
    SettingsError
        No such protocol.
    """
    known = checked_protocol(protocol)
    results, labels, target_count = run_methods(
        world_query_sets(drive, triangles_at, world_frames(drive, frames), known, sampling),
        methods or methods_for(known, baselines=baselines),
        reporter(progress),
    )
    ground_truth = "exact world, rays by Embree"
    return EvaluationResult(drive.name, ground_truth, known, labels, target_count, results)


def methods_for(protocol: Protocol, *, baselines: bool) -> list[Method]:
    """The methods to evaluate under a protocol: the engine first."""
    return [engine(), *(baseline_methods(several_scans=protocol != "single") if baselines else [])]


def chosen_pairs(drive: Drive, pairs: Pairs | None) -> Pairs:
    """The requested pairs, checked, or the default ones.

    Raises
    ------
    DriveError
        See `evaluate_held_out`.
    """
    poses = _poses(drive)
    if pairs is None:
        found = default_pairs(poses)
        if not found:
            raise DriveError(
                f"{drive.name} moves too little to choose pairs of frames 4 to 16 m apart:"
                " name them, as in 0:5,0:10."
            )
        return found
    for i, j in pairs:
        _check_frames(drive, (i, j))
        input_frames("single", poses, i, j)  # raises where a pose is missing or i equals j
    return pairs


def world_frames(drive: Drive, frames: Sequence[int] | None) -> tuple[int, ...]:
    """The requested frames, checked, or three spread evenly.

    Raises
    ------
    DriveError
        There is no such frame.
    """
    numbers = drive.frame_numbers
    if frames is None:
        return tuple(numbers[len(numbers) * sixths // 6] for sixths in (1, 3, 5))
    _check_frames(drive, frames)
    return tuple(frames)


def _check_frames(drive: Drive, numbers: Sequence[int]) -> None:
    for number in numbers:
        if number not in drive:
            drive[number]  # raises a DriveError that names the nearest numbers


def held_out_query_sets(
    drive: Drive,
    pairs: Pairs,
    protocol: Protocol,
    settings: HeldOutSettings = HELD_OUT,
) -> QuerySets:
    """One query set for each pair of frames (i, j); see `evaluate_held_out`."""
    poses, scan_of = _poses(drive), _cached_scans(drive)
    timestamps_ns = settings.timestamps_ns(drive)
    for i, j in pairs:
        targets, visible = labelled_targets(
            settings.targets, (scan_of(i), poses[i]), (scan_of(j), poses[j]), settings.rule, (i, j)
        )
        if len(targets) == 0:
            raise DriveError(
                f"scan {j} gives no label for any point of scan {i}: choose frames that see the"
                " same place."
            )
        numbers = _nearest(input_frames(protocol, poses, i, j), poses, poses[j], i)
        viewpoint = poses[j][:3, 3].copy()
        dynamic = dynamic_lines(viewpoint, targets, scan_of(i), poses[i], scan_of(j), poses[j])
        yield QuerySet(
            f"{i}:{j}",
            _input_scans(timestamps_ns, numbers, poses, scan_of, i, j),
            viewpoint,
            targets,
            visible,
            {"static": ~dynamic, "dynamic": dynamic},
        )


def world_query_sets(
    drive: Drive,
    triangles_at: Callable[[int], Float64Array],
    numbers: Sequence[int],
    protocol: Protocol,
    sampling: Sampling | None = None,
) -> QuerySets:
    """The query sets of frames of a simulated drive; see `evaluate_world`."""
    poses, scan_of = _poses(drive, least=1), _cached_scans(drive)
    for number in numbers:
        allowed = {
            "single": (number,),
            "past": tuple(n for n in sorted(poses) if n <= number),
            "map": tuple(sorted(poses)),
        }[protocol]
        nearest = _nearest(allowed, poses, poses[number], number)
        inputs = _input_scans(drive.timestamps_ns, nearest, poses, scan_of, number, number)
        yield from exact_query_sets(inputs, RayCaster(triangles_at(number)), sampling)


def _input_scans(
    timestamps_ns: Mapping[int, int],
    numbers: Sequence[int],
    poses: Mapping[int, Float64Array],
    scan_of: Callable[[int], Float32Array],
    i: int,
    j: int,
) -> InputScans:
    return InputScans(
        tuple(numbers),
        tuple(scan_of(number) for number in numbers),
        tuple(poses[number] for number in numbers),
        i,
        j,
        _seconds_since(timestamps_ns, numbers, j),
    )


def _seconds_since(
    timestamps_ns: Mapping[int, int], numbers: Sequence[int], reference: int
) -> tuple[float, ...] | None:
    """Seconds from frame `reference` to each frame; None where one of them has no timestamp."""
    if any(number not in timestamps_ns for number in (reference, *numbers)):
        return None
    return tuple(1e-9 * (timestamps_ns[number] - timestamps_ns[reference]) for number in numbers)


def _nearest(
    numbers: Sequence[int], poses: Mapping[int, Float64Array], pose: Float64Array, i: int
) -> tuple[int, ...]:
    """Frame i, if it is in `numbers`, and the others nearest to a pose: `MAX_SCANS` at most."""
    ordered = sorted(numbers, key=lambda n: (n != i, distance_m(poses[n], pose)))
    return tuple(sorted(ordered[:MAX_SCANS]))


def _poses(drive: Drive, least: int = 2) -> dict[int, Float64Array]:
    poses = drive.poses or {}
    known = {number: poses[number] for number in drive.frame_numbers if number in poses}
    checked_poses(known, drive.name, least)
    return known


def _cached_scans(drive: Drive) -> Callable[[int], Float32Array]:
    """Scans by number; repeated calls return the same array, which `SurfaceCache` relies on."""
    return lru_cache(SCAN_CACHE_SIZE)(lambda number: drive[number].points)
