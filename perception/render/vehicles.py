"""Detected vehicles: what each detector saw, what they say together, and the boxes on the ground."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.render import palette
from perception.render.detections import draw_boxes
from perception.render.palette import Color
from perception.render.panels import Resizing
from perception.render.track_figures import TrackFigures, track_figures
from perception.render.tracked_object_figure import draw_tag
from perception.render.tracks import TrackStyle, draw_track_figures
from perception.types import Bool, Detections, Float64, Int, Result, Tracks, UInt8, Vehicles

# From this score on, what was detected is drawn.
SHOWN_SCORE = 0.5


@dataclass(frozen=True)
class VehicleFigures:
    """The likely vehicles of one frame.

    Attributes:
        result: of the frame.
        ids: (M,) of the vehicles that are drawn, -1 of those that are not followed.
        boxes_px: (M, 4) in the image.
        distances_m: (M,) NaN where it is not known.
        speeds_m_s: (M,) NaN where it is not known.
        figures: 3D boxes of those that have one and are not drawn as tracks.
        names: of `figures`, in its order.
    """

    result: Result
    ids: Int
    boxes_px: Float64
    distances_m: Float64
    speeds_m_s: Float64
    figures: TrackFigures
    names: tuple[str, ...]

    @classmethod
    def of(cls, result: Result) -> Self | None:
        """Choose what is drawn of a frame; None where no detector looked at it."""
        vehicles = result.vehicles
        if vehicles is None:
            return None
        shown: Bool = np.asarray(vehicles.fused.detections.scores >= SHOWN_SCORE)
        tracks = _as_tracks(vehicles, shown, result.tracks.ids)
        figures = track_figures(tracks, list(tracks.boxes.bottom_m[:, None]))
        speeds_m_s = np.hypot(*vehicles.velocities_m_s.T)[shown]
        return cls(
            result,
            vehicles.ids[shown],
            vehicles.fused.detections.boxes_px[shown],
            vehicles.distances_m[shown],
            speeds_m_s,
            figures,
            tuple(_name(track) for track in figures.tracks.ids.tolist()),
        )

    def draw_on_image(self, canvas: UInt8, resizing: Resizing, style: TrackStyle) -> None:
        """Draw the boxes of each detector thinly, and bold ones with names for what they say together."""
        for modality, found in self.result.modality_detections.items():
            color = palette.MODALITIES[modality]
            draw_boxes(canvas, resizing.move_boxes(likely_boxes_px(found)), color)
        boxes_px = resizing.move_boxes(self.boxes_px)
        for row in range(len(boxes_px)):
            color = _color(int(self.ids[row]))
            draw_boxes(canvas, boxes_px[row : row + 1], color, style.line_px + 1)
        for row, box_px in enumerate(boxes_px):
            draw_tag(
                canvas, self._label_text(row), box_px, _color(int(self.ids[row])), style.text_px
            )

    def draw_in_space(self, canvas: UInt8, image_P_velo: Float64, style: TrackStyle) -> None:
        """Draw the 3D boxes of vehicles that are not drawn as tracks, with their names."""
        if not self.names:
            return
        colors = [_color(track) for track in self.figures.tracks.ids.tolist()]
        outlines = draw_track_figures(canvas, image_P_velo, self.figures, colors, style)
        for name, outline, color in zip(self.names, outlines, colors, strict=True):
            draw_tag(canvas, name, outline, color, style.text_px)

    def _label_text(self, row: int) -> str:
        """Return id, distance and speed, as far as they are known."""
        text = [str(self.ids[row])] if self.ids[row] >= 0 else []
        for value, unit in (
            (self.distances_m[row], "{:.0f} m"),
            (self.speeds_m_s[row], "{:.1f} m/s"),
        ):
            if np.isfinite(value):
                text.append(unit.format(value))
        return "  ".join(text) or "car"


def likely_boxes_px(found: Detections) -> Float64:
    """Return (K, 4) the boxes that are drawn of what a detector saw."""
    return found.boxes_px[found.scores >= SHOWN_SCORE]


def _as_tracks(vehicles: Vehicles, shown: Bool, drawn_ids: Int) -> Tracks:
    """Return the vehicles that have a box in space and no other track of their id."""
    is_located = np.isfinite(vehicles.boxes.bottom_m).all(axis=1)
    is_drawn = (vehicles.ids >= 0) & np.isin(vehicles.ids, drawn_ids)
    rows = np.flatnonzero(shown & is_located & ~is_drawn)
    return Tracks(
        vehicles.ids[rows],
        vehicles.boxes[rows],
        np.nan_to_num(vehicles.velocities_m_s[rows]),
        np.ones(len(rows), bool),
    )


def _name(track: int) -> str:
    return str(track) if track >= 0 else "car"


def _color(track: int) -> Color:
    return palette.track_color(track) if track >= 0 else palette.TEXT
