"""What a viewpoint sees over a drive, to look at: an interactive page, and recordings."""

from intervis.view.frame_stream import judge_frames
from intervis.view.page_file import page_html, save_page
from intervis.view.view_request import ViewRequest

__all__ = ["ViewRequest", "judge_frames", "page_html", "save_page"]
