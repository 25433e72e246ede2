"""The summary of a run: input, settings, machine, times and measures."""

import json
import math
import os
import platform
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import intervis
from intervis.errors import OutputError
from intervis.output_folder import is_marked
from intervis.run.frame_file import FrameRecord
from intervis.run.frame_sight import SightRequest
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Drive

Content = dict[str, Any]

COMPARED = ("intervis", "viewpoint", "settings", "sight", "input")
"""What must be equal in two runs for the second to resume the first."""


def describe(
    drive: "Drive",
    settings: Settings,
    viewpoint: str | list[float],
    sight: SightRequest | None = None,
) -> Content:
    """Program version, requested viewpoint, settings, sight lines, place and input of a run."""
    head = {
        "intervis": intervis.__version__,
        "source": str(drive.root),
        "viewpoint": viewpoint,
        "settings": settings.model_dump(mode="json"),
        **({} if sight is None else {"sight": sight.described()}),
        "input": drive.fingerprint(),
    }
    # In the form in which it is read back: paths become text and tuples become lists.
    return dict(json.loads(json.dumps(head, default=str)))


def differences(earlier: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Differences between two descriptions, one text each.

    Examples
    --------
    >>> differences({"settings": {"tau": 35}}, {"settings": {"tau": 10}})
    ['settings tau is 35 there and 10 here']
    """
    found = []
    for name in COMPARED:
        there, here = earlier.get(name), now.get(name)
        if isinstance(there, Mapping) and isinstance(here, Mapping):
            keys = sorted(set(there) | set(here))
            found += [
                f"{name} {key} is {there.get(key)} there and {here.get(key)} here"
                for key in keys
                if there.get(key) != here.get(key)
            ]
        elif there != here:
            found.append(f"{name} is {there} there and {here} here")
    return found


def summarize(
    head: Mapping[str, Any],
    records: Sequence[FrameRecord],
    failures: Sequence[tuple[int, str]],
    *,
    complete: bool = True,
    rate: Content | None = None,
    budget: Content | None = None,
) -> Content:
    """Content of ``summary.json``.

    Parameters
    ----------
    head : mapping
        From `describe`.
    records : sequence of FrameRecord
        The frames with a result.
    failures : sequence of (number, reason)
        The frames without a result.
    complete : bool
        False while the run is in progress.
    rate, budget : mapping or None
        From `intervis.run.pace`.
    """
    return {
        **head,
        "versions": version_numbers(),
        "machine": machine(),
        "complete": complete,
        "timing": "seconds; without compilation (the first frame is analysed once before the timed"
        " analysis) and without reading or writing files, which other threads do meanwhile; rate:"
        " with reading and writing",
        "times_s": {name: spread(values) for name, values in _columns(records, "times_s")},
        "rate": rate,
        "budget": budget,
        "measures": {name: _statistics(values) for name, values in _columns(records, "measures")},
        "frames": [
            {
                "number": record.number,
                "tau": record.tau,
                "measures": {name: _json_number(v) for name, v in record.measures.items()},
                "times_s": {name: _json_number(v) for name, v in record.times_s.items()},
                **_sight_shares(record),
            }
            for record in records
        ],
        "failures": [{"number": number, "reason": reason} for number, reason in failures],
    }


def _sight_shares(record: FrameRecord) -> Content:
    """Shares of the returns of a frame by state, if sight lines were asked."""
    if record.sight is None:
        return {}
    return {"sight": {name: _json_number(share) for name, share in record.sight.items()}}


def same_results(earlier: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    """Whether two summaries hold the same frames, failures, completeness and place of the drive."""
    names = ("complete", "source", "frames", "failures")
    return all(earlier.get(name) == now.get(name) for name in names)


def as_json(content: Mapping[str, Any]) -> str:
    """A summary as JSON text; NaN or infinity raises ValueError."""
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def read_summary(path: Path) -> Content | None:
    """The summary of an earlier run; None where there is none.

    Raises
    ------
    OutputError
        The file cannot be read or is not a summary.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutputError(f"cannot read {path}: {(error.strerror or '').lower()}.") from None
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict) or "settings" not in content:
        raise OutputError(
            f"{path} is not the summary of a run: choose another folder"
            f"{', or overwrite it' if is_marked(path.parent) else ''}."
        )
    return content


def _columns(records: Sequence[FrameRecord], kind: str) -> list[tuple[str, list[float]]]:
    if not records:
        return []
    names = getattr(records[0], kind)
    return [(name, [getattr(record, kind)[name] for record in records]) for name in names]


def spread(values: Sequence[float]) -> Content:
    """Median, 99th percentile, mean and sample standard deviation, and the extremes."""
    return {
        "p50": _json_number(np.percentile(values, 50)),
        "p99": _json_number(np.percentile(values, 99)),
        **_statistics(values),
    }


def _statistics(values: Sequence[float]) -> Content:
    """Mean, sample standard deviation (None for a single value) and the extremes.

    Examples
    --------
    >>> _statistics([1.0, 2.0, 3.0])
    {'mean': 2, 'sample_std': 1, 'min': 1, 'max': 3}
    """
    return {
        "mean": _json_number(np.mean(values)),
        "sample_std": _json_number(np.std(values, ddof=1)) if len(values) > 1 else None,
        "min": _json_number(np.min(values)),
        "max": _json_number(np.max(values)),
    }


def _json_number(value: float | np.floating[Any]) -> float | int | None:
    """A number for JSON: None for NaN and infinity, an int for a whole number."""
    number = float(value)
    if not math.isfinite(number):
        return None
    return int(number) if number.is_integer() else number


def version_numbers() -> Content:
    """Versions of the package, of Python, and of the libraries that compute."""
    return {
        "intervis": intervis.__version__,
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in ("numpy", "scipy", "numba")},
    }


def machine() -> Content:
    """System, processor, and the number of cores that this process may use."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {"system": platform.platform(), "processor": _processor_name(), "cpus": usable}


def _processor_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
