"""One picture of one followed object: camera and close-up, the scene in 3D and from above, its speed (Fig. 5.13)."""

from dataclasses import dataclass

import numpy as np

from perception.geometry.angles import wrap
from perception.render import palette
from perception.render.canvas import Align, blank_canvas, draw_text, text_width_px
from perception.render.panels import LegendEntry, draw_legend, place_panel
from perception.render.speed_chart import STATUS_COLORS, draw_speed_chart
from perception.render.tracked_object_scene import KM_H, TrackedObjectScene
from perception.render.tracked_object_views import TrackedObjectViews
from perception.render.tracks import TrackStyle
from perception.types import Boxes3D, UInt8

# The parts of the picture, as shares of its width and height.
_LEFT_SHARE = 0.70
_FOOTER_SHARE = 0.11
_CAMERA_SHARE = 0.43
_CHART_SHARES = (0.33, 0.80)
_GUTTER_PX = 4


@dataclass(frozen=True)
class TrackedObjectComposition:
    """How scenes become pictures of one fixed size.

    Attributes:
        size_px: (width, height), even as video needs it.
        frame_count: of the drive.
        name: of the object.
    """

    size_px: tuple[int, int] = (1600, 900)
    frame_count: int = 1
    name: str = "object"

    def draw(self, scene: TrackedObjectScene) -> UInt8:
        """Return the (height, width, 3) picture of one moment."""
        width, height = self.size_px
        view = TrackedObjectViews(scene, TrackStyle.of_height(height))
        canvas = blank_canvas(self.size_px, palette.BACKGROUND)
        body_px, left_px = round(height * (1 - _FOOTER_SHARE)), round(width * _LEFT_SHARE)
        right_px = left_px + _GUTTER_PX
        camera = view.camera((left_px, round(body_px * _CAMERA_SHARE)))
        close_up = view.close_up((width - right_px, len(camera)))
        below_px = len(camera) + _GUTTER_PX if len(camera) else 0
        place_panel(canvas, camera, (0, 0), "Camera")
        place_panel(canvas, close_up, (right_px, 0), f"Close-up of {self.name}")
        behind = view.from_behind((left_px, body_px - below_px))
        above = view.from_above((width - right_px, body_px - below_px))
        place_panel(canvas, behind, (0, below_px), "3D, over the vehicle towards the object")
        place_panel(canvas, above, (right_px, below_px), "From above")
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
        _write_chart_words(chart, round(0.8 * text_px), 4.0 * text_px)
        _write_state(canvas, scene, text_px)


def _legends(scene: TrackedObjectScene) -> list[list[LegendEntry]]:
    entries: list[LegendEntry] = [
        ("object and its way", (palette.TRACKED_OBJECT,)),
        ("way of the vehicle", (palette.EGO_PATH,)),
    ]
    further: list[LegendEntry] = []
    if scene.region is not None:
        further += [("its region", (palette.INSIDE,)), ("ring", (palette.RING,))]
    if scene.truth is not None:
        further.append(("label", (palette.TRUTH,)))
    return [entries, further]


def _write_chart_words(chart: UInt8, text_px: int, left_px: float) -> None:
    """Say under the chart what it shows, each state in its colour."""
    text = [("km/h over the drive, object", palette.FAINT_TEXT)]
    text += [(str(state), color) for state, color in STATUS_COLORS.items()]
    baseline = chart.shape[0] - 0.45 * text_px
    for said, color in text:
        draw_text(chart, said, (left_px, baseline), color=color, height_px=text_px)
        left_px += text_width_px(said, text_px) + text_px


def _write_state(canvas: UInt8, scene: TrackedObjectScene, text_px: int) -> None:
    """Write state, speed and distance, how far off the label is, and the time."""
    height, width = canvas.shape[:2]
    tracked, frame = scene.tracked, scene.result.frame
    lines = [(str(tracked.state), STATUS_COLORS[tracked.state])]
    box = tracked.box_velo
    if box is not None:
        speed_km_h = KM_H * float(np.hypot(*tracked.velocity_m_s))
        far_m = float(np.hypot(*box.bottom_m[0, :2]))
        lines[0] = (f"{tracked.state}, {speed_km_h:.1f} km/h, {far_m:.1f} m away", lines[0][1])
    if box is not None and scene.truth is not None:
        lines.append((_off_the_label(box, scene.truth), palette.TRUTH))
    time_s, spent_ms = frame.stamp_s, 1e3 * scene.seconds
    text = f"frame {frame.index}   {time_s:.1f} s   tracker {spent_ms:.1f} ms"
    lines.append((text, palette.FAINT_TEXT))
    for number, (text, color) in enumerate(lines):
        at = (width - 1.2 * text_px, height * (0.30 + 0.28 * number))
        draw_text(canvas, text, at, color=color, height_px=text_px, align=Align.RIGHT)


def _off_the_label(box: Boxes3D, truth: Boxes3D) -> str:
    middle = np.array([0, 0, 0.5])
    off_m = (box.bottom_m + middle * box.size_m) - (truth.bottom_m + middle * truth.size_m)
    turn_rad = wrap(box.yaw_rad - truth.yaw_rad)
    return f"{np.linalg.norm(off_m):.2f} m, {abs(np.degrees(turn_rad[0])):.0f} deg off its label"
