"""Tracked objects over time: a row for each object, and for each instant the image above the scene in 3D (Figs 7.7, 7.8)."""

from collections.abc import Mapping, Sequence

import numpy as np

from perception.render import palette
from perception.render.canvas import blank_canvas
from perception.render.palette import Style
from perception.render.panels import place_panel
from perception.render.tracked_object_views import TrackedObjectScene, TrackedObjectViews
from perception.types import UInt8

_CELL_PX = (640, 512)
_CAMERA_PX = 194  # height of an image of KITTI as wide as a cell
_GUTTER_PX = 4
_STYLE = Style(line_px=2, text_px=10)


def draw_tracked_objects(rows: Mapping[str, Sequence[TrackedObjectScene]]) -> UInt8:
    """Return one image of all objects; rows of fewer instants end in blank cells.

    Args:
        rows: Instants of each object by its name, from left to right.
    """
    width, height = np.array(_CELL_PX) + _GUTTER_PX
    columns = max(len(scenes) for scenes in rows.values())
    canvas = blank_canvas((columns * width, len(rows) * height), palette.BACKGROUND)
    for row, (name, scenes) in enumerate(rows.items()):
        for column, scene in enumerate(scenes):
            title = f"{name}, frame {scene.result.frame.index}"
            corner_px = (column * width, row * height)
            place_panel(canvas, _draw_cell(scene), corner_px, title, _STYLE.text_px)
    return canvas


def _draw_cell(scene: TrackedObjectScene) -> UInt8:
    """Return the image of one instant; without a camera the scene in 3D takes all of it."""
    width, height = _CELL_PX
    views = TrackedObjectViews(scene, _STYLE)
    camera = views.camera((width, _CAMERA_PX))
    behind = views.from_behind((width, height - len(camera)))
    return np.concatenate([camera, behind])
