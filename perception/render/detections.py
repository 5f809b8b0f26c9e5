"""What a detector of boxes saw and said: the depth picture, its proposals, its detections with their scores."""

import cv2
import numpy as np

from perception.maps.densify import DenseMaps
from perception.maps.encoding import encode_depth
from perception.render import palette
from perception.render.palette import Color
from perception.render.strokes import fixed_point
from perception.render.tracked_object_figure import draw_tag
from perception.types import Detections, Float64, UInt8

PROPOSED: Color = palette.STATIC
DETECTED: Color = palette.MOVING
_FIXED_POINT_BITS = 4
# So that boxes stand out from the colours of depths; the reddest ones are almost black.
_DEPTH_BRIGHTNESS, _REDDEST = 0.66, 236


def draw_detections(canvas: UInt8, detections: Detections, text_px: int) -> None:
    """Draw boxes with their scores, the surest last and so uppermost; class names where there are several."""
    is_one_class = len(np.unique(detections.types)) < 2
    ranked = detections[np.argsort(detections.scores, kind="stable")]
    draw_boxes(canvas, ranked.boxes_px, DETECTED, width_px=2)
    for box_px, score, name in zip(
        ranked.boxes_px, ranked.scores.tolist(), ranked.types.tolist(), strict=True
    ):
        text = f"{score:.2f}" if is_one_class else f"{name} {score:.2f}"
        draw_tag(canvas, text, box_px, DETECTED, text_px)


def draw_boxes(canvas: UInt8, boxes_px: Float64, color: Color, width_px: int = 1) -> None:
    """Draw (M, 4) boxes x1 y1 x2 y2 with a dark seam, which shows them on any ground."""
    outlines = list(fixed_point(boxes_px[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]))
    for line, width in ((palette.BACKGROUND, width_px + 2), (color, width_px)):
        cv2.polylines(canvas, outlines, True, line, width, cv2.LINE_AA, _FIXED_POINT_BITS)


def color_depth_map(dense: DenseMaps) -> UInt8:
    """Return (H, W, 3) depths from red, near, to blue, far; dark where nothing is known."""
    nearness = cv2.convertScaleAbs(255 - encode_depth(dense.depth_m), alpha=_REDDEST / 255)
    colors = cv2.applyColorMap(nearness, cv2.COLORMAP_TURBO)[:, :, ::-1]
    dimmed = cv2.convertScaleAbs(np.ascontiguousarray(colors), alpha=_DEPTH_BRIGHTNESS)
    dimmed[~dense.is_valid] = palette.PANEL
    return np.asarray(dimmed, np.uint8)
