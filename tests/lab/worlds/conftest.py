"""The built-in street, built once."""

import pytest

from intervis.lab.worlds.street.layout import build_street
from intervis.lab.worlds.world import Moment, World


@pytest.fixture(scope="session")
def street() -> World:
    return build_street(0)


@pytest.fixture(scope="session")
def street_moment(street: World) -> Moment:
    return street.at(0.7)
