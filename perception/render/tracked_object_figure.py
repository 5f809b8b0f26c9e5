"""A tracked object drawn through any projection: box, path, speed, status and region of the image."""

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.render import palette
from perception.render.canvas import FIXED_POINT_BITS, draw_tag, fixed_point
from perception.render.palette import Color
from perception.render.strokes import draw_seam, draw_strokes, project_strokes
from perception.render.track_figures import TrackFigures, track_figures
from perception.render.tracks import TrackStyle, draw_track_figures
from perception.render.trails import KM_H
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Float64, Tracks, UInt8

STATUS_COLORS: dict[TrackStatus, Color] = {
    TrackStatus.SEEN: palette.TRACKED_OBJECT,
    TrackStatus.PREDICTED: palette.TRACKS[3],
    TrackStatus.LOST: palette.STATIC,
}
_REGION_OPACITY = 0.30


@dataclass(frozen=True)
class TrackedObjectFigure:
    """Lines and label of a tracked object that has a box.

    Attributes:
        figures: Box, and path and velocity arrow where requested.
        text: Label: speed, and the status where the object is not observed.
        color: Colour of lines and label.
    """

    figures: TrackFigures
    text: str
    color: Color

    @classmethod
    def of(cls, tracked: TrackedObject, path_velo: Float64 | None, name: str = "") -> Self | None:
        """Return the figure of an object, or None of one without a box.

        Args:
            tracked: Output of the one-object tracker.
            path_velo: (K, 3) path in the LiDAR frame, or None to draw the box without path and arrow.
            name: Name among other tracks, which gives the label their form.
        """
        if tracked.box_velo is None:
            return None
        is_lost = tracked.status is TrackStatus.LOST
        is_still = is_lost or path_velo is None
        track = Tracks.unclassified(
            np.zeros(1, np.int64),
            tracked.box_velo,
            np.zeros((1, 2)) if is_still else tracked.velocity_m_s[None],
            np.array([tracked.status is TrackStatus.SEEN]),
        )
        figures = track_figures(track, [np.zeros((0, 3)) if path_velo is None else path_velo])
        return cls(
            figures,
            _label_text(tracked, name),
            palette.FAINT_TEXT if is_lost else palette.TRACKED_OBJECT,
        )

    def draw(self, canvas: UInt8, image_P_velo: Float64, style: TrackStyle) -> None:
        """Draw the lines, and the label above or below the box."""
        (outline_px,) = draw_track_figures(canvas, image_P_velo, self.figures, [self.color], style)
        draw_tag(canvas, self.text, outline_px, self.color, style.text_px)


def _label_text(tracked: TrackedObject, name: str) -> str:
    speed_m_s = float(np.hypot(*tracked.velocity_m_s))
    speed = f"{speed_m_s:.1f} m/s" if name else f"{KM_H * speed_m_s:.1f} km/h"
    state_text = {
        TrackStatus.SEEN: speed,
        TrackStatus.PREDICTED: f"predicted {speed}",
        TrackStatus.LOST: "lost",
    }[tracked.status]
    return f"{name}  {state_text}".strip()


def draw_path(canvas: UInt8, image_P_velo: Float64, path_velo: Float64, color: Color) -> None:
    """Draw a (K, 3) path as a curve."""
    if len(path_velo) < 2:
        return
    segments = np.stack([path_velo[:-1], path_velo[1:]], axis=1)
    strokes = project_strokes(image_P_velo, canvas, segments, np.zeros(len(segments), np.int64))
    draw_seam(canvas, strokes, palette.BACKGROUND, 4)
    draw_strokes(canvas, strokes, [color], np.array([2]))


def draw_region(canvas: UInt8, hull_px: Float64, outer_px: Float64) -> None:
    """Tint the object's region blue and the ring around it red, as in Fig. 5.13.

    Args:
        canvas: (H, W, 3) image.
        hull_px: (V, 2) corners of the region in the image.
        outer_px: (V, 2) corners of the region with its ring.
    """
    inside, outside = fixed_point(hull_px), fixed_point(outer_px)
    painted = canvas.copy()
    # Filling two outlines together leaves out what lies within both.
    cv2.fillPoly(painted, [outside, inside], palette.RING, cv2.LINE_AA, FIXED_POINT_BITS)
    cv2.fillPoly(painted, [inside], palette.INSIDE, cv2.LINE_AA, FIXED_POINT_BITS)
    cv2.addWeighted(painted, _REGION_OPACITY, canvas, 1 - _REGION_OPACITY, 0, dst=canvas)
    for outline, color in ((outside, palette.RING), (inside, palette.INSIDE)):
        cv2.polylines(canvas, [outline], True, color, 1, cv2.LINE_AA, FIXED_POINT_BITS)
