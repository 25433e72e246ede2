"""The page of a run: the numbers of its files, and a sentence for everything that is missing."""

import html
import json
import shutil

import numpy as np
import pytest
from page_content import parts_of, unpacked

from intervis.drives import open_drive
from intervis.errors import DriveError, OutputError, SettingsError
from intervis.run import SightRequest, load_analysis, load_sight, run_drive
from intervis.run.frame_file import frame_path, load_frame
from intervis.run.stored_run import StoredRun, is_run, read_run, runs_below
from intervis.settings import Settings
from intervis.sight import Scene, explain
from intervis.view import ViewRequest, page_html
from intervis.view.run_page import request_of_run, run_page
from intervis.view.verdicts import percent_codes
from small_drive import files_below, scan_folder

VIEWPOINT, RISK, NUMBERS = (6.0, 1.0, 0.5), 0.1, (0, 1, 2)
STATE_OF_KIND = {0: 0, 1: 1, 2: -1, 3: -1, 4: 0, 5: -1}
ENOUGH = 10_000


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """Three scans with poses; the car moves two metres a frame."""
    folder = scan_folder(tmp_path_factory.mktemp("street") / "drive", NUMBERS)
    rows = [f"1 0 0 {2 * n} 0 1 0 0 0 0 1 0" for n in NUMBERS]
    (folder / "poses.txt").write_text("\n".join(rows) + "\n")
    return folder


def run_of(street, out, **options):
    """A run over the street; its folder."""
    chosen = {"settings": Settings(tau=5), "viewpoint": VIEWPOINT} | options
    return run_drive(open_drive(street), out, **chosen).out


@pytest.fixture(scope="module")
def with_sight(street, tmp_path_factory):
    """A run with sight lines from its viewpoint."""
    return run_of(street, tmp_path_factory.mktemp("run") / "out", sight=SightRequest(risk=RISK))


@pytest.fixture(scope="module")
def without_sight(street, tmp_path_factory):
    """A run of the paper's method alone."""
    return run_of(street, tmp_path_factory.mktemp("run") / "out")


def page_of(folder, *, drive=None, missing="", **options):
    """Content, columns of each frame, text, and frames that were left out."""
    run = read_run(folder)
    request = request_of_run(run, **options)
    page, left_out = run_page(run, drive, missing, run.numbers, request)
    content, blocks = parts_of(page.decode())
    columns = [unpacked(blocks[f"block-{n}"]) for n in range(len(content["frames"]))]
    return content, columns, html.unescape(page.decode()), left_out


@pytest.fixture(scope="module")
def shown(street, with_sight):
    """The page of the run with sight lines, and its drive."""
    return page_of(with_sight, drive=read_run(with_sight).drive())


def test_measures_times_and_shares_are_those_of_the_files(with_sight, shown):
    content, _, _, left_out = shown
    frames = json.loads((with_sight / "summary.json").read_text())["frames"]
    assert left_out == []
    assert [frame["number"] for frame in content["frames"]] == list(NUMBERS)
    for header, stored in zip(content["frames"], frames, strict=True):
        assert header["run"]["measures"] == stored["measures"]
        assert header["run"]["times_s"] == stored["times_s"]
        assert header["run"]["shares"] == stored["sight"]
        assert header["run"]["tau"] == stored["tau"] == 5
        arrays = load_frame(frame_path(with_sight, header["number"]))
        names, values = arrays["measure_names"].tolist(), arrays["measures"].tolist()
        named = dict(zip(names, values, strict=True))
        assert header["run"]["measures"] == named


def test_states_and_probabilities_are_those_of_the_files(with_sight, shown):
    content, columns, _, _ = shown
    kinds = set()
    for header, column in zip(content["frames"], columns, strict=True):
        stored = load_sight(frame_path(with_sight, header["number"]))
        rows = np.array(column["row"])
        assert header["viewpoint"] == list(VIEWPOINT)
        assert len(rows) == len(stored.state)  # the small scans are not thinned
        states = [STATE_OF_KIND[kind & 7] for kind in column["kind"]]
        assert states == stored.state[rows].tolist()
        assert column["percent"] == percent_codes(stored.probability[rows]).tolist()
        counts = [header[name] for name in ("visible", "occluded", "unknown")]
        assert counts == [states.count(state) for state in (1, 0, -1)]
        kinds |= {kind & 7 for kind in column["kind"]}
    assert {0, 1, 2} <= kinds


