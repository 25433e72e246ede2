"""What a notebook shows: small tables of results, and the page in an iframe."""

import importlib
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import intervis
from intervis.drives import Frame, open_drive
from intervis.errors import ArgumentError, MissingExtraError, PointsError, SceneError, SettingsError
from intervis.run.frame_file import record_of
from intervis.view import notebook
from intervis.view.live_page import reply, widget_script
from parsed_page import Parsed
from small_drive import cam_from_velo, camera, scan_folder, street

TOOLS = Path(__file__).resolve().parents[2] / "tools"
VIEWPOINT = (6.0, 1.0, 0.5)


@pytest.fixture
def scene():
    return intervis.Scene.from_scan(street(0))


def rows_of(table: str) -> dict[str, str]:
    """Names and values of a table, which has no other tags than those of tables."""
    assert set(Parsed(table).tags) <= {"table", "caption", "tr", "th", "td"}
    return dict(re.findall(r"<tr><th>(.*?)</th><td>(.*?)</td></tr>", table))


def test_a_sight_shows_its_counts(scene):
    sight = scene.sight(VIEWPOINT, street(0))
    rows = rows_of(sight._repr_html_())
    states = {"visible": 1, "occluded": 0, "unknown": -1}
    for name, state in states.items():
        count = int((sight.state == state).sum())
        assert rows[name] == f"{count} ({100 * count / len(sight):.1f} %)"
    several = scene.sight([VIEWPOINT, VIEWPOINT], street(0))
    assert rows_of(several._repr_html_())["visible"].startswith(f"{2 * int(sight.visible.sum())} ")
    assert "0 sight lines" in scene.sight(VIEWPOINT, np.empty((0, 3)))._repr_html_()


def test_an_explanation_shows_its_sentences_and_numbers(scene):
    said = intervis.explain(scene, VIEWPOINT, (9.0, 0.0, -1.0))
    table = said._repr_html_()
    assert Parsed(table).text.startswith(str(said))
    rows = rows_of(table)
    assert rows["length"] == f"{said.length_m:.1f} m"
    assert rows["unobserved"] == f"{said.unobserved_m:.1f} m"


def test_scene_analysis_and_frames_have_tables():
    scene = intervis.Scene()
    assert rows_of(scene._repr_html_())["scans"] == "0"
    for nth in range(2):
        pose = np.eye(4)
        pose[0, 3] = 3.0 * nth
        scene.add(street(nth), pose, timestamp_s=10.0 + 0.5 * nth)
    rows = rows_of(scene._repr_html_())
    assert rows["scans"] == "2"
    assert rows["time from first to last"] == "0.5 s"
    assert rows["way from scan to scan"] == "3.0 m"
    result = intervis.analyze(street(0), settings=intervis.Settings(tau=5))
    assert rows_of(result._repr_html_())["TPI"] == f"{result.measures.TPI:.2f} %"
    assert rows_of(record_of(7, result)._repr_html_())["n"] == f"{result.measures.n}"


def test_names_in_tables_are_escaped():
    frame = Frame(3, street(0), image_path=Path("<b onclick=1>&.png"))
    table = frame._repr_html_()
    assert rows_of(table)["points"] == f"{len(frame.points)}"
    assert rows_of(table)["image"] == "&lt;b onclick=1&gt;&amp;.png"


def test_the_iframe_holds_the_page_and_nothing_else(scene):
    page = intervis.show(scene, street(0), viewpoint=VIEWPOINT)
    parsed = Parsed(page._repr_html_())
    assert parsed.tags == ["iframe"]
    attributes = dict(parsed.attributes)
    assert attributes["sandbox"] == "allow-scripts"
    assert attributes["srcdoc"] == page.content.decode()
    assert "src" not in attributes


def test_a_page_that_is_too_large_is_refused(scene, monkeypatch):
    monkeypatch.setattr(notebook, "MOST_MB", 0.01)
    with pytest.raises(SettingsError, match="show fewer frames or returns"):
        intervis.show(scene, street(0), viewpoint=VIEWPOINT)


