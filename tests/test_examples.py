"""The examples run as they stand, on the built-in street."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))
SAID = {
    "visible_returns": ("visible", "Occluded: "),
    "agents": ("Row sees column", "roadside unit"),
    "blind_spots": ("m away:", "could hide: car"),
    "blockers": (
        "% of the occluded lines: car",
        "without parked car, moving-car: <Sight:",
        " occluded lines become visible",
    ),
    "voxel_masks": ("occluded: ", "image_02 sees ", "<BevGrid: 300 x 300 cells of 0.2 m"),
    "route": ("2 of 2 zones come into sight", "Largest visible shares: kerb"),
    "siting": ("Places", "Zones, seen by all chosen places", "No other 2 candidates reach more."),
    "sight_distance": ("crest, AASHTO, derived", "62.8", "junction, AASHTO"),
    "two_scanners": ("LIDAR_TOP: 4", " 0 beside the left doors", "LIDAR_LEFT: 1"),
    "stream": (
        "while scans arrive: <Sight: 5,000 lines",
        "with all of them:   <Sight: 5,000 lines",
    ),
}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(path: Path) -> None:
    pytest.importorskip("embreex", reason="embreex, which scans the street, is not installed")
    done = subprocess.run(
        [sys.executable, str(path)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    for words in SAID[path.stem]:
        assert words in done.stdout


def test_every_example_is_there() -> None:
    assert {path.stem for path in EXAMPLES} == set(SAID)
