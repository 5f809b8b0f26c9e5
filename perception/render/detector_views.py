"""What each modality's detector found: on the camera image, and on small images of the maps."""

from collections.abc import Mapping

import cv2
import numpy as np

from perception.detection.vehicles.camera_views import view_of
from perception.render import palette
from perception.render.palette import LinePattern
from perception.render.panels import Resizing
from perception.render.scene import Scene
from perception.render.strokes import draw_seam, draw_strokes, rectangle_strokes
from perception.types import MAP_MODALITIES, MODALITIES, MapModality, Modality, UInt8

_SKY_SHARE = 0.25  # top of a map that is cut off: a LiDAR has no returns from the sky
_TITLES: dict[MapModality, str] = {"dm": "Depth map", "rm": "Reflectance map"}


def draw_detector_boxes(
    canvas: UInt8,
    scene: Scene,
    modality: Modality,
    resizing: Resizing,
    *,
    display_score: float,
    pattern: LinePattern | None = None,
) -> None:
    """Draw the boxes of one modality's detector, each in the colour of the vehicle that it is a part of.

    Args:
        canvas: (H, W, 3) canvas that shows the camera image or a map.
        scene: Content of the image.
        modality: Modality of the detector.
        resizing: Scale and shift from the camera image to the canvas.
        display_score: Score from which a detection is drawn.
        pattern: Pattern of the lines; else they are solid.
    """
    result = view_of(scene.result, 0)
    found, vehicles = result.modality_detections[modality], result.vehicles
    ids = np.full(len(found), -1)
    if vehicles is not None:
        # The best fused detection of several comes first and is assigned last.
        sources = vehicles.fused.source_indices[::-1, MODALITIES.index(modality)]
        ids[sources[sources >= 0]] = vehicles.ids[::-1][sources >= 0]
    rows = np.flatnonzero(found.scores >= display_score)
    boxes_px = resizing.move_boxes(found.boxes_px[rows])
    strokes = rectangle_strokes(boxes_px, np.arange(len(rows)))
    strokes = strokes if pattern is None else strokes.dashed(pattern)
    draw_seam(canvas, strokes, palette.BACKGROUND, 3)
    draw_strokes(canvas, strokes, scene.objects.colors_of(ids[rows]), np.ones(len(rows), np.int64))


def map_insets(
    scene: Scene, largest_px: tuple[int, int], display_score: float
) -> Mapping[str, UInt8]:
    """Return the maps that detectors used as small images by title, with the detections in them.

    Args:
        scene: Content of the image.
        largest_px: (width, height) that each image has at most.
        display_score: Score from which a detection is drawn.
    """
    insets = {}
    for modality in (name for name in MAP_MODALITIES if name in scene.result.map_images):
        values = scene.result.map_images[modality]
        height, width = values.shape
        top = round(_SKY_SHARE * height)
        scale = min(largest_px[0] / width, largest_px[1] / (height - top))
        size_px = (round(scale * width), round(scale * (height - top)))
        # The nearest pixel: a mean of known and unknown pixels has no meaning.
        shown = cv2.resize(values[top:], size_px, interpolation=cv2.INTER_NEAREST)
        image: UInt8 = np.asarray(cv2.applyColorMap(shown, _COLORS[modality]), np.uint8)
        resizing = Resizing.of_window(np.array([0.0, top, width, height]), size_px)
        draw_detector_boxes(image, scene, modality, resizing, display_score=display_score)
        insets[_TITLES[modality]] = image
    return insets


def _color_table(color_map: int, *, is_reversed: bool) -> UInt8:
    """Return the (256, 1, 3) colour of each value; of 0, unknown, the colour of a panel."""
    values = np.arange(256, dtype=np.uint8)[:, None]
    shown = cv2.applyColorMap(255 - values if is_reversed else values, color_map)
    table: UInt8 = np.asarray(shown[:, :, ::-1], np.uint8).copy()
    table[0] = palette.PANEL
    return table


# Near is bright, as in the thesis' figures.
_COLORS: dict[MapModality, UInt8] = {
    "dm": _color_table(cv2.COLORMAP_TURBO, is_reversed=True),
    "rm": _color_table(cv2.COLORMAP_BONE, is_reversed=False),
}
