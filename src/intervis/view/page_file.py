"""The page as one HTML file: markup, style, script, and the data of all frames."""

import base64
import html
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

import intervis
from intervis.drives import Drive
from intervis.files import write_whole
from intervis.progress import Progress
from intervis.sight.occupancy_model import DEFAULT_RISK
from intervis.view.colours import COLOURS, ON_IMAGE, VIRIDIS
from intervis.view.frame_data import FrameData, frame_data
from intervis.view.frame_stream import FrameSink, judge_frames
from intervis.view.judged_frame import JudgedFrame
from intervis.view.own_file import check_own_file
from intervis.view.view_request import ViewRequest

MODULES = (
    *("numbers", "blocks", "verdicts", "matrices", "orbit", "renderer", "palette", "layers"),
    *("picking", "pointer", "scan_view", "camera_panel", "timeline", "charts", "selection"),
    *("engine", "frames", "legend", "measures", "static_picture", "page"),
)
"""Modules of the page's script; each imports from those before it only."""

IMPORT = re.compile(r"^import\s[^;]*;\n", re.MULTILINE)
EXPORT = re.compile(r"^export ", re.MULTILINE)
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Control characters, and those that change the direction of text."""

GENERATOR = b'<meta name="generator" content="intervis view">'
"""In the head of each page: such files may be replaced."""


class PageFrames:
    """Takes judged frames, and keeps what a page stores of them, in order."""

    def __init__(self) -> None:
        self.frames: list[FrameData] = []

    def prepare(self, judged: JudgedFrame) -> FrameData:
        """What the page stores of a frame."""
        return frame_data(judged)

    def add(self, prepared: FrameData) -> None:
        """Keep it."""
        self.frames.append(prepared)


def page_html(
    drive: Drive,
    numbers: Sequence[int],
    request: ViewRequest | None = None,
    *,
    is_served: bool = False,
    is_live: bool = False,
    also: Sequence[FrameSink] = (),
    progress: Progress | None = None,
) -> bytes:
    """Judge frames of a drive, and put them into a page.

    Parameters
    ----------
    drive : Drive
    numbers : sequence of int
        Frame numbers, one or more.
    request : ViewRequest, optional
    is_served : bool
        Whether `intervis.view.server` will answer the page's questions.
    is_live : bool
        Whether the widget around the page will answer them.
    also : sequence of FrameSink
        What else takes the judged frames: recordings.
    progress : callable, optional
        Called after each frame.

    Returns
    -------
    bytes
        UTF-8. The page loads nothing: it works offline and from the file system.

    Raises
    ------
    DriveError
        A frame lacks the camera or the pose that the request needs, or no scan can be read. Single
        scans that cannot be read are left out, with a warning.
    """
    request = request or ViewRequest()
    page = PageFrames()
    judge_frames(drive, numbers, request, [page, *also], progress)
    lead = _lead(len(drive.frame_numbers), page.frames, request)
    return page_of_frames(
        drive.name, lead, page.frames, request, is_served=is_served, is_live=is_live
    )


def page_of_frames(
    name: str,
    lead: str,
    frames: Sequence[FrameData],
    request: ViewRequest,
    *,
    is_served: bool = False,
    is_live: bool = False,
    has_command: bool = True,
    run: Mapping[str, bool] | None = None,
) -> bytes:
    """Put frames into a page.

    Parameters
    ----------
    name : str
        Of the drive: the title.
    lead : str
        What is shown.
    frames : sequence of FrameData
    request : ViewRequest
    is_served : bool
        Whether `intervis.view.server` will answer the page's questions.
    is_live : bool
        Whether the widget around the page will answer them.
    has_command : bool
        Whether ``intervis sight NAME`` gives the explanations of the page.
    run : mapping or None
        For the frames of a run: ``has_drive``, whether its drive is there; ``has_states``, whether
        the states of returns are known.
    """
    named_viewpoint = request.viewpoint if isinstance(request.viewpoint, str) else None
    content = {
        "drive": shown(name),
        "has_command": has_command,
        "risk": request.risk,
        "default_risk": DEFAULT_RISK,
        "viewpoint": None if request.is_fixed or run is not None else named_viewpoint,
        "is_served": is_served or is_live,
        **({} if run is None else {"run": run}),
        "colours": {
            theme: {**colours, "sequential": VIRIDIS, "onImage": ON_IMAGE}
            for theme, colours in COLOURS.items()
        },
        "frames": [frame.header for frame in frames],
    }
    parts = {
        "TITLE": html.escape(shown(name)),
        "LEAD": html.escape(lead),
        "NOTES": html.escape(_notes()),
        "CONNECT": "'self'" if is_served else "'none'",
        "STYLE": _page_file("page.css"),
        "SCRIPT": script(),
        "CONTENT": json.dumps(content, allow_nan=False).replace("<", "\\u003c"),
        "BLOCKS": "\n".join(_blocks(frames)),
    }
    template = _page_file("page.html")
    text = re.sub(r"\{\{([A-Z]+)\}\}", lambda match: parts[match[1]], template)
    return text.encode("utf-8", errors="backslashreplace")


def save_page(path: Path, content: bytes) -> None:
    """Write a page whole or not at all; only an earlier page is replaced.

    Raises
    ------
    OutputError
        As `check_page`, or the system refuses.
    """
    check_page(path)
    write_whole(path, lambda file: file.write(content))


def check_page(path: Path) -> None:
    """Check before the work that a page can be written to a path: see `check_own_file`."""
    check_own_file(path, GENERATOR)


def script() -> str:
    """The modules of the page as one: in order, without their imports and exports."""
    return "\n".join(
        EXPORT.sub("", IMPORT.sub("", _page_file(f"{name}.js"))).strip() for name in MODULES
    )


def shown(text: str) -> str:
    r"""The text with control characters written as escapes.

    Examples
    --------
    >>> print(shown("a\x1b[31m name"))
    a\x1b[31m name
    """
    return CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def _page_file(name: str) -> str:
    return files("intervis.view").joinpath("page", name).read_text(encoding="utf-8")


def _blocks(frames: Sequence[FrameData]) -> list[str]:
    """Elements that hold the binary data of the frames as base64."""
    made = []
    for nth, frame in enumerate(frames):
        for name, content in (("block", frame.block), ("image", frame.jpeg)):
            if content is not None:
                text = base64.b64encode(content).decode("ascii")
                made.append(f'<script type="text/plain" id="{name}-{nth}">{text}</script>')
    return made


def _lead(total: int, frames: Sequence[FrameData], request: ViewRequest) -> str:
    """What is shown, in two sentences; `total` frames has the drive."""
    place = request.viewpoint
    where = (
        f"the {place}"
        if isinstance(place, str)
        else "a viewpoint at ({:g}, {:g}, {:g})".format(*place)
    )
    if request.is_fixed:
        where += f" of frame {frames[0].header['number']}, fixed in the world"
    some = f"{len(frames)} of {total:,}" if len(frames) < total else f"{total:,}"
    scans = max(len(frame.header["memory"]) for frame in frames) + 1
    used = "one scan" if scans == 1 else f"up to {scans} scans"
    stored = max(frame.header["stored"] for frame in frames)
    returns = max(frame.header["returns"] for frame in frames)
    share = "" if stored == returns else f", evenly chosen of {returns:,}"
    return (
        f"What {where} sees: up to {stored:,} returns a frame{share}, each judged by {used};"
        f" {some} frame{'s' if total > 1 else ''}. {axes_sentence(frames)}"
    )


def axes_sentence(frames: Sequence[FrameData]) -> str:
    """The frame of the coordinates; where the sensor is tilted, what that does to the page."""
    axes = "Coordinates are metres in the sensor's frame: x forward, y left, z "
    tilts_deg = [frame.header["tilt_deg"] for frame in frames if "tilt_deg" in frame.header]
    if not tilts_deg:
        return f"{axes}up."
    return (
        f'{axes}along its axis, by its scan {max(tilts_deg)} degrees off upright. "From'
        ' above" looks along z, and there are no blind spots: both need the pose.'
    )


def _notes() -> str:
    return (
        f"Made by intervis {intervis.__version__}, offline. Visible: the line is free with a high"
        " enough probability. Occluded: an observed surface lies between. Unknown: the space"
        " between was not observed, or the evidence is not decisive. The region is the paper's, and"
        " not what the viewpoint sees."
    )