def test_mesh_and_region_are_those_of_the_files(with_sight, shown):
    content, columns, _, _ = shown
    for header, column in zip(content["frames"], columns, strict=True):
        stored = load_analysis(frame_path(with_sight, header["number"]))
        nodes = np.column_stack([column[f"node_{axis}"] for axis in "xyz"]) / 100
        assert np.abs(nodes - stored.node_points).max() <= 0.00501
        edges = np.column_stack([column["edge_a"], column["edge_b"]])
        assert np.array_equal(edges, stored.edges)
        assert column["edge_intervisible"] == stored.edge_intervisible.astype(int).tolist()
        region = np.column_stack([column[f"region_{corner}"] for corner in "abc"])
        assert np.array_equal(region, stored.triangles[stored.region])
        assert header["TPI"] == round(stored.measures.TPI, 2)


def test_numbers_are_read_and_not_computed_again(with_sight, tmp_path):
    out = shutil.copytree(with_sight, tmp_path / "out")
    arrays = load_frame(frame_path(out, 1))
    state, probability = np.roll(arrays["sight_state"], 7), np.roll(arrays["sight_probability"], 7)
    changed = {
        "sight_state": state,
        "sight_probability": probability,
        "measures": arrays["measures"] + 1.0,
        "region": ~arrays["region"],
    }
    np.savez(frame_path(out, 1), **(arrays | changed))
    content, columns, _, _ = page_of(out, drive=read_run(out).drive())
    rows, header = np.array(columns[1]["row"]), content["frames"][1]
    assert [STATE_OF_KIND[kind & 7] for kind in columns[1]["kind"]] == state[rows].tolist()
    assert columns[1]["percent"] == percent_codes(probability[rows]).tolist()
    assert list(header["run"]["measures"].values()) == changed["measures"].tolist()
    assert len(columns[1]["region_a"]) == changed["region"].sum() > 0
    assert header["unexplained"] == ""  # the scan is that of the run


def test_what_the_run_did_not_store_is_judged_from_the_scan_itself(street, shown):
    content, columns, _, _ = shown
    drive, column = open_drive(street), columns[1]
    scene = Scene.from_scan(drive[1].points)
    blocked, compared = 0, 0
    for i, row in enumerate(column["row"]):
        said = explain(scene, VIEWPOINT, drive[1].points[row], risk=RISK)
        assert said.state == STATE_OF_KIND[column["kind"][i] & 7]
        if column["kind"][i] & 7 == 0:
            place = [column[f"blocker_{axis}"][blocked] / 10 for axis in "xyz"]
            assert np.abs(place - np.array(said.blocker)).max() <= 0.0501
            blocked += 1
        if np.isfinite(said.clearance_m):
            assert abs(column["clearance"][i] / 10 - abs(said.clearance_m)) <= 0.0501
            compared += 1
    assert blocked > 3
    assert compared > 100
    assert content["risk"] == RISK
    assert content["frames"][1]["memory"] == []


def test_states_of_a_run_without_them_are_those_of_the_drives_page(street, without_sight):
    content, columns, text, _ = page_of(without_sight, drive=read_run(without_sight).drive())
    request = ViewRequest(viewpoint=VIEWPOINT, has_method=False)
    page = page_html(open_drive(street), NUMBERS, request).decode()
    drive_content, blocks = parts_of(page)
    for n, column in enumerate(columns):
        of_drive = unpacked(blocks[f"block-{n}"])
        assert {name: column[name] for name in of_drive} == of_drive
        assert content["frames"][n]["memory"] == drive_content["frames"][n]["memory"] != []
        assert content["frames"][n]["run"]["shares"] == {}
    assert "seen from (6, 1, 0.5), are judged from the drive now, by up to 3 scans" in text


def test_without_the_drive_the_nodes_are_shown_with_their_stored_states(with_sight):
    content, columns, text, _ = page_of(with_sight, missing="it is gone")
    assert "blind spots and images, because the drive is missing: it is gone." in text
    assert content["run"] == {"has_states": True, "has_drive": False}
    assert not content["has_command"]
    for header, column in zip(content["frames"], columns, strict=True):
        path = frame_path(with_sight, header["number"])
        nodes, stored = load_analysis(path).nodes, load_sight(path)
        assert column["row"] == nodes.tolist()
        states = [STATE_OF_KIND[kind & 7] for kind in column["kind"]]
        assert states == stored.state[nodes].tolist()
        assert column["percent"] == percent_codes(stored.probability[nodes]).tolist()
        assert header["unexplained"] == "The scan is missing: it is gone."


def test_paths_with_control_characters_are_escaped(with_sight):
    content, _, text, _ = page_of(with_sight, missing="no \x1b[31m<b>\u202e here")
    assert "missing: no \\x1b[31m<b>\\u202e here." in text  # unescaped by `page_of`
    assert "\\x1b[31m" in content["frames"][0]["unexplained"]
    assert not {"\x1b", "\u202e"} & set(text)


