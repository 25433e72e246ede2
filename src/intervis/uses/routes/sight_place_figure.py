"""Picture of one station: what hides the road, over the image, from above and in section."""

from typing import TYPE_CHECKING, Any

import numpy as np

from intervis.arrays import Float64Array
from intervis.plots.figures import draw_image, pixels_of
from intervis.plots.style import FAINT, INK, INTERVISIBLE, NODE, dots, legend_below, page_figure
from intervis.sight import OCCLUDED, UNKNOWN, VISIBLE
from intervis.transform import inverse, transform
from intervis.uses.routes.sight_distance import SightDistances
from intervis.uses.routes.sight_distance_table import stations_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from intervis.drives import Frame

BESIDE_M = 0.5
"""Returns up to this distance beside the sight line are in the section."""
AROUND_M = 6.0
STATES = ((UNKNOWN, "unknown", FAINT), (OCCLUDED, "hidden", NODE), (VISIBLE, "seen", INTERVISIBLE))


def place_picture(
    found: SightDistances, nth: int, returns: Float64Array, frame: "Frame | None" = None
) -> "Figure":
    """The objects ahead of a station, and the line to the first hidden one.

    Parameters
    ----------
    found : SightDistances
    nth : int
        Index of a station with a hidden object.
    returns : (N, 3) float64 array
        Returns around it, scene frame.
    frame : Frame or None
        A frame near the station; its image is drawn if it has one.

    Raises
    ------
    MissingExtraError
        matplotlib or Pillow (extra ``plots``) is not installed.
    """
    line, objects, state = _line_to_hidden(found, nth)
    blocker = found.ending_blocker[nth]
    window = _window(line, objects)
    plan_in = 6.3 * float(np.ptp(window[:, 1]) / np.ptp(window[:, 0]))
    ratios = [float(np.clip(plan_in, 1.2, 4.5)), 1.7]
    camera = frame.camera if frame is not None and frame.has_image else None
    if camera is not None:
        ratios.insert(0, 0.4 + 6.2 * camera.height_px / camera.width_px)
    with page_figure(sum(ratios) + 1.4, nrows=len(ratios), height_ratios=ratios) as (figure, axes):
        if camera is not None:
            assert frame is not None
            _draw_over_image(axes[0], frame, line, objects, state, blocker)
        _draw_plan(axes[-2], found, returns, line, objects, state, blocker, window)
        _draw_section(axes[-1], found, nth, returns, line, blocker)
        axes[0].set_title(_title(found, nth))
        legend_below(figure, axes[-2])
        return figure


def _title(found: SightDistances, nth: int) -> str:
    one = stations_of(found)[nth]
    return (
        f"Chainage {one.chainage_m:.0f} m: {one.possible_m:.0f} m of {one.required_m:.0f} m"
        f" required at {one.speed_kmh:.0f} km/h ({found.standard.name})"
    )


def _line_to_hidden(found: SightDistances, nth: int) -> tuple[Float64Array, Float64Array, Any]:
    """(2, 3) the sight line to the first hidden object, (K, 3) objects on the path, and states."""
    standard, at_m = found.standard, float(found.chainage_m[nth])
    ahead = found.state[nth] >= UNKNOWN
    where = np.minimum(at_m + found.distance_m[ahead], found.road.length_m)
    objects = found.road.above(where, standard.object_m[0])
    state = found.state[nth, ahead]
    first_m = found.possible_m[nth] + found.step_m
    first = int(np.argmax((state == OCCLUDED) & (found.distance_m[ahead] >= first_m - 1e-6)))
    eye = found.road.above(at_m, standard.eye_m[0])
    return np.stack([eye, objects[first]]), objects, state


def _window(line: Float64Array, objects: Float64Array) -> Float64Array:
    shown = np.vstack([line[:, :2], objects[:, :2]])
    low, high = shown.min(axis=0) - AROUND_M, shown.max(axis=0) + AROUND_M
    missing = np.maximum(0.25 * (high - low)[::-1] - (high - low), 0.0) / 2
    return np.stack([low - missing, high + missing])


