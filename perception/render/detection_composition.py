"""The image of DepthCN's detections in one frame: camera above depth map, both with boxes (Fig. 7.10)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from perception.render import palette
from perception.render.canvas import Align, blank_canvas, draw_text
from perception.render.detections import DETECTED, PROPOSED, draw_boxes, draw_detections
from perception.render.panels import FittedImage, LegendEntry, draw_legend, place_panel
from perception.render.stage_bar import draw_stage_bar
from perception.types import Detections, Float64, UInt8

_FOOTER_PX = 64
_GUTTER_PX = 4
_BAR_SHARES = (0.34, 0.86)
_TEXT_PX = 9
_MAX_WIDTH_PX, _MAX_PANEL_PX = 1280, 620
_LEGEND: tuple[LegendEntry, ...] = (
    ("proposal", (PROPOSED,)),
    ("vehicle, with its score", (DETECTED,)),
)


@dataclass(frozen=True)
class DetectionScene:
    """Content of one frame.

    Attributes:
        number: Number of the frame in its files.
        image: (H, W, 3) camera image, or None.
        depth: (H, W, 3) coloured depth map.
        proposals_px: (P, 4) boxes x1 y1 x2 y2 of the proposals.
        detections: Verified detections.
        timings_s: Time of each stage in seconds.
    """

    number: int
    image: UInt8 | None
    depth: UInt8
    proposals_px: Float64
    detections: Detections
    timings_s: Mapping[str, float]


@dataclass(frozen=True)
class DetectionComposition:
    """Layout of the images of a drive, all of one size.

    Attributes:
        panel_px: (width, height) of the panel of the camera and of that of the depth map, even numbers.
        has_camera: Whether there is a panel for the camera's image.
        turn_s: Time of one LiDAR revolution in seconds, the time budget of a frame.
    """

    panel_px: tuple[int, int]
    has_camera: bool
    turn_s: float = 0.1

    @classmethod
    def of(cls, first: DetectionScene, turn_s: float) -> Self:
        """Return the layout for scenes like the first."""
        height, width = first.depth.shape[:2]
        scale = min(_MAX_WIDTH_PX / width, _MAX_PANEL_PX / height)
        panel_px = (_MAX_WIDTH_PX, 2 * round(scale * height / 2))
        return cls(panel_px, first.image is not None, turn_s)

    def draw(self, scene: DetectionScene) -> UInt8:
        """Return the (height, width, 3) image of one frame."""
        width, panel_height = self.panel_px
        top = panel_height + _GUTTER_PX if self.has_camera else 0
        body_height = top + panel_height
        canvas = blank_canvas((width, body_height + _FOOTER_PX), palette.BACKGROUND)
        if scene.image is not None and self.has_camera:
            place_panel(canvas, self._panel(scene, scene.image), (0, 0), "Camera")
        place_panel(canvas, self._panel(scene, scene.depth), (0, top), "Depth map")
        self._draw_footer(canvas[body_height:], scene)
        return canvas

    def _panel(self, scene: DetectionScene, image: UInt8) -> UInt8:
        """Return an image with its boxes, resized to the panel."""
        fitted = FittedImage.within(image, self.panel_px)
        draw_boxes(fitted.canvas, fitted.resizing.move_boxes(scene.proposals_px), PROPOSED)
        found = scene.detections
        moved = replace(found, boxes_px=fitted.resizing.move_boxes(found.boxes_px))
        draw_detections(fitted.canvas, moved, _TEXT_PX)
        strip = blank_canvas(self.panel_px, palette.PANEL)
        centred = fitted.on_strip(self.panel_px[0])
        strip[: len(centred)] = centred
        return strip

    def _draw_footer(self, canvas: UInt8, scene: DetectionScene) -> None:
        height, width = canvas.shape[:2]
        draw_legend(canvas, _LEGEND, _TEXT_PX)
        start, stop = (round(share * width) for share in _BAR_SHARES)
        draw_stage_bar(canvas[:, start:stop], scene.timings_s, self.turn_s, _TEXT_PX)
        counts = f"{len(scene.detections)} of {len(scene.proposals_px)} proposals"
        for row, text in enumerate((f"frame {scene.number}", counts)):
            baseline = (width - _TEXT_PX, (0.40 + 0.36 * row) * height)
            draw_text(canvas, text, baseline, height_px=_TEXT_PX, align=Align.RIGHT)
