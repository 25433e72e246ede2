"""``intervis evaluate`` at the command line, with methods whose answers are known."""

import json
import sys

import numpy as np
import pytest
import typer
from yard import YARD, write_drive

from intervis.errors import (
    DriveError,
    IntervisError,
    MissingExtraError,
    OutputError,
    SettingsError,
)
from intervis.lab.cli.evaluate import evaluate
from intervis.lab.truth.baselines import InputScans
from intervis.lab.truth.methods import Method, Predictions
from intervis.lab.truth.query_set import QuerySet
from intervis.lab.truth.reliability_plot import reliability_figure
from intervis.lab.truth.results import EvaluationResult, MethodResult
from intervis.lab.truth.tables import accuracy_table
from intervis.lab.worlds.ray_casting import RayCaster


@pytest.fixture
def drive(tmp_path):
    folder = tmp_path / "yard"
    folder.mkdir()
    write_drive(folder, YARD, np.arange(-10.0, 2.0, 2.0), step_deg=0.5)
    return folder


@pytest.fixture
def known_methods(monkeypatch):
    def cast(inputs, viewpoint, targets):
        distance = np.linalg.norm(targets - viewpoint, axis=1)
        blocked = RayCaster(YARD).blocked(viewpoint, targets, slack_m=0.15 + 0.01 * distance)
        probability = np.where(blocked, 0.1, 0.9)
        state = np.where(np.arange(len(targets)) % 4 == 0, -1, ~blocked)
        return Predictions(probability, state, 0.01, 0.002)

    def constant(inputs, viewpoint, targets):
        return Predictions(np.ones(len(targets)), None, 0.0, 0.5)

    def methods_for(protocol, *, baselines):
        others = [Method("constant", "visible", constant)] if baselines else []
        return [Method("intervis", "default", cast), *others]

    monkeypatch.setattr("intervis.lab.truth.evaluation.methods_for", methods_for)


def command(*arguments):
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command()(evaluate)
    return app(args=[str(argument) for argument in arguments], standalone_mode=False)


def test_table_and_json(drive, known_methods, tmp_path, capsys):
    file = tmp_path / "accuracy.json"
    command(drive, "--pairs", "0:5,5:0", "--rivals", "--json", file)
    shown = capsys.readouterr().out
    assert "yard: held-out returns, protocol single, 2 viewpoints" in shown
    assert "constant (visible)" in shown
    assert "0:5" in shown
    content = json.loads(file.read_text())
    assert content["drive"]["frames"] == 6
    (evaluation,) = content["evaluations"]
    engine, constant = evaluation["results"]
    assert engine["mean"]["mcc"] > 0.95
    assert engine["mean"]["coverage"] == pytest.approx(0.75, abs=0.01)
    assert constant["mean"]["mcc"] == 0.0
    assert constant["mean"]["precision_occluded"] is None
    assert f"{engine['mean']['mcc']:.3f}" in shown
    assert "yard: risk and coverage, held-out returns, protocol single" in shown
    assert f"{constant['mean']['aurc']:.4f}" in shown
    assert constant["mean"]["aurc"] == pytest.approx(1 - constant["mean"]["visible_fraction"])
    assert content["schema"] == evaluation["schema"] == 3


def test_each_output_needs_a_file_of_its_own(drive, tmp_path):
    """Before anything is evaluated: there is no pair 0:99."""
    (tmp_path / "here").mkdir()
    for name in ("out", "here/../out"):
        with pytest.raises(OutputError, match=r"--json and --markdown both name .*out: give"):
            command(
                drive, "--pairs", "0:99", "--json", tmp_path / "out", "--markdown", tmp_path / name
            )
    picture = tmp_path / "a.png"
    with pytest.raises(OutputError, match=r"--markdown and --plot both name .*a\.png"):
        command(drive, "--pairs", "0:99", "--markdown", picture, "--plot", picture)
    assert not (tmp_path / "out").exists()
    with pytest.raises(DriveError):
        command(drive, "--pairs", "0:99", "--json", tmp_path / "a", "--markdown", tmp_path / "b")


def test_a_picture_that_cannot_be_drawn_is_told_before_the_work(drive, tmp_path, monkeypatch):
    with pytest.raises(OutputError, match=r"\.png or \.svg at its end, got .*plot\.jpg"):
        command(drive, "--pairs", "0:99", "--plot", tmp_path / "plot.jpg")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match="matplotlib"):
        command(drive, "--pairs", "0:99", "--plot", tmp_path / "plot.png")


def test_random_points_in_space(drive, known_methods, capsys):
    command(drive, "--pairs", "0:5", "--targets", "space")
    assert "held-out returns, random points in space, protocol single" in capsys.readouterr().out


def test_without_baselines_there_is_the_engine_only(drive, known_methods, capsys):
    command(drive, "--pairs", "0:5", "--protocol", "map")
    shown = capsys.readouterr().out
    assert "protocol map, 1 viewpoint, " in shown
    assert "constant" not in shown


