"""The page in a real browser: pixels, switches, timeline, picking, and the served engine."""

import importlib
import shlex
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import intervis.view
from intervis.drives import open_drive
from intervis.lab.worlds import simulate
from intervis.sight import explain
from intervis.uses.registration import query_moment_s, registered_scene
from intervis.view import ViewRequest, page_html
from intervis.view.server import ViewServer

TOOLS = Path(__file__).resolve().parents[2] / "tools"
PAGE = Path(intervis.view.__file__).parent / "page"
AHEAD = (14.0, 0.0, 1.0)

COUNT_PIXELS = """
const view = window.intervis[arguments[0]];
view.draw();
const { gl, canvas } = view.renderer;
const pixels = new Uint8Array(4 * canvas.width * canvas.height);
gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
const [r, g, b] = [1, 3, 5].map((at) => parseInt(arguments[1].slice(at, at + 2), 16));
let count = 0;
for (let i = 0; i < pixels.length; i += 4) {
  count += pixels[i] === r && pixels[i + 1] === g && pixels[i + 2] === b;
}
return count;
"""
"""Pixels of exactly one colour in the view `arguments[0]`."""

PIXEL_OF = """
const view = window.intervis[arguments[0]];
const box = view.canvas.getBoundingClientRect();
const at = view.pixelOf(arguments[1]);
return [box.left + at[0], box.top + at[1]];
"""


@pytest.fixture(scope="module")
def tool():
    """The module that drives a browser; without one the tests are skipped, and say why."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(TOOLS))
        module = importlib.import_module("browser")
    reason = module.missing_program()
    if reason is not None:
        pytest.skip(reason)
    return module


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Three frames of the built-in street."""
    return open_drive(simulate(tmp_path_factory.mktemp("street"), frames=3))


@pytest.fixture(scope="module")
def page(drive, tmp_path_factory):
    """The page of the street, seen from a place ahead of the car."""
    request = ViewRequest(viewpoint=AHEAD, ends=[(30.0, -6.0, -1.0)], most_returns=12_000, memory=1)
    path = tmp_path_factory.mktemp("page") / "page.html"
    path.write_bytes(page_html(drive, drive.frame_numbers, request))
    return path


@pytest.fixture(scope="module")
def window(tool):
    with tool.Browser(1400, 1000) as browser:
        yield browser


@pytest.fixture
def opened(window, page):
    """The page, freshly loaded; a test must leave nothing on the console."""
    window.resize(1400, 1000)
    window.open(page.as_uri())
    window.log()
    yield window
    assert window.log() == []


@pytest.fixture(scope="module")
def scenes(drive):
    """The scene of each frame, as `intervis sight --frames` makes it."""
    made = {}
    for number in drive.frame_numbers:
        around = [n for n in (number - 1, number + 1) if n in drive]
        made[number] = registered_scene(drive, drive[number], around)
    return made


def colour(window, name, theme="light"):
    return window.run(
        "return window.intervis.page.colours[arguments[0]][arguments[1]]", theme, name
    )


def pressed(window, selector):
    window.run("document.querySelector(arguments[0]).click()", selector)


def test_nothing_is_loaded_and_nothing_is_complained(window, page):
    window.log()
    window.open(page.as_uri())
    assert window.log() == []
    assert (
        window.run("return performance.getEntriesByType('resource').map((one) => one.name)") == []
    )


def test_each_state_has_its_colour_and_its_switch(opened):
    for name in ("visible", "occluded", "unknown"):
        shade = colour(opened, name)
        before = opened.run(COUNT_PIXELS, "scan", shade)
        assert before > 300
        assert opened.run(COUNT_PIXELS, "above", shade) > 100
        pressed(opened, f".chip.state.{name}")
        assert opened.run(COUNT_PIXELS, "scan", shade) < 0.02 * before
        pressed(opened, f".chip.state.{name}")
        assert opened.run(COUNT_PIXELS, "scan", shade) == before


def test_the_counts_of_the_legend_are_those_of_the_returns(opened):
    counted = opened.run("""
        const { frame } = window.intervis, counts = [0, 0, 0];
        for (const state of frame.verdicts.states) counts[state] += 1;
        return [counts, [frame.occluded, frame.visible, frame.unknown],
                [...document.querySelectorAll(".chip.state span")].map((one) => one.textContent)];
    """)
    counts, header, shown = counted
    assert counts == header
    assert [int(text.replace(",", "")) for text in shown] == [counts[1], counts[0], counts[2]]


