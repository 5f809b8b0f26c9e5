"""The image of DepthCN's detections in one frame: camera above depth map, both with boxes (Fig. 7.10)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from perception.render import palette
from perception.render.canvas import Align, blank_canvas, draw_text
from perception.render.detections import DETECTED, PROPOSED, draw_boxes, draw_detections
from perception.render.panels import (
    FittedImage,
    LegendEntry,
    draw_legend,
    place_panel,
    title_area_px,
)
from perception.render.strip import draw_stage_bar
from perception.types import Detections, Float64, UInt8

_FOOTER_PX = 64
_GUTTER_PX = 4
_BAR_SHARES = (0.34, 0.86)
_TEXT_PX = 9
_MAX_WIDTH_PX, _MIN_WIDTH_PX, _MAX_PANEL_PX = 1280, 960, 620
_WIDE = 2.0  # aspect ratio from which images lie one above the other
_LEGEND: tuple[LegendEntry, ...] = (
    LegendEntry("proposal", (PROPOSED,)),
    LegendEntry("vehicle, with its score", (DETECTED,)),
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
        columns: Number of panels side by side.
        has_camera: Whether there is a panel for the camera's image.
        period_s: Time from one scan to the next in seconds, the time budget of a frame.
    """

    panel_px: tuple[int, int]
    columns: int
    has_camera: bool
    period_s: float = 0.1

    @classmethod
    def of(cls, first: DetectionScene, period_s: float) -> Self:
        """Return the layout for scenes like the first: wide images one above the other, others side by side."""
        height, width = first.depth.shape[:2]
        aspect, has_camera = width / height, first.image is not None
        columns = 2 if has_camera and aspect < _WIDE else 1
        fitting_px = min(_MAX_WIDTH_PX / columns, _MAX_PANEL_PX * aspect)
        panel_px = max(fitting_px, _MIN_WIDTH_PX / columns)
        even = (2 * round(panel_px / 2), 2 * round(fitting_px / aspect / 2))
        return cls(even, columns, has_camera, period_s)

    def draw(self, scene: DetectionScene) -> UInt8:
        """Return the (height, width, 3) image of one frame."""
        width, height = self.panel_px
        second_px = (0, 0)
        if self.has_camera:
            second_px = (width, 0) if self.columns > 1 else (0, height + _GUTTER_PX)
        body_px = second_px[1] + height
        canvas = blank_canvas((self.columns * width, body_px + _FOOTER_PX), palette.BACKGROUND)
        if scene.image is not None and self.has_camera:
            camera = self._panel(scene, scene.image, "Camera")
            place_panel(canvas, camera, (0, 0), "Camera", _TEXT_PX)
        depth = self._panel(scene, scene.depth, "Depth map")
        place_panel(canvas, depth, second_px, "Depth map", _TEXT_PX)
        self._draw_footer(canvas[body_px:], scene)
        return canvas

    def _panel(self, scene: DetectionScene, image: UInt8, title: str) -> UInt8:
        """Return an image with its boxes, resized to the panel."""
        fitted = FittedImage.within(image, self.panel_px)
        draw_boxes(fitted.canvas, fitted.resizing.move_boxes(scene.proposals_px), PROPOSED)
        found = scene.detections
        moved = replace(found, boxes_px=fitted.resizing.move_boxes(found.boxes_px))
        draw_detections(fitted.canvas, moved, _TEXT_PX, [title_area_px(title, _TEXT_PX)])
        strip = blank_canvas(self.panel_px, palette.PANEL)
        centred = fitted.on_strip(self.panel_px[0])
        strip[: len(centred)] = centred
        return strip

    def _draw_footer(self, canvas: UInt8, scene: DetectionScene) -> None:
        height, width = canvas.shape[:2]
        draw_legend(canvas, _LEGEND, _TEXT_PX)
        start, stop = (round(share * width) for share in _BAR_SHARES)
        draw_stage_bar(canvas[:, start:stop], scene.timings_s, self.period_s, _TEXT_PX)
        counts = f"{len(scene.detections)} of {len(scene.proposals_px)} proposals"
        for row, text in enumerate((f"frame {scene.number}", counts)):
            baseline = (width - _TEXT_PX, (0.40 + 0.36 * row) * height)
            draw_text(canvas, text, baseline, height_px=_TEXT_PX, align=Align.RIGHT)
