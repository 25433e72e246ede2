"""Names of which a caller chooses one."""

from typing import TypeVar

from intervis.errors import SettingsError

Choice = TypeVar("Choice", bound=str)


def checked_choice(name: str, choices: tuple[Choice, ...], complaint: str) -> Choice:
    """The choice of that name.

    Parameters
    ----------
    name : str
    choices : tuple of str
    complaint : str
        Start of the error message.

    Raises
    ------
    SettingsError
        There is no such choice.

    Examples
    --------
    >>> checked_choice("map", ("single", "map"), "there is no protocol")
    'map'
    """
    for choice in choices:
        if name == choice:
            return choice
    raise SettingsError(f"{complaint} {name!r}; choose one of {', '.join(choices)}.")
