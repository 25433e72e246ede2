"""What a page stores, decoded by a double in Python, against the answers of the engine."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from page_content import parts_of, unpacked

import intervis.view
from intervis.drives import open_drive
from intervis.sight import explain
from intervis.sight.explanation import _metres, _percent
from intervis.uses.registration import registered_scene
from intervis.view import ViewRequest, page_html
from intervis.view.columns import packed
from intervis.view.page_file import MODULES
from intervis.view.verdicts import decimetres, percent_codes, thinned_rows
from intervis.view.view_request import remembered_frames, thinned_frames
from parsed_page import Parsed
from small_drive import scan_folder

PAGE = Path(intervis.view.__file__).parent / "page"


@given(
    st.lists(st.integers(-(2**30), 2**30), max_size=40),
    st.lists(st.integers(0, 300), max_size=40),
    st.booleans(),
)
def test_columns_come_back(first, second, by_difference):
    columns = {"a": np.array(first, np.int64), "b": np.array(second, np.int64)}
    block = packed(columns, ["a"] if by_difference else [])
    assert unpacked(block) == {"a": first, "b": second}


@given(st.lists(st.floats(-1000, 1000) | st.integers(-4000, 4000).map(lambda n: n / 20)))
def test_decimetres_are_rounded_as_printed(values):
    printed = [round(10 * float(f"{value:.1f}")) for value in values]
    assert decimetres(np.array(values, np.float64)).tolist() == printed


@given(st.floats(0, 1))
def test_percent_codes_stand_for_the_printed_percentages(probability):
    code = int(percent_codes(np.array([probability]))[0])
    words = {0: "less than 1 %", 101: "more than 99 %"}.get(code, f"{code} %")
    assert words == _percent(probability)


@given(st.integers(1, 6000), st.integers(1, 60))
def test_thinned_frames_are_even_and_keep_both_ends(count, most):
    chosen = thinned_frames(range(count), most)
    assert len(chosen) == min(count, most)
    assert chosen[0] == 0
    if most > 1:
        assert chosen[-1] == count - 1
    steps = np.diff(chosen)
    assert not len(steps) or steps.max() - steps.min() <= 1


@given(st.integers(0, 60), st.integers(1, 60))
def test_thinned_rows_are_even_and_no_more_than_asked_for(count, most):
    points = np.ones((count, 3))
    points[::7] = np.nan
    rows = thinned_rows(points, most)
    returns = np.flatnonzero(np.isfinite(points).all(axis=1))
    assert set(rows) <= set(returns)
    steps = np.diff(np.searchsorted(returns, rows))
    assert len(rows) == min(most, len(returns))
    assert not len(steps) or steps.max() - steps.min() <= 1


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Four scans of a bumpy street with posts; the car moves two metres a frame."""
    folder = scan_folder(tmp_path_factory.mktemp("street"), (0, 1, 2, 3))
    rows = [f"1 0 0 {2 * n} 0 1 0 0 0 0 1 0" for n in range(4)]
    (folder / "poses.txt").write_text("\n".join(rows) + "\n")
    return open_drive(folder)


VIEWPOINT = (6.0, 1.0, 0.5)


@pytest.fixture(scope="module")
def made(drive):
    """Content, blocks and text of the page of a drive."""
    text = page_html(drive, [1, 3], ViewRequest(viewpoint=VIEWPOINT, memory=1)).decode()
    return *parts_of(text), text


def test_the_stored_numbers_are_those_of_the_engine(drive, made):
    content, blocks, _ = made
    frame = content["frames"][0]
    assert (frame["number"], frame["memory"]) == (1, [0, 2])
    columns = unpacked(blocks["block-0"])
    scene = registered_scene(drive, drive[1], [0, 2])
    points = drive[1].points[columns["row"]]
    ends = np.column_stack([columns[axis] for axis in "xyz"]) / 100
    assert np.abs(ends - points).max() <= 0.00501
    blocked, partly, kinds = 0, 0, set()
    for i, end in enumerate(ends):
        said = explain(scene, VIEWPOINT, end)
        kind = columns["kind"][i] & 7
        kinds.add(kind)
        starts = ("Occluded: ", "Visible: ", "Unknown: not obs", "Unknown: not dec", "Occluded: ")
        assert said.text.startswith(starts[kind])
        assert _percent(said.probability) in said.text
        percent = {0: "less than 1 %", 101: "more than 99 %"}.get(
            columns["percent"][i], f"{columns['percent'][i]} %"
        )
        assert f"probability of {percent}" in said.text or f"is {percent}." in said.text
        if np.isinf(said.clearance_m):
            assert columns["clearance"][i] == 65535
        else:
            shown = columns["clearance"][i] / 10
            assert f"{shown:.1f}" == f"{abs(said.clearance_m):.1f}"
        unobserved_dm = columns["metres"][i]
        if kind == 1:
            crossed = round(10 * float(f"{said.length_m:.1f}")) - unobserved_dm
            assert f"{crossed / 10:.1f}" == f"{said.length_m - said.unobserved_m:.1f}"
        else:
            assert f"{unobserved_dm / 10:.1f}" == f"{said.unobserved_m:.1f}"
        if kind == 0:
            place = [columns[f"blocker_{axis}"][blocked] / 10 for axis in "xyz"]
            assert "at (" + ", ".join(f"{value:.1f}" for value in place) + ")" in said.text
            at = _metres(said.blocker_m)
            assert f"{columns['blocker_at'][blocked] / 10:.1f}" == at or at.startswith("less")
            blocked += 1
        assert bool(columns["kind"][i] & 8) == (said.unobserved_m > 0)
        partly += columns["kind"][i] >> 3
    assert blocked == len(columns["blocker_at"])
    assert partly == len(columns["profile"])
    assert {0, 1, 2} <= kinds
    assert frame["visible"] == sum((kind & 7) == 1 for kind in columns["kind"])


