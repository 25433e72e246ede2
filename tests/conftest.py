"""What every test may lean on: where the real scans lie, and random numbers that repeat."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

# A first example may compile a kernel: how long one takes says nothing.
settings.register_profile("intervis", deadline=None)
settings.load_profile("intervis")

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real scans beside the project; the test is skipped, and says so, without it."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"real scans are not here: no folder {SHARED_DATA}")
    return SHARED_DATA


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20260101)
