"""``intervis sight``: sight lines from one place, with explanations."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from intervis.cli import options
from intervis.cli.run import CameraName, Source
from intervis.cli.survey import Risk
from intervis.cli.terminal import progress, show

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from intervis.arrays import Float64Array
    from intervis.drives import Drive, Frame
    from intervis.sight import Explanation, Scene, Sight
    from intervis.uses.semantics.labelled_scene import LabelledScene

Point = tuple[float, float, float]
FrameNumber = Annotated[
    int | None, typer.Option("--frame", metavar="N", help="Frame number; default: the first.")
]
FROM = typer.Option(
    "--from",
    metavar="X,Y,Z|camera|sensor",
    help="Viewpoint: coordinates in the sensor frame, metres, or a name.",
)
STATE_NAMES = ("visible", "occluded", "unknown")


def sight(
    source: Source,
    start: Annotated[str, FROM],
    ends: Annotated[
        list[str] | None,
        typer.Option(
            "--to", metavar="X,Y,Z|camera|sensor", help="End, in the same form; may be repeated."
        ),
    ] = None,
    targets: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|returns",
            help="Many ends: the points of a file in the sensor frame, or the returns of frame N"
            " that --without leaves.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the answers for all ends as .csv, .json, .npz or .ply."
        ),
    ] = None,
    frame: FrameNumber = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="A:B",
            help="Add the scans of frames A to B - 1, registered to frame N by the poses; also A:,"
            " :B or A.",
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            metavar="CLASS",
            help="Leave out the returns of a class of the drive's labels or boxes: vegetation, car,"
            " 'parked car'; may be repeated.",
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png|FILE.svg",
            help="Draw the sight line, and the returns that are visible from its start.",
        ),
    ] = None,
    blockers: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png|FILE.svg",
            help="Draw which classes occlude the returns from the start; before and after"
            " --without.",
        ),
    ] = None,
    risk: Risk = None,
    camera: CameraName = None,
) -> None:
    """Explain sight lines from one place.

    Prints the state of each line, the probability that it is open, the blocker, and the clearance;
    of the lines to many targets, how many have which state. Where the drive has labels of points or
    boxes of objects, also the class of what occludes them.
    """
    from intervis.errors import DriveError, SettingsError

    frame_range = options.frame_range(frames)
    given_start = options.place(start, "--from")
    given_ends = [options.place(end, "--to") for end in ends or ()]
    if not given_ends and targets is None:
        raise SettingsError("give the end of a sight line as --to X,Y,Z, or many with --targets.")
    options.check_picture_file(picture)
    options.check_picture_file(blockers)
    read = [source, None if targets in (None, "returns") else Path(targets)]
    options.check_output_files({"--picture": picture, "--blockers": blockers, "--out": out}, read)

    import numpy as np

    from intervis.drives import open_drive
    from intervis.sight.occupancy_model import DEFAULT_RISK, RISK_RANGE
    from intervis.uses.answer_file import check_ending, save_answers
    from intervis.uses.semantics.classed_returns import no_classes
    from intervis.uses.semantics.labelled_scene import scene_of_frames

    check_ending(out)

    risk = DEFAULT_RISK if risk is None else risk
    if not RISK_RANGE[0] <= risk <= RISK_RANGE[1]:
        raise SettingsError(f"--risk must be from {RISK_RANGE[0]} to {RISK_RANGE[1]}, got {risk}.")
    drive = open_drive(source, camera=camera)
    options.check_drive_kept(drive, [picture, blockers, out])
    now = drive[drive.frame_numbers[0] if frame is None else frame]
    from_point = point_in_frame(now, given_start, "--from")
    to_points = [point_in_frame(now, end, "--to") for end in given_ends]
    numbers = _other_frames(drive, now, frame_range)
    with progress("scans", len(numbers) + 2) as advance:
        labelled = scene_of_frames(drive, now, numbers, tuple(without or ()), advance)
        if blockers is not None and labelled.returns is None:
            raise DriveError(no_classes(now))
        many = np.concatenate([np.reshape(to_points, (-1, 3)), _targets(labelled, targets)])
        explained = [labelled.explain(from_point, end, risk=risk) for end in to_points]
        answers = labelled.sight(from_point, many, risk=risk)
        classes = None if labelled.returns is None else labelled.blocker_classes(answers)
        advance("sight lines")
    count = len(labelled.scene)
    scans = f"{count} scan{'s' if count != 1 else ''}{_left_out(labelled)}"
    tilt = _tilt(labelled.scene)
    show(f"{drive.name}, frame {now.number}, {scans}; coordinates in its sensor frame.{tilt}")
    for nth, one in enumerate(explained):
        show(f"{one}{_class_of_blocker(one, classes, nth)}")
    if targets is not None:
        show(_counts(answers))
        _show_shares(classes)
    if out is not None:
        save_answers(out, np.array(from_point), many, answers, classes)
        show(f"Answers: {out}")
    if picture is not None:
        line = (explained[0], np.array(to_points[0])) if explained else (None, None)
        _draw(picture, labelled, from_point, risk, *line)
        show(f"Picture: {picture}")
    if blockers is not None:
        _draw_blockers(blockers, drive, numbers, labelled, from_point, risk)
        show(f"Picture of the blockers: {blockers}")


def _left_out(labelled: "LabelledScene") -> str:
    if not labelled.without:
        return ""
    return f" without {' and '.join(labelled.without)} ({labelled.left_out:,} returns left out)"


def _class_of_blocker(
    explained: "Explanation", classes: "NDArray[np.str_] | None", nth: int
) -> str:
    """A sentence with the class of the blocker; empty where there is none, or no class."""
    if classes is None or math.isnan(explained.blocker_m):
        return ""
    return f" Class of the blocker: {classes[nth]}."


def _show_shares(classes: "NDArray[np.str_] | None") -> None:
    from intervis.uses.semantics.blockers import blocker_table

    if classes is not None and (table := blocker_table(classes)).rows:
        show("\n" + table.as_text())


def _tilt(scene: "Scene") -> str:
    """What was found without a pose about a scanner that does not stand upright."""
    if not scene.tilt_deg:
        return ""
    return f" By its scan, the scanner is tilted by {scene.tilt_deg:.0f} degrees."


def _counts(answers: "Sight") -> str:
    counts = [f"{int(getattr(answers, name).sum()):,} {name}" for name in STATE_NAMES]
    return f"{len(answers):,} lines: {', '.join(counts)}."


def _targets(labelled: "LabelledScene", text: str | None) -> "Float64Array":
    """(M, 3) targets of ``--targets``: finite points of a file, or the frame's returns left."""
    import numpy as np

    from intervis.arrays import finite_rows
    from intervis.drives.scan_file import read_scan

    if text is None:
        return np.empty((0, 3))
    if text == "returns":
        return labelled.targets
    points = read_scan(Path(text)).points
    return points[finite_rows(points), :3].astype(np.float64)


