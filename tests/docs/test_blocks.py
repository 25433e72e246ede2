"""Code blocks of the pages run as they stand, in a folder where DRIVE is a simulated drive.

Doctests (pycon) are run by pytest's option --doctest-glob. A block that is not run says why in a
comment before it (`markdown_pages.NOT_RUN`).
"""

import contextlib
import io
import os
import shlex
import tomllib
from pathlib import Path

import pytest
from markdown_pages import PAGES, ROOT, Block, blocks, relative

import intervis
from intervis.cli import DONE, exit_code
from intervis.lab.worlds import simulate
from intervis.lab.worlds.drive_simulation import simulate_drive
from intervis.lab.worlds.mounted_scanner import mounted
from small_drive import scan_folder

FRAMES = 18
"""Frames of the drive: as many as the pages speak of."""

LABELLED = ("docs/objects.md", "docs/agents.md")
"""Pages whose DRIVE has boxes of objects."""

SLOW = ("docs/masks.md", "docs/routes.md", "docs/view.md")
"""Pages whose blocks take more than some seconds."""

ELSEWHERE = ("make ", "pip ")
"""Lines of the README that are not run: set-up and demonstration, by the workflow."""

FILES = {
    "signs.csv": "name,x,y,z\nsign,12,3,0.5\n",
    "exit.csv": "x,y\n1,-2\n14,-1\n",
    "zones.geojson": """{"type": "FeatureCollection", "features": [{"type": "Feature",
        "properties": {"name": "kerb", "low_m": 0.2, "high_m": 1.0}, "geometry": {"type": "Polygon",
        "coordinates": [[[8, 3], [11, 3], [11, 4], [8, 4], [8, 3]]]}}]}""",
    "poles.csv": "name,x,y,height\npole,5,4,3\nlamp,12,4,3\ngate,20,4,3\n",
    "verges.geojson": """{"type": "FeatureCollection", "features": [{"type": "Feature",
        "properties": {"name": "verge"}, "geometry": {"type": "Polygon",
        "coordinates": [[[4, 3], [16, 3], [16, 6], [4, 6], [4, 3]]]}}]}""",
}
"""Files that the commands of the pages read; agents.csv stands on its page."""


def run_blocks(page: Path) -> list[Block]:
    return [
        block
        for block in blocks(page)
        if block.language in ("python", "sh", "console") and block.is_run
    ]


PAGES_TO_RUN = [
    pytest.param(page, id=relative(page), marks=[pytest.mark.slow] * (relative(page) in SLOW))
    for page in PAGES
    if run_blocks(page)
]


@pytest.fixture(scope="module")
def drives(tmp_path_factory) -> Path:
    """Folder with DRIVE, LABELLED and small drives A, B and C; pages work on links to them."""
    pytest.importorskip("pyarrow", reason="pyarrow, which writes the drive with boxes, is absent")
    pytest.importorskip("embreex", reason="embreex, which scans the street, is not installed")
    folder = tmp_path_factory.mktemp("pages")
    scanner = mounted("vlp-16")  # a fifth of the returns of the default scanner
    simulate(folder / "DRIVE", frames=FRAMES, scanner=scanner, images=False, labels=True)
    simulate_drive(folder / "BOXES", "argoverse2", ["vlp-16", "vlp-16@under"], frames=1)
    for number, name in enumerate("ABC"):
        scan_folder(folder / name, (number, number + 1))
    return folder


@pytest.fixture
def place(drives, tmp_path, monkeypatch) -> Path:
    """A working folder of its own, as a reader has it."""
    for name in ("DRIVE", "A", "B", "C"):
        (tmp_path / name).symlink_to(drives / name)
    (tmp_path / "SEQUENCE").symlink_to(drives / "DRIVE")
    (tmp_path / "2011_09_26_drive_0009_sync").symlink_to(drives / "DRIVE")  # of the README
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", PAGES_TO_RUN)
def test_blocks_run(page, place, drives):
    if relative(page) in LABELLED:
        (place / "DRIVE").unlink()
        (place / "DRIVE").symlink_to(drives / "BOXES")
    for block in blocks(page):
        if block.language == "csv":
            (place / "agents.csv").write_text(block.text)
    # What a page takes from its reader: the import, a scan, its pose, and places to ask about.
    frame = intervis.open_drive(drives / "DRIVE")[0]
    names = {
        "__name__": "__main__",
        "intervis": intervis,
        "points": frame.points,
        "world_from_sensor": frame.pose,
        "viewpoint": [0.0, 0.0, 1.0],
        "targets": frame.points[::1000],
    }
    for block in run_blocks(page):
        where = f"{relative(page)}:{block.line}"
        if block.language == "python":
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(block.text, where, "exec"), names)
        for line in block.run_commands() if block.language != "python" else ():
            said = run_line(line)
            assert said is None, f"{where}: {line}: {said}"


def run_line(line: str) -> str | None:
    """What went wrong in a command line; None where all went well."""
    if line.startswith(ELSEWHERE):
        return None
    name, *words = shlex.split(line, comments=True)
    if name != "intervis":
        return "only intervis is run: say in a comment before the block why this is not"
    if words[0] == "simulate" and os.path.lexists(place := words[words.index("--out") + 1]):
        Path(place).unlink()  # a link to the drive that the page simulates
    out, errors = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        code = exit_code(words)
    return None if code == DONE else errors.getvalue() or f"exit code {code}"


def test_only_the_readme_leaves_lines_to_others():
    leaving = {
        relative(page)
        for page in PAGES
        for block in run_blocks(page)
        if block.language != "python"
        and any(line.startswith(ELSEWHERE) for line in block.run_commands())
    }
    assert leaving == {"README.md"}


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_a_block_of_toml_is_toml(page):
    for block in blocks(page):
        if block.language == "toml":
            assert tomllib.loads(block.text)


def test_every_reason_names_a_test_that_is_there():
    for page in PAGES:
        for block in blocks(page):
            for word in block.reason.replace(";", " ").split():
                if word.startswith("tests/"):
                    assert (ROOT / word).exists(), f"{relative(page)}:{block.line}"
