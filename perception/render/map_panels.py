"""The maps that two of the detectors look at, small, with what they saw in them."""

import cv2
import numpy as np

from perception.render import palette
from perception.render.detections import draw_boxes
from perception.render.vehicles import likely_boxes_px
from perception.types import MAP_MODALITIES, MapModality, Result, UInt8


def _color_table(color_map: int, *, is_reversed: bool) -> UInt8:
    """Return (256, 1, 3) the colour of each value; of 0, which nobody measured, that of a panel."""
    values = np.arange(256, dtype=np.uint8)[:, None]
    shown = cv2.applyColorMap(255 - values if is_reversed else values, color_map)
    table: UInt8 = np.asarray(shown[:, :, ::-1], np.uint8).copy()
    table[0] = palette.PANEL
    return table


# As in the thesis' figures: near is bright.
_COLORS: dict[MapModality, UInt8] = {
    "dm": _color_table(cv2.COLORMAP_TURBO, is_reversed=True),
    "rm": _color_table(cv2.COLORMAP_BONE, is_reversed=False),
}
# Of the picture, so much at its top is sky, where a LiDAR has no returns.
_SKY_SHARE = 0.25
_TITLES: dict[MapModality, str] = {"dm": "Depth map", "rm": "Reflectance map"}


def map_panels(result: Result, largest_px: tuple[int, int]) -> dict[str, UInt8]:
    """Return pictures by title, each within (width, height), of the maps that detectors looked at."""
    panels = {}
    for modality in (name for name in MAP_MODALITIES if name in result.map_images):
        shown = result.map_images[modality]
        scale = min(largest_px[0] / shown.shape[1], largest_px[1] / shown.shape[0])
        values = _smaller(shown, scale)
        image: UInt8 = np.asarray(cv2.applyColorMap(values, _COLORS[modality]), np.uint8)
        # Pixels of the map whose centres are whole numbers, as in `Resizing`.
        boxes_px = (likely_boxes_px(result.modality_detections[modality]) + 0.5) * scale - 0.5
        draw_boxes(image, boxes_px, palette.MODALITIES[modality])
        panels[_TITLES[modality]] = image[round(_SKY_SHARE * len(image)) :]
    return panels


def _smaller(values: UInt8, scale: float) -> UInt8:
    """Take one pixel of many: between those that are known and those that are not lies nothing."""
    size_px = (round(values.shape[1] * scale), round(values.shape[0] * scale))
    return np.asarray(cv2.resize(values, size_px, interpolation=cv2.INTER_NEAREST), np.uint8)