def _draw_states(axes: Any, places: Float64Array, state: Any, size: float) -> None:
    for code, name, colour in STATES:
        chosen = state == code
        look = {"edgecolor": "white", "linewidths": 0.3, "zorder": 4}
        dots(axes, places[chosen], s=size, color=colour, label=name, **look)


def _mark_blocker(axes: Any, place: Float64Array) -> None:
    look = {"s": 40, "marker": "X", "color": INK, "edgecolor": "white", "linewidths": 0.6}
    dots(axes, place.reshape(1, -1), label="hides it", zorder=6, **look)


def _draw_over_image(
    axes: Any,
    frame: "Frame",
    line: Float64Array,
    objects: Float64Array,
    state: Any,
    blocker: Float64Array,
) -> None:
    """Objects and blocker over the image of the frame, whose camera is near the eye."""
    draw_image(axes, frame)
    velo_from_scene = np.eye(4) if frame.pose is None else inverse(frame.pose)  # one scan alone
    pixels, ahead = pixels_of(frame, transform(velo_from_scene, objects))
    _draw_states(axes, pixels, state[ahead], 12.0)
    if np.isfinite(blocker).all():
        place, _ = pixels_of(frame, transform(velo_from_scene, blocker[None]))
        if len(place):
            _mark_blocker(axes, place[0])
    assert frame.camera is not None
    axes.set(xlim=(0, frame.camera.width_px), ylim=(frame.camera.height_px, 0), xlabel="")


def _draw_plan(
    axes: Any,
    found: SightDistances,
    returns: Float64Array,
    line: Float64Array,
    objects: Float64Array,
    state: Any,
    blocker: Float64Array,
    window: Float64Array,
) -> None:
    low, high = window
    inside = ((returns[:, :2] > low) & (returns[:, :2] < high)).all(axis=1)
    road_m = float(np.median(objects[:, 2])) - found.standard.object_m[0]
    inside &= returns[:, 2] > road_m + 0.3
    dots(axes, returns[inside], s=0.5, color=FAINT, rasterized=True)
    axes.plot(line[:, 0], line[:, 1], color=INK, linewidth=0.9, label="sight line")
    _draw_states(axes, objects, state, 10.0)
    dots(axes, line[:1], marker="*", s=60, color=INK, edgecolor="white", label="eye", zorder=5)
    if np.isfinite(blocker).all():
        _mark_blocker(axes, blocker[:2])
    axes.set(xlim=window[:, 0], ylim=window[:, 1], aspect="equal", xlabel="x, m", ylabel="y, m")


def _draw_section(
    axes: Any,
    found: SightDistances,
    nth: int,
    returns: Float64Array,
    line: Float64Array,
    blocker: Float64Array,
) -> None:
    """Returns beside the vertical plane of the sight line."""
    step = line[1, :2] - line[0, :2]
    length_m = float(np.linalg.norm(step))
    ahead = step / length_m
    from_eye = returns[:, :2] - line[0, :2]
    along_m = from_eye @ ahead
    beside_m = np.abs(from_eye @ np.array([-ahead[1], ahead[0]]))
    near = (beside_m < BESIDE_M) & (along_m > -1.0) & (along_m < length_m + 3.0)
    near &= np.abs(returns[:, 2] - line[0, 2]) < 4.0
    dots(axes, np.column_stack([along_m, returns[:, 2]])[near], s=1.5, color="#8a9099")
    axes.plot([0, length_m], line[:, 2], color=INK, linewidth=0.9)
    dots(axes, np.array([[0.0, line[0, 2]]]), marker="*", s=60, color=INK, edgecolor="white")
    dots(axes, np.array([[length_m, line[1, 2]]]), s=18, color=NODE, edgecolor="white", zorder=5)
    if np.isfinite(blocker).all():
        place = np.array([(blocker[:2] - line[0, :2]) @ ahead, blocker[2]])
        _mark_blocker(axes, place)
    road_m = float(found.road.at(found.chainage_m[nth])[2])
    axes.set(
        xlabel=f"along the sight line, m; returns up to {BESIDE_M:g} m beside it",
        ylabel="z, m",
        ylim=(road_m - 1.0, road_m + 3.5),
    )