def test_scanners_of_one_moment(drive, known_methods, tmp_path, capsys):
    text = "".join(
        f'[[scanner]]\nname = "{name}"\nscan = "{drive}/{number:06d}.bin"\n'
        f"translation_m = [{x}, 0, 1.7]\n"
        for name, number, x in (("front", 5, 0.0), ("rear", 3, -4.0))
    )
    file, listed = tmp_path / "accuracy.json", tmp_path / "together.toml"
    listed.write_text(text)
    command(listed, "--protocol", "together", "--rivals", "--json", file)
    shown = capsys.readouterr().out
    assert "together: a second scanner, queries in the frame of the scene" in shown
    assert "front:rear, constant (visible)" in shown
    content = json.loads(file.read_text())
    assert content["drive"]["scanners"] == ["front", "rear"]
    (evaluation,) = content["evaluations"]
    assert evaluation["query_sets"] == ["front:rear", "rear:front"]
    assert evaluation["results"][0]["mean"]["mcc"] > 0.95
    command(listed, "--protocol", "together", "--pairs", "rear:front")
    shown = capsys.readouterr().out
    assert "rear:front" in shown
    assert "front:rear" not in shown
    # a folder of scans with poses: frames 5 and 3 are the same two scans
    command(drive, "--protocol", "together", "--pairs", "5:3", "--json", file)
    (other,) = json.loads(file.read_text())["evaluations"]
    assert other["target_count"] == evaluation["results"][0]["query_sets"]["front:rear"]["count"]


def test_a_short_simulated_drive_is_compared_with_its_world_only(known_methods, tmp_path, capsys):
    from intervis.lab.worlds import simulate

    source = simulate(tmp_path / "street", frames=2, images=False)
    command(source)
    output = capsys.readouterr()
    assert "exact world, rays by Embree" in output.out
    assert "free points" in output.out
    assert "against held-out returns is skipped" in output.err
    (source / "poses.txt").unlink()
    with pytest.raises(DriveError):
        command(source)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (["--pairs", "0-5"], SettingsError, "0:5,0:10"),
        (["--pairs", "0:77"], DriveError, "no frame 77"),
        (["--pairs", "2:2"], DriveError, "own reference"),
        (["--protocol", "all"], SettingsError, "single, past, map"),
        (["--targets", "anywhere"], SettingsError, "returns, space"),
        (["--protocol", "together", "--targets", "all"], SettingsError, "returns, space"),
        (["--rate", "0"], SettingsError, "the rate of scans must be from"),
        (["--protocol", "together", "--graph"], SettingsError, "needs a drive"),
        (["--protocol", "together", "--frame", "world"], SettingsError, "scene, scanner"),
        (["--protocol", "together", "--pairs", "0:0"], DriveError, "own reference"),
        (["--json", "/nowhere/at/all.json"], OutputError, "no folder"),
        (["--json", "."], OutputError, "is a folder"),
    ],
)
def test_wrong_requests(drive, known_methods, arguments, error, message):
    with pytest.raises(error, match=message):
        command(drive, *arguments)


def test_no_such_source(tmp_path):
    with pytest.raises(IntervisError, match="nothing at"):
        command(tmp_path / "none")


def test_nothing_is_written_when_the_work_fails(drive, monkeypatch, tmp_path):
    """The second of two query sets fails, when one set of answers is there already."""
    asked = []

    def fail_later(inputs, viewpoint, targets):
        asked.append(viewpoint)
        if len(asked) == 2:
            raise DriveError("the second fails.")
        return Predictions(np.ones(len(targets)), None, 0.0, 0.5)

    monkeypatch.setattr(
        "intervis.lab.truth.evaluation.methods_for",
        lambda protocol, *, baselines: [Method("intervis", "default", fail_later)],
    )
    out = tmp_path / "out"
    out.mkdir()
    outputs = ["--json", out / "a.json", "--markdown", out / "a.md", "--plot", out / "a.png"]
    with pytest.raises(DriveError, match="the second fails"):
        command(drive, "--pairs", "0:5,5:0", *outputs)
    assert len(asked) == 2
    assert not list(out.iterdir())


def test_the_reliability_plot_is_a_picture(drive, known_methods, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    file = tmp_path / "reliability.png"
    command(drive, "--pairs", "0:5", "--plot", file)
    assert file.read_bytes().startswith(b"\x89PNG")
    assert str(file) in capsys.readouterr().out


def evaluation_of(probability, visible):
    inputs = InputScans((), (), (), 0, 1)
    points = np.zeros((len(visible), 3))
    query_set = QuerySet("0:1", inputs, np.zeros(3), points, np.array(visible))
    result = MethodResult("intervis", "default")
    result.add(query_set, Predictions(np.array(probability), None, 0.0, 0.001))
    return EvaluationResult(
        "drive", "held-out returns", "single", ("0:1",), len(visible), (result,)
    )


def test_the_plot_shows_the_bins():
    pytest.importorskip("matplotlib")
    evaluation = evaluation_of([0.05, 0.15, 0.95, 0.95], [False, False, True, False])
    (axes,) = reliability_figure([evaluation]).axes
    heights = [bar.get_height() for bar in axes.patches]
    np.testing.assert_allclose(heights, [0.25, 0.25, 0, 0, 0, 0, 0, 0, 0, 0.5])
    dots = axes.lines[1].get_xydata()
    np.testing.assert_allclose(dots, [[0.05, 0], [0.15, 0], [0.95, 0.5]])


def test_nan_is_a_dash():
    table = accuracy_table(evaluation_of([0.9, 0.8], [True, True]))
    assert table.rows[0][1] == "-"  # all labels are equal: no correlation
    assert table.rows[0][4] == "0.025"


def test_the_graph_and_markdown(drive, known_methods, tmp_path, capsys):
    file, page = tmp_path / "accuracy.json", tmp_path / "accuracy.md"
    command(drive, "--pairs", "0:5", "--graph", "--json", file, "--markdown", page)
    shown = capsys.readouterr().out
    assert "The paper's graph compared with held-out returns" in shown
    graphs = json.loads(file.read_text())["graphs"]["held-out returns"]
    assert {score["criterion"] for score in graphs} == {"elevation", "sight_angle", "sight_line"}
    assert {score["tau"] for score in graphs} == {35, 10, 1}
    text = page.read_text()
    assert "sight_line" in text
    assert "yard: held-out returns, protocol single" in text
