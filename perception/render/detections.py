"""Detections as boxes with scores, correct and wrong ones in their colours, and depth maps in colours."""

from collections.abc import Sequence

import cv2
import numpy as np

from perception.geometry.box_overlap_px import iou_px
from perception.maps.densify import DenseMaps
from perception.maps.encoding import encode_depth
from perception.render import palette
from perception.render.canvas import FIXED_POINT_BITS, fixed_point
from perception.render.labels import Label, draw_labels
from perception.render.palette import Color
from perception.types import Bool, Detections, Float64, Int, UInt8

PROPOSED: Color = palette.STATIC
DETECTED: Color = palette.MOVING
# Darker than the colour map, so that boxes stand out; its reddest values are almost black and left out.
_DEPTH_BRIGHTNESS, _REDDEST = 0.66, 236
_MIN_WIDTH_PX = 960  # smaller images are enlarged before errors are drawn
_TEXT_PX = 11


def draw_detections(
    canvas: UInt8, detections: Detections, text_px: int, taken_px: Sequence[Int] = ()
) -> None:
    """Draw boxes with class and score, the highest score on top; labels leave the taken areas free."""
    ranked = detections[np.argsort(detections.scores, kind="stable")]
    draw_boxes(canvas, ranked.boxes_px, DETECTED, width_px=2)
    best_first = ranked[::-1]
    labels = [
        Label(box_px, name, DETECTED, f"{100 * score:.0f}%")
        for box_px, score, name in zip(
            best_first.boxes_px, best_first.scores.tolist(), best_first.types.tolist(), strict=True
        )
    ]
    draw_labels(canvas, labels, text_px, taken_px)


def draw_boxes(canvas: UInt8, boxes_px: Float64, color: Color, width_px: int = 1) -> None:
    """Draw (M, 4) boxes x1 y1 x2 y2 with a dark outline, which keeps them visible on any background."""
    outlines = list(fixed_point(boxes_px[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]))
    for line, width in ((palette.BACKGROUND, width_px + 2), (color, width_px)):
        cv2.polylines(canvas, outlines, True, line, width, cv2.LINE_AA, FIXED_POINT_BITS)


def draw_detection_errors(
    image: UInt8, objects_px: Float64, ignored_px: Float64, detections: Detections, iou: float
) -> UInt8:
    """Return an image with objects and detections, enlarged where it is small.

    Detected objects are thin and white, missed ones thick and red. Detections with their scores are green where
    they overlap an object or an ignored region, else orange.

    Args:
        image: (H, W, 3) image, or (H, W, 1) map.
        objects_px: (M, 4) boxes x1 y1 x2 y2 that have to be detected.
        ignored_px: (K, 4) boxes that may be detected: similar classes, objects above the difficulty,
            unlabelled regions.
        detections: Detections above the score threshold.
        iou: Overlap (IoU) above which an object is detected.
    """
    scale = max(1, -(-_MIN_WIDTH_PX // image.shape[1]))
    canvas = np.repeat(np.repeat(image, scale, axis=0), scale, axis=1)
    if canvas.shape[2] == 1:
        canvas = np.asarray(cv2.cvtColor(canvas, cv2.COLOR_GRAY2RGB), np.uint8)
    overlaps = iou_px(objects_px, detections.boxes_px) > iou
    is_ignored = (iou_px(ignored_px, detections.boxes_px) > iou).any(axis=0)
    is_wrong: Bool = np.asarray(~overlaps.any(axis=0) & ~is_ignored)
    is_found = overlaps.any(axis=1)
    draw_boxes(canvas, scale * ignored_px, palette.FAINT_TEXT)
    draw_boxes(canvas, scale * objects_px[is_found], palette.TEXT)
    draw_boxes(canvas, scale * objects_px[~is_found], palette.STATIC, width_px=3)
    labels = []
    for rows, color in ((~is_wrong, palette.MOVING), (is_wrong, palette.TRACKED_OBJECT)):
        shown = detections[rows]
        draw_boxes(canvas, scale * shown.boxes_px, color, width_px=2)
        for box_px, score in zip(scale * shown.boxes_px, shown.scores.tolist(), strict=True):
            labels.append(Label(box_px, f"{100 * score:.0f}%", color))
    draw_labels(canvas, labels, _TEXT_PX)
    return canvas


def color_depth_map(dense: DenseMaps) -> UInt8:
    """Return an (H, W, 3) image of depths from red, near, to blue, far; dark where unknown."""
    nearness = cv2.convertScaleAbs(255 - encode_depth(dense.depth_m), alpha=_REDDEST / 255)
    colors = cv2.applyColorMap(nearness, cv2.COLORMAP_TURBO)[:, :, ::-1]
    dimmed = cv2.convertScaleAbs(np.ascontiguousarray(colors), alpha=_DEPTH_BRIGHTNESS)
    dimmed[~dense.is_valid] = palette.PANEL
    return np.asarray(dimmed, np.uint8)
