"""A frame file read back: everything that a run stored of one frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intervis.arrays import IntArray
from intervis.camera import Camera
from intervis.drives import Frame
from intervis.errors import IntervisError, OutputError
from intervis.method.analysis import Analysis
from intervis.run.frame_file import (
    Arrays,
    FrameRecord,
    analysis_in,
    load_frame,
    record_in,
    sight_in,
)
from intervis.run.frame_sight import FrameSight


@dataclass(frozen=True, eq=False)
class StoredFrame:
    """What a run stored of one frame: results, and of the frame all but points and image.

    Attributes
    ----------
    record : FrameRecord
        Measures, stage times, tau, and the shares of the sight lines.
    analysis : Analysis
        As `intervis.analyze` returned it.
    sight : FrameSight or None
        The sight lines to every row of the scan; None where the run asked for none.
    fingerprint : str
        Digest of all that the results depend on.
    frame : Frame
        Number, pose, time and camera; its points are the nodes, for the scan is not stored.
    """

    record: FrameRecord
    analysis: Analysis
    sight: FrameSight | None
    fingerprint: str
    frame: Frame


def load_stored_frame(path: Path) -> StoredFrame:
    """Everything in a frame file, after a check that it fits together.

    Raises
    ------
    OutputError
        As `intervis.run.frame_file.load_frame`; or the arrays contradict each other.
    """
    arrays = load_frame(path)
    analysis, sight = analysis_in(path, arrays), sight_in(path, arrays)
    record = record_in(path, arrays)
    if not _fits(analysis) or not (sight is None or _are_indices(analysis.nodes, len(sight.state))):
        raise OutputError(f"{path} is damaged: its arrays do not fit together.")
    if path.stem != f"{record.number:010d}":
        raise OutputError(f"{path} is damaged: it holds frame {record.number}.")
    try:
        frame = _frame(record.number, analysis, arrays)
    except (IntervisError, KeyError, TypeError, ValueError) as error:
        raise OutputError(f"{path} is damaged: {str(error).rstrip('.')}.") from None
    return StoredFrame(record, analysis, sight, str(arrays.get("fingerprint", "")), frame)


def _frame(number: int, analysis: Analysis, arrays: Arrays) -> Frame:
    """What is stored of the frame itself."""
    camera = None
    if "projection" in arrays:
        width_px, height_px = arrays["image_size_px"].tolist()
        camera = Camera(arrays["projection"], width_px, height_px)
    return Frame(
        number=number,
        points=analysis.node_points.astype(np.float32),
        camera=camera,
        cam_from_velo=None if camera is None else arrays["cam_from_velo"],
        pose=arrays.get("world_from_velo"),
        timestamp_ns=int(arrays["timestamp_ns"]) if "timestamp_ns" in arrays else None,
    )


def _fits(analysis: Analysis) -> bool:
    """Whether the arrays that describe the mesh have the shapes and indices of one mesh."""
    nodes, edges, triangles = analysis.nodes, analysis.edges, analysis.triangles
    return (
        analysis.viewpoint.shape == (3,)
        and bool(np.isfinite(analysis.viewpoint).all())
        and nodes.ndim == 1
        and _are_indices(nodes, np.iinfo(np.int64).max)
        and analysis.node_points.shape == (len(nodes), 3)
        and bool(np.isfinite(analysis.node_points).all())
        and analysis.node_intervisible.shape == nodes.shape
        and edges.shape == (len(edges), 2)
        and _are_indices(edges, len(nodes))
        and analysis.edge_intervisible.shape == (len(edges),)
        and triangles.shape == (len(triangles), 3)
        and _are_indices(triangles, len(nodes))
        and analysis.region.shape == (len(triangles),)
    )


def _are_indices(values: IntArray, count: int) -> bool:
    """Whether all values are whole numbers from 0 to below `count`."""
    if values.dtype.kind not in "iu":
        return False
    return not values.size or bool(values.min() >= 0 and values.max() < count)
