"""The image of one tracked object in one frame: camera, close-up, 3D view, top view and speed (Fig. 5.13)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from perception.geometry.se3 import wrap
from perception.render import palette
from perception.render.camera_grid import aspect_of
from perception.render.canvas import Align, blank_canvas, draw_text, text_width_px
from perception.render.palette import Style
from perception.render.panels import LegendEntry, draw_legend, left_column_px, place_panel
from perception.render.tracked_object_views import (
    STATUS_COLORS,
    TrackedObjectScene,
    TrackedObjectViews,
)
from perception.render.trails import KM_H
from perception.tracking.single_object.tracker import TrackStatus
from perception.types import Boxes3D, UInt8

# Sizes of the panels, as shares of the image's width and height.
_FOOTER_SHARE = 0.11
_CAMERA_SHARE = 0.5
_CHART_SHARES = (0.33, 0.80)
_GUTTER_PX = 4
_TICK_KM_H = 10.0
_BEHIND = "3D, over the vehicle towards the object"


@dataclass(frozen=True)
class TrackedObjectComposition:
    """Layout of the images of a tracked object, all of one size.

    Attributes:
        size_px: (width, height) of an image; video needs even numbers.
        frame_count: Number of frames of the drive.
        name: Name of the object.
    """

    size_px: tuple[int, int] = (1600, 900)
    frame_count: int = 1
    name: str = "object"

    def draw(self, scene: TrackedObjectScene) -> UInt8:
        """Return the (height, width, 3) image of one frame."""
        width, height = self.size_px
        style = Style.of_height(height)
        view = TrackedObjectViews(scene, style)
        canvas = blank_canvas(self.size_px, palette.BACKGROUND)
        body_px = round(height * (1 - _FOOTER_SHARE))
        frame = scene.result.frame
        image = None if frame.calibration is None else frame.image
        aspect = None if image is None else aspect_of(image)
        left_px, camera_px = left_column_px((width, body_px), aspect, _CAMERA_SHARE)
        # Above: the camera image and the object in it; below: the scene from behind and from above.
        right_px, below_px = left_px + _GUTTER_PX, camera_px + _GUTTER_PX if camera_px else 0
        rest_px, low_px = width - right_px, body_px - below_px
        panels = {
            "Camera": ((0, 0), view.camera((left_px, camera_px))),
            f"Close-up of {self.name}": ((right_px, 0), view.close_up((rest_px, camera_px))),
            _BEHIND: ((0, below_px), view.from_behind((left_px, low_px))),
            "From above": ((right_px, below_px), view.from_above((rest_px, low_px))),
        }
        for title, (corner_px, panel) in panels.items():
            place_panel(canvas, panel, corner_px, title, style.text_px)
        self._draw_footer(canvas[body_px:], scene)
        return canvas

    def _draw_footer(self, canvas: UInt8, scene: TrackedObjectScene) -> None:
        height, width = canvas.shape[:2]
        text_px = max(round(0.125 * height), 7)
        for row, legend in enumerate(_legends(scene)):
            part = canvas[round((0.06 + 0.42 * row) * height) : round((0.48 + 0.42 * row) * height)]
            draw_legend(part, legend, text_px)
        start, stop = (round(share * width) for share in _CHART_SHARES)
        chart = canvas[:, start:stop]
        draw_speed_chart(chart, scene.speeds_km_h, scene.states, self.frame_count, text_px)
        _write_chart_legend(chart, round(0.8 * text_px), 4.0 * text_px)
        _write_state(canvas, scene, text_px)


def _legends(scene: TrackedObjectScene) -> list[list[LegendEntry]]:
    entries: list[LegendEntry] = [
        LegendEntry("object and its path", (palette.TRACKED_OBJECT,)),
        LegendEntry("path of the vehicle", (palette.EGO_PATH,)),
    ]
    further: list[LegendEntry] = []
    if scene.tracked.region is not None:
        further += [
            LegendEntry("its region", (palette.INSIDE,)),
            LegendEntry("ring", (palette.RING,)),
        ]
    if scene.truth is not None:
        further.append(LegendEntry("label", (palette.TRUTH,)))
    return [entries, further]


def _write_chart_legend(chart: UInt8, text_px: int, left_px: float) -> None:
    """Write the unit and the colours of the states below the chart."""
    entries = [("km/h over the drive, object", palette.FAINT_TEXT)]
    entries += [(str(state), color) for state, color in STATUS_COLORS.items()]
    baseline = chart.shape[0] - 0.45 * text_px
    for text, color in entries:
        draw_text(chart, text, (left_px, baseline), color=color, height_px=text_px)
        left_px += text_width_px(text, text_px) + text_px


def _write_state(canvas: UInt8, scene: TrackedObjectScene, text_px: int) -> None:
    """Write state, speed, distance, error from the label, and time."""
    height, width = canvas.shape[:2]
    tracked, frame = scene.tracked, scene.result.frame
    lines = [(str(tracked.status), STATUS_COLORS[tracked.status])]
    box = tracked.box_velo
    if box is not None:
        speed_km_h = KM_H * float(np.hypot(*tracked.velocity_m_s))
        far_m = float(np.hypot(*box.bottom_m[0, :2]))
        lines[0] = (f"{tracked.status}, {speed_km_h:.1f} km/h, {far_m:.1f} m away", lines[0][1])
    if box is not None and scene.truth is not None:
        lines.append((_label_error(box, scene.truth), palette.TRUTH))
    time_s, spent_ms = frame.stamp_s, 1e3 * scene.seconds
    text = f"frame {frame.index}   {time_s:.1f} s   tracker {spent_ms:.1f} ms"
    lines.append((text, palette.FAINT_TEXT))
    for number, (text, color) in enumerate(lines):
        at = (width - 1.2 * text_px, height * (0.30 + 0.28 * number))
        draw_text(canvas, text, at, color=color, height_px=text_px, align=Align.RIGHT)


def _label_error(box: Boxes3D, truth: Boxes3D) -> str:
    error_m = box.centers_m - truth.centers_m
    turn_rad = wrap(box.yaw_rad - truth.yaw_rad)
    return f"{np.linalg.norm(error_m):.2f} m, {abs(np.degrees(turn_rad[0])):.0f} deg from the label"


def draw_speed_chart(
    canvas: UInt8,
    speeds_km_h: Sequence[float],
    states: Sequence[TrackStatus],
    frame_count: int,
    text_px: int,
) -> None:
    """Fill the canvas with the speed over time and, below it, a strip in the colour of the status.

    Args:
        canvas: (H, W, 3) canvas.
        speeds_km_h: Speed in km/h of each frame so far, NaN where unknown.
        states: Tracking status of the same frames.
        frame_count: Number of frames of the drive, the width of the chart.
        text_px: Height of capitals.
    """
    height, width = canvas.shape[:2]
    left, top, bottom = 4 * text_px, round(0.14 * height), round(0.70 * height)
    count = max(frame_count, len(states), 1)
    columns = left + (width - 1 - left) * np.arange(count + 1) / count
    speeds = np.array(speeds_km_h, np.float64)
    known = speeds[np.isfinite(speeds)]
    ceiling = _TICK_KM_H * np.ceil(max(known.max(initial=0.0), 1.0) / _TICK_KM_H)
    canvas[top:bottom, left:] = palette.PANEL
    for value, row in ((ceiling, top), (0.0, bottom)):
        canvas[row, left:] = palette.GRID
        at = (left - 0.6 * text_px, row + 0.5 * text_px)
        draw_text(
            canvas,
            f"{value:.0f}",
            at,
            color=palette.FAINT_TEXT,
            height_px=text_px,
            align=Align.RIGHT,
        )
    rows = bottom - (bottom - top) * speeds / ceiling
    middles = (columns[:-1] + columns[1:]) / 2
    strip = slice(bottom + 3, bottom + 3 + max(text_px // 2, 3))
    for frame, state in enumerate(states):
        start = round(columns[frame])
        stop = max(round(columns[frame + 1]), start + 1)
        canvas[strip, start:stop] = STATUS_COLORS[state]
        if frame and np.isfinite(rows[frame - 1 : frame + 1]).all():
            before, here = ((round(middles[i]), round(rows[i])) for i in (frame - 1, frame))
            cv2.line(canvas, before, here, STATUS_COLORS[state], 2, cv2.LINE_AA)