def test_without_drive_and_sight_lines_there_are_no_states(without_sight):
    content, columns, text, _ = page_of(without_sight, missing="it is gone")
    assert "without states, blockers, blind spots and images" in text
    assert not content["run"]["has_states"]
    assert {code for column in columns for code in column["percent"]} == {255}
    few, columns, _, _ = page_of(without_sight, missing="it is gone", most_returns=10)
    assert [frame["stored"] for frame in few["frames"]] == [10, 10, 10]
    assert len(columns[0]["node_x"]) > 10


def test_a_scan_that_changed_after_the_run_is_not_shown(street, with_sight, tmp_path):
    moved = shutil.copytree(street, tmp_path / "moved")
    scan = moved / "000001.bin"
    content = bytearray(scan.read_bytes())
    content[:4] = np.float32(17.0).tobytes()  # outside the part that `Drive.fingerprint` reads
    scan.write_bytes(bytes(content))
    run = read_run(with_sight)
    content, columns, _, _ = page_of(with_sight, drive=run.drive(moved))
    assert [bool(frame["unexplained"]) for frame in content["frames"]] == [False, True, False]
    assert "scan, pose or camera of frame 1 changed after the run" in str(content["frames"][1])
    assert columns[1]["row"] == load_analysis(frame_path(with_sight, 1)).nodes.tolist()
    scan.write_bytes(b"123")
    with pytest.raises(DriveError, match="is not the drive of the run any more: the size of the"):
        run.drive(moved)


def test_a_drive_is_found_where_it_was_or_where_the_user_says(street, with_sight, tmp_path):
    run = read_run(with_sight)
    assert run.drive().root == street
    moved = shutil.copytree(street, tmp_path / "another name")
    assert run.drive(moved).root == moved
    (moved / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 3)
    with pytest.raises(DriveError, match=r"another name is not the drive .* the digest differs$"):
        run.drive(moved)
    with pytest.raises(DriveError, match=r"^there is nothing at .*nowhere$"):
        run.drive(tmp_path / "nowhere")


def test_a_run_that_does_not_say_where_its_drive_is(with_sight, tmp_path):
    older = shutil.copytree(with_sight, tmp_path / "older")
    summary = json.loads((older / "summary.json").read_text())
    del summary["source"]
    (older / "summary.json").write_text(json.dumps(summary))
    with pytest.raises(DriveError, match=r"^the run does not say where its drive was$"):
        read_run(older).drive()


def test_the_last_frame_has_no_lines_from_the_next_one(street, tmp_path):
    out = run_of(street, tmp_path / "out", sight=SightRequest("next"))
    content, columns, text, _ = page_of(out, drive=read_run(out).drive())
    assert "start at the scanner's place in the next frame" in text
    assert [frame["viewpoint"] for frame in content["frames"]] == [[2, 0, 0]] * 2 + [
        list(VIEWPOINT)
    ]
    assert content["frames"][2]["unexplained"].endswith("there is no next frame.")
    assert set(columns[2]["percent"]) == {255}
    assert content["frames"][2]["run"]["shares"]["visible"] is None
    assert len(columns[2]["row"]) == len(open_drive(street)[2].points)


def test_a_run_that_was_cut_short_shows_the_frames_that_are_there(street, tmp_path):
    def cut(note):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_of(street, tmp_path / "out", progress=cut)
    run = read_run(tmp_path / "out")
    content, _, text, _ = page_of(tmp_path / "out", drive=run.drive())
    assert 1 <= len(content["frames"]) < 3
    assert f"of the 3 frames of its drive it has written {len(run.numbers)}." in text


def test_damaged_frames_are_listed_and_the_rest_is_shown(with_sight, tmp_path):
    out = shutil.copytree(with_sight, tmp_path / "out")
    frame_path(out, 1).write_bytes(b"broken")
    content, _, text, left_out = page_of(out, missing="it is gone")
    assert left_out == [1]
    assert [frame["number"] for frame in content["frames"]] == [0, 2]
    assert "Left out, because their files are damaged: frame 1." in text
    shutil.copy(frame_path(out, 0), frame_path(out, 2))
    assert page_of(out, missing="it is gone")[3] == [1, 2]
    frame_path(out, 0).write_bytes(b"")
    with pytest.raises(OutputError, match=r"0000000000\.npz is damaged"):
        page_of(out, missing="it is gone")


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("edges", lambda edges: edges + len(edges)),
        ("triangles", lambda triangles: triangles - 1),
        ("nodes", lambda nodes: nodes + ENOUGH),
        ("node_points", lambda points: points * np.nan),
        ("node_points", lambda points: points[1:]),
        ("region", lambda region: region[1:]),
        ("edges", lambda edges: edges.astype(float)),
        ("viewpoint", lambda viewpoint: viewpoint[:2]),
        ("sight_state", lambda state: state[1:]),
        ("world_from_velo", lambda pose: 2 * pose),
    ],
)
def test_files_that_contradict_themselves_are_damaged(with_sight, tmp_path, name, damage):
    path = frame_path(tmp_path, 1)
    path.parent.mkdir()
    arrays = load_frame(frame_path(with_sight, 1))
    np.savez(path, **arrays)
    run = read_run(with_sight)
    here = StoredRun(**(vars(run) | {"folder": tmp_path}))
    assert here.frame(1).record.number == 1
    np.savez(path, **(arrays | {name: damage(arrays[name])}))
    with pytest.raises(OutputError, match=r"0000000001\.npz is damaged: .*\.$"):
        here.frame(1)


