"""A page with the engine behind it, for this machine only: any line, any viewpoint.

The server listens on 127.0.0.1. It answers three requests and reads no paths: ``GET /`` is the
page; ``POST /line`` explains the line between two places; ``POST /judge`` judges a frame from
a viewpoint. Requests that other web sites make a browser send are refused: the Host
must be this server, and so must the Origin, if there is one.
"""

import base64
import json
import logging
from collections import OrderedDict
from collections.abc import Collection
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import BoundedSemaphore, Lock
from typing import Any, ClassVar

import numpy as np

from intervis.arrays import Float64Array
from intervis.drives import Drive
from intervis.errors import IntervisError, OutputError, PointsError
from intervis.view.frame_data import frame_content, line_content
from intervis.view.frame_judge import FrameJudge, frame_judge
from intervis.view.view_request import ViewRequest

log = logging.getLogger(__name__)

HOST = "127.0.0.1"
MOST_REQUEST_BYTES = 4096
LONGEST_NUMBER = 5
"""Digits of the length of a request."""

HIGHEST_PORT = 65535
MOST_CONNECTIONS = 16
"""Connections that are answered at a time; others wait."""

FARTHEST_M = 1e6
KEPT_FRAMES = 4
"""Frames whose scans are kept in memory."""


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
        self._drive, self._numbers, self._request = drive, numbers, request
        self._judges: OrderedDict[int, FrameJudge] = OrderedDict()
        self._lock = Lock()
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

    def answer(self, path: str, question: Any) -> dict[str, Any]:
        """The answer to a question of the page, as JSON.

        Raises
        ------
        PointsError
            The question has not the expected form.
        """
        if not isinstance(question, dict):
            raise PointsError("the question must be a JSON object.")
        with self._lock:
            judge = self._judge(question.get("frame"))
            start = _place(question.get("from"), "from")
            if path == "/line":
                line = judge.line(start, _place(question.get("to"), "to"))
                return line_content(line, judge.scene, judge.moment_s)
            header, block = frame_content(judge.judged(start))
        return {"header": header, "block": base64.b64encode(block).decode("ascii")}

    def _judge(self, number: Any) -> FrameJudge:
        """A frame of the page, by its number, with its scans; those of a few frames are kept."""
        if isinstance(number, bool) or not isinstance(number, int) or number not in self._numbers:
            raise PointsError("frame must be the number of a frame of the page.")
        if number not in self._judges:
            self._judges[number] = frame_judge(self._drive, number, self._request)
            while len(self._judges) > KEPT_FRAMES:
                self._judges.popitem(last=False)
        self._judges.move_to_end(number)
        return self._judges[number]


def _place(value: Any, name: str) -> Float64Array:
    """(3,) coordinates of a request, metres."""
    if not isinstance(value, list) or len(value) != 3:
        raise PointsError(f"{name} must be three numbers.")
    for number in value:
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise PointsError(f"{name} must be three numbers.")
        if not abs(number) <= FARTHEST_M:  # nor is NaN
            raise PointsError(f"{name} must be three finite numbers in metres.")
    return np.array(value, np.float64)


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
            answer = self.server.answer(self.path, question)
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