def test_layers_change_the_picture_and_change_it_back(opened):
    background = colour(opened, "background")
    before = opened.run(COUNT_PIXELS, "above", background)
    for layer in ("mesh", "region", "spots", "rings", "viewpoint"):
        pressed(opened, f".chip.layer.{layer}")
        assert opened.run(COUNT_PIXELS, "above", background) != before, layer
        pressed(opened, f".chip.layer.{layer}")
        assert opened.run(COUNT_PIXELS, "above", background) == before, layer


def test_colouring_by_probability_uses_the_scale(opened):
    visible = colour(opened, "visible")
    before = opened.run(COUNT_PIXELS, "scan", visible)
    opened.run("""
        const select = document.querySelector("#legend select");
        select.value = "percent";
        select.dispatchEvent(new Event("change"));
    """)
    # The scale runs from purple to yellow and holds no blue of the states.
    assert opened.run(COUNT_PIXELS, "scan", visible) < 0.02 * before
    assert not opened.run("return document.querySelector('#legend .scale').hidden")


def test_the_timeline_steps_by_keys_and_plays(opened):
    shown = "return [window.intervis.frame.number, document.querySelector('output').textContent]"
    assert opened.run(shown) == [0, "frame 0 (1 of 3)"]
    opened.key("ArrowRight")
    opened.wait_for("return window.intervis.frame.number === 1")
    assert opened.run(shown) == [1, "frame 1 (2 of 3)"]
    opened.key("End")
    opened.wait_for("return window.intervis.frame.number === 2")
    opened.key("Home")
    opened.wait_for("return window.intervis.frame.number === 0")
    pressed(opened, "[data-do=play]")
    opened.wait_for("return window.intervis.frame.number === 2")
    pressed(opened, "[data-do=play]")
    assert not opened.run("return window.intervis.timeline.isPlaying")


def test_the_charts_follow_the_timeline(opened):
    value = "return document.querySelector('#charts figure b').textContent"
    share = """
        const { visible, occluded, unknown } = window.intervis.page.frames[arguments[0]];
        return 100 * visible / (visible + occluded + unknown);
    """
    for index in (0, 2):
        opened.run("return window.intervis.go(arguments[0])", index)
        assert float(opened.run(value)) == pytest.approx(opened.run(share, index), abs=0.051)


def test_a_return_that_is_not_stored_gives_the_nearest_and_says_so(opened, page):
    rows = opened.run("return [...window.intervis.frame.verdicts.columns.row]")
    gap = next(row for row in range(rows[0], rows[-1]) if row not in set(rows))
    shown = (
        "const { intervis } = window; return [intervis.frame.number, intervis.line?.row ?? null,"
    )
    shown += " document.getElementById('message').textContent]"
    nearest = min(rows, key=lambda row: abs(row - gap))
    for place, expected in (
        (f"frame=0&return={rows[3]}", [0, rows[3], ""]),
        (
            f"frame=0&return={gap}",
            [0, nearest, f"The page holds no return {gap}; this is the nearest, return"],
        ),
        ("frame=7", [2, None, "The page holds no frame 7; this is the nearest, frame 2."]),
        ("frame=0&return=x", [0, None, "The page holds no return x."]),
    ):
        opened.open(f"{page.as_uri()}?{place}#{place}")  # another hash alone loads nothing
        number, row, message = opened.run(shown)
        assert [number, row] == expected[:2]
        assert message.startswith(expected[2])
        assert bool(message) == bool(expected[2])


def test_the_ends_of_an_axis_differ(opened):
    code = (PAGE / "charts.js").read_text().replace("export ", "")
    frames = [
        {"visible": 1000, "occluded": 10, "unknown": 10, "lines": [{"probability": 0.9141}]},
        {"visible": 1000, "occluded": 10, "unknown": 11, "lines": [{"probability": 0.9142}]},
    ]
    captions, ends = opened.run(
        f"{code}; const parent = document.createElement('div');"
        " new Charts(parent, arguments[0], [0, 1], () => {}).show(0);"
        " const texts = (name) => [...parent.querySelectorAll(name)].map((one) => one.textContent);"
        " return [texts('figcaption'), texts('svg text').filter((_, k) => k % 4 < 2)]",
        frames,
    )
    assert captions[-1] == "line 1, P(visible), % 91.410"
    assert ends[-2:] == ["91.410", "91.420"]
    assert all(low != high for low, high in zip(ends[::2], ends[1::2], strict=True))


