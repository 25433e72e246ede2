"""The page of a run in a browser: its measures, its layers, and what it says without a drive."""

import importlib
import json
from pathlib import Path

import pytest

from intervis.drives import open_drive
from intervis.lab.worlds import simulate
from intervis.run import SightRequest, run_drive
from intervis.run.stored_run import read_run
from intervis.sight import Scene, explain
from intervis.view.run_page import request_of_run, run_page

TOOLS = Path(__file__).resolve().parents[2] / "tools"
AHEAD = (14.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def window():
    """A browser; without one the tests are skipped, and say why."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(TOOLS))
        tool = importlib.import_module("browser")
    reason = tool.missing_program()
    if reason is not None:
        pytest.skip(reason)
    with tool.Browser(1400, 1000) as browser:
        yield browser


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Two frames of the built-in street."""
    return open_drive(simulate(tmp_path_factory.mktemp("street"), frames=2))


@pytest.fixture(scope="module")
def out(drive, tmp_path_factory):
    """A run over the street with sight lines from a place ahead of the car."""
    folder = tmp_path_factory.mktemp("run") / "out"
    return run_drive(drive, folder, viewpoint=AHEAD, sight=SightRequest()).out


def opened(window, folder, page, drive=None, missing=""):
    """The page of a run in the browser."""
    run = read_run(folder)
    request = request_of_run(run, most_returns=8_000)
    page.write_bytes(run_page(run, drive, missing, run.numbers, request)[0])
    window.resize(1400, 1000)
    window.log()
    window.open(page.as_uri())
    assert window.log() == []


def text_of(window, selector):
    return window.run("return document.querySelector(arguments[0])?.textContent", selector)


def measures(window):
    """The measures that the page shows, by name."""
    return window.run("""
        return Object.fromEntries([...document.querySelectorAll("#measures dl div")].map(
            (one) => [one.querySelector("dt").textContent, one.querySelector("dd").textContent]));
    """)


def test_the_measures_of_each_frame_are_shown(window, out, drive, tmp_path):
    opened(window, out, tmp_path / "page.html", drive)
    stored = json.loads((out / "summary.json").read_text())["frames"]
    for nth, frame in enumerate(stored):
        window.run(f"return window.intervis.go({nth})")
        shown = measures(window)
        assert shown["TPI"] == f"{frame['measures']['TPI']:.2f} %"
        assert shown["n_raw"] == f"{frame['measures']['n_raw']:,}"
        assert shown["tau"] == str(frame["tau"])
        assert shown["time"] == f"{1000 * frame['times_s']['total']:.1f} ms"
        charts = window.run(
            "return [...document.querySelectorAll('#charts b')].map(b => b.textContent)"
        )
        assert float(charts[0]) == pytest.approx(100 * frame["sight"]["visible"], abs=0.06)
    layers = window.run("return window.intervis.shownLayers")
    assert layers["region"]
    assert layers["mesh"]
    assert window.run("return document.querySelector('#measures p').hidden")


def test_a_return_is_explained_from_the_scan_of_its_frame(window, out, drive, tmp_path):
    opened(window, out, tmp_path / "page.html", drive)
    scene, points = Scene.from_scan(drive[0].points), drive[0].points
    lines = window.run("""
        const { verdicts } = window.intervis.frame;
        return Array.from({ length: 40 }, (_, k) => verdicts.line(190 * k));
    """)
    for line in lines:
        said = explain(scene, AHEAD, points[line["row"]])
        assert line["text"].split(":")[0] == said.text.split(":")[0]
    assert len({line["state"] for line in lines}) == 3
    window.run("window.intervis.pick(0)")
    assert "its end rounded to 1 cm" in text_of(window, "#selection")
    assert text_of(window, ".command code").startswith("intervis sight ")


def test_without_its_drive_the_page_shows_the_nodes_and_says_why(window, out, tmp_path):
    opened(window, out, tmp_path / "page.html", missing="it is gone")
    assert "because the drive is missing: it is gone." in text_of(window, ".lead")
    assert window.run("return document.getElementById('camera').hidden")
    window.run("window.intervis.pick(3)")
    assert text_of(window, "#selection .text").endswith(
        "as the run stored it. The scan is missing: it is gone."
    )
    assert text_of(window, ".command code") is None
    assert text_of(window, ".bar") is None
    assert measures(window)["n"] == f"{window.run('return window.intervis.frame.stored'):,}"
    for theme in ("light", "dark"):
        window.resize(500, 900)
        window.run("document.documentElement.dataset.theme = arguments[0]", theme)
        window.run("window.intervis.recolour()")
        assert window.run("return document.documentElement.scrollWidth") <= 500


def test_without_drive_and_states_none_are_offered(window, drive, tmp_path):
    out = run_drive(drive, tmp_path / "out", frames=(0, 1)).out
    opened(window, out, tmp_path / "page.html", missing="it is gone")
    assert window.run("return document.querySelectorAll('.chip.state').length") == 0
    choices = window.run("return [...document.querySelectorAll('option')].map((one) => one.value)")
    assert choices == ["height"]
    assert "no return can be judged" in text_of(window, "#selection")
    window.run("window.intervis.pick(0)")
    assert text_of(window, ".badge") == "not judged"
    assert text_of(window, "#selection .text").startswith("Not judged. The run asked no sight")
    assert window.log() == []
