"""The result of one frame as a file: plain arrays, no pickle, written atomically."""

import dataclasses
import io
import json
import tomllib
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import digest_of
from intervis.errors import OutputError, SettingsError
from intervis.files import write_whole
from intervis.result_table import result_table
from intervis.run.frame_sight import FrameSight
from intervis.settings import Settings

if TYPE_CHECKING:
    from intervis.drives import Frame
    from intervis.method.analysis import Analysis

FORMAT = 3
"""Version of the layout of a frame file; files of other versions are refused."""

MOST_BYTES = 2**31
"""Bytes that the arrays of a frame may declare in all: more is a damaged file, or a trap."""

SIGHT_ARRAYS = ("viewpoint", "state", "probability")
"""Arrays of `FrameSight`; in the file their names begin with ``sight_``."""

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class FrameRecord:
    """Measures and stage times of one frame.

    Attributes
    ----------
    number : int
        The frame's number in its drive.
    measures : mapping of str to float
        The paper's measures by name.
    times_s : mapping of str to float
        Seconds by stage.
    tau : int or None
        The granularity used; None where nodes were sampled by a radius.
    reused : bool
        True where an earlier run had already written the frame.
    remade : str
        Why the file of an earlier run was replaced; empty if it was not.
    sight : mapping of str to float, or None
        Shares of the returns by state, if sight lines were asked.

    Examples
    --------
    >>> FrameRecord(17, {"n": 467.0, "TPI": 34.612}, {"total": 0.0072}, tau=35)
    <FrameRecord 17: tau 35, n 467, TPI 34.61 %, total 7.2 ms>
    """

    number: int
    measures: Mapping[str, float]
    times_s: Mapping[str, float]
    tau: int | None = None
    reused: bool = False
    remade: str = ""
    sight: Mapping[str, float] | None = None

    def _repr_html_(self) -> str:
        """Measures and times, as a notebook shows them."""
        rows = {"tau": "-" if self.tau is None else str(self.tau)}
        rows |= {name: f"{value:,.6g}" for name, value in self.measures.items()}
        rows |= {f"time, {name}": f"{1e3 * value:.1f} ms" for name, value in self.times_s.items()}
        return result_table(f"Frame {self.number}", rows)

    def __repr__(self) -> str:
        parts = [] if self.tau is None else [f"tau {self.tau}"]
        for name, form, unit in (("n", ".0f", ""), ("TPI", ".2f", " %")):
            if name in self.measures:
                parts.append(f"{name} {self.measures[name]:{form}}{unit}")
        if "total" in self.times_s:
            parts.append(f"total {1e3 * self.times_s['total']:.1f} ms")
        if self.reused:
            parts.append("reused")
        if self.remade:
            parts.append("made again")
        return f"<FrameRecord {self.number}: {', '.join(parts)}>"


def frame_path(out: Path, number: int) -> Path:
    """File of one frame in the output folder of a run: ten digits, as in KITTI.

    Examples
    --------
    >>> frame_path(Path("out"), 17).as_posix()
    'out/frames/0000000017.npz'
    """
    return out / "frames" / f"{number:010d}.npz"


def frame_fingerprint(
    frame: "Frame",
    settings: Settings,
    viewpoint: str | Sequence[float],
    sight: Sequence[object] = (),
) -> str:
    """Digest of all that the analysis of a frame depends on, as 32 hexadecimal digits.

    Points, pose, camera, number and time of the frame, the settings and the viewpoint of the run,
    and what its sight lines depend on, if they are asked.
    """
    run = [FORMAT, settings.model_dump(mode="json"), viewpoint, *sight]
    arrays = {**_arrays_of_frame(frame), "points": frame.points}
    return digest_of(json.dumps(run, sort_keys=True, default=str), arrays)


@dataclass(frozen=True, eq=False)
class FrameFile:
    """A frame file that is yet to be written: it holds results, and not the scan.

    Array fields keep their names. ``measures`` and ``times_s`` are vectors; ``measure_names`` and
    ``time_names`` name their entries. ``settings_toml`` is text. ``number``, ``timestamp_ns``,
    ``world_from_velo``, ``cam_from_velo``, ``projection`` and ``image_size_px`` come from the
    frame, if it has them. ``fingerprint`` is that of `frame_fingerprint`.

    Attributes
    ----------
    path : Path
        Where it is written.
    record : FrameRecord
        Measures and stage times of the frame.
    arrays : dict of str to array
        The content.
    compress : bool
        Deflate the arrays.
    """

    path: Path
    record: FrameRecord
    arrays: Arrays
    compress: bool = False

    def write(self) -> FrameRecord:
        """Write the file, whole or not at all, and return its record.

        Raises
        ------
        OutputError
            The file cannot be written.
        """
        write_whole(
            self.path, lambda file: _write_archive(file, self.arrays, compress=self.compress)
        )
        return self.record