def test_a_picture_of_a_page_refuses_unknown_layers(tool, page, tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(TOOLS))
    module = importlib.import_module("page_screenshot")
    picture = tmp_path / "p.png"
    words = ["page_screenshot", str(page), str(picture), "--switch"]
    monkeypatch.setattr("sys.argv", [*words, "blind-spots"])
    assert module.main() == 2
    assert (
        "no layer 'blind-spots': viewpoint, spots, region, mesh, rings." in capsys.readouterr().err
    )
    assert not picture.exists()
    monkeypatch.setattr("sys.argv", [*words, "spots"])
    assert module.main() == 0
    assert picture.stat().st_size > 10_000


def test_every_explanation_is_that_of_python(opened, drive, scenes):
    rng = np.random.default_rng(7)
    kinds = set()
    for index, number in enumerate(drive.frame_numbers):
        opened.run("return window.intervis.go(arguments[0])", index)
        count = opened.run("return window.intervis.frame.verdicts.count")
        chosen = rng.choice(count, 150, replace=False).tolist()
        lines = opened.run(
            "return arguments[0].map((i) => window.intervis.frame.verdicts.line(i))", chosen
        )
        moment_s = query_moment_s(scenes[number])
        for line in lines:
            said = explain(scenes[number], AHEAD, line["end"], moment_s=moment_s)
            assert line["text"] == str(said)
            kinds.add(line["kind"])
    assert {0, 1, 2} <= kinds  # occluded by a surface, visible, not observed


def test_the_page_rounds_as_python_does(opened, rng):
    values = [n / 20 for n in range(-60, 60)] + rng.uniform(-200, 200, 300).round(3).tolist()
    text = (PAGE / "numbers.js").read_text().replace("export ", "")
    printed = opened.run(f"{text}; return arguments[0].map(oneDecimal)", values)
    assert printed == [f"{value:.1f}" for value in values]


def test_a_click_explains_the_return_under_the_pointer(opened, drive, scenes):
    row, place = opened.run("""
        const { verdicts } = window.intervis.frame;
        const view = window.intervis.scan;
        const { clientWidth, clientHeight } = view.canvas;
        const inside = (at) => at && at[0] > 60 && at[1] > 60 && at[0] < clientWidth - 60
            && at[1] < clientHeight - 60;
        const chosen = [...verdicts.blockedAt.keys()].find((i) => verdicts.blockedAt[i] >= 0
            && inside(view.pixelOf(verdicts.end(i)))
            && view.pick(...view.pixelOf(verdicts.end(i)).slice(0, 2)) === i);
        return [verdicts.columns.row[chosen], verdicts.end(chosen)];
    """)
    opened.click(*opened.run(PIXEL_OF, "scan", place))
    shown = opened.run("return document.querySelector('#selection .text').textContent")
    assert drive[0].points[row] == pytest.approx(place, abs=0.0051)
    assert shown == str(explain(scenes[0], AHEAD, place, moment_s=query_moment_s(scenes[0])))
    assert f"return {row:,}" in opened.run("return document.querySelector('.head').textContent")
    assert opened.run("return document.querySelectorAll('.bar .parts i').length") == 16
    opened.key("Escape")
    assert opened.run("return document.querySelector('#selection .text')") is None


def test_a_stored_line_is_explained_as_by_python(opened, scenes):
    pressed(opened, "#stored button")
    said = explain(scenes[0], AHEAD, (30.0, -6.0, -1.0), moment_s=query_moment_s(scenes[0]))
    assert opened.run("return document.querySelector('#selection .text').textContent") == str(said)


