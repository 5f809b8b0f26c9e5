"""The speed of a followed object over the whole drive, coloured by what each answer rests on."""

from collections.abc import Sequence

import cv2
import numpy as np

from perception.render import palette
from perception.render.canvas import Align, draw_text
from perception.render.palette import Color
from perception.tracking.single_object.tracker import TrackStatus
from perception.types import UInt8

STATUS_COLORS: dict[TrackStatus, Color] = {
    TrackStatus.SEEN: palette.TRACKED_OBJECT,
    TrackStatus.PREDICTED: palette.TRACKS[3],
    TrackStatus.LOST: palette.STATIC,
}
_TICK_KM_H = 10.0


def draw_speed_chart(
    canvas: UInt8,
    speeds_km_h: Sequence[float],
    states: Sequence[TrackStatus],
    frame_count: int,
    text_px: int,
) -> None:
    """Fill the canvas with a curve of the speed up to now, and a strip of states below it.

    Args:
        canvas: what is drawn on.
        speeds_km_h: one a frame so far, NaN for none.
        states: of the same frames.
        frame_count: of the whole drive, which is the width of the chart.
        text_px: height of capitals.
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
