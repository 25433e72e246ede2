"""Evaluate: a drive against its own held-out returns, or against the triangles of its world."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

from intervis.arrays import Float32Array, Float64Array
from intervis.drives import Drive
from intervis.errors import DriveError
from intervis.lab.truth import exact
from intervis.lab.truth.baselines import Seen
from intervis.lab.truth.dynamic import changed_between
from intervis.lab.truth.held_out import judge
from intervis.lab.truth.methods import Method, ours, theirs
from intervis.lab.truth.pairs import Pairs, default_pairs, posed
from intervis.lab.truth.protocols import Protocol, checked_protocol, distance_m, frames_to_see
from intervis.lab.truth.query_set import Question, Questions
from intervis.lab.truth.scoring import Evaluation, run_questions
from intervis.lab.worlds.ray_casting import RayCaster
from intervis.transform import transform

Progress = Callable[[str], None]
"""Called with a note after every answer."""

MOST_SCANS = 40
"""Of more scans than this, a method is given those whose poses lie nearest to the viewpoint."""
SCANS_IN_MEMORY = 64


def evaluate_held_out(
    drive: Drive,
    *,
    pairs: Pairs | None = None,
    protocol: str = "single",
    rivals: bool = False,
    progress: Progress | None = None,
    methods: Sequence[Method] | None = None,
) -> Evaluation:
    """Judge lines of sight through a drive by returns that the method does not see.

    Where the drive says when its frames were taken, the method is asked about the moment of
    scan j, and so it is in `evaluate_world` about the moment of the frame asked about.

    Parameters
    ----------
    drive : Drive
        With poses.
    pairs : sequence of (i, j), optional
        Frame numbers: scan i is asked about, from pose j, judged by scan j. Default: see
        `intervis.lab.truth.pairs.default_pairs`.
    protocol : {"single", "past", "map"}
        What a method may see, see `intervis.lab.truth.protocols`.
    rivals : bool
        Whether today's tools answer the same questions.
    progress : callable, optional
        Called with a note after each method's answer to each pair.
    methods : sequence of Method, optional
        Who answers, instead of the engine (and the rivals).

    Returns
    -------
    Evaluation
        Its rows tell lines on which something moved between the two scans from the others; see
        `intervis.lab.truth.dynamic`.

    Raises
    ------
    DriveError
        No poses, no such frame, a frame paired with itself, a drive that moves too little, or a
        pair without one judged point.
    SettingsError
        No such protocol.
    """
    known = checked_protocol(protocol)
    asked = chosen_pairs(drive, pairs)
    rows, labels, points = run_questions(
        _held_out_questions(drive, asked, known),
        methods or methods_for(known, rivals=rivals),
        progress or _nothing,
    )
    return Evaluation(drive.name, "held-out returns", known, labels, points, tuple(rows))


def evaluate_world(
    drive: Drive,
    triangles_at: Callable[[int], Float64Array],
    *,
    frames: Sequence[int] | None = None,
    protocol: str = "single",
    rivals: bool = False,
    sampling: exact.Sampling | None = None,
    progress: Progress | None = None,
    methods: Sequence[Method] | None = None,
) -> Evaluation:
    """Judge lines of sight through a simulated drive by the triangles that were scanned.

    Parameters
    ----------
    drive : Drive
        With poses.
    triangles_at : callable
        Triangles (T, 3, 3) of the world at a frame's moment, in the frame of the poses.
    frames : sequence of int, optional
        Whose scans are asked about. Default: three, spread evenly.
    protocol : {"single", "past", "map"}
        A world has no judging scan: ``past`` is all scans up to the asked one, ``map`` all scans.
    rivals, progress, methods
        As in `evaluate_held_out`.
    sampling : Sampling
        How much is asked; see `intervis.lab.truth.exact`.

    Returns
    -------
    Evaluation
        Its rows tell returns and free points apart.

    Raises
    ------
    DriveError
        No poses, or no such frame.
    SettingsError
        No such protocol.
    """
    known = checked_protocol(protocol)
    poses = _poses(drive, least=1)
    numbers = world_frames(drive, frames)
    questions = _world_questions(drive, poses, triangles_at, numbers, known, sampling)
    rows, labels, points = run_questions(
        questions, methods or methods_for(known, rivals=rivals), progress or _nothing
    )
    truth = "exact world, rays by Embree"
    return Evaluation(drive.name, truth, known, labels, points, tuple(rows))


def methods_for(protocol: Protocol, *, rivals: bool) -> list[Method]:
    """Who answers in a protocol: ours first."""
    return [ours(), *(theirs(several_scans=protocol != "single") if rivals else [])]


def chosen_pairs(drive: Drive, pairs: Pairs | None) -> Pairs:
    """The pairs asked for, checked, or the default ones.

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
        frames_to_see("single", poses, i, j)  # complains where one of them has no pose
    return pairs


