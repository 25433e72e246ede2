"""The server of a page: what it answers, and what it refuses."""

import base64
import http.client
import json
import socket
import struct
import threading

import pytest
from test_view_data import unpacked

from intervis.drives import open_drive
from intervis.errors import OutputError
from intervis.sight import Scene, explain
from intervis.view import ViewRequest
from intervis.view.server import ViewServer
from small_drive import scan_folder

PAGE = b"<!DOCTYPE html><title>page</title>"


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return open_drive(scan_folder(tmp_path_factory.mktemp("street"), (3, 7)))


@pytest.fixture(scope="module")
def server(drive):
    request = ViewRequest(viewpoint="sensor", most_returns=100)
    with ViewServer(drive, [3, 7], request, 0) as made:
        made.page = PAGE
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield made
        made.shutdown()
        thread.join()


def ask(server, method, path, body=None, **headers):
    """Status and body of one request; a header of None is left out."""
    sent = {"Host": f"127.0.0.1:{server.server_port}", "Content-Type": "application/json"}
    sent |= {name.replace("_", "-"): value for name, value in headers.items()}
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=20)
    try:
        connection.putrequest(method, path, skip_host=True)
        content = json.dumps(body).encode() if isinstance(body, dict | list) else body or b""
        for name, value in (sent | {"Content-Length": str(len(content))} | headers).items():
            if value is not None:
                connection.putheader(name.replace("_", "-"), value)
        connection.endheaders(content)
        response = connection.getresponse()
        return response.status, response.read()
    finally:
        connection.close()


def test_the_page_is_at_the_root(server):
    assert ask(server, "GET", "/") == (200, PAGE)
    assert server.url == f"http://127.0.0.1:{server.server_port}/"
    assert server.socket.getsockname()[0] == "127.0.0.1"


def test_a_line_is_explained_as_by_python(server, drive):
    question = {"frame": 7, "from": [0, 0, 0.5], "to": [20, -3, -1.0]}
    status, body = ask(server, "POST", "/line", question)
    answer = json.loads(body)
    said = explain(Scene.from_scan(drive[7].points), question["from"], question["to"])
    assert status == 200
    assert answer["text"] == str(said)
    assert answer["probability"] == said.probability
    assert sum(answer["parts_m"]) == pytest.approx(said.unobserved_m, abs=0.01)


def test_the_scan_is_judged_from_another_viewpoint(server, drive):
    question = {"frame": 3, "from": [5, 1, 0.5]}
    status, body = ask(server, "POST", "/judge", question)
    answer = json.loads(body)
    columns = unpacked(base64.b64decode(answer["block"]))
    ends = [[columns[axis][i] / 100 for axis in "xyz"] for i in range(len(columns["x"]))]
    sight = Scene.from_scan(drive[3].points).sight(question["from"], ends)
    assert status == 200
    assert len(ends) == 100
    assert [(kind & 7) == 1 for kind in columns["kind"]] == sight.visible.tolist()
    assert answer["header"]["visible"] == sight.visible.sum()
    assert answer["header"]["viewpoint"] == question["from"]


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "example.org"},
        {"Host": None},
        {"Host": "127.0.0.1:1"},
        {"Origin": "http://example.org"},
        {"Origin": "null"},
        {"Content_Type": "text/plain"},
    ],
)
def test_other_sites_are_refused(server, headers):
    question = {"frame": 3, "from": [5, 1, 0.5]}
    if "Content_Type" not in headers:
        assert ask(server, "GET", "/", **headers)[0] == 403
    assert ask(server, "POST", "/judge", question, **headers)[0] == 403


@pytest.mark.parametrize(
    "path", ["/etc/passwd", "/../pyproject.toml", "/x", "/line", "/?a", "/%2e"]
)
def test_no_path_is_read(server, path):
    assert ask(server, "GET", path)[0] == 404


@pytest.mark.parametrize(
    ("body", "status", "reason"),
    [
        (b"{", 400, "not JSON"),
        (b"[" * 4000, 400, "not JSON"),
        (b"\xff\xfe", 400, "not JSON"),
        (b" " * 5000, 413, "too long"),
        ([1], 400, "JSON object"),
        ({"frame": 0, "from": [0, 0, 0]}, 400, "frame must be the number"),
        ({"frame": True, "from": [0, 0, 0]}, 400, "frame must be"),
        ({"frame": 3, "from": [0, 0]}, 400, "from must be three numbers"),
        ({"frame": 3, "from": [0, 0, "1"]}, 400, "from must be three numbers"),
        (b'{"frame": 3, "from": [0, 0, NaN]}', 400, "finite"),
        ({"frame": 3, "from": [0, 0, 10**9]}, 400, "finite"),
        ({"frame": 3, "from": [0, 0, 10**400]}, 400, "finite"),
        ({"frame": 3, "from": [0, 0, 0], "to": None}, 400, "to must be three numbers"),
    ],
)
def test_wrong_questions_get_a_sentence(server, body, status, reason):
    got, content = ask(server, "POST", "/line", body)
    assert got == status
    assert reason in json.loads(content)["error"]


def test_a_taken_port_is_told(drive):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(OutputError, match=f"cannot listen on port {port}.*--port"):
            ViewServer(drive, [3], ViewRequest(), port)
    with pytest.raises(OutputError, match="got 70000"):
        ViewServer(drive, [3], ViewRequest(), 70_000)


def raw(server, text):
    """The first line of the answer to bytes as they stand."""
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=20) as connection:
        connection.sendall(text.encode("latin-1"))
        return connection.recv(4096).partition(b"\r\n")[0].decode()


@pytest.mark.parametrize("length", ["\xb2", "9" * 5000, "-1", "99999", ""])
def test_a_length_that_is_none_is_refused(server, length):
    host = f"Host: 127.0.0.1:{server.server_port}\r\nContent-Type: application/json\r\n"
    said = raw(server, f"POST /line HTTP/1.1\r\n{host}Content-Length: {length}\r\n\r\n")
    assert said.startswith("HTTP/1.1 413 ")


@pytest.mark.parametrize("second", ["Host: evil", "Origin: http://evil"])
def test_a_second_name_beside_the_right_one_is_refused(server, second):
    own = f"127.0.0.1:{server.server_port}"
    head = f"Host: {own}\r\nOrigin: http://{own}\r\n"
    assert raw(server, f"GET / HTTP/1.1\r\n{head}\r\n").startswith("HTTP/1.1 200 ")
    assert raw(server, f"GET / HTTP/1.1\r\n{head}{second}\r\n\r\n").startswith("HTTP/1.1 403 ")


def test_a_client_that_goes_leaves_no_traceback(server, capfd):
    for _ in range(5):
        connection = socket.create_connection(("127.0.0.1", server.server_port), timeout=20)
        own = f"Host: 127.0.0.1:{server.server_port}\r\n"
        connection.sendall(f"GET / HTTP/1.1\r\n{own}\r\nGET / HTTP/1.1\r\n{own}\r\n".encode())
        reset = struct.pack("ii", 1, 0)  # close at once, without taking the answer
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
        connection.close()
    assert ask(server, "GET", "/") == (200, PAGE)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("port", [-1, 65536, 99999])
def test_a_port_that_is_none_is_one_sentence(drive, port):
    with pytest.raises(OutputError, match=r"^a port is a number from 0 to 65535, got \S+\.$"):
        ViewServer(drive, [3], ViewRequest(viewpoint="sensor"), port)