def test_folders_that_are_no_whole_run_get_one_sentence(with_sight, tmp_path):
    out = shutil.copytree(with_sight, tmp_path / "out")
    whole = (out / "summary.json").read_text()
    for content, said in (
        ("{", r"summary\.json is not the summary of a run\.$"),
        ("{}", r"summary\.json is not the summary of a run\.$"),
        ('{"settings": {}}', r"summary\.json is damaged"),
        (whole.replace('"frames": 3', '"frames": "all"'), r"summary\.json is damaged"),
        (whole.replace('"tau": 5', '"tau": -5', 1), r"summary\.json is damaged"),
    ):
        (out / "summary.json").write_text(content)
        assert is_run(out)
        with pytest.raises(OutputError, match=said):
            read_run(out)
    (out / "summary.json").unlink()
    assert is_run(out)
    with pytest.raises(OutputError, match=r"whose summary\.json is missing"):
        read_run(out)
    shutil.rmtree(out / "frames")
    assert not is_run(out)
    (out / "summary.json").write_text(whole)
    (out / "frames").mkdir()
    with pytest.raises(OutputError, match="holds a run without frames"):
        read_run(out)
    assert runs_below(tmp_path) == ["out"]
    assert runs_below(tmp_path / "nowhere") == []


def test_risk_and_memory_of_stored_lines_are_not_chosen_again(with_sight, without_sight):
    for given, option in (({"risk": 0.02}, "--risk"), ({"memory": 1}, "--memory")):
        with pytest.raises(SettingsError, match=f"^{option} is about lines that are judged now"):
            request_of_run(read_run(with_sight), **given)
    request = request_of_run(read_run(without_sight), risk=0.02, memory=1)
    assert (request.risk, request.memory) == (0.02, 1)


def test_failed_frames_and_an_older_version_are_told(street, tmp_path):
    damaged = shutil.copytree(street, tmp_path / "drive")
    (damaged / "000001.bin").write_bytes(b"123")
    out = run_of(damaged, tmp_path / "out")
    summary = (out / "summary.json").read_text()
    (out / "summary.json").write_text(summary.replace('"intervis": "', '"intervis": "0.0.', 1))
    content, _, text, _ = page_of(out, drive=read_run(out).drive())
    assert [frame["number"] for frame in content["frames"]] == [0, 2]
    assert "Without a result in the run: frame 1." in text
    assert "The run was made by intervis 0.0." in text


def test_a_drive_of_one_scan_whose_number_is_a_time(tmp_path):
    folder = scan_folder(tmp_path / "drive", (1532402927647951,))
    out = run_of(folder, tmp_path / "out", sight=SightRequest())
    content, _, text, _ = page_of(out, drive=read_run(out).drive())
    assert [frame["number"] for frame in content["frames"]] == [1532402927647951]
    assert "What a run stored" in text
    assert "; 1 frame. " in text


def test_a_page_changes_nothing_of_the_run(with_sight, street):
    before = files_below(with_sight), files_below(street)
    page_of(with_sight, drive=read_run(with_sight).drive())
    assert (files_below(with_sight), files_below(street)) == before


@pytest.mark.realdata
def test_a_real_run_is_shown_by_its_own_numbers(shared_data, tmp_path):
    drive = open_drive(shared_data / "kitti_raw")
    out = run_drive(
        drive, tmp_path / "out", viewpoint=(12, 0, 1), frames=(4, 5), sight=SightRequest()
    ).out
    content, columns, _, _ = page_of(out, drive=read_run(out).drive(), most_returns=20_000)
    stored = load_sight(frame_path(out, 4))
    rows = np.array(columns[0]["row"])
    states = [STATE_OF_KIND[kind & 7] for kind in columns[0]["kind"]]
    assert states == stored.state[rows].tolist()
    # The same engine: every occluded return has its blocker.
    assert sum(kind & 7 == 0 for kind in columns[0]["kind"]) == states.count(0)
    assert content["frames"][0]["camera"]["has_image"]
