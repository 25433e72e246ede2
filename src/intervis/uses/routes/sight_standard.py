"""Standards of sight distance: heights of eye and object, and the stopping distance required."""

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from intervis.arguments import flag_of, object_of, shown
from intervis.arrays import Float64Array, fit_together, numbers_of
from intervis.errors import PointsError, SettingsError
from intervis.sight.query_checks import finite_number

GRAVITY_MPS2 = 9.81
LEAST_BRAKING = 0.02
"""Least difference of braking and down-grade, as a share of gravity: below it nothing stops."""
MOST_HEIGHT_M, MOST_REACTION_S = 10.0, 10.0


@dataclass(frozen=True)
class SightStandard:
    """Heights and braking of a standard; every number may be changed.

    Several heights make an envelope: an object counts as visible if every eye sees every height.

    Attributes
    ----------
    name : str
    eye_m, object_m : tuple of float
        Heights above the road, metres.
    reaction_s : float
        Time until the brakes work, seconds.
    braking : float
        Deceleration as a share of gravity.
    with_grade : bool
        Whether the grade enters the stopping distance.
    note : str
        Where the numbers come from.

    Raises
    ------
    SettingsError
        A number is out of range.

    Examples
    --------
    >>> round(float(AASHTO.stopping_m(100 / 3.6)), 1)
    182.9
    """

    name: str
    eye_m: tuple[float, ...]
    object_m: tuple[float, ...]
    reaction_s: float
    braking: float
    with_grade: bool
    note: str

    def __post_init__(self) -> None:
        object_of(self.name, str, "the name of a standard")
        object_of(self.note, str, "the note of a standard")
        for name in ("reaction_s", "braking"):
            number = finite_number(name, getattr(self, name), "a number")
            object.__setattr__(self, name, number)
        object.__setattr__(self, "with_grade", flag_of(self.with_grade, "with_grade"))
        for name in ("eye_m", "object_m"):
            given = numbers_of(getattr(self, name), f"{name[:-2]} heights")
            heights = tuple(np.atleast_1d(given).ravel().tolist())
            object.__setattr__(self, name, heights)
            if not heights or not all(0.0 <= height <= MOST_HEIGHT_M for height in heights):
                raise SettingsError(
                    f"{name[:-2]} heights must be from 0 to {MOST_HEIGHT_M:g} m, got"
                    f" {', '.join(map(str, heights)) or 'none'}."
                )
        if not 0.0 <= self.reaction_s <= MOST_REACTION_S:
            raise SettingsError(
                f"the reaction time must be from 0 to {MOST_REACTION_S:g} s, got {self.reaction_s}."
            )
        if not LEAST_BRAKING <= self.braking <= 1.0:
            raise SettingsError(
                f"braking must be from {LEAST_BRAKING:g} to 1, as a share of gravity, got"
                f" {self.braking}."
            )

    def changed(self, **values: Any) -> Self:
        """The standard with some of its numbers replaced; None leaves one as it is."""
        given = {name: value for name, value in values.items() if value is not None}
        unknown = given.keys() - {field.name for field in fields(self)}
        if unknown:
            raise SettingsError(f"a standard has no {', '.join(sorted(unknown))}.")
        return replace(self, name=f"{self.name}, changed", **given) if given else self

    def stopping_m(self, speed_mps: ArrayLike, grade: ArrayLike = 0.0) -> Float64Array:
        """Distance of reaction and braking, v t + v^2 / (2 g (braking + grade)).

        Parameters
        ----------
        speed_mps : (...) array
            Metres per second.
        grade : (...) array
            Rise over run in the direction of travel; ignored unless `with_grade`.

        Returns
        -------
        (...) float64 array
            Metres; infinite where the down-grade is as steep as the braking.
        """
        speed, slope = numbers_of(speed_mps, "speed_mps"), numbers_of(grade, "grade")
        if not fit_together(speed, slope):
            raise PointsError(f"speeds {speed.shape} and grades {slope.shape} do not fit together.")
        slowing = self.braking + (slope if self.with_grade else 0.0)
        stops = slowing >= LEAST_BRAKING
        with np.errstate(over="ignore", invalid="ignore"):
            braking_m = speed**2 / (2.0 * GRAVITY_MPS2 * np.where(stops, slowing, 1.0))
            return np.asarray(speed * self.reaction_s + np.where(stops, braking_m, math.inf))


AASHTO = SightStandard(
    "AASHTO",
    (1.08,),
    (0.60,),
    2.5,
    3.4 / GRAVITY_MPS2,
    True,
    "AASHTO Green Book (2011, 2018): stopping sight distance for cars.",
)
DMRB = SightStandard(
    "DMRB",
    (1.05, 2.00),
    (0.26, 2.00),
    2.0,
    0.25,
    False,
    "UK DMRB CD 109, desirable minimum; read in a textbook extract, not in the standard itself.",
)
AUSTROADS = SightStandard(
    "Austroads",
    (1.10,),
    (0.20,),
    2.5,
    0.36,
    True,
    "Austroads AGRD Part 3, cars: R = 2.5 s and d = 0.36; choose R and d for your road.",
)

STANDARDS = {"aashto": AASHTO, "dmrb": DMRB, "austroads": AUSTROADS}
"""The presets by name."""


def standard_named(name: str) -> SightStandard:
    """The preset of that name, upper or lower case.

    Raises
    ------
    SettingsError
        There is none.
    """
    object_of(name, str, "the name of a standard")
    if name.lower() not in STANDARDS:
        raise SettingsError(
            f"there is no standard {shown(name)}: choose one of {', '.join(STANDARDS)}."
        )
    return STANDARDS[name.lower()]
