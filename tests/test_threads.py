"""Queries that scipy spreads over threads obey INTERVIS_THREADS."""

import ast
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

import intervis
from intervis import directions


@pytest.fixture
def workers(monkeypatch) -> list[int]:
    """Thread counts that nearest-neighbour queries ask for, while two threads are allowed."""
    asked = []

    class Recorded(cKDTree):
        def query(self, *arguments, workers=1, **options):
            asked.append(workers)
            return super().query(*arguments, workers=workers, **options)

    monkeypatch.setattr(directions, "cKDTree", Recorded)
    monkeypatch.setenv("INTERVIS_THREADS", "2")
    return asked


def test_nearest_directions(workers, rng):
    rays = rng.normal(size=(100, 3))
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    directions.nearest_directions(rays, rays, 3, 5.0)
    assert workers == [2]


def test_no_call_takes_all_cores():
    for path in Path(intervis.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.keyword) and node.arg == "workers":
                assert "-1" not in ast.unparse(node.value), f"{path}: line {node.value.lineno}"
