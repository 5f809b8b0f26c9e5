"""Obstacles of one frame over its image, to be counted: voxels, numbered boxes, and arrows to missed ones (Fig. 7.2)."""

import cv2
import numpy as np

from perception.errors import ImageError
from perception.evaluation.objects import MotionState
from perception.evaluation.obstacles import FrameObstacles
from perception.geometry.boxes import edges
from perception.geometry.camera import box_outlines_px
from perception.geometry.grids import LocalArea
from perception.render import palette
from perception.render.labels import Label, draw_labels
from perception.render.overlay import OverlayStyle, draw_overlay, sample_surface
from perception.render.palette import Color
from perception.render.strokes import draw_seam, draw_strokes, project_strokes
from perception.types import Float64, Int, Result, UInt8

_NO_GROUND = OverlayStyle(ground_opacity=0.0, mesh_opacity=0.0)
_COLORS: dict[int, Color] = {
    MotionState.UNKNOWN: palette.TEXT,
    MotionState.STATIC: palette.STATIC,
    MotionState.MOVING: palette.MOVING,
}
_TEXT_PX = 9
_ARROW_PX = 34  # length of an arrow


def draw_counted_obstacles(result: Result, counted: FrameObstacles | None) -> UInt8:
    """Return the image with voxels and the boxes of known obstacles: static red, moving green, missed by an arrow.

    Args:
        result: Static and moving voxels of a frame that has an image.
        counted: Labelled objects or exact elements of the frame; None where none is known.

    Raises:
        ImageError: The frame has no image, or no calibration.
    """
    frame = result.frame
    if frame.image is None or frame.calibration is None:
        raise ImageError(frame.source, expected="an image with its calibration", found="none")
    image_P_velo = frame.calibration.image_P_velo
    surface = sample_surface(result.ground, LocalArea())
    canvas = frame.image.copy()
    draw_overlay(canvas, image_P_velo, surface, result.obstacles, _NO_GROUND)
    if counted is None or not len(counted.counted):
        return canvas
    boxes = counted.counted.boxes_velo
    colors = [_COLORS[motion] for motion in counted.counted.motions.tolist()]
    owners = np.repeat(np.arange(len(boxes)), 12)
    strokes = project_strokes(image_P_velo, canvas, edges(boxes).reshape(-1, 2, 3), owners)
    draw_seam(canvas, strokes, palette.BACKGROUND, 2)
    draw_strokes(canvas, strokes, colors, np.ones(len(boxes), np.int64))
    height, width = canvas.shape[:2]
    outlines = box_outlines_px(image_P_velo, boxes, (width, height))
    visible = np.flatnonzero(np.isfinite(outlines).all(axis=1))
    labels = [Label(outlines[row], str(row + 1), colors[row]) for row in visible.tolist()]
    arrows = [_draw_arrow(canvas, outlines[row]) for row in visible[counted.is_missed[visible]]]
    draw_labels(canvas, labels, _TEXT_PX, arrows)
    return canvas


def _draw_arrow(canvas: UInt8, outline_px: Float64) -> Int:
    """Draw an arrow that points down to the top of a rectangle; return (4,) the area that it takes."""
    x1, y1, x2, _ = outline_px
    tip = (round((x1 + x2) / 2), max(round(y1), _ARROW_PX))
    tail = (tip[0], tip[1] - _ARROW_PX)
    for color, width_px in ((palette.BACKGROUND, 5), (palette.GROUND, 3)):
        cv2.arrowedLine(canvas, tail, tip, color, width_px, cv2.LINE_AA, tipLength=0.4)
    half_px = _ARROW_PX // 2
    return np.array([tip[0] - half_px, tail[1], tip[0] + half_px, tip[1]])
