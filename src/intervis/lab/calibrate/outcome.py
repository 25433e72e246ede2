"""The outcome of a calibration: numbers, losses and provenance, as TOML."""

import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import numpy as np

import intervis

MARK = "`intervis calibrate` writes this file."
"""End of the first line of every file of an outcome."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """Fitted numbers by name, and where they come from.

    Attributes
    ----------
    numbers : dict
        Floats and lists of floats.
    provenance : dict
        Texts and numbers: inputs, their fingerprints, losses.
    """

    numbers: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def to_toml(self, heading: str) -> str:
        """Both as the TOML file that the package reads."""
        return "\n".join(
            [
                f"# {heading} {MARK}",
                "",
                "[provenance]",
                *(_line(name, value) for name, value in self.provenance.items()),
                "",
                "[numbers]",
                *(_line(name, value) for name, value in self.numbers.items()),
                "",
            ]
        )


def versions() -> str:
    """Versions that the numbers depend on."""
    names = ("numpy", "scipy")
    return ", ".join(
        [
            f"intervis {intervis.__version__}",
            f"Python {platform.python_version()}",
            *(f"{name} {metadata.version(name)}" for name in names),
        ]
    )


def compared(shipped: Mapping[str, Any], fitted: Mapping[str, Any]) -> tuple[tuple[str, ...], ...]:
    """Rows (name, shipped, fitted) of the numbers that both hold."""
    return tuple(
        (name, _text(shipped[name]), _text(fitted[name])) for name in fitted if name in shipped
    )


def _text(value: Any) -> str:
    if np.ndim(value) == 0:
        return f"{value:.4g}"
    return " ".join(f"{number:.2f}" for number in value)


def _line(name: str, value: Any) -> str:
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, str):
        return f"{name} = {_quoted(value)}"
    if isinstance(value, bool):
        return f"{name} = {str(value).lower()}"
    if isinstance(value, int):
        return f"{name} = {value}"
    if isinstance(value, float):
        return f"{name} = {value:.6g}"
    if len(value) and np.ndim(value[0]):
        rows = ",\n  ".join(f"[{', '.join(f'{float(x):.6g}' for x in row)}]" for row in value)
        return f"{name} = [\n  {rows},\n]"
    return f"{name} = [{', '.join(f'{float(number):.6g}' for number in value)}]"


def _quoted(text: str) -> str:
    """A TOML string; bytes of a file name that are not valid UTF-8 are written escaped."""
    whole = text.encode("utf-8", errors="backslashreplace").decode()
    # JSON and TOML escape alike, except that TOML also forbids DEL.
    return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007F")