def frame_file(
    path: Path,
    frame: "Frame",
    analysis: "Analysis",
    fingerprint: str,
    *,
    sight: FrameSight | None = None,
    compress: bool = False,
    remade: str = "",
) -> FrameFile:
    """The file of an analysis, with what is known of its frame except points and image.

    With `sight` it holds ``sight_viewpoint``, ``sight_state`` and ``sight_probability``, too.
    """
    record = dataclasses.replace(
        record_of(frame.number, analysis),
        remade=remade,
        sight=None if sight is None else sight.shares,
    )
    arrays = {**_arrays_of_frame(frame), **_arrays_of_analysis(analysis)}
    if sight is not None:
        arrays |= {f"sight_{name}": getattr(sight, name) for name in SIGHT_ARRAYS}
    arrays["measure_names"] = np.array(list(record.measures))
    arrays["measures"] = np.array(list(record.measures.values()), dtype=np.float64)
    arrays["time_names"] = np.array(list(record.times_s))
    arrays["times_s"] = np.array(list(record.times_s.values()), dtype=np.float64)
    arrays["fingerprint"] = np.array(fingerprint)
    if record.tau is not None:
        arrays["tau"] = np.array(record.tau)
    return FrameFile(path, record, arrays, compress)


def _write_archive(file: BinaryIO, arrays: Arrays, *, compress: bool) -> None:
    # As np.savez or np.savez_compressed, but without pickle, and at the fastest level. In memory
    # first: writing in hundreds of pieces would wait for the interpreter lock, which the analysis
    # of the next frame holds, at each.
    content = io.BytesIO()
    method = zipfile.ZIP_DEFLATED if compress else zipfile.ZIP_STORED
    with zipfile.ZipFile(content, "w", method, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
    file.write(content.getbuffer())


def record_of(number: int, analysis: "Analysis") -> FrameRecord:
    """The measures and stage times of an analysis, by name."""
    measures = {k: float(v) for k, v in dataclasses.asdict(analysis.measures).items()}
    times_s = {k: float(v) for k, v in dataclasses.asdict(analysis.times).items()}
    tau = analysis.settings.tau
    by_tau = analysis.settings.sampling != "radius" and tau != "auto"
    return FrameRecord(number, measures, times_s, int(tau) if by_tau else None)


def _arrays_of_frame(frame: "Frame") -> Arrays:
    arrays: Arrays = {"format": np.array(FORMAT), "number": np.array(frame.number)}
    if frame.timestamp_ns is not None:
        arrays["timestamp_ns"] = np.array(frame.timestamp_ns, dtype=np.int64)
    if frame.pose is not None:
        arrays["world_from_velo"] = np.asarray(frame.pose)
    if frame.camera is not None and frame.cam_from_velo is not None:
        arrays["cam_from_velo"] = np.asarray(frame.cam_from_velo)
        arrays["projection"] = np.asarray(frame.camera.projection)
        arrays["image_size_px"] = np.array([frame.camera.width_px, frame.camera.height_px])
    return arrays


def _arrays_of_analysis(analysis: "Analysis") -> Arrays:
    arrays: Arrays = {
        "settings_toml": np.array(analysis.settings.to_toml()),
        "cut": np.array(analysis.cut, dtype=np.float64),
        "metric": np.array(analysis.metric),
    }
    for field in dataclasses.fields(analysis):
        value = getattr(analysis, field.name)
        if isinstance(value, np.ndarray):
            arrays[field.name] = value
    return arrays


def load_frame(path: Path) -> Arrays:
    """All arrays of a frame file, by name, after comparing the checksums of the archive.

    Raises
    ------
    OutputError
        The file cannot be read, is damaged, or is not a frame file of this version.
    """
    try:
        # Read at once: damage anywhere in the file must raise here, not at a later access.
        content = io.BytesIO(path.read_bytes())
        _check_unpacked_size(content)
        with np.load(content, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except OSError as error:
        raise OutputError(f"cannot read {path}: {error.strerror or error}.") from None
    except Exception as error:  # zipfile, zlib and numpy raise various types on damage
        reason = (str(error) or type(error).__name__).splitlines()[0].rstrip(".")
        raise OutputError(f"{path} is damaged: {reason}.") from None
    version = arrays.get("format", np.array(-1))
    if version.shape != () or version.dtype.kind not in "iu" or int(version) != FORMAT:
        raise OutputError(f"{path} is not a frame file of this version of intervis.")
    return arrays


def _check_unpacked_size(content: io.BytesIO) -> None:
    """Check what an archive declares to hold, before memory is taken for it."""
    with zipfile.ZipFile(content) as archive:
        unpacked_bytes = sum(entry.file_size for entry in archive.infolist())
    if unpacked_bytes > MOST_BYTES:
        raise ValueError(f"it declares {unpacked_bytes} bytes, and no frame has {MOST_BYTES}")
    content.seek(0)


def load_analysis(path: Path) -> "Analysis":
    """The analysis in a frame file, as `intervis.analyze` returned it.

    Raises
    ------
    OutputError
        As `load_frame`.
    """
    return analysis_in(path, load_frame(path))


def analysis_in(path: Path, arrays: Arrays) -> "Analysis":
    """The analysis among the arrays of a frame file.

    Raises
    ------
    OutputError
        Arrays are missing, or are none of this version.
    """
    from intervis.method.analysis import Analysis, StageTimes
    from intervis.method.measures import Measures

    record = record_in(path, arrays)
    counts = {field.name for field in dataclasses.fields(Measures) if field.type is int}
    measures: dict[str, Any] = {
        name: int(value) if name in counts else value for name, value in record.measures.items()
    }
    try:
        known = {
            field.name: arrays[field.name]
            for field in dataclasses.fields(Analysis)
            if field.name not in ("settings", "metric", "cut", "measures", "times")
        }
        return Analysis(
            **known,
            settings=Settings(**tomllib.loads(str(arrays["settings_toml"]))),
            metric=str(arrays["metric"]),
            cut=float(arrays["cut"]),
            measures=Measures(**measures),
            times=StageTimes(**record.times_s),
        )
    except (KeyError, TypeError, ValueError, SettingsError) as error:
        raise OutputError(f"{path} is not a frame file of this version of intervis.") from error


def load_sight(path: Path) -> FrameSight:
    """The sight lines in a frame file of a run with ``--sight``.

    Raises
    ------
    OutputError
        As `load_frame`; or the run asked for no sight lines.
    """
    sight = sight_in(path, load_frame(path))
    if sight is None:
        raise OutputError(f"{path} holds no sight lines: run with sight lines (--sight).")
    return sight


def sight_in(path: Path, arrays: Arrays) -> FrameSight | None:
    """The sight lines among the arrays of a frame file; None if it has none.

    Raises
    ------
    OutputError
        The arrays do not fit together.
    """
    found = [arrays.get(f"sight_{name}") for name in SIGHT_ARRAYS]
    viewpoint, state, probability = found
    if viewpoint is None or state is None or probability is None:
        return None
    if viewpoint.shape != (3,) or state.ndim != 1 or state.shape != probability.shape:
        raise OutputError(f"{path} is damaged: its sight lines do not fit together.")
    return FrameSight(viewpoint, state, probability)


def load_record(path: Path, fingerprint: str | None = None) -> FrameRecord:
    """The record of a frame, read from its frame file.

    Raises
    ------
    OutputError
        As `load_frame`; or the file was not made from the input and settings of `fingerprint`.
    """
    arrays = load_frame(path)
    if fingerprint is not None and str(arrays.get("fingerprint")) != fingerprint:
        raise OutputError(f"{path} was made from another scan, pose, camera or setting.")
    return record_in(path, arrays)


def record_in(path: Path, arrays: Arrays) -> FrameRecord:
    """The record among the arrays of a frame file.

    Raises
    ------
    OutputError
        Arrays are missing, or do not fit together.
    """
    try:
        measures = dict(
            zip(arrays["measure_names"].tolist(), arrays["measures"].tolist(), strict=True)
        )
        times_s = dict(zip(arrays["time_names"].tolist(), arrays["times_s"].tolist(), strict=True))
        tau = int(arrays["tau"]) if "tau" in arrays else None
        sight = sight_in(path, arrays)
        shares = None if sight is None else sight.shares
        number = int(arrays["number"])
        return FrameRecord(number, measures, times_s, tau, reused=True, sight=shares)
    except (KeyError, TypeError, ValueError) as error:
        raise OutputError(f"{path} is damaged: {error}.") from None
