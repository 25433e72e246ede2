"""Settings of the method: frozen, validated, and read from or written to TOML."""

import difflib
import tomllib
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from intervis.arguments import path_of, shown
from intervis.errors import SettingsError

View = Literal["camera", "circle", "front", "wide"]
Sampling = Literal["kernel", "stride", "radius"]
Metric = Literal["mahalanobis", "normalized", "euclidean", "ground"]
Chart = Literal["ground", "angles", "polar"]
Weights = Literal["length", "unit"]
Gate = Literal["degree", "mean", "shortest", "star_minimum", "none"]
ConcaveBoundary = Literal["every", "any"]
Criterion = Literal["elevation", "sight_angle", "sight_line"]

MAX_TAU = 2**31 - 1
"""Greatest granularity: more returns than any scan has, and safe for 64-bit products with n_fov."""


class Settings(BaseModel):
    """All settings of the method; the defaults are those that the measurements favour.

    Attributes
    ----------
    view : {"camera", "circle", "front", "wide"}
        Field of view: the camera's image (for a scan without camera the full circle), the full
        circle, or 90 or 180 degrees of azimuth ahead.
    tau : int or "auto"
        Granularity: how many returns one sampling kernel holds, 1 to 2**31 - 1. 1 keeps every
        return; "auto" chooses by `tpi_tolerance` and `time_budget_ms`.
    tpi_tolerance : float
        For ``tau="auto"``: points of TPI that coarser sampling may lose, by the measured curve.
    time_budget_ms : float or None
        For ``tau="auto"``: the finest tau whose predicted time for a frame is within this budget,
        but never one so coarse that it breaks `tpi_tolerance`. None chooses the coarsest tau
        within the tolerance.
    sampling : {"kernel", "stride", "radius"}
        Balanced compact kernels, every tau-th return, or balls of `radius_m` metres.
    radius_m : float
        Radius of a ball for ``sampling="radius"``, metres.
    metric : {"mahalanobis", "normalized", "euclidean", "ground"}
        The distance D: Eq. 4, Eq. 5, metres in three dimensions, or metres over the ground plane.
    chart : {"ground", "angles", "polar"}
        Projection in which the mesh is built: the ground plane, azimuth and elevation seen from
        the viewpoint, or azimuth and the logarithm of ground range.
    cohesion, repulsion : float
        The scale factors alpha (Eq. 3) and beta (Eq. 6).
    influence_radius : float or None
        Radius R of Eq. 6 in units of D; None is the median flow distance D' of the frame.
    weights : {"length", "unit"}
        Edge weights of the Laplacian (Eq. 9): the length D, or 1.
    gate : {"degree", "mean", "shortest", "star_minimum", "none"}
        Interpretation of D_min in line 1 of Algorithm 1: the weighted degree of the node, the mean
        or the shortest edge of its star, the least weighted degree in its star, or no gate.
    concave_boundary : {"every", "any"}
        Interpretation of line 2: a node lies on a concave boundary when every edge of it, or any,
        is shorter than its distance to the centroid of its subgraph.
    criterion : {"elevation", "sight_angle", "sight_line"}
        What lines 6 and 8 compare: elevations z (the paper), elevation angles seen from the
        viewpoint, or (not in the paper) ranges of the returns nearest in direction. None of
        them tells visible from hidden nodes reliably; `intervis.Scene` does.

    Raises
    ------
    SettingsError
        A name is unknown (the message names the nearest valid one) or a value is out of range.

    Examples
    --------
    >>> Settings(tau=35).criterion
    'sight_angle'
    >>> Settings(taw=35)
    Traceback (most recent call last):
        ...
    intervis.errors.SettingsError: unknown setting 'taw': did you mean 'tau'?
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    view: View = "camera"
    tau: int | Literal["auto"] = 35
    tpi_tolerance: float = Field(default=3.0, gt=0, le=50)
    time_budget_ms: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    sampling: Sampling = "kernel"
    radius_m: float = Field(default=0.5, gt=0, allow_inf_nan=False)
    metric: Metric = "ground"
    chart: Chart = "ground"
    cohesion: float = Field(default=0.1, ge=0, le=1)
    repulsion: float = Field(default=0.1, ge=0, allow_inf_nan=False)
    influence_radius: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    weights: Weights = "length"
    gate: Gate = "degree"
    concave_boundary: ConcaveBoundary = "every"
    criterion: Criterion = "sight_angle"

    def __init__(self, /, **values: Any) -> None:
        """Validate the values; settings that are not given have their defaults."""
        for name in values:
            if name not in type(self).model_fields:
                raise SettingsError(f"unknown setting {shown(name)}: {_suggestion(name)}")
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise SettingsError(_message(error)) from None
        # The messages leave the value out: Python does not print integers of over 4,300 digits.
        if self.tau != "auto" and self.tau < 1:
            raise SettingsError("setting 'tau' must be 1 or more, or 'auto'.")
        if self.tau != "auto" and self.tau > MAX_TAU:
            raise SettingsError(f"setting 'tau' must be at most {MAX_TAU}.")

    def with_changes(self, /, **values: Any) -> Self:
        """A copy with some settings changed, validated again."""
        return type(self)(**{**self.model_dump(), **values})

    @classmethod
    def from_toml(cls, path: Path) -> Self:
        """Read settings from a TOML file, as `to_toml` writes them.

        Raises
        ------
        SettingsError
            The file cannot be read, is not TOML, or has an unknown or invalid setting.
        """
        path = path_of(path, "path")
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8-sig"))
        except OSError as error:
            raise SettingsError(f"cannot read the settings {path}: {error.strerror}.") from None
        except ValueError as error:  # also a whole number of more digits than Python reads
            reason = str(error).split(";")[0].rstrip(".")
            raise SettingsError(f"{path} is not valid TOML: {reason}.") from None
        except RecursionError:
            raise SettingsError(f"{path} is nested too deeply to be settings.") from None
        try:
            return cls(**values)
        except SettingsError as error:
            raise SettingsError(f"{path}: {error}") from None

    def to_toml(self) -> str:
        """The settings as TOML; a setting that is None is left out.

        Examples
        --------
        >>> print(Settings(tau=10).to_toml().splitlines()[1])
        tau = 10
        """
        lines = []
        for name, value in self.model_dump().items():
            if value is not None:
                lines.append(
                    f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value}"
                )
        return "\n".join(lines) + "\n"


def _suggestion(name: str) -> str:
    close = difflib.get_close_matches(name, Settings.model_fields, n=1, cutoff=0.5)
    if close:
        return f"did you mean {close[0]!r}?"
    return f"the settings are {', '.join(Settings.model_fields)}."


def _message(error: ValidationError) -> str:
    first = error.errors()[0]
    wanted = " ".join(first["msg"].lower().split())
    return f"setting {first['loc'][0]!r}: {wanted}, got {shown(first['input'])}."
