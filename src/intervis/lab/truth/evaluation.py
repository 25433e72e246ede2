"""Evaluations: labels from held-out returns, a second scanner, or a simulated world's triangles."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from intervis.arrays import Float32Array, Float64Array
from intervis.drives import Drive
from intervis.errors import DriveError, SettingsError
from intervis.lab.truth.baselines import InputScans
from intervis.lab.truth.dynamic import dynamic_lines
from intervis.lab.truth.exact_world import Sampling, exact_query_sets
from intervis.lab.truth.held_out import DRIVE_RULE, LabelRule, held_out_labels, rule_for_scanner
from intervis.lab.truth.methods import Method, baseline_methods, engine
from intervis.lab.truth.pairs import Pairs, checked_poses, default_pairs
from intervis.lab.truth.protocols import Protocol, checked_protocol, distance_m, input_frames
from intervis.lab.truth.query_set import QuerySet, QuerySets
from intervis.lab.truth.results import EvaluationResult, run_methods
from intervis.lab.truth.scanner_set import ScannerSet
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.progress import Progress, silent
from intervis.transform import inverse, transform

MAX_SCANS = 40
"""A method gets at most so many scans: those whose poses are nearest to the viewpoint."""
SCAN_CACHE_SIZE = 64

QueryFrame = Literal["scene", "scanner"]
QUERY_FRAMES: tuple[QueryFrame, ...] = get_args(QueryFrame)
"""Frames in which scanners of one moment are queried, see `evaluate_together`."""


def evaluate_held_out(
    drive: Drive,
    *,
    pairs: Pairs | None = None,
    protocol: str = "single",
    baselines: bool = False,
    progress: Progress | None = None,
    methods: Sequence[Method] | None = None,
    rule: LabelRule = DRIVE_RULE,
    rate_hz: float | None = None,
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
    rule : LabelRule
        How the returns of scan j label points.
    rate_hz : float, optional
        Frames a second, for a drive without timestamps.

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
        No such protocol, or the rate is not positive.
    """
    known = checked_protocol(protocol)
    results, labels, target_count = run_methods(
        held_out_query_sets(drive, chosen_pairs(drive, pairs), known, rule, rate_hz),
        methods or methods_for(known, baselines=baselines),
        progress or silent,
    )
    return EvaluationResult(drive.name, "held-out returns", known, labels, target_count, results)


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
        progress or silent,
    )
    ground_truth = "exact world, rays by Embree"
    return EvaluationResult(drive.name, ground_truth, known, labels, target_count, results)


def evaluate_together(
    scanners: ScannerSet,
    *,
    frame: str = "scene",
    baselines: bool = False,
    progress: Progress | None = None,
    methods: Sequence[Method] | None = None,
) -> EvaluationResult:
    """Evaluate sight lines through the scan of one scanner against a second one of the same moment.

    The methods get the scan of the known scanner. The viewpoint is the place of the reference
    scanner, whose returns are hidden and give the labels (`rule_for_scanner`). Nothing moved
    between the two, and no pose drifted.

    Parameters
    ----------
    scanners : ScannerSet
        With the pairs to evaluate.
    frame : {"scene", "scanner"}
        Frame of the queries. ``scene``: the scan is added with its pose. ``scanner``: the frame of
        the known scanner, with the identity as its pose, so that a method is not told the tilt.
    baselines, progress, methods
        As in `evaluate_held_out`.

    Raises
    ------
    DriveError
        A pair without any labelled point.
    SettingsError
        No such frame.
    """
    results, labels, target_count = run_methods(
        together_query_sets(scanners, checked_frame(frame)),
        methods or methods_for("single", baselines=baselines),
        progress or silent,
    )
    ground_truth = f"a second scanner, queries in the frame of the {frame}"
    return EvaluationResult(scanners.name, ground_truth, "together", labels, target_count, results)


def checked_frame(name: str) -> QueryFrame:
    """The frame of the queries.

    Raises
    ------
    SettingsError
        There is no such frame.
    """
    for frame in QUERY_FRAMES:
        if name == frame:
            return frame
    raise SettingsError(f"there is no frame {name!r}; choose one of {', '.join(QUERY_FRAMES)}.")


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
    rule: LabelRule = DRIVE_RULE,
    rate_hz: float | None = None,
) -> QuerySets:
    """One query set for each pair of frames (i, j); see `evaluate_held_out`."""
    poses, scan_of = _poses(drive), _cached_scans(drive)
    times_ns = drive.timestamps_ns or _times_at_rate(drive.frame_numbers, rate_hz)
    for i, j in pairs:
        labels = held_out_labels(scan_of(i), poses[i], scan_of(j), poses[j], rule)
        if len(labels.index) == 0:
            raise DriveError(
                f"scan {j} gives no label for any point of scan {i}: choose frames that see the"
                " same place."
            )
        numbers = _nearest(input_frames(protocol, poses, i, j), poses, poses[j], i)
        viewpoint = poses[j][:3, 3].copy()
        targets = transform(poses[i], scan_of(i)[labels.index])
        dynamic = dynamic_lines(viewpoint, targets, scan_of(i), poses[i], scan_of(j), poses[j])
        yield QuerySet(
            f"{i}:{j}",
            _input_scans(times_ns, numbers, poses, scan_of, i, j),
            viewpoint,
            targets,
            labels.visible,
            {"static": ~dynamic, "dynamic": dynamic},
        )


def together_query_sets(scanners: ScannerSet, frame: QueryFrame = "scene") -> QuerySets:
    """One query set for each pair of scanners; see `evaluate_together`."""
    for names in scanners.pairs:
        known, reference = (scanners.scanner(name) for name in names)
        rule = rule_for_scanner(reference.points)
        labels = held_out_labels(known.points, known.pose, reference.points, reference.pose, rule)
        if len(labels.index) == 0:
            raise DriveError(
                f"scanner {reference.name} gives no label for any point of scanner {known.name}:"
                " check the poses, and choose scanners that see the same place."
            )
        query_from_scanner = known.pose if frame == "scene" else np.eye(4)
        query_from_scene = query_from_scanner @ inverse(known.pose)
        yield QuerySet(
            ":".join(names),
            InputScans(
                (scanners.index(known.name),),
                (known.points,),
                (query_from_scanner,),
                scanners.index(known.name),
                scanners.index(reference.name),
            ),
            transform(query_from_scene, reference.pose[:3, 3]),
            transform(query_from_scanner, known.points[labels.index]),
            labels.visible,
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


def _times_at_rate(numbers: Sequence[int], rate_hz: float | None) -> dict[int, int]:
    """Timestamps of frames at a constant rate, nanoseconds; none without a rate."""
    if rate_hz is None:
        return {}
    if not (np.isfinite(rate_hz) and rate_hz > 0):
        raise SettingsError(f"the rate must be positive, in frames a second, got {rate_hz}.")
    return {number: round(1e9 * number / rate_hz) for number in numbers}


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
