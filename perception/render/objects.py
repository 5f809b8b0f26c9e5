"""Objects drawn through any projection: the camera's or a virtual one.

An object is a box with a filled front, its path, a velocity arrow as long as its path in one second, and a label, in
the colour of its id, or of its class where it has no id; the mark of the label has the colour of the class. Faint lines: predicted, not observed in this scan. An object without a 3D box is drawn as the
rectangle of its detection.
"""

from collections.abc import Sequence

import numpy as np

from perception.geometry.camera import NEAREST_M, outlines_px, project
from perception.render import palette
from perception.render.labels import Label
from perception.render.object_figures import ObjectFigures, ObjectPart
from perception.render.palette import Color, Style
from perception.render.panels import Resizing
from perception.render.strokes import (
    Strokes,
    draw_seam,
    draw_strokes,
    fill_polygons,
    project_strokes,
    rectangle_strokes,
)
from perception.types import Bool, Float64, UInt8

_FRONT_OPACITY = 0.5
# Brightness of each part: the path fades with its age.
_LIGHT = {
    ObjectPart.OLD_PATH: 0.5,
    ObjectPart.PATH: 0.75,
    ObjectPart.NEW_PATH: 1.0,
    ObjectPart.BOX: 1.0,
    ObjectPart.ARROW: 1.0,
}
# Boxes with a smaller outline are drawn with thin lines.
_SMALL_PX = 40.0


def draw_objects(
    canvas: UInt8,
    image_P_velo: Float64,
    figures: ObjectFigures,
    style: Style,
    resizing: Resizing | None = None,
) -> list[Label]:
    """Draw objects onto a canvas, and return their labels, which are drawn over everything.

    Args:
        canvas: (H, W, 3) canvas.
        image_P_velo: (3, 4) projection from the LiDAR frame to the canvas.
        figures: (T) objects as lines and faces.
        style: Line width and text height.
        resizing: Scale and shift from the camera image to the canvas; None of another view, which shows no rectangles.
    """
    objects, count = figures.objects, len(figures.objects)
    if not count:
        return []
    colors = figures.colors
    strokes = project_strokes(image_P_velo, canvas, figures.segments_m, figures.numbers)
    boxes = slice(ObjectPart.BOX * count, ObjectPart.ARROW * count)
    outlines = outlines_px(strokes.ends_px, strokes.owners, len(ObjectPart) * count)[boxes]
    if resizing is not None:
        strokes, outlines = _with_rectangles(strokes, outlines, figures, resizing)
    widths_px = np.full((len(ObjectPart), count), style.line_px)
    widths_px[ObjectPart.BOX, _is_small(outlines) | ~objects.is_observed] = 1
    widths_px[:, objects.is_selected] += 1
    _fill_fronts(canvas, image_P_velo, figures, colors)
    # A dark outline keeps boxes and arrows visible on any background.
    seam = strokes.since(ObjectPart.BOX * count)
    draw_seam(canvas, seam, palette.BACKGROUND, style.line_px + 2)
    draw_strokes(canvas, strokes, _colors_of_parts(colors), widths_px.ravel())
    return [Label(outlines[row], *text) for row, text in figures.texts.items()]


def _with_rectangles(
    strokes: Strokes, outlines: Float64, figures: ObjectFigures, resizing: Resizing
) -> tuple[Strokes, Float64]:
    """Add the rectangles of the detections that have no 3D box."""
    objects = figures.objects
    rows = np.flatnonzero(~objects.has_box & np.isfinite(objects.boxes_px).all(axis=1))
    boxes_px = resizing.move_boxes(objects.boxes_px[rows])
    rectangles = rectangle_strokes(boxes_px, ObjectPart.BOX * len(objects) + rows)
    outlines = outlines.copy()
    outlines[rows] = boxes_px
    return strokes.joined(rectangles), outlines


def _colors_of_parts(colors: Sequence[Color]) -> list[Color]:
    """Return the colour of each line number."""
    return [palette.dimmed(color, light) for light in _LIGHT.values() for color in colors]


def _fill_fronts(
    canvas: UInt8, image_P_velo: Float64, figures: ObjectFigures, colors: Sequence[Color]
) -> None:
    """Fill the front faces of the boxes that face the camera."""
    pixels, depth_m = project(image_P_velo, figures.faces_m.reshape(-1, 3))
    polygons = pixels.reshape(-1, 4, 2)
    shown = (depth_m.reshape(-1, 4) > NEAREST_M).all(axis=1)
    shown &= _is_near(polygons, canvas) & _is_clockwise(polygons)
    face_colors = [colors[row] for row in figures.face_rows[shown].tolist()]
    fill_polygons(canvas, polygons[shown], face_colors, _FRONT_OPACITY)


def _is_near(polygons_px: Float64, canvas: UInt8) -> Bool:
    """Return the (F,) mask of the (F, C, 2) polygons within one canvas size of the canvas."""
    size = np.array([canvas.shape[1], canvas.shape[0]])
    return np.asarray(((polygons_px > -size) & (polygons_px < 2 * size)).all(axis=(1, 2)))


def _is_clockwise(polygons_px: Float64) -> Bool:
    """Return the (F,) mask of the (F, C, 2) polygons that are clockwise and have an area."""
    following = np.roll(polygons_px, -1, axis=1)
    cross = polygons_px[..., 0] * following[..., 1] - polygons_px[..., 1] * following[..., 0]
    return np.asarray(cross.sum(axis=1) > 1.0)


def _is_small(outlines: Float64) -> Bool:
    return np.asarray((outlines[:, 2:] - outlines[:, :2]).max(axis=1) < _SMALL_PX)