def world_frames(drive: Drive, frames: Sequence[int] | None) -> tuple[int, ...]:
    """The frames asked for, checked, or three spread evenly.

    Raises
    ------
    DriveError
        There is no such frame.
    """
    numbers = drive.frame_numbers
    if frames is None:
        return tuple(numbers[len(numbers) * part // 6] for part in (1, 3, 5))
    _check_frames(drive, frames)
    return tuple(frames)


def _check_frames(drive: Drive, numbers: Sequence[int]) -> None:
    for number in numbers:
        if number not in drive:
            drive[number]  # raises, and names the nearest numbers


def _held_out_questions(drive: Drive, pairs: Pairs, protocol: Protocol) -> Questions:
    poses, scan_of = _poses(drive), _reader(drive)
    for i, j in pairs:
        judgement = judge(scan_of(i), poses[i], scan_of(j), poses[j])
        if len(judgement.index) == 0:
            raise DriveError(
                f"scan {j} can judge no point of scan {i}: choose frames that see the same place."
            )
        numbers = _nearest(frames_to_see(protocol, poses, i, j), poses, poses[j], i)
        viewpoint = poses[j][:3, 3].copy()
        targets = transform(poses[i], scan_of(i)[judgement.index])
        changed = changed_between(viewpoint, targets, scan_of(i), poses[i], scan_of(j), poses[j])
        yield Question(
            f"{i}:{j}",
            _seen(drive, numbers, poses, scan_of, i, j),
            viewpoint,
            targets,
            judgement.visible,
            {"nothing moved": ~changed, "something moved": changed},
        )


def _world_questions(
    drive: Drive,
    poses: Mapping[int, Float64Array],
    triangles_at: Callable[[int], Float64Array],
    numbers: Sequence[int],
    protocol: Protocol,
    sampling: exact.Sampling | None,
) -> Questions:
    scan_of = _reader(drive)
    for number in numbers:
        others = {
            "single": (number,),
            "past": tuple(n for n in sorted(poses) if n <= number),
            "map": tuple(sorted(poses)),
        }[protocol]
        nearest = _nearest(others, poses, poses[number], number)
        seen = _seen(drive, nearest, poses, scan_of, number, number)
        yield from exact.questions(seen, RayCaster(triangles_at(number)), sampling)


def _seen(
    drive: Drive,
    numbers: Sequence[int],
    poses: Mapping[int, Float64Array],
    scan_of: Callable[[int], Float32Array],
    i: int,
    j: int,
) -> Seen:
    return Seen(
        tuple(numbers),
        tuple(scan_of(number) for number in numbers),
        tuple(poses[number] for number in numbers),
        i,
        j,
        _stamps_s(drive.timestamps_ns, numbers, j),
    )


def _stamps_s(
    timestamps_ns: Mapping[int, int], numbers: Sequence[int], moment: int
) -> tuple[float, ...] | None:
    """Seconds from frame `moment` to each of the frames, None where one of them has no stamp."""
    if any(number not in timestamps_ns for number in (moment, *numbers)):
        return None
    return tuple(1e-9 * (timestamps_ns[number] - timestamps_ns[moment]) for number in numbers)


def _nearest(
    numbers: Sequence[int], poses: Mapping[int, Float64Array], place: Float64Array, i: int
) -> tuple[int, ...]:
    """At most so many frames, the nearest to a pose; frame i stays where it was among them."""
    ordered = sorted(numbers, key=lambda n: (n != i, distance_m(poses[n], place)))
    return tuple(sorted(ordered[:MOST_SCANS]))


def _poses(drive: Drive, least: int = 2) -> dict[int, Float64Array]:
    poses = drive.poses or {}
    known = {number: poses[number] for number in drive.frame_numbers if number in poses}
    posed(known, drive.name, least)
    return known


def _reader(drive: Drive) -> Callable[[int], Float32Array]:
    """Scans by number; the last ones read stay in memory, the same array each time."""
    return lru_cache(SCANS_IN_MEMORY)(lambda number: drive[number].points)


def _nothing(note: str) -> None:
    pass