def test_the_camera_shows_image_and_states_and_can_be_clicked(opened):
    place = opened.run("""
        const { verdicts } = window.intervis.frame;
        const panel = window.intervis.camera;
        const at = (i) => panel.pixelOf(verdicts.end(i));
        const chosen = [...verdicts.states.keys()].find((i) => at(i) && at(i)[1] > 120
            && panel.pick(at(i)[0], at(i)[1]) === i);
        const box = panel.canvas.getBoundingClientRect();
        const factor = box.width / panel.canvas.width;
        const [x, y] = at(chosen);
        return [box.left + factor * x, box.top + factor * y, verdicts.columns.row[chosen]];
    """)
    opened.click(*place[:2])
    assert opened.run("return window.intervis.line.row") == place[2]
    colours = opened.run("""
        const { canvas } = window.intervis.camera;
        const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
        const seen = new Set();
        for (let i = 0; i < data.length; i += 4) {
          seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
        }
        return [seen.size, Object.values(window.intervis.colours.onImage).filter(
            (hex) => seen.has(parseInt(hex.slice(1), 16))).length];
    """)
    assert colours[0] > 1000
    assert colours[1] == 3


def test_dragging_turns_and_the_wheel_keeps_what_is_under_the_cursor(opened):
    x, y = opened.run("""
        const box = window.intervis.scan.canvas.getBoundingClientRect();
        return [box.left + box.width / 2, box.top + box.height / 2];
    """)
    before = opened.run("return window.intervis.scan.camera.azimuth")
    opened.drag((x, y), (x + 90, y))
    assert opened.run("return window.intervis.scan.camera.azimuth") < before - 0.1
    # A point in the plane of the target, under a place beside the middle of the canvas.
    under = opened.run("""
        const { camera } = window.intervis.scan;
        const { right, up } = camera.axes();
        return camera.target.map((value, axis) => value + 6 * right[axis] + 4 * up[axis]);
    """)
    at = opened.run(PIXEL_OF, "scan", under)
    distance = opened.run("return window.intervis.scan.camera.distance")
    opened.mouse("mouseWheel", *at, deltaX=0, deltaY=-200)
    opened.wait_for(f"return window.intervis.scan.camera.distance < {0.9 * distance}")
    assert opened.run(PIXEL_OF, "scan", under) == pytest.approx(at, abs=0.6)


def test_the_page_fits_into_500_pixels_in_both_themes(opened):
    opened.resize(500, 900)
    for theme in ("light", "dark"):
        opened.run("document.documentElement.dataset.theme = arguments[0]", theme)
        opened.run("window.intervis.recolour()")
        assert opened.run("return document.documentElement.scrollWidth") <= 500
        assert opened.run(COUNT_PIXELS, "scan", colour(opened, "visible", theme)) > 100
        assert opened.run(COUNT_PIXELS, "scan", colour(opened, "background", theme)) > 10_000
        assert (
            opened.run("return document.querySelector('#charts').getBoundingClientRect().right")
            <= 500
        )


def test_without_webgl_there_are_a_sentence_and_a_picture(tool, page):
    with tool.Browser(800, 900, flags=tool.WITHOUT_WEBGL) as browser:
        browser.open(page.as_uri())
        assert browser.run("return document.documentElement.dataset.ready") == "true"
        assert browser.run("return document.getElementById('no-webgl').offsetHeight") > 0
        colours = browser.run("""
            const canvas = document.querySelector("#scan canvas.gl");
            const { width, height } = canvas;
            const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
            const counts = {};
            const two = (value) => value.toString(16).padStart(2, "0");
            for (let i = 0; i < data.length; i += 4) {
              const hex = `#${two(data[i])}${two(data[i + 1])}${two(data[i + 2])}`;
              counts[hex] = (counts[hex] ?? 0) + 1;
            }
            const { visible, occluded } = window.intervis.colours;
            return [counts[visible], counts[occluded]];
        """)
        assert min(colours) > 50


