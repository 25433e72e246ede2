"""The built-in street, built once for all tests, and once more to compare."""

import pytest

from intervis.lab.worlds.street.layout import build_street
from intervis.lab.worlds.world import Snapshot, World


@pytest.fixture(scope="session")
def street() -> World:
    return build_street(0)


@pytest.fixture(scope="session")
def street_again() -> World:
    """The street of the same seed, built a second time."""
    return build_street(0)


@pytest.fixture(scope="session")
def street_snapshot(street: World) -> Snapshot:
    return street.at(0.7)
