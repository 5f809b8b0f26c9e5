"""What a detector found, missed and made up in one picture."""

import cv2
import numpy as np

from perception.geometry.box_overlap_px import iou_px
from perception.render import palette
from perception.render.detections import draw_boxes
from perception.render.tracked_object_figure import draw_tag
from perception.types import Bool, Detections, Float64, UInt8

_MIN_WIDTH_PX = 960
_TEXT_PX = 11


def draw_detection_errors(
    image: UInt8, objects_px: Float64, ignored_px: Float64, detections: Detections, iou: float
) -> UInt8:
    """Return an (H, W, 3) picture with objects and detections on it, enlarged where it is small.

    Objects that a detection overlaps by more than the IoU are thin, missed ones red and thick. Detections
    are green where they overlap an object or something that does not count, else orange, with their scores.

    Args:
        image: (H, W, 3), or (H, W, 1) of a map.
        objects_px: (M, 4) what has to be found.
        ignored_px: (K, 4) what may be found: other classes alike, objects too hard to see, regions unlabelled.
        detections: sure enough to count.
        iou: from which on an object is found.
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
    for rows, color in ((~is_wrong, palette.MOVING), (is_wrong, palette.TRACKED_OBJECT)):
        shown = detections[rows]
        draw_boxes(canvas, scale * shown.boxes_px, color, width_px=2)
        for box_px, score in zip(scale * shown.boxes_px, shown.scores.tolist(), strict=True):
            draw_tag(canvas, f"{score:.2f}", box_px, color, _TEXT_PX)
    return canvas
