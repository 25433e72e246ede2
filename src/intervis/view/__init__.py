"""The interactive page: verdicts of the sight engine over a drive, in one HTML file or served."""

from intervis.view.page_file import page_html, save_page
from intervis.view.view_request import ViewRequest

__all__ = ["ViewRequest", "page_html", "save_page"]