def test_the_page_is_whole_and_loads_nothing(made):
    content, blocks, text = made
    parsed = Parsed(text)
    assert len(content["frames"]) == 2
    assert set(blocks) == {"block-0", "block-1"}
    assert not [name for name, _ in parsed.attributes if name in ("src", "href", "action")]
    policy = next(value for _, value in parsed.attributes if value and "default-src" in value)
    assert "default-src 'none'" in policy
    assert "connect-src 'none'" in policy
    assert "{{" not in re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert "import " not in re.findall(r'<script type="module">(.*?)</script>', text, re.S)[0]


def test_a_page_without_poses_uses_single_scans(tmp_path):
    drive = open_drive(scan_folder(tmp_path, (4, 5)))
    content, _ = parts_of(page_html(drive, [4, 5], ViewRequest(viewpoint="sensor")).decode())
    assert [frame["memory"] for frame in content["frames"]] == [[], []]
    assert [frame["camera"] for frame in content["frames"]] == [None, None]


def test_a_fixed_viewpoint_stays_in_the_world(drive):
    request = ViewRequest(viewpoint=VIEWPOINT, is_fixed=True, has_blind_spots=False)
    content, _ = parts_of(page_html(drive, [0, 3], request).decode())
    first, last = (frame["viewpoint"] for frame in content["frames"])
    assert first == list(VIEWPOINT)
    # Camera-frame poses are not meant here: the car moved 6 m along x in the world of the file.
    moved = drive[3].pose @ np.append(last, 1)
    assert (drive[0].pose @ np.append(first, 1))[:3] == pytest.approx(moved[:3], abs=0.001)
    assert first != last


def test_a_scan_that_cannot_be_read_is_left_out_of_the_scenes_around_it(drive, tmp_path, caplog):
    folder = shutil.copytree(drive.root, tmp_path / "street")
    (folder / "000001.bin").write_bytes(b"123")
    request = ViewRequest(viewpoint=VIEWPOINT, has_blind_spots=False)
    content, _ = parts_of(page_html(open_drive(folder), [0, 1, 3], request).decode())
    assert [(frame["number"], frame["memory"]) for frame in content["frames"]] == [
        (0, [2]),
        (3, [2]),
    ]
    assert "frame 0 is judged without that scan: " in caplog.text
    assert "frame 1 is left out: " in caplog.text


def test_remembered_frames_are_those_around(drive):
    assert remembered_frames(drive, 0, 2) == [1, 2]
    assert remembered_frames(drive, 2, 1) == [1, 3]
    assert remembered_frames(drive, 2, 0) == []


def test_markup_in_the_data_ends_no_script(tmp_path):
    folder = tmp_path / "a<b>\u202e\x1b[2J"
    drive = open_drive(scan_folder(folder, (0,)))
    text = page_html(drive, [0], ViewRequest(viewpoint="sensor", has_blind_spots=False)).decode()
    content, _ = parts_of(text)
    assert content["drive"] == "a<b>\\u202e\\x1b[2J"
    assert "a<b>" not in text
    assert "\x1b" not in text
    assert "\u202e" not in text


def test_every_module_imports_from_those_before_it_and_names_are_unique():
    assert sorted(MODULES) == sorted(path.stem for path in PAGE.glob("*.js"))
    top_level = re.compile(r"^(?:export )?(?:async )?(?:function|class|const|let) (\w+)", re.M)
    names: list[str] = []
    for nth, module in enumerate(MODULES):
        text = (PAGE / f"{module}.js").read_text()
        sources = re.findall(r'^import \{[^}]*\} from "\./(\w+)\.js";', text, re.M)
        assert len(sources) == text.count("\nimport ") + text.startswith("import ")
        assert set(sources) <= set(MODULES[:nth])
        for imported, source in re.findall(r'import \{([^}]*)\} from "\./(\w+)\.js";', text):
            there = (PAGE / f"{source}.js").read_text()
            for name in re.findall(r"\w+", imported):
                assert re.search(rf"^export .*\b{name}\b", there, re.M), name
        names += top_level.findall(text)
    assert len(names) == len(set(names))


@pytest.mark.realdata
def test_a_real_drive_fits_into_ten_megabytes(shared_data):
    drive = open_drive(shared_data / "pcd_drive")
    numbers = drive.frame_numbers[:2]
    page = page_html(drive, numbers, ViewRequest(viewpoint=(16.0, 1.0, 0.3)))
    assert len(page) * 24 / len(numbers) < 10e6
    content, blocks = parts_of(page.decode())
    rows = unpacked(blocks["block-1"])["row"]
    assert len(rows) == content["frames"][1]["stored"] <= 50_000


def test_a_tilted_scanner_without_a_pose_has_a_page_without_ground(tmp_path):
    x, y = np.meshgrid(np.arange(-12, 12, 0.2), np.arange(-12, 12, 0.2))
    ground = np.stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)], axis=1)
    s = np.sqrt(0.5)
    for turn, has_ground in (
        (np.eye(3), True),
        (np.array([[s, 0, s], [0, 1, 0], [-s, 0, s]]), False),
    ):
        np.save(tmp_path / "scan.npy", (ground @ turn).astype(np.float32))
        drive = open_drive(tmp_path / "scan.npy")
        page = page_html(drive, [0], ViewRequest(viewpoint="sensor")).decode()
        content, _ = parts_of(page)
        assert (content["frames"][0]["ground_m"] is not None) is has_ground
        assert ("x forward, y left, z up." in page) is has_ground
        assert ("by its scan 45 degrees off upright." in page) is not has_ground
