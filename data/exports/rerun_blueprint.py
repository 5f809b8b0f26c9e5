"""The layout of the Rerun viewer: the scene, camera and maps, and series."""

from typing import Any

import rerun.blueprint as rrb

from data.exports.rerun_entities import CAMERA, camera_path
from perception.types import MAP_MODALITIES, Result

_PATH_S = 4.0


def blueprint_of(result: Result) -> rrb.Blueprint:
    """Return the layout for a drive by its first result: without views of what it does not have."""
    views = [_scene_view()]
    if side := _image_views(result):
        views.append(rrb.Vertical(*side))
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*views, column_shares=[3, 2][: len(views)]),
            rrb.Horizontal(
                rrb.TimeSeriesView(origin="timings", name="Timings [ms]"),
                rrb.TimeSeriesView(origin="counts", name="Counts"),
                rrb.TimeSeriesView(origin="health", name="Health"),
            ),
            row_shares=[3, 1],
        ),
        rrb.TimePanel(timeline="time", state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )


def _scene_view() -> Any:  # noqa: ANN401 - a view
    """Return the 3D view, seen from behind the vehicle, with its path."""
    now = rrb.TimeRangeBoundary.cursor_relative()
    before = rrb.TimeRangeBoundary.cursor_relative(seconds=-_PATH_S)
    return rrb.Spatial3DView(
        origin="world/ego",
        name="Scene",
        contents=["+ /world/**", f"- {CAMERA}/**"],
        eye_controls=rrb.EyeControls3D(
            position=(-16, 0, 10), look_target=(10, 0, -2), eye_up=(0, 0, 1)
        ),
        overrides={
            "world/path": rrb.VisibleTimeRanges(
                [rrb.VisibleTimeRange("time", start=before, end=now)]
            )
        },
    )


def _image_views(result: Result) -> list[Any]:
    """Return the views of the cameras' images and of the maps, each with its detections."""
    views: list[Any] = []
    if result.frame.image is not None:
        contents = [f"{CAMERA}/image", f"{CAMERA}/detections/fused", "world/tracks"]
        views.append(rrb.Spatial2DView(origin=CAMERA, contents=contents, name="Camera"))
    maps = [
        rrb.Spatial2DView(
            origin=CAMERA,
            contents=[f"{CAMERA}/{modality}", f"{CAMERA}/detections/{modality}"],
            name=name,
        )
        for modality, name in zip(MAP_MODALITIES, ("Depth map", "Reflectance map"), strict=True)
        if modality in result.map_images
    ]
    further = [
        rrb.Spatial2DView(
            origin=(path := camera_path(one.name)),
            contents=[f"{path}/image", f"{path}/detections/fused", "world/tracks"],
            name=one.name,
        )
        for one in result.frame.further_cameras
    ]
    return views + further + maps
