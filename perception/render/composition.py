"""One picture that explains one frame: camera, scene in 3D, bird's-eye view, legend, stage times."""

from dataclasses import dataclass, field

import cv2
import numpy as np

from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.render import palette
from perception.render.birds_eye import draw_birds_eye, view_of_area
from perception.render.canvas import blank_canvas
from perception.render.overlay import draw_overlay
from perception.render.perspective import draw_perspective
from perception.render.stage_bar import draw_stage_bar
from perception.render.surface import Surface, sample_surface
from perception.render.text import Align, draw_text, text_width_px
from perception.types import Result, UInt8

# The parts of the picture, as shares of its width and height.
_LEFT_SHARE = 0.70
_FOOTER_SHARE = 0.075
_CAMERA_SHARE = 0.46
_BAR_SHARES = (0.27, 0.86)
_GUTTER_PX = 4
# The bird's-eye view shows a little more than the area that is searched.
_SURROUND_M = 1.0
_LEGEND = (
    ("ground", palette.GROUND),
    ("static", palette.STATIC),
    ("moving", palette.MOVING),
)


@dataclass(frozen=True)
class Composition:
    """How results become pictures of one fixed size.

    Attributes:
        size_px: (width, height), even as video needs it.
        area: the local area that the obstacle stages searched.
        turn_s: time of one turn of the LiDAR, the budget of a frame.
    """

    size_px: tuple[int, int] = (1600, 900)
    area: LocalArea = field(default_factory=LocalArea)
    turn_s: float = 0.1

    def __post_init__(self) -> None:
        """Refuse sizes that no video can have, or that hold no readable text."""
        width, height = self.size_px
        if width % 2 or height % 2 or width < 640 or height < 360:
            raise UsageError(
                "picture size",
                expected="an even width and height of at least 640x360 pixels",
                found=f"{width}x{height}",
            )

    def draw(self, result: Result) -> UInt8:
        """Return the (height, width, 3) picture of one frame."""
        width, height = self.size_px
        surface = sample_surface(result.ground, self.area)
        canvas = blank_canvas(self.size_px, palette.BACKGROUND)
        body_px, left_px = round(height * (1 - _FOOTER_SHARE)), round(width * _LEFT_SHARE)
        # Left: what the camera sees, and below it the same in 3D; without a camera, 3D alone.
        camera = self._camera(result, surface, (left_px, round(body_px * _CAMERA_SHARE)))
        scene_top_px = len(camera) + _GUTTER_PX if len(camera) else 0
        scene = draw_perspective((left_px, body_px - scene_top_px), result, surface)
        _place(canvas, camera, (0, 0), "Camera")
        _place(canvas, scene, (0, scene_top_px), "3D, from behind the vehicle")
        # Right: the same from above.
        right_px = left_px + _GUTTER_PX
        above = self._from_above(result, surface, (width - right_px, body_px))
        _place(canvas, above, (right_px, 0), "From above")
        # Below: what the colours mean, and where the time went.
        self._draw_footer(canvas[body_px:], result)
        return canvas

    def _camera(self, result: Result, surface: Surface, largest_px: tuple[int, int]) -> UInt8:
        """Return the overlay at the largest size that fits, centred on a strip; empty without a camera."""
        image, calibration = result.frame.image, result.frame.calibration
        if image is None or calibration is None:
            return np.zeros((0, largest_px[0], 3), np.uint8)
        overlay = draw_overlay(image, calibration.image_P_velo, surface, result.obstacles)
        scale = min(largest_px[0] / image.shape[1], largest_px[1] / image.shape[0])
        width, height = round(image.shape[1] * scale), round(image.shape[0] * scale)
        interpolation = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        strip = blank_canvas((largest_px[0], height), palette.PANEL)
        left = (largest_px[0] - width) // 2
        strip[:, left : left + width] = cv2.resize(
            overlay, (width, height), interpolation=interpolation
        )
        return strip

    def _from_above(self, result: Result, surface: Surface, size_px: tuple[int, int]) -> UInt8:
        shown = LocalArea(
            self.area.ahead_m + _SURROUND_M,
            self.area.behind_m + _SURROUND_M,
            self.area.side_m + _SURROUND_M,
        )
        return draw_birds_eye(view_of_area(shown, size_px), result, surface)

    def _draw_footer(self, canvas: UInt8, result: Result) -> None:
        height, width = canvas.shape[:2]
        text_px = round(0.19 * height)
        _draw_legend(canvas, text_px)
        start, stop = (round(share * width) for share in _BAR_SHARES)
        draw_stage_bar(canvas[:, start:stop], result.timings_s, self.turn_s, round(0.85 * text_px))
        total_s = sum(result.timings_s.values())
        lines = [f"frame {result.frame.index}   {result.frame.stamp_s:.1f} s"]
        if total_s > 0:
            lines.insert(0, f"{total_s * 1e3:.0f} ms = {1 / total_s:.0f} frames/s")
        for line, words in enumerate(lines):
            at = (width - 1.2 * text_px, height * (0.42 + 0.4 * line))
            color = palette.FAINT_TEXT if line else palette.TEXT
            draw_text(canvas, words, at, color=color, height_px=text_px, align=Align.RIGHT)


def _place(canvas: UInt8, panel: UInt8, corner_px: tuple[int, int], title: str) -> None:
    """Put a panel, with its title in its upper left corner, into the canvas."""
    if not len(panel):
        return
    column, row = corner_px
    height, width = panel.shape[:2]
    target = canvas[row : row + height, column : column + width]
    target[:] = panel
    text_px = max(round(canvas.shape[0] / 80), 7)
    margin = text_px
    tag = target[: 2 * text_px + 4, : text_width_px(title, text_px) + 2 * margin]
    tag[:] = tag // 3
    draw_text(target, title, (margin, 1.5 * text_px + 2), height_px=text_px)


def _draw_legend(canvas: UInt8, text_px: int) -> None:
    column, baseline, swatch_px = 1.2 * text_px, 0.5 * (canvas.shape[0] + text_px), 1.5 * text_px
    for name, color in _LEGEND:
        left, top = round(column), round(baseline - 1.25 * text_px)
        corner = (round(column + swatch_px), round(top + swatch_px))
        cv2.rectangle(canvas, (left, top), corner, color, -1)
        column += swatch_px + 0.7 * text_px
        draw_text(canvas, name, (column, baseline), height_px=text_px)
        column += text_width_px(name, text_px) + 1.8 * text_px