def test_names_with_markup_are_shown_and_not_run(window, tmp_path):
    name = "<img src=x onerror=window.harm=1>&amp;'$(reboot)\x1b[31m"
    y, z = np.meshgrid(np.arange(-5, 5, 0.1), np.arange(-1.5, 1.5, 0.1))
    folder = tmp_path / name
    folder.mkdir()
    wall = np.stack([np.full(y.size, 10.0), y.ravel(), z.ravel(), 0 * z.ravel()], axis=1)
    wall.astype("<f4").tofile(folder / "000000.bin")
    drive = open_drive(folder)
    path = tmp_path / "page.html"
    path.write_bytes(page_html(drive, [0], ViewRequest(viewpoint="sensor")))
    window.open(path.as_uri())
    title = window.run("return document.querySelector('h1').textContent")
    assert title == name.replace("\x1b", "\\x1b")
    assert window.run("return window.harm") is None
    assert window.run("return document.querySelectorAll('img').length") == 0
    window.run("window.intervis.pick(0)")
    command = window.run("return document.querySelector('.command code').textContent")
    assert shlex.split(command)[2] == title
    assert window.run("return document.getElementById('camera').hidden")  # a drive without images
    assert window.run("return document.querySelector('[data-do=play]').disabled")  # and one frame


@contextmanager
def served(drive, request):
    with ViewServer(drive, drive.frame_numbers, request, 0) as server:
        server.page = page_html(drive, drive.frame_numbers, request, is_served=True)
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def test_the_served_page_answers_lines_and_follows_the_viewpoint(window, drive):
    request = ViewRequest(viewpoint=AHEAD, most_returns=4_000, memory=0, has_blind_spots=False)
    scene = registered_scene(drive, drive[0], ())
    with served(drive, request) as server:
        window.resize(1400, 1000)
        window.open(server.url)
        start, end = window.run("""
            const { verdicts } = window.intervis.frame, view = window.intervis.scan;
            const seen = [...verdicts.states.keys()].filter((i) => {
              const at = view.pixelOf(verdicts.end(i));
              return at && at[0] > 60 && at[1] > 80 && at[0] < view.canvas.clientWidth - 60
                  && at[1] < view.canvas.clientHeight - 60 && view.pick(at[0], at[1]) === i;
            });
            return [seen[0], seen[seen.length - 1]].map((i) => verdicts.end(i));
        """)
        pressed(window, "#between")
        for place in (start, end):
            window.click(*window.run(PIXEL_OF, "scan", place))
        window.wait_for("return document.querySelector('#selection .text')")
        said = window.run("return document.querySelector('#selection .text').textContent")
        assert said == str(explain(scene, start, end, moment_s=0.0))

        at = window.run(PIXEL_OF, "above", list(AHEAD))
        window.drag(at, (at[0] - 60, at[1] + 40))
        window.wait_for("return window.intervis.frame.isMoved && !window.intervis.judge.isBusy")
        viewpoint, lines = window.run("""
            const { frame } = window.intervis;
            return [frame.viewpoint, [0, 700, 1900, 3000].map((i) => frame.verdicts.line(i))];
        """)
        assert viewpoint[1] > AHEAD[1] + 2  # to the left on the page is y
        assert viewpoint[0] < AHEAD[0] - 1
        for line in lines:
            assert line["text"] == str(explain(scene, viewpoint, line["end"], moment_s=0.0))

        at = window.run(PIXEL_OF, "scan", viewpoint)
        dropped = (at[0] + 35, at[1] + 20)
        window.drag(at, dropped)
        moved = window.run("return window.intervis.frame.viewpoint")
        assert window.run(PIXEL_OF, "scan", moved) == pytest.approx(dropped, abs=0.6)
        assert moved[2] == AHEAD[2]
        window.wait_for("return !window.intervis.judge.isBusy")
        assert window.log() == []


@pytest.mark.realdata
def test_a_real_frame_is_explained_as_by_python(window, shared_data, tmp_path):
    drive = open_drive(shared_data / "kitti_raw")
    path = tmp_path / "page.html"
    request = ViewRequest(viewpoint=(12.0, 0.0, 1.0), most_returns=8_000, memory=1)
    path.write_bytes(page_html(drive, [10], request))
    window.resize(1400, 1000)
    window.open(path.as_uri())
    scene = registered_scene(drive, drive[10], [9, 11])
    chosen = list(range(0, 8_000, 80))
    lines = window.run(
        "return arguments[0].map((i) => window.intervis.frame.verdicts.line(i))", chosen
    )
    for line in lines:
        assert line["text"] == str(explain(scene, request.viewpoint, line["end"]))
    assert {line["state"] for line in lines} == {0, 1, 2}
    assert window.log() == []