def point_in_frame(frame: "Frame", place: str | Point, option: str) -> Point:
    """A place in the sensor frame, metres: coordinates, ``camera`` or ``sensor``."""
    from intervis.errors import DriveError

    if not isinstance(place, str):
        return place
    if place == "sensor":
        return 0.0, 0.0, 0.0
    if frame.camera is None:
        raise DriveError(f"this drive has no camera: give {option} as X,Y,Z, or sensor.")
    x, y, z = frame.viewpoint_velo.tolist()
    return x, y, z


def _other_frames(
    drive: "Drive", now: "Frame", frames: tuple[int | None, int | None] | None
) -> list[int]:
    """Numbers of the frames to add besides frame `now`."""
    from intervis.run.stream import selected_frames

    if frames is None:
        return []
    return [n for n in selected_frames(drive.frame_numbers, frames) if n != now.number]


def _draw(
    path: Path,
    labelled: "LabelledScene",
    start: Point,
    risk: float,
    explained: "Explanation | None",
    end: "Float64Array | None",
) -> None:
    from dataclasses import replace

    import numpy as np

    from intervis.plots.sight_figure import sight_picture
    from intervis.plots.style import save_figure

    points = labelled.targets
    answers = labelled.sight(start, points, risk=risk)
    drawn = replace(labelled.frame, points=points.astype(np.float32), attributes={})
    figure = sight_picture(drawn, answers, np.array(start), explained, end, labelled.scene.tilt_deg)
    save_figure(figure, path, path.suffix[1:].lower())


def _draw_blockers(
    path: Path,
    drive: "Drive",
    numbers: list[int],
    labelled: "LabelledScene",
    start: Point,
    risk: float,
) -> None:
    """Draw the classes of the blockers; where some are left out, beside those of the whole scene.

    Both panels ask for the same returns: those that are left.
    """
    import numpy as np

    from intervis.plots.style import save_figure
    from intervis.uses.semantics.blocker_figure import Panel, blocker_picture
    from intervis.uses.semantics.labelled_scene import scene_of_frames

    def panel(one: "LabelledScene", title: str) -> Panel:
        sight = one.sight(start, labelled.targets, risk=risk)
        return Panel(title, sight, one.blocker_classes(sight))

    panels = [panel(labelled, f"without {', '.join(labelled.without)}")]
    if labelled.without:
        panels.insert(0, panel(scene_of_frames(drive, labelled.frame, numbers), "as scanned"))
    else:
        panels = [panels[0]._replace(title="as scanned")]
    figure = blocker_picture(labelled.targets, np.array(start), panels)
    save_figure(figure, path, path.suffix[1:].lower())
