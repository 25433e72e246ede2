"""Processing of a drive frame by frame: results on disk, their summary, and the report of a run."""

from intervis.run.frame_file import FrameRecord, load_analysis, load_sight
from intervis.run.frame_sight import FrameSight, SightRequest
from intervis.run.stream import RunSummary, run_drive
from intervis.run.stretch import FrameFailure

__all__ = [
    "FrameFailure",
    "FrameRecord",
    "FrameSight",
    "RunSummary",
    "SightRequest",
    "load_analysis",
    "load_sight",
    "run_drive",
]