def test_mistakes_get_one_sentence(scene, tmp_path):
    drive = open_drive(scan_folder(tmp_path / "drive"))
    with pytest.raises(PointsError, match="points with a scene, and only with a scene"):
        intervis.show(scene)
    with pytest.raises(PointsError, match="points with a scene, and only with a scene"):
        intervis.show(drive, street(0))
    with pytest.raises(PointsError, match="up to 100 km from its origin"):
        intervis.show(scene, street(0) + np.float32(2e5))
    with pytest.raises(PointsError, match="viewpoint must be camera, sensor, or X, Y, Z"):
        intervis.show(drive, viewpoint="driver")
    with pytest.raises(PointsError, match="viewpoint must be X, Y, Z in metres, got 'camera'"):
        intervis.show(scene, street(0), viewpoint="camera")
    with pytest.raises(SceneError):
        intervis.show(intervis.Scene(), street(0))
    with pytest.raises(SettingsError, match="frames holds no frame number"):
        intervis.show(drive, frames=[])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"height_px": '"><script>alert(1)</script>'}, "height_px must be 1 or more"),
        ({"height_px": 0}, "height_px must be 1 or more"),
        ({"height_px": float("nan")}, "height_px must be 1 or more"),
        ({"frames": 3}, "frames must be a list of whole numbers, got 3"),
        ({"most_frames": "a"}, "must be 1 or more, got 'a'"),
        ({"most_returns": 1.5}, "must be 1 or more, got 1.5"),
        ({"risk": None}, "risk must be a finite number (0.001 to 0.2), got None"),
        ({"risk": "low"}, "risk must be a finite number (0.001 to 0.2), got 'low'"),
        ({"moment_s": 1.0}, "moment_s is the query time of a scene"),
        ({"ends": 5}, "ends must be a list"),
        ({"ends": [[1e30, 0, 0]]}, "a place must be within 1e+09 m"),
        ({"viewpoint": [0, 0, -1e300]}, "a place must be within 1e+09 m"),
    ],
)
def test_arguments_that_make_no_sense_get_one_sentence(tmp_path, arguments, said):
    drive = open_drive(scan_folder(tmp_path / "drive"))
    with pytest.raises((ArgumentError, PointsError, SettingsError)) as raised:
        intervis.show(drive, **arguments)
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_what_cannot_be_shown_is_told(scene):
    for source in (None, "drive", street(0)):
        with pytest.raises(ArgumentError, match="source must be a Drive, a Frame or a Scene, got"):
            intervis.show(source)
    with pytest.raises(SettingsError, match="frames are the frame numbers of a drive"):
        intervis.show(scene, street(0), frames=[0])


def test_frames_of_any_iterable_are_shown(tmp_path):
    drive = open_drive(scan_folder(tmp_path / "drive"))
    given = [intervis.show(drive, frames=some).content for some in ([2, 0], iter([2, 0]))]
    assert given[0] == given[1]


def test_returns_of_a_damaged_file_are_left_out():
    points = street(0)
    points[3] = 1e30  # whole centimetres of it fit into no integer
    page = intervis.show(Frame(0, points))
    assert f"{len(points) - 1:,} points" in Parsed(page.content.decode()).text


def test_a_page_is_saved_as_a_file(scene, tmp_path):
    page = intervis.show(scene, street(0), viewpoint=VIEWPOINT)
    page.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_bytes() == page.content


@pytest.fixture(scope="module")
def window():
    """A browser; without one the tests are skipped, and say why."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(TOOLS))
        tool = importlib.import_module("browser")
    reason = tool.missing_program()
    if reason is not None:
        pytest.skip(reason)
    with tool.Browser(1200, 1000) as browser:
        yield browser


def opened(window, page, tmp_path):
    """The output of a cell on a page of its own; the browser is inside its iframe."""
    place = tmp_path / "cell.html"
    place.write_text(
        f"<!DOCTYPE html><html data-ready='true'><body>{page._repr_html_()}</body></html>"
    )
    window.enter_frame(None)
    window.open(place.as_uri())
    window.log()
    window.enter_frame(0)
    window.wait_for("return document.documentElement.dataset.ready === 'true'")


def test_a_scene_is_shown_with_the_counts_of_python(window, scene, tmp_path):
    points = np.round(street(0).astype(np.float64), 2)
    sight = scene.sight(VIEWPOINT, points)
    opened(window, intervis.show(scene, points, viewpoint=VIEWPOINT), tmp_path)
    frame = window.run(
        "const { visible, occluded, unknown } = window.intervis.frame;"
        " return [visible, occluded, unknown];"
    )
    masks = (sight.visible, sight.occluded, sight.unknown)
    assert frame == [int(mask.sum()) for mask in masks]
    window.run("window.intervis.pick(0)")
    end = window.run("return window.intervis.frame.verdicts.end(0)")
    said = window.run("return document.querySelector('#selection .text').textContent")
    assert said == str(intervis.explain(scene, VIEWPOINT, end))
    assert window.run("return document.querySelector('.command')") is None
    assert window.log() == []


def test_the_page_cannot_reach_the_notebook(window, scene, tmp_path):
    opened(window, intervis.show(scene, street(0), viewpoint=VIEWPOINT), tmp_path)
    reached = window.run(
        "try { return parent.document.title; } catch (error) { return error.name; }"
    )
    assert reached == "SecurityError"


def test_frames_and_drives_are_shown(window, tmp_path):
    frame = Frame(17, street(17), camera=camera(), cam_from_velo=cam_from_velo())
    opened(window, intervis.show(frame), tmp_path)
    assert window.run("return window.intervis.frame.number") == 17
    assert window.run("return document.querySelector('h1').textContent") == "Frame 17"
    drive = open_drive(scan_folder(tmp_path / "drive", (0, 1, 2)))
    opened(window, intervis.show(drive, viewpoint=VIEWPOINT, frames=[1, 2]), tmp_path)
    assert window.run("return window.intervis.page.frames.map((one) => one.number)") == [1, 2]
    assert window.run("return window.intervis.frame.viewpoint") == list(VIEWPOINT)
    assert window.log() == []


HOST = """<!DOCTYPE html><html data-ready="true"><body><div id="cell"></div><script type="module">
%s
const listeners = [];
window.asked = [];
window.answered = (answer) => listeners.forEach((listener) => listener(answer));
const model = {
  get: (name) => ({ page: %s, height_px: 900 })[name],
  on: (name, listener) => listeners.push(listener),
  off: (name, listener) => listeners.splice(listeners.indexOf(listener), 1),
  send: (message) => window.asked.push(message),
};
window.stop = widget.render({ model, el: document.getElementById("cell") });
</script></body></html>"""
"""A notebook's page with a widget whose messages the test carries to Python and back."""


