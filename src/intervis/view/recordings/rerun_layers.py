"""What a recording for Rerun holds of a frame: one entity for each layer of the page."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intervis.arrays import Float64Array, IntArray
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE
from intervis.uses.objects import ObjectSight
from intervis.uses.visibility_grid import VisibilityGrid, blind_cells
from intervis.view.colours import COLOURS, on_scale, rgb
from intervis.view.frame_data import FRUSTUM_M
from intervis.view.judged_frame import JudgedFrame
from intervis.view.recordings.measures import STATES, frame_measures
from intervis.view.recordings.object_look import object_label, state_of_object
from intervis.view.recordings.placement import placement, velo_from_pinhole
from intervis.view.recordings.rerun_blueprint import PROBABILITY_COLOUR, SENSOR
from intervis.view.reduced_image import reduced_camera

PALETTE = COLOURS["dark"]
CLASS_OF_STATE = {OCCLUDED: 0, VISIBLE: 1, UNKNOWN: 2}
"""Numbers of the classes: the places of the names in `STATES`."""

RETURN_PX, VIEWPOINT_PX, LINE_PX = 1.6, 7.0, 1.8
REGION_ALPHA, SPOT_ALPHA = 120, 110


def static_entities() -> Iterator[tuple[str, Any]]:
    """Entities that do not change: axes, names and colours of the states, sizes of points."""
    import rerun as rr

    yield "world", rr.ViewCoordinates.RIGHT_HAND_Z_UP
    classes = [(number, name, rgb(PALETTE[name])) for number, name in enumerate(STATES)]
    yield "/", rr.AnnotationContext(classes)
    yield f"{SENSOR}/returns", rr.Points3D.from_fields(radii=rr.Radius.ui_points(RETURN_PX))
    for name in STATES:
        lines = rr.SeriesLines(colors=[rgb(PALETTE[name])], names=[name])
        yield f"measures/{name}_percent", lines


class Layers:
    """Logs the layers of frames into a stream; the time is set by the caller.

    A layer that a frame lacks is cleared if an earlier frame had it: viewers show the latest.
    """

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self._shown: set[str] = set()

    def place(self, world_from_velo: Float64Array | None) -> None:
        """Log where the sensor is."""
        self._log(SENSOR, None if world_from_velo is None else _transform(world_from_velo))

    def log(self, judged: JudgedFrame) -> None:
        """Log everything else of a frame."""
        import rerun as rr

        viewpoint = rr.Points3D(
            judged.viewpoint[None],
            radii=rr.Radius.ui_points(VIEWPOINT_PX),
            colors=[rgb(PALETTE["ink"])],
            labels=["viewpoint"],
            show_labels=False,
        )
        self._log_returns(judged)
        self._log(f"{SENSOR}/viewpoint", viewpoint)
        self._log_camera(judged)
        self._log(f"{SENSOR}/objects", _boxes(judged.objects))
        self._log(f"{SENSOR}/blind_spots", _cells(judged.grid))
        for name, archetype in _method(judged).items():
            self._log(f"{SENSOR}/method/{name}", archetype)
        self._log_lines(judged)
        for name, value in frame_measures(judged).items():
            self._stream.log(f"measures/{name}", rr.Scalars(value))

    def _log_returns(self, judged: JudgedFrame) -> None:
        import rerun as rr

        probability = judged.sight.probability
        values: dict[str, Any] = {
            "probability": probability.astype(np.float32),
            PROBABILITY_COLOUR: packed_colours(on_scale(probability)),
            "row": judged.rows.astype(np.uint32),
        }
        classes = class_numbers(judged.sight.state)
        points = rr.Points3D(judged.points.astype(np.float32), class_ids=classes)
        self._log(f"{SENSOR}/returns", points, rr.AnyValues(**values))

    def _log_camera(self, judged: JudgedFrame) -> None:
        import rerun as rr

        camera, cam_from_velo = judged.frame.camera, judged.frame.cam_from_velo
        if camera is None or cam_from_velo is None:
            self._log(f"{SENSOR}/camera", None)
        else:
            reduced = reduced_camera(camera, judged.image)
            pinhole = rr.Pinhole(
                image_from_camera=reduced.projection[:, :3],
                resolution=[reduced.width_px, reduced.height_px],
                image_plane_distance=FRUSTUM_M,
            )
            self._log(
                f"{SENSOR}/camera", pinhole, _transform(velo_from_pinhole(camera, cam_from_velo))
            )
        image = None
        if judged.image is not None:
            image = rr.EncodedImage(contents=judged.image.jpeg, media_type="image/jpeg")
        self._log(f"{SENSOR}/camera/image", image)

    def _log_lines(self, judged: JudgedFrame) -> None:
        """The requested lines: segments, blockers, sentences."""
        import rerun as rr

        lines = judged.lines
        if not lines:
            return
        states = np.array([line.explanation.state for line in lines])
        strips = rr.LineStrips3D(
            [np.stack([line.start, line.end]) for line in lines],
            class_ids=class_numbers(states),
            radii=rr.Radius.ui_points(LINE_PX),
        )
        self._log(f"{SENSOR}/sight_lines", strips)
        blockers = np.array([line.explanation.blocker for line in lines])
        blockers = blockers[np.isfinite(blockers).all(axis=1)]
        crosses = rr.Points3D(
            blockers,
            class_ids=[CLASS_OF_STATE[OCCLUDED]] * len(blockers),
            radii=rr.Radius.ui_points(VIEWPOINT_PX),
        )
        self._log(f"{SENSOR}/sight_lines/blockers", crosses if len(blockers) else None)
        for k, line in enumerate(lines, start=1):
            text = rr.TextLog(line.explanation.text, level="INFO")
            self._stream.log(f"sight_lines/{k}", text)

    def _log(self, path: str, *archetypes: Any) -> None:
        """Log archetypes at a path; None clears what an earlier frame left there."""
        import rerun as rr

        if archetypes[0] is not None:
            self._stream.log(path, *archetypes)
            self._shown.add(path)
        elif path in self._shown:
            self._stream.log(path, rr.Clear(recursive=False))
            self._shown.remove(path)


def class_numbers(states: NDArray[Any]) -> NDArray[np.uint16]:
    """(N,) numbers of the classes of states (N,).

    Examples
    --------
    >>> class_numbers(np.array([1, 0, -1], np.int8)).tolist()
    [1, 0, 2]
    """
    return np.where(states == UNKNOWN, CLASS_OF_STATE[UNKNOWN], states).astype(np.uint16)


def packed_colours(colours: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(N,) opaque colours (N, 3) as 0xRRGGBBAA.

    Examples
    --------
    >>> f"{packed_colours(np.array([[1, 2, 255]], np.uint8))[0]:08x}"
    '0102ffff'
    """
    red, green, blue = colours.astype(np.uint32).T
    return np.asarray(red << 24 | green << 16 | blue << 8 | 255, np.uint32)


