"""A page with the engine behind it, for this machine only: any line, any viewpoint.

The server listens on 127.0.0.1. It answers three requests and reads no paths: ``GET /`` is the
page; ``POST /line`` explains the line between two places; ``POST /judge`` judges a frame from
a viewpoint. Requests that other web sites make a browser send are refused: the Host
must be this server, and so must the Origin, if there is one.
"""

import json
import logging
from collections.abc import Collection
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import BoundedSemaphore
from typing import Any, ClassVar

from intervis.drives import Drive
from intervis.errors import IntervisError, OutputError
from intervis.view.frame_judge import frame_judge
from intervis.view.page_engine import PageEngine
from intervis.view.view_request import ViewRequest

log = logging.getLogger(__name__)

HOST = "127.0.0.1"
MOST_REQUEST_BYTES = 4096
LONGEST_NUMBER = 5
"""Digits of the length of a request."""

HIGHEST_PORT = 65535
MOST_CONNECTIONS = 16
"""Connections that are answered at a time; others wait."""


class ViewServer(ThreadingHTTPServer):
    """Serves one page, and answers its questions; the port is taken at once.

    Parameters
    ----------
    drive : Drive
    numbers : collection of int
        Numbers of the frames that may be asked about.
    request : ViewRequest
    port : int
        0 chooses a free one.

    Attributes
    ----------
    engine : PageEngine
        Answers the page's questions.
    page : bytes
        From `intervis.view.page_html` with ``is_served=True``; set before `serve_forever`.

    Raises
    ------
    OutputError
        The port is taken, may not be used, or is none.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(
        self, drive: Drive, numbers: Collection[int], request: ViewRequest, port: int
    ) -> None:
        if not 0 <= port <= HIGHEST_PORT:
            raise OutputError(f"a port is a number from 0 to {HIGHEST_PORT}, got {port}.")
        try:
            super().__init__((HOST, port), _Handler)
        except OSError as error:
            reason = error.strerror or str(error)
            raise OutputError(
                f"cannot listen on port {port} of {HOST}: {reason.lower()}; choose another with"
                " --port."
            ) from None
        self.page = b""
        self.engine = PageEngine(lambda number: frame_judge(drive, number, request), numbers)
        self._free = BoundedSemaphore(MOST_CONNECTIONS)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a connection in a thread of its own, once one of `MOST_CONNECTIONS` is free."""
        self._free.acquire()
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer a connection, and free its place."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Log what ended a connection: a browser that closes a page does so at any moment."""
        log.debug("a connection ended", exc_info=True)

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self.server_port}/"


class _Handler(BaseHTTPRequestHandler):
    server: ViewServer
    protocol_version = "HTTP/1.1"
    timeout = 10
    _kinds: ClassVar[dict[str, str]] = {
        "/": "text/html; charset=utf-8",
        "/line": "application/json",
        "/judge": "application/json",
    }

    def do_GET(self) -> None:
        """The page."""
        if not self._is_from_here():
            self._send_error(HTTPStatus.FORBIDDEN, "this server answers its own page only.")
        elif self.path != "/":
            self._send_error(HTTPStatus.NOT_FOUND, "there is nothing here.")
        else:
            self._send(HTTPStatus.OK, self.server.page, self._kinds["/"])

    def do_POST(self) -> None:
        """A line, or the whole scan."""
        is_json = self.headers.get("Content-Type", "").partition(";")[0] == "application/json"
        if not self._is_from_here() or not is_json:
            self._send_error(HTTPStatus.FORBIDDEN, "this server answers its own page only.")
            return
        if self.path not in ("/line", "/judge"):
            self._send_error(HTTPStatus.NOT_FOUND, "there is nothing here.")
            return
        length = self.headers.get("Content-Length", "")
        is_number = length.isascii() and length.isdigit() and len(length) <= LONGEST_NUMBER
        if not is_number or int(length) > MOST_REQUEST_BYTES:
            self._send_error(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "the question is too long.")
            return
        try:
            question = json.loads(self.rfile.read(int(length)))
            answer = self.server.engine.answer(self.path[1:], question)
        except (ValueError, RecursionError) as error:  # PointsError is a ValueError
            reason = str(error) if isinstance(error, IntervisError) else "this is not JSON."
            self._send_error(HTTPStatus.BAD_REQUEST, reason)
        except IntervisError as error:
            self._send_error(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
        else:
            content = json.dumps(answer, allow_nan=False).encode()
            self._send(HTTPStatus.OK, content, self._kinds[self.path])

    def _is_from_here(self) -> bool:
        """Whether the request names this server, and no other site caused it."""
        own = {f"{name}:{self.server.server_port}" for name in (HOST, "localhost")}
        hosts = self.headers.get_all("Host", [])
        origins = [one.removeprefix("http://") for one in self.headers.get_all("Origin", [])]
        return len(hosts) == 1 and len(origins) <= 1 and own.issuperset(hosts + origins)

    def _send_error(self, status: HTTPStatus, reason: str) -> None:
        self.close_connection = True  # the body of the request was not read
        self._send(status, json.dumps({"error": reason}).encode(), "application/json")

    def _send(self, status: HTTPStatus, content: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing: requests are no news."""
