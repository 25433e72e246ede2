"""How a recording opens in the viewer of Rerun: views, charts, and which layers are shown."""

from typing import Any

from intervis.drives import Drive
from intervis.view.view_request import ViewRequest

SENSOR = "world/sensor"
"""Entity of the sensor frame; what a frame shows stands below it."""

PROBABILITY_COLOUR = "probability_colour"
"""Component of the returns: the colour of their probability, which a view shows instead."""

HIDDEN_LAYERS = ("blind_spots", "method")
"""Layers that are switched on by the eye beside their name, as on the page."""


def blueprint(drive: Drive, request: ViewRequest) -> Any:
    """Views beside each other: the scan by state or by probability, camera, charts."""
    import rerun as rr
    import rerun.blueprint as rrb

    hidden = rrb.EntityBehavior(visible=False)
    layers = {f"{SENSOR}/{name}": hidden for name in HIDDEN_LAYERS}
    eye = rrb.EyeControls3D(position=(-22.0, 0.0, 16.0), look_target=(8.0, 0.0, -1.0))
    by_state = rrb.Spatial3DView(origin=SENSOR, name="Sight", overrides=layers, eye_controls=eye)
    by_probability = rrb.Spatial3DView(
        origin=SENSOR,
        name="Probability",
        overrides={**layers, f"{SENSOR}/returns": _by_probability()},
        eye_controls=eye,
    )
    world = rrb.Spatial3DView(origin="world", name="World", overrides=layers)
    scans = [by_state, by_probability, *([world] if drive.poses else [])]
    beside: list[Any] = []
    if drive.camera_name is not None:
        camera = f"{SENSOR}/camera"
        shown = [f"/{camera}/**", f"/{SENSOR}/returns"]
        beside.append(rrb.Spatial2DView(origin=camera, name="Camera", contents=shown))
    shares = [f"/measures/{name}_percent" for name in ("visible", "occluded", "unknown")]
    beside.append(rrb.TimeSeriesView(origin="measures", name="States, %", contents=shares))
    others = [rrb.TimeSeriesView(origin="measures/TPI", name="TPI of the paper, %")]
    if request.has_blind_spots:
        others.insert(
            0, rrb.TimeSeriesView(origin="measures/blind_area_m2", name="Blind spots, m²")
        )
    if request.ends:
        names = [f"/measures/sight_line_{k + 1}_percent" for k in range(len(request.ends))]
        others.insert(
            0, rrb.TimeSeriesView(origin="measures", name="P(visible), %", contents=names)
        )
        others.append(rrb.TextLogView(origin="sight_lines", name="Sight lines"))
    beside.append(rrb.Tabs(*others))
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Tabs(*scans),
            rrb.Vertical(*beside, row_shares=[4, 3, 3][-len(beside) :]),
            column_shares=[3, 2],
        ),
        rrb.BlueprintPanel(state=rr.blueprint.components.PanelState.Collapsed),
        rrb.SelectionPanel(state=rr.blueprint.components.PanelState.Collapsed),
        rrb.TimePanel(
            state=rr.blueprint.components.PanelState.Collapsed, timeline="frame", fps=10.0
        ),
        auto_layout=False,
        auto_views=False,
    )


def _by_probability() -> Any:
    """The returns in the colours of `PROBABILITY_COLOUR` instead of those of their states."""
    import rerun as rr
    from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

    mapping = VisualizerComponentMapping(
        "Points3D:colors",
        ComponentSourceKind.SourceComponent,
        source_component=PROBABILITY_COLOUR,
    )
    return rr.Points3D.from_fields().visualizer(mappings=[mapping])