def _transform(parent_from_child: Float64Array) -> Any:
    import rerun as rr

    place = placement(parent_from_child)
    return rr.Transform3D(
        translation=place.translation, quaternion=rr.Quaternion(xyzw=place.quaternion)
    )


def _boxes(objects: list[ObjectSight]) -> Any:
    """Labelled boxes, coloured by what most of each is; None without objects."""
    import rerun as rr

    if not objects:
        return None
    places = [placement(one.box.velo_from_box) for one in objects]
    return rr.Boxes3D(
        centers=np.array([place.translation for place in places]),
        half_sizes=np.array([one.box.size_m for one in objects]) / 2,
        quaternions=np.array([place.quaternion for place in places]),
        colors=[rgb(PALETTE[state_of_object(one)]) for one in objects],
        labels=[object_label(one) for one in objects],
        show_labels=False,
        radii=rr.Radius.ui_points(1.2),
    )


def cell_corners(grid: VisibilityGrid) -> tuple[Float64Array, IntArray]:
    """Corners (4 K, 3) of the K cells that are not visible, on the ground, and their states (K,).

    Examples
    --------
    >>> from intervis.uses.visibility_grid import VisibilityGrid
    >>> state, flat = np.array([[0, 1]], np.int8), np.zeros((1, 2))
    >>> grid = VisibilityGrid(np.zeros(3), np.zeros(2), 2.0, 1.0, state, flat,
    ...                       np.zeros((1, 2, 3)), flat - 1.7, flat > 0)
    >>> corners, states = cell_corners(grid)
    >>> corners[[0, 2]].tolist(), states.tolist()
    ([[0.0, 0.0, -1.7], [2.0, 2.0, -1.7]], [0])
    """
    blind = blind_cells(grid)
    middles = np.column_stack([grid.middles[blind], grid.ground_m[blind]])
    offsets = grid.cell_m / 2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    corners = (middles[:, None] + offsets).reshape(-1, 3)
    return corners, grid.state[blind].astype(np.int64)


def _cells(grid: VisibilityGrid | None) -> Any:
    """Cells of the ground where something could stand unseen; None where there are none."""
    import rerun as rr

    if grid is None:
        return None
    corners, states = cell_corners(grid)
    if not len(states):
        return None
    first = 4 * np.arange(len(states))[:, None]
    triangles = (first[:, :, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    colours = np.array([(*rgb(PALETTE[name]), SPOT_ALPHA) for name in STATES], np.uint8)
    return rr.Mesh3D(
        vertex_positions=corners,
        triangle_indices=triangles,
        vertex_colors=np.repeat(colours[class_numbers(states)], 4, axis=0),
    )


def _method(judged: JudgedFrame) -> dict[str, Any]:
    """The paper's nodes, intervisible edges and region; each None where there are none."""
    import rerun as rr

    analysis = judged.analysis
    if analysis is None:
        return dict.fromkeys(("nodes", "intervisible_edges", "region"))
    good = rgb(PALETTE["visible"])
    colours = np.array([rgb(PALETTE["line"]), good], np.uint8)
    nodes = rr.Points3D(
        analysis.node_points,
        colors=colours[analysis.node_intervisible.astype(np.int64)],
        radii=rr.Radius.ui_points(2.5),
    )
    edges = analysis.edges[analysis.edge_intervisible]
    triangles = analysis.triangles[analysis.region]
    strips = rr.LineStrips3D(
        analysis.node_points[edges], colors=[good], radii=rr.Radius.ui_points(1.0)
    )
    region = rr.Mesh3D(
        vertex_positions=analysis.node_points,
        triangle_indices=triangles,
        albedo_factor=[*rgb(PALETTE["region"]), REGION_ALPHA],
    )
    return {
        "nodes": nodes,
        "intervisible_edges": strips if len(edges) else None,
        "region": region if len(triangles) else None,
    }
