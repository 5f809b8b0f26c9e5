"""A followed object drawn through any projection: its box, its way, its speed, its region of the image."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.render import palette
from perception.render.canvas import draw_text, text_width_px
from perception.render.palette import Color
from perception.render.strokes import draw_seam, draw_strokes, fixed_point, project_strokes
from perception.render.track_figures import TrackFigures, track_figures
from perception.render.tracked_object_scene import KM_H
from perception.render.tracks import TrackStyle, draw_track_figures
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Float64, Tracks, UInt8

_REGION_OPACITY = 0.30
_FIXED_POINT_BITS = 4
_GAP_PX = 6


@dataclass(frozen=True)
class TrackedObjectFigure:
    """What is drawn of a followed object that has a box.

    Attributes:
        figures: box, and way and arrow where they are wanted.
        text: its state where it is not seen, and its speed.
        color: of all.
    """

    figures: TrackFigures
    text: str
    color: Color

    @classmethod
    def of(cls, tracked: TrackedObject, path_velo: Float64 | None, name: str = "") -> Self | None:
        """Make the figure of an object; None of one without a box.

        Args:
            tracked: the object.
            path_velo: (K, 3) where it was, or None to draw its box alone, without way and arrow.
            name: what it is called among other tracks, whose labels its words are then like.
        """
        if tracked.box_velo is None:
            return None
        is_lost = tracked.state is TrackStatus.LOST
        is_still = is_lost or path_velo is None
        track = Tracks(
            ids=np.zeros(1, np.int64),
            boxes=tracked.box_velo,
            velocities_m_s=np.zeros((1, 2)) if is_still else tracked.velocity_m_s[None],
            is_observed=np.array([tracked.state is TrackStatus.SEEN]),
        )
        figures = track_figures(track, [np.zeros((0, 3)) if path_velo is None else path_velo])
        return cls(
            figures,
            _label_text(tracked, name),
            palette.FAINT_TEXT if is_lost else palette.TRACKED_OBJECT,
        )

    def draw(self, canvas: UInt8, image_P_velo: Float64, style: TrackStyle) -> None:
        """Draw it, and its words over its box or under it."""
        (outline_px,) = draw_track_figures(canvas, image_P_velo, self.figures, [self.color], style)
        draw_tag(canvas, self.text, outline_px, self.color, style.text_px)


def _label_text(tracked: TrackedObject, name: str) -> str:
    speed_m_s = float(np.hypot(*tracked.velocity_m_s))
    speed = f"{speed_m_s:.1f} m/s" if name else f"{KM_H * speed_m_s:.1f} km/h"
    state_text = {
        TrackStatus.SEEN: speed,
        TrackStatus.PREDICTED: f"predicted {speed}",
        TrackStatus.LOST: "lost",
    }[tracked.state]
    return f"{name}  {state_text}".strip()


def draw_tag(canvas: UInt8, text: str, outline_px: Float64, color: Color, text_px: int) -> None:
    """Write words on a dark tag over a (4,) rectangle x1 y1 x2 y2, or under it; none where it is not seen."""
    height, width = canvas.shape[:2]
    x1, y1, x2, y2 = np.clip(outline_px, 0, (width, height, width, height)).tolist()
    size = (text_width_px(text, text_px) + round(1.2 * text_px), round(1.9 * text_px))
    if not (x2 > x1 and y2 > y1) or size[0] > width:
        return
    left = round(min(max((x1 + x2 - size[0]) / 2, 0), width - size[0]))
    over, under = round(y1) - _GAP_PX - size[1], round(y2) + _GAP_PX
    top = over if over >= 0 else min(under, height - size[1])
    tag = canvas[top : top + size[1], left : left + size[0]]
    tag[:] = tag // 4
    tag[:, : max(text_px // 4, 2)] = color
    baseline = (left + 0.7 * text_px, top + 1.45 * text_px)
    draw_text(canvas, text, baseline, color=palette.TEXT, height_px=text_px)


def draw_path(canvas: UInt8, image_P_velo: Float64, path_velo: Float64, color: Color) -> None:
    """Draw a (K, 3) way as a curve."""
    if len(path_velo) < 2:
        return
    segments = np.stack([path_velo[:-1], path_velo[1:]], axis=1)
    strokes = project_strokes(image_P_velo, canvas, segments, np.zeros(len(segments), np.int64))
    draw_seam(canvas, strokes, palette.BACKGROUND, 4)
    draw_strokes(canvas, strokes, [color], np.array([2]))


def draw_region(canvas: UInt8, hull_px: Float64, outer_px: Float64) -> None:
    """Tint the object's region blue and the ring around it red, as in Fig. 5.13.

    Args:
        canvas: the image.
        hull_px: (V, 2) corners of the region.
        outer_px: (V, 2) corners of the region with its ring.
    """
    inside, outside = fixed_point(hull_px), fixed_point(outer_px)
    painted = canvas.copy()
    # Where two outlines are filled together, what lies within both stays as it is.
    cv2.fillPoly(painted, [outside, inside], palette.RING, cv2.LINE_AA, _FIXED_POINT_BITS)
    cv2.fillPoly(painted, [inside], palette.INSIDE, cv2.LINE_AA, _FIXED_POINT_BITS)
    cv2.addWeighted(painted, _REGION_OPACITY, canvas, 1 - _REGION_OPACITY, 0, dst=canvas)
    for outline, color in ((outside, palette.RING), (inside, palette.INSIDE)):
        cv2.polylines(canvas, [outline], True, color, 1, cv2.LINE_AA, _FIXED_POINT_BITS)
