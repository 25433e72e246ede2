"""Errors of the library have one root, and reach other processes."""

import inspect
import pickle
import pkgutil
from importlib import import_module

import intervis
from intervis.errors import IntervisError, MissingExtraError


def errors_of_the_package() -> set[type[BaseException]]:
    """All exception classes of the package, of the laboratory and the command line as well."""
    names = [
        module.name
        for module in pkgutil.walk_packages(intervis.__path__, "intervis.")
        if module.name != "intervis.__main__"
    ]
    return {
        value
        for name in names
        for value in vars(import_module(name)).values()
        if inspect.isclass(value)
        and issubclass(value, BaseException)
        and value.__module__.startswith("intervis")
    }


def test_every_public_error_of_the_library_is_an_intervis_error():
    errors = {
        error
        for error in errors_of_the_package()
        if not error.__module__.startswith(("intervis.cli", "intervis.lab"))
        and not error.__name__.startswith("_")
    }
    assert len(errors) > 10
    assert all(issubclass(error, IntervisError) for error in errors)


def test_every_error_survives_pickling():
    made = [
        error("numpy", "lab", "this") if error is MissingExtraError else error("one sentence.")
        for error in errors_of_the_package()
    ]
    for error in made:
        copy = pickle.loads(pickle.dumps(error))
        assert type(copy) is type(error)
        assert str(copy) == str(error)
        assert copy.args == error.args