def live_parts(scene):
    """The page of a scene as a live page, and its engine."""
    captured = {}

    def capture(content, height_px, engine):
        captured.update(content=content, engine=engine)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(notebook, "live_page", capture)
        patch.setattr(notebook, "require_anywidget", lambda: None)
        intervis.show(scene, street(0), viewpoint=VIEWPOINT, is_live=True)
    return captured["content"], captured["engine"]


def test_a_live_page_is_judged_again_by_python(window, scene, tmp_path):
    content, engine = live_parts(scene)
    module = widget_script().replace("export default", "const widget =")
    place = tmp_path / "cell.html"
    page = json.dumps(content.decode()).replace("</", "<\\/")
    place.write_text(HOST % (module, page))
    window.enter_frame(None)
    window.open(place.as_uri())
    window.log()
    window.enter_frame(0)
    window.wait_for("return document.documentElement.dataset.ready === 'true'")
    moved = [2.0, -1.0, 0.3]
    # the promise is not waited for: the answer is carried below
    window.run("window.intervis.judge.request(0, arguments[0]); return null", moved)
    window.enter_frame(None)
    window.wait_for("return window.asked.length === 1")
    (asked,) = window.run("return window.asked")
    assert asked["kind"] == "judge"
    window.run("window.answered(arguments[0])", reply(engine, asked))
    window.enter_frame(0)
    window.wait_for("return window.intervis.frame.isMoved")
    counts = window.run(
        "const { visible, occluded, unknown } = window.intervis.frame;"
        " return [visible, occluded, unknown];"
    )
    sight = scene.sight(moved, np.round(street(0).astype(np.float64) * 100) / 100)
    masks = (sight.visible, sight.occluded, sight.unknown)
    assert counts == [int(mask.sum()) for mask in masks]
    assert window.log() == []
    window.enter_frame(None)
    window.run("window.stop(); window.answered({ id: 1 })")  # nothing listens any more


def test_python_answers_lines_and_refuses_what_is_none(scene):
    _, engine = live_parts(scene)
    question = {"frame": 0, "from": [6.0, 1.0, 0.5], "to": [9.0, 0.0, -1.0]}
    said = reply(engine, {"id": 5, "kind": "line", "question": question})
    assert said["id"] == 5
    assert said["answer"]["text"] == str(intervis.explain(scene, question["from"], question["to"]))
    for message, reason in (
        ({"id": 1, "kind": "line", "question": {**question, "frame": 1}}, "frame must be"),
        ({"id": 1, "kind": "line", "question": {**question, "to": [1, "2", 3]}}, "to must be"),
        ({"id": 1, "kind": "eval", "question": question}, "kind of a question must be"),
        ({"id": 1}, "kind of a question must be|must be a JSON object"),
        ("text", "must be a JSON object"),
    ):
        assert re.search(reason, reply(engine, message)["error"])


def test_a_live_page_is_a_widget(scene):
    pytest.importorskip("anywidget", reason="anywidget is not installed: intervis[notebook]")
    widget = intervis.show(scene, street(0), viewpoint=VIEWPOINT, is_live=True)
    assert "intervis view" in widget.page
    sent = []
    widget.send = sent.append
    question = {"frame": 0, "from": [6.0, 1.0, 0.5], "to": [9.0, 0.0, -1.0]}
    widget._handle_custom_msg({"id": 3, "kind": "line", "question": question}, [])
    assert [one["id"] for one in sent] == [3]
    assert sent[0]["answer"]["state"] in (1, 0, -1)


def test_a_live_page_names_its_extra(scene, monkeypatch):
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(MissingExtraError, match=r"intervis\[notebook\]"):
        intervis.show(scene, street(0), viewpoint=VIEWPOINT, is_live=True)
