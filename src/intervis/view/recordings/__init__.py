"""Recordings of what a viewpoint sees over a drive, for the viewers Rerun and Foxglove."""

from intervis.view.recordings.foxglove_file import foxglove_recording
from intervis.view.recordings.rerun_file import rerun_recording

__all__ = ["foxglove_recording", "rerun_recording"]
