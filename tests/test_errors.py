"""Errors of the library have one root."""

import inspect
import pkgutil
from importlib import import_module

import intervis
from intervis.errors import IntervisError


def test_every_public_error_of_the_library_is_an_intervis_error():
    names = [
        module.name
        for module in pkgutil.walk_packages(intervis.__path__, "intervis.")
        if not module.name.startswith(("intervis.cli", "intervis.lab", "intervis.__main__"))
    ]
    errors = {
        value
        for name in names
        for value in vars(import_module(name)).values()
        if inspect.isclass(value)
        and issubclass(value, BaseException)
        and value.__module__.startswith("intervis")
        and not value.__name__.startswith("_")
    }
    assert len(errors) > 10
    assert all(issubclass(error, IntervisError) for error in errors)
